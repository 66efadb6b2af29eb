"""`holdfast label --compare` and `--audit`: check labels against others, or a classifier."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from holdfast.cli.label.inputs import RuleOptions, recordings_at
from holdfast.cli.terminal.console import (
    format_number,
    print_json,
    print_line,
    print_message,
    print_paragraph,
    print_table,
)
from holdfast.cli.terminal.progress import progress

if TYPE_CHECKING:
    from holdfast.labelling.review.audit import Audit, Suspect
    from holdfast.labelling.review.compare import (
        Agreement,
        FingerAgreement,
        PooledAgreement,
        RecordingAgreement,
    )
    from holdfast.recordings import Label, Recording

LabelsOf = Callable[["Recording"], "dict[str, tuple[Label, ...]]"]


def compare_labels(
    paths: Sequence[Path], options: RuleOptions, annotator: str | None, *, as_json: bool
) -> None:
    """Print the agreement of A and B for each recording and finger.

    Recordings without labels in A or B are left out, and named.

    Args:
        paths: A and B: each a file or folder of labels or labelled recordings, or a rule.
        options: options of a rule.
        annotator: annotator whose labels are read from an export of Label Studio.
        as_json: print JSON.

    Raises:
        ValueError: the number of paths is not two, or both are rules.
        RecordingError: no recording has labels in both.
    """
    from msgspec import to_builtins

    from holdfast.labelling.review.compare import pool

    if len(paths) != 2:
        raise ValueError(f"--compare A B: two paths expected, {len(paths)} given")
    a, b = paths
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

    if _is_rule(a) and _is_rule(b):
        raise ValueError(f"rules {a} and {b} given; A or B must be recordings or labels")
    for place in (a, b):
        if not _is_rule(place) and not place.exists():
            raise RecordingError(f"{place} does not exist; labels, recordings or a rule expected")
    for place in (a, b):
        if not _is_rule(place) and (files := _recordings_beside(place)):
            return files
    raise RecordingError(
        f"no recordings beside the labels in {a} or {b}; recordings give the sample times"
    )


def _recordings_beside(place: Path) -> list[Path]:
    """Return the recordings in a folder, at a path, or beside a label file."""
    from holdfast.errors import RecordingError
    from holdfast.io import load_dataset
    from holdfast.io.label_files import SUFFIX, load_labels
    from holdfast.io.recording_files import SUFFIXES

    if place.is_dir():
        try:
            return list(load_dataset(place).paths)
        except RecordingError:
            return []
    if place.suffix in SUFFIXES:
        return [place]
    stems = [place.stem]
    if place.name.endswith(SUFFIX):
        stems = [place.name.removesuffix(SUFFIX), load_labels(place).name]
    beside = [place.with_name(stem + suffix) for stem in stems for suffix in SUFFIXES]
    return [path for path in beside if path.is_file()][:1]


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


def audit_labels(paths: Sequence[Path], jobs: int, *, as_json: bool) -> "Sequence[Suspect]":
    """Print the labels that a classifier contradicts, and return them.

    Args:
        paths: recordings, or folders of recordings.
        jobs: number of parallel fits; -1: one per processor.
        as_json: print JSON.

    Raises:
        TrainingError: there are too few labels to train a classifier.
        RecordingError: a recording cannot be read.
    """
    from msgspec import to_builtins

    from holdfast.io import Dataset
    from holdfast.labelling.review.audit import audit

    files = recordings_at(paths)
    print_message(f"cross-validating the labels of {len(files)} recordings")
    result = audit(Dataset(files), n_jobs=jobs)
    if as_json:
        print_json(to_builtins(result))
    else:
        _print_suspects(result)
    return result.suspects


def _print_suspects(result: "Audit") -> None:
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
