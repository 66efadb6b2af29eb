"""`holdfast label compare`: the agreement of two sets of labels."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.label.inputs import AnnotatorOption, RuleOptions
from holdfast.cli.options import JsonOption
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
    from holdfast.labelling.review.compare import (
        Agreement,
        FingerAgreement,
        PooledAgreement,
        RecordingAgreement,
    )
    from holdfast.recordings import Label, Recording

LabelsOf = Callable[["Recording"], "dict[str, tuple[Label, ...]]"]


def compare(
    a: Annotated[Path, typer.Argument(help="A: recordings, labels of them, or a rule.")],
    b: Annotated[Path, typer.Argument(help="B: likewise; one of both is no rule.")],
    *,
    options: RuleOptions,
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

    from holdfast.labelling.review.compare import pool

    files = _recordings_to_compare(a, b)
    both = (_labels_of(a, options, annotator), _labels_of(b, options, annotator))
    results = dict(_compare_each(files, both))
    compared = [result for result in results.values() if not isinstance(result, str)]
    left_out = {name: text for name, text in results.items() if isinstance(text, str)}
    if not compared:
        raise _nothing_to_compare(left_out)
    agreement = pool(compared)
    if as_json:
        document = to_builtins(agreement)
        print_json({"a": str(a), "b": str(b), **document, "left_out": left_out})
        return
    _print(agreement)
    for name, text in left_out.items():
        print_message(f"{name} is left out: {text}")


def _nothing_to_compare(left_out: dict[str, str]) -> Exception:
    from holdfast.errors import RecordingError

    name, text = next(iter(left_out.items()))
    more = f" (and {len(left_out) - 1} other recordings)" if len(left_out) > 1 else ""
    return RecordingError(f"nothing to compare: {name}: {text}{more}")


def _compare_each(
    files: Sequence[Path], both: tuple[LabelsOf, LabelsOf]
) -> "Iterator[tuple[str, RecordingAgreement | str]]":
    """Yield the name of each recording with its agreement, or with why it is left out."""
    from holdfast.errors import RecordingError
    from holdfast.io import load_recording
    from holdfast.labelling.review.compare import compare

    for path in progress(files, "comparing"):
        try:
            recording = load_recording(path, labels=False)
            a, b = (labels_of(recording) for labels_of in both)
            if not (any(a.values()) and any(b.values())):
                side = "B" if any(a.values()) else "A"
                yield recording.name, f"{side} has no labels of this recording"
                continue
            times = {name: module.times for name, module in recording.modules.items()}
            yield recording.name, compare(a, b, times, recording.name)
        except RecordingError as cause:
            yield path.stem, str(cause)


def _labels_of(place: Path, options: RuleOptions, annotator: str | None) -> LabelsOf:
    from holdfast.labelling.exchange.read_labels import read_labels

    if _is_rule(place):
        return lambda recording: options.propose(str(place), recording)
    return lambda recording: read_labels(place, recording, annotator)


def _is_rule(place: Path) -> bool:
    from holdfast.labelling.rules import RULES

    return str(place) in RULES and not place.exists()


def _recordings_to_compare(a: Path, b: Path) -> list[Path]:
    """Return the recordings to compare: those in A, otherwise those in B.

    Raises:
        RecordingError: there are none.
        ValueError: both are rules.
    """
    from holdfast.errors import RecordingError
    from holdfast.labelling.labelled_files import recordings_beside

    if _is_rule(a) and _is_rule(b):
        raise ValueError(f"rules {a} and {b} given; A or B must be recordings or labels")
    for place in (a, b):
        if not _is_rule(place) and not place.exists():
            raise RecordingError(f"{place} does not exist; labels, recordings or a rule expected")
    for place in (a, b):
        if not _is_rule(place) and (files := recordings_beside(place)):
            return files
    raise RecordingError(
        f"no recordings beside the labels in {a} or {b}; recordings give the sample times"
    )


def _print(agreement: "Agreement") -> None:
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
    _print_causes(agreement.pooled)


def _print_causes(pooled: "PooledAgreement") -> None:
    """Print the number of samples by their cause in A and in B, if both give causes."""
    from holdfast.contact import Cause

    counts = dict(zip(Cause, pooled.causes, strict=True))
    in_b = [cause for k, cause in enumerate(Cause) if any(row[k] for row in counts.values())]
    if not in_b:
        return
    order = list(Cause)
    rows = [
        (cause, *(row[order.index(other)] for other in in_b))
        for cause, row in counts.items()
        if any(row)
    ]
    print_line()
    print_table(("cause", *in_b), rows)
    print_line()
    print_paragraph(
        "samples for which both give a cause, by that in A (rows) and in B (columns); "
        f"their kappa is {format_number(pooled.kappa_cause, 3)}"
    )


def _row(labels: "FingerAgreement | PooledAgreement") -> tuple[str, ...]:
    onsets = labels.onset_differences
    return (
        format_number(labels.kappa, 3),
        format_number(labels.kappa_stable, 3),
        f"{onsets.n}",
        _milliseconds(onsets.median),
        _milliseconds(onsets.p95),
        f"{100 * labels.only_a:.1f}",
        f"{100 * labels.only_b:.1f}",
    )


def _milliseconds(seconds: float | None) -> str:
    return format_number(None if seconds is None else 1e3 * seconds, 0)
