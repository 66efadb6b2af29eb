"""Submissions to the benchmark: scores by sample that another program wrote, as CSV or Parquet.

A submission has a row for each sample of each finger: `recording` (SPLIT/NAME), `finger`, `sample`
(from 0 on), `stable` (a score from 0 to 1 that the contact is stable) and, for the task of slips,
`slip` (a score from 0 to 1 that this finger slides). It has no decisions and no thresholds.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from holdfast.recordings import Recording
from holdfast.sensors.types import Array

COLUMN_TYPES = {
    "recording": pa.string(),
    "finger": pa.string(),
    "sample": pa.int64(),
    "stable": pa.float64(),
    "slip": pa.float64(),
}
"""Columns of a submission; the last is only needed for the task of slips."""
SLIP = "slip"
SUBMISSION_SUFFIXES = (".csv", ".parquet")
MAX_NAMED = 5
"""Maximum number of names in a message."""


class FingerScores(NamedTuple):
    """Scores of one finger in one recording.

    Attributes:
        stable: (n,) from 0 to 1.
        slip: (n,) from 0 to 1; None without a task of slips.
    """

    stable: Array
    slip: Array | None


class Submission(NamedTuple):
    """Scores of a submission.

    Attributes:
        name: of its file.
        recordings: scores by finger, by `SPLIT/NAME`.
        has_slips: whether it has scores of slips.
    """

    name: str
    recordings: Mapping[str, Mapping[str, FingerScores]]
    has_slips: bool

    def splits(self) -> list[str]:
        """Return the splits that it has scores for."""
        return list(dict.fromkeys(name.partition("/")[0] for name in self.recordings))

    def scores_of(self, split: str, recording: Recording) -> Mapping[str, FingerScores]:
        """Return the scores of a recording.

        Raises:
            ValueError: a finger is unknown or missing, or has another number of samples.
        """
        key = f"{split}/{recording.name}"
        scores = self.recordings.get(key, {})
        labelled = [name for name, module in recording.modules.items() if module.labels]
        if unknown := sorted(scores.keys() - recording.modules.keys()):
            raise ValueError(
                f"{self.name}: unknown finger {unknown[0]!r} of {key}; it has {_named(labelled)}"
            )
        for finger in labelled:
            n_given = len(scores[finger].stable) if finger in scores else 0
            n_samples = recording.modules[finger].n_samples
            if n_given != n_samples:
                raise ValueError(
                    f"{self.name}: {n_given} scores given for {finger} of {key}, {n_samples} "
                    "expected: one for each sample"
                )
        return {finger: scores[finger] for finger in labelled}

    def check_names(self, split: str, names: list[str]) -> None:
        """Check that it scores no recording that the split does not have.

        Raises:
            ValueError: it does.
        """
        known = {f"{split}/{name}" for name in names}
        scored = {key for key in self.recordings if key.startswith(f"{split}/")}
        if unknown := sorted(scored - known):
            raise ValueError(
                f"{self.name}: unknown recording {unknown[0]!r}; {split} has {_named(names)}"
            )


def read_submission(path: Path) -> Submission:
    """Read a submission.

    Raises:
        ValueError: it is no table of scores, or a score is not from 0 to 1.
    """
    table = read_score_table(path)
    values: dict[str, Array] = {}
    for name in ("stable", SLIP):
        if name not in table.column_names:
            continue
        column = values[name] = table.column(name).to_numpy(zero_copy_only=False)
        # Not `(column < 0) | (column > 1)`: an empty cell is NaN, which no comparison finds.
        wrong = np.flatnonzero(~((column >= 0) & (column <= 1)))
        if len(wrong):
            raise ValueError(
                f"{path}: {name} is {column[wrong[0]]:g} in row {wrong[0] + 1} of {len(column)}; a "
                f"number from 0 to 1 expected ({len(wrong)} of them are not)"
            )
    samples = table.column("sample").to_numpy(zero_copy_only=False)
    names = ("recording", "finger")
    # Names as codes: rows are sorted and compared by numbers, not by millions of strings.
    keys = [table.column(name).combine_chunks().dictionary_encode() for name in names]
    codes = [key.indices.to_numpy(zero_copy_only=False) for key in keys]
    order = np.lexsort((samples, codes[1], codes[0]))
    changes = np.any([np.diff(code[order]) != 0 for code in codes], axis=0)
    recordings: dict[str, dict[str, FingerScores]] = {}
    for rows in np.split(order, np.flatnonzero(changes) + 1):
        recording, finger = (
            str(key.dictionary[int(code[rows[0]])]) for key, code in zip(keys, codes, strict=True)
        )
        # The sorted numbers run from 0 without a gap or a repeat.
        numbers = samples[rows]
        wrong = np.flatnonzero(numbers != np.arange(len(numbers)))
        if len(wrong):
            raise ValueError(
                f"{path}: sample {wrong[0]} of {finger} of {recording} expected, "
                f"{numbers[wrong[0]]} found; every sample has one row"
            )
        slip = values[SLIP][rows] if SLIP in values else None
        recordings.setdefault(recording, {})[finger] = FingerScores(values["stable"][rows], slip)
    return Submission(path.name, recordings, SLIP in values)


def read_score_table(path: Path) -> pa.Table:
    """Read the columns of a submission.

    Raises:
        ValueError: the file cannot be read, a column is missing, or a cell that needs a value is
            empty.
    """
    if path.suffix not in SUBMISSION_SUFFIXES:
        raise ValueError(f"{path}: a .csv or .parquet file expected")
    try:
        if path.suffix == ".csv":
            # Without types pyarrow guesses them, and names that are digits become numbers.
            options = pa.csv.ConvertOptions(column_types=COLUMN_TYPES)
            table = pa.csv.read_csv(path, convert_options=options)
        else:
            table = pa.parquet.read_table(path)
        needed = [name for name in COLUMN_TYPES if name != SLIP]
        if missing := [name for name in needed if name not in table.column_names]:
            raise ValueError(
                f"{path}: column {missing[0]!r} is missing; {', '.join(needed)} expected, and "
                f"{SLIP} for the task of slips"
            )
        names = [name for name in COLUMN_TYPES if name in table.column_names]
        # Other columns are dropped, and a Parquet file may have narrower numbers.
        table = table.select(names).cast(pa.schema([(name, COLUMN_TYPES[name]) for name in names]))
    except pa.ArrowException as cause:
        raise ValueError(f"{path}: {str(cause).splitlines()[0]}") from cause
    # The table, if it has rows and no cell of a name or number is empty.
    if not len(table):
        raise ValueError(f"{path}: no row given; one for each sample of each finger expected")
    for name in ("recording", "finger", "sample"):
        if table.column(name).null_count:
            raise ValueError(f"{path}: {name} is empty in {table.column(name).null_count} rows")
    return table


def _named(names: list[str]) -> str:
    more = f" and {len(names) - MAX_NAMED} more" if len(names) > MAX_NAMED else ""
    return ", ".join(names[:MAX_NAMED]) + more
