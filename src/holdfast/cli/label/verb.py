"""`holdfast label`: labels drawn on a page, proposed by rules, compared and audited."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.serve import HOST

PORT = 8081


def label(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings, or folders of them; A and B to compare.")
    ],
    auto: Annotated[
        str | None, typer.Option(help="Let a rule label: signal, tracking or command.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="How far A and B agree; B may be a rule.")
    ] = False,
    audit: Annotated[
        bool, typer.Option("--audit", help="Find labels that a classifier contradicts.")
    ] = False,
    export: Annotated[
        tuple[str, Path] | None,
        typer.Option(metavar="FORMAT FOLDER", help="Write labels: label-studio or csv."),
    ] = None,
    take: Annotated[
        Path | None, typer.Option("--import", help="Take labels: Label Studio's JSON, CSV.")
    ] = None,
    page: Annotated[
        bool, typer.Option("--page", help="After --audit: show what it found on the page.")
    ] = False,
    poses: Annotated[
        Path | None, typer.Option(help="Poses for the rule tracking: a CSV file, or a bag.")
    ] = None,
    tracks: Annotated[
        list[str] | None,
        typer.Option(
            "--track", metavar="BODY=NAME", help="Topic or frame of a bag; BODY: object, thumb, ..."
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="A rule's parameter.")
    ] = None,
    tare: Annotated[
        str, typer.Option(help="Seconds from the start, first, none, or START:END.")
    ] = "0.5",
    author: Annotated[
        str | None, typer.Option(help="Who labels; the login name, or rule:RULE.")
    ] = None,
    annotator: Annotated[
        str | None, typer.Option(help="Whose labels of an export of Label Studio.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Fits at a time of --audit; -1: all there are.")] = -1,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="With --auto or --import: write nothing.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace a person's labels, or what was exported.")
    ] = False,
    host: Annotated[str, typer.Option(help="Address to listen at.")] = HOST,
    port: Annotated[int, typer.Option(help="Port; 0 finds a free one.")] = PORT,
    token: Annotated[
        str | None, typer.Option(help="Secret that readers must know; needed with --host.")
    ] = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Do not open the page in a browser.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Labels recordings on a page, by a rule, or checks labels that are there.

    Without a mode, a page opens: drag to label, keys for states, undo, proposals of a rule that
    one key accepts; every change is saved at once. Labels are kept in NAME.labels.json beside the
    recording, which itself is never changed. --auto writes what a rule proposes, and lists what a
    person should look at first; labels that a person saved are not replaced without --force.
    --compare tells Cohen's kappa and onset differences of two labellings: files, folders, or a
    rule. --audit finds labels that a cross-validated classifier contradicts. docs/labels.md.

    Example:
      holdfast label recordings/
      holdfast label --auto signal recordings/ --dry-run
      holdfast label --auto tracking grasp.parquet --poses markers.csv
      holdfast label --auto tracking grasp.mcap --poses run.bag --track object=/aruco/pose
      holdfast label --compare recordings/ eve/ --json
      holdfast label --compare recordings/ signal
      holdfast label --audit recordings/ --page
      holdfast label --export label-studio studio/ recordings/
      holdfast label --import export.json recordings/
    """
    from holdfast.cli.label.inputs import Asking, Serving

    asking = Asking(tare, poses, tuple(tracks or ()), tuple(parameters or ()))
    serving = Serving(host, port, token, not no_browser, as_json)
    mode = _mode(auto, compare, audit, export, take)
    if page and mode != "audit":
        raise ValueError("--page shows what --audit found: give --audit as well")
    if mode == "auto":
        from holdfast.cli.label.auto_mode import label_by_rule

        label_by_rule(
            paths, auto or "", asking,
            author=author, dry_run=dry_run, force=force, as_json=as_json,
        )  # fmt: skip
    elif mode == "compare":
        from holdfast.cli.label.compare_mode import compare_labels

        compare_labels(paths, asking, annotator, as_json=as_json)
    elif mode == "export" and export is not None:
        from holdfast.cli.label.exchange_mode import export_labels

        export_labels(paths, *export, force=force, as_json=as_json)
    elif mode == "import" and take is not None:
        from holdfast.cli.label.exchange_mode import import_labels

        import_labels(
            paths, take,
            annotator=annotator, author=author, dry_run=dry_run, force=force, as_json=as_json,
        )  # fmt: skip
    else:
        from holdfast.cli.label.audit_mode import audit_labels
        from holdfast.cli.label.page_mode import show_label_page

        suspects = audit_labels(paths, jobs, as_json=as_json and not page) if audit else ()
        if page or not audit:
            show_label_page(paths, asking, serving, author, suspects)


def _mode(
    auto: str | None,
    compare: bool,
    audit: bool,
    export: tuple[str, Path] | None,
    take: Path | None,
) -> str:
    """The one mode that is asked for; empty for the page.

    Raises:
        ValueError: there are two.
    """
    asked: Sequence[tuple[str, bool]] = (
        ("auto", auto is not None),
        ("compare", compare),
        ("audit", audit),
        ("export", export is not None),
        ("import", take is not None),
    )
    chosen = [name for name, given in asked if given]
    if len(chosen) > 1:
        raise ValueError(f"--{chosen[0]} and --{chosen[1]} given; one of them at a time expected")
    return chosen[0] if chosen else ""
