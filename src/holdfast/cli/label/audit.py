"""`holdfast label audit`: labels that a classifier contradicts."""

from typing import Annotated

from holdfast.cli.label.inputs import (
    LABEL_ADDRESS,
    AuthorOption,
    PageOption,
    PathsArgument,
    RuleOptions,
)
from holdfast.cli.options import (
    DEFAULT_JOBS,
    RARE,
    BrowserOption,
    JobsOption,
    JsonOption,
    ServerOptions,
)
from holdfast.cli.terminal.console import print_json, print_line, print_message, print_table
from holdfast.errors import require_extras


def audit(
    paths: PathsArgument,
    *,
    options: Annotated[RuleOptions, RARE],
    page: PageOption = False,
    author: AuthorOption = None,
    jobs: Annotated[JobsOption, RARE] = DEFAULT_JOBS,
    access: Annotated[ServerOptions, RARE] = LABEL_ADDRESS,
    browser: Annotated[BrowserOption, RARE] = None,
    as_json: JsonOption = False,
) -> None:
    """Find labels that a classifier contradicts.

    A classifier is cross-validated over the recordings. Labels that it contradicts with high
    confidence are printed, and with --page shown on the labelling page. See docs/labels.md.

    Example:
      holdfast label audit recordings/
      holdfast label audit recordings/ --page
    """
    from msgspec import to_builtins

    from holdfast.cli.label.page import show_label_page
    from holdfast.io import Dataset
    from holdfast.labelling.labelled_files import recordings_at
    from holdfast.labelling.review.audit import audit as find_contradictions

    require_extras("label", "train")
    access.find_token()  # a wrong token is refused in every mode
    files = recordings_at(paths)
    print_message(f"cross-validating the labels of {len(files)} recordings")
    result = find_contradictions(Dataset(files), n_jobs=jobs)
    if as_json and not page:  # the page prints its own
        print_json(to_builtins(result))
    else:
        rows = [
            (
                suspect.recording, suspect.finger, suspect.kind,
                f"{suspect.start:.2f}", f"{suspect.end:.2f}",
                suspect.given, suspect.expected, f"{suspect.confidence:.2f}",
                "-" if suspect.shift is None else f"{suspect.shift:+.2f}",
            )
            for suspect in result.suspects
        ]  # fmt: skip
        if rows:
            header = (
                "recording", "finger", "kind", "start [s]", "end [s]",
                "label", "expected", "confidence", "shift [s]",
            )  # fmt: skip
            print_table(header, rows)
            print_line()
        print_line(
            f"{len(rows)} suspects in {result.judged:.1f} s of labels of "
            f"{result.n_recordings} recordings"
        )
    if page:
        show_label_page(
            paths, options, access, author,
            browser=browser is not False, as_json=as_json, suspects=result.suspects,
        )  # fmt: skip
