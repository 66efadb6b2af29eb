"""`holdfast label`: label recordings on a page or by a rule, compare and audit labels."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from holdfast.cli.label.inputs import RuleOptions, SaveOptions
from holdfast.cli.options import (
    LOCALHOST,
    BrowserOption,
    JobsOption,
    JsonOption,
    ServerOptions,
)
from holdfast.errors import require_extras

LABEL_ADDRESS = ServerOptions(LOCALHOST, port=8081)


@dataclass(frozen=True)
class ModeOptions:
    """Group of options: what to do instead of opening the page; at most one of the first five."""

    auto: Annotated[
        str | None, typer.Option(help="Label by a rule: signal, tracking or command.")
    ] = None
    compare: Annotated[
        bool, typer.Option("--compare", help="Print the agreement of A and B; B may be a rule.")
    ] = False
    audit: Annotated[
        bool, typer.Option("--audit", help="Find labels that a classifier contradicts.")
    ] = False
    export: Annotated[
        tuple[str, Path] | None,
        typer.Option(metavar="FORMAT FOLDER", help="Export labels: label-studio or csv."),
    ] = None
    import_from: Annotated[
        Path | None,
        typer.Option("--import", help="Import labels: JSON of Label Studio, or CSV."),
    ] = None
    page: Annotated[
        bool, typer.Option("--page", help="With --audit: show the contradicted labels on the page.")
    ] = False

    def check(self) -> None:
        """Check that at most one mode is given, and `--page` only with `--audit`.

        Raises:
            ValueError: two modes are given, or the page of no audit.
        """
        modes = {
            "auto": self.auto is not None,
            "compare": self.compare,
            "audit": self.audit,
            "export": self.export is not None,
            "import": self.import_from is not None,
        }
        wanted = [name for name, is_wanted in modes.items() if is_wanted]
        if len(wanted) > 1:
            raise ValueError(f"--{wanted[0]} and --{wanted[1]} given; only one of them expected")
        if self.page and not self.audit:
            raise ValueError("--page shows the result of --audit: give --audit as well")


def label(
    paths: Annotated[
        list[Path], typer.Argument(help="Recordings or folders; for --compare: A and B.")
    ],
    *,
    mode: ModeOptions,
    options: RuleOptions,
    saving: SaveOptions,
    jobs: JobsOption = -1,
    access: ServerOptions = LABEL_ADDRESS,
    browser: BrowserOption = None,
    as_json: JsonOption = False,
) -> None:
    r"""Label recordings on a page or by a rule, and check labels.

    Without --auto, --compare, --audit, --export and --import, open the labelling page: draw labels
    with the mouse, set states with keys, undo changes, and accept the proposals of a rule. Every
    change is saved at once. Labels are stored in NAME.labels.json beside the recording. The
    recording itself is never changed.

    --auto writes the labels that a rule proposes, and prints those with low confidence. They
    outrank labels that came with the recording; --dry-run only shows them. Labels of a person are
    overwritten only with --force. The tare is 0.5 s by default; of a recording that begins in
    contact it is the first sample. --compare prints Cohen's kappa and onset
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
    require_extras(*(("label", "train") if mode.audit else ("label",)))
    access.find_token()  # a wrong token is refused in every mode
    mode.check()
    if mode.auto is not None:
        from holdfast.cli.label.auto_mode import label_by_rule

        label_by_rule(paths, mode.auto, options, saving, as_json=as_json)
    elif mode.compare:
        from holdfast.cli.label.check_modes import compare_labels

        compare_labels(paths, options, saving.annotator, as_json=as_json)
    elif mode.export is not None:
        from holdfast.cli.label.exchange_mode import export_labels

        export_labels(paths, *mode.export, force=saving.force, as_json=as_json)
    elif mode.import_from is not None:
        from holdfast.cli.label.exchange_mode import import_labels

        import_labels(paths, mode.import_from, saving, as_json=as_json)
    else:
        from holdfast.cli.label.check_modes import audit_labels
        from holdfast.cli.label.page_mode import show_label_page

        show = mode.page or not mode.audit
        suspects = audit_labels(paths, jobs, as_json=as_json and not show) if mode.audit else ()
        if show:
            show_label_page(
                paths, options, access, saving.author,
                browser=browser is not False, as_json=as_json, suspects=suspects,
            )  # fmt: skip
