"""`holdfast label compare`: the agreement of two sets of labels."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.label.inputs import AnnotatorOption, RuleOptions
from holdfast.cli.options import RARE, JsonOption
from holdfast.cli.terminal.console import (
    format_number,
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import progress
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.labelling.labelled_files import LabelsOf
    from holdfast.labelling.review.compare import (
        Agreement,
        FingerAgreement,
        PooledAgreement,
    )


def compare(
    a: Annotated[Path, typer.Argument(help="A: recordings, labels of them, or a rule.")],
    b: Annotated[Path, typer.Argument(help="B: likewise; one of both is no rule.")],
    *,
    options: Annotated[RuleOptions, RARE],
    annotator: AnnotatorOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compare two sets of labels: kappa and differences of onsets.

    A and B are files, folders, or a rule: signal, tracking or command. Print Cohen's kappa, the
    differences of the onsets, and how many intervals only one of them has. See docs/labels.md.

    Example:
      holdfast label compare recordings/ labels-of-ann/ --json
      holdfast label compare recordings/ signal
    """
    require_extras("label")
    from msgspec import to_builtins

    from holdfast.labelling.exchange.read_labels import read_labels
    from holdfast.labelling.labelled_files import compare_files, is_rule, recordings_to_compare

    def labels_of(place: Path) -> "LabelsOf":
        if is_rule(place):
            return lambda recording, _: options.propose(str(place), recording)
        return lambda recording, _: read_labels(place, recording, annotator)

    files = recordings_to_compare(a, b)
    agreement, left_out = compare_files(progress(files, "comparing"), labels_of(a), labels_of(b))
    if as_json:
        document = to_builtins(agreement)
        print_json({"a": str(a), "b": str(b), **document, "left_out": left_out})
        return
    print_agreement(agreement)
    for name, text in left_out.items():
        print_message(f"{name} is left out: {text}")


def print_agreement(agreement: "Agreement") -> None:
    """Print the table of the fingers, and the causes on which both agree or not."""
    from holdfast.contact import Cause

    header = (
        "recording", "finger", "kappa", "kappa stable", "onsets", "median [ms]", "p95 [ms]",
        "only A [%]", "only B [%]", "not in A", "not in B",
    )  # fmt: skip
    rows = [
        (recording.name, finger, *_row(labels), len(labels.missing_in_a), len(labels.missing_in_b))
        for recording in agreement.recordings
        for finger, labels in recording.fingers.items()
    ]
    pooled = {**agreement.fingers, "all": agreement.pooled}
    if len(agreement.recordings) > 1:
        rows += [
            ("all", finger, *_row(labels), labels.n_missing_in_a, labels.n_missing_in_b)
            for finger, labels in pooled.items()
        ]
    print_table(header, rows)
    print_line()
    print_paragraph(
        "onset differences: B minus A, for onsets of instability in both; "
        "not in A, not in B: number of intervals that only the other has"
    )
    counts = dict(zip(Cause, agreement.pooled.causes, strict=True))
    columns = [k for k in range(len(Cause)) if any(row[k] for row in counts.values())]
    if not columns:  # one of both gives no causes
        return
    table = [(cause, *(row[k] for k in columns)) for cause, row in counts.items() if any(row)]
    print_line()
    print_table(("cause", *(list(Cause)[k] for k in columns)), table)
    print_line()
    print_paragraph(
        "samples for which both give a cause, by that in A (rows) and in B (columns); "
        f"their kappa is {format_number(agreement.pooled.kappa_cause, 3)}"
    )


def _row(labels: "FingerAgreement | PooledAgreement") -> tuple[str, ...]:
    onsets = labels.onset_differences
    times = (None if time is None else 1e3 * time for time in (onsets.median, onsets.p95))
    return (
        format_number(labels.kappa, 3),
        format_number(labels.kappa_stable, 3),
        f"{onsets.n}",
        *(format_number(time, 0) for time in times),
        f"{100 * labels.only_a:.1f}",
        f"{100 * labels.only_b:.1f}",
    )
