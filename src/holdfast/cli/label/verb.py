"""`holdfast label`: label recordings on a page or by a rule, compare and audit labels."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.options import (
    HostOption,
    JobsOption,
    JsonOption,
    PortOption,
    TokenFileOption,
    TokenOption,
    find_token,
)
from holdfast.cli.serve import DEFAULT_HOST
from holdfast.errors import require_extras

DEFAULT_PORT = 8081


def label(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings or folders; for --compare: A and B.")
    ],
    auto: Annotated[
        str | None, typer.Option(help="Label by a rule: signal, tracking or command.")
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Print the agreement of A and B; B may be a rule.")
    ] = False,
    audit: Annotated[
        bool, typer.Option("--audit", help="Find labels that a classifier contradicts.")
    ] = False,
    export: Annotated[
        tuple[str, Path] | None,
        typer.Option(metavar="FORMAT FOLDER", help="Export labels: label-studio or csv."),
    ] = None,
    import_from: Annotated[
        Path | None,
        typer.Option("--import", help="Import labels: JSON of Label Studio, or CSV."),
    ] = None,
    page: Annotated[
        bool, typer.Option("--page", help="With --audit: show the contradicted labels on the page.")
    ] = False,
    poses: Annotated[
        Path | None, typer.Option(help="Poses for the rule tracking: a CSV file or a ROS bag.")
    ] = None,
    tracks: Annotated[
        list[str] | None,
        typer.Option(
            "--track",
            metavar="BODY=NAME",
            help="Topic or frame of a body in the bag; BODY is object or a finger.",
        ),
    ] = None,
    parameters: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Parameter of the rule; may be repeated."),
    ] = None,
    tare: Annotated[
        str | None,
        typer.Option(
            help="Tare: seconds from the start, first, none, or START:END [s].",
            show_default="0.5, or first if a recording begins in contact",
        ),
    ] = None,
    author: Annotated[
        str | None,
        typer.Option(help="Author of the labels.", show_default="login name, or rule:RULE"),
    ] = None,
    annotator: Annotated[
        str | None, typer.Option(help="Annotator whose labels are read from Label Studio.")
    ] = None,
    jobs: JobsOption = -1,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="With --auto or --import: write nothing.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite labels of a person, or exported files.")
    ] = False,
    host: HostOption = DEFAULT_HOST,
    port: PortOption = DEFAULT_PORT,
    token: TokenOption = None,
    token_file: TokenFileOption = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Do not open the page in a browser.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    r"""Label recordings on a page or by a rule, and check labels.

    Without --auto, --compare, --audit, --export and --import, open the labelling page: draw labels
    with the mouse, set states with keys, undo changes, and accept the proposals of a rule. Every
    change is saved at once. Labels are stored in NAME.labels.json beside the recording. The
    recording itself is never changed.

    --auto writes the labels that a rule proposes, and prints those with low confidence. They
    outrank labels that came with the recording; --dry-run only shows them. Labels of a person are
    overwritten only with --force. The tare of a recording that begins in contact is its first
    sample. --compare prints Cohen's kappa and onset
    differences of two sets of labels: files, folders, or a rule. --audit prints labels that a
    cross-validated classifier contradicts. See docs/labels.md.

    Example:
      holdfast label recordings/
      holdfast label --auto signal recordings/ --dry-run
      holdfast label --auto tracking grasp.parquet --poses markers.csv
      holdfast label --auto tracking grasp.mcap --poses run.bag \
        --track object=/aruco/pose
      holdfast label --compare recordings/ labels-of-ann/ --json
      holdfast label --compare recordings/ signal
      holdfast label --audit recordings/ --page
      holdfast label --export label-studio studio/ recordings/
      holdfast label --import export.json recordings/
    """
    require_extras(*(("label", "train") if audit else ("label",)))
    from holdfast.cli.label.inputs import PageOptions, RuleOptions

    options = RuleOptions(tare, poses, tuple(tracks or ()), tuple(parameters or ()))
    page_options = PageOptions(host, port, find_token(token, token_file), not no_browser, as_json)
    mode = _mode(auto, compare, audit, export, import_from)
    if page and mode != "audit":
        raise ValueError("--page shows the result of --audit: give --audit as well")
    if mode == "auto":
        from holdfast.cli.label.auto_mode import label_by_rule

        label_by_rule(
            paths, auto or "", options,
            author=author, dry_run=dry_run, force=force, as_json=as_json,
        )  # fmt: skip
    elif mode == "compare":
        from holdfast.cli.label.compare_mode import compare_labels

        compare_labels(paths, options, annotator, as_json=as_json)
    elif mode == "export" and export is not None:
        from holdfast.cli.label.exchange_mode import export_labels

        export_labels(paths, *export, force=force, as_json=as_json)
    elif mode == "import" and import_from is not None:
        from holdfast.cli.label.exchange_mode import import_labels

        import_labels(
            paths, import_from,
            annotator=annotator, author=author, dry_run=dry_run, force=force, as_json=as_json,
        )  # fmt: skip
    else:
        from holdfast.cli.label.audit_mode import audit_labels
        from holdfast.cli.label.page_mode import show_label_page

        suspects = audit_labels(paths, jobs, as_json=as_json and not page) if audit else ()
        if page or not audit:
            show_label_page(paths, options, page_options, author, suspects)


def _mode(
    auto: str | None,
    compare: bool,
    audit: bool,
    export: tuple[str, Path] | None,
    import_from: Path | None,
) -> str:
    """Return the name of the mode; empty for the page.

    Raises:
        ValueError: two modes are given.
    """
    modes: Sequence[tuple[str, bool]] = (
        ("auto", auto is not None),
        ("compare", compare),
        ("audit", audit),
        ("export", export is not None),
        ("import", import_from is not None),
    )
    chosen = [name for name, given in modes if given]
    if len(chosen) > 1:
        raise ValueError(f"--{chosen[0]} and --{chosen[1]} given; only one of them expected")
    return chosen[0] if chosen else ""
