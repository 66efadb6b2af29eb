"""Scores of a submission: stability, events and slips, from the truth of the recordings.

The scorer chooses every threshold itself, on the split `tuning`, for a budget of false alarms.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np

from holdfast.contact import STABLE, UNSTABLE
from holdfast.metrics import Decisions, FingerDecisions, summarise
from holdfast.metrics.decisions import Codes
from holdfast.metrics.slip_truth import slip_truth
from holdfast.recordings import Recording
from holdfast.sensors.types import Array
from holdfast_lab.report.result_tables import Key, ResultTable, Row
from holdfast_lab.study.benchmark.protocol import (
    TUNING,
    BenchmarkProtocol,
    differing,
    digest_of,
    load_split,
)
from holdfast_lab.study.benchmark.submission import FingerScores, Submission
from holdfast_lab.study.comparison.event_tables import (
    EVENT_DIGITS,
    FALSE_ALARMS_OF_GLITCH,
    OTHER_FALSE_ALARMS,
    event_rows,
)
from holdfast_lab.study.comparison.rows import DIGITS, sample_rows
from holdfast_lab.study.comparison.slip_table import SLIP_DIGITS, slip_rows
from holdfast_lab.study.evaluation.alarms import (
    AlarmLabels,
    AlarmStatistics,
    FalseAlarmRanges,
    threshold_shift,
)
from holdfast_lab.study.evaluation.evaluate_method import HOLD_TIME
from holdfast_lab.study.evaluation.evaluate_slips import (
    SLIP_RATE,
    SlipScores,
    slip_curves,
    still_ranks,
    summarise_slips,
)
from holdfast_lab.study.evaluation.fitted_method import Scores

EVENT_BUDGETS = (1.0, 5.0)
"""Rates of false alarms of a finger under a stable label that events are scored at [1/min]."""
DECISION_SCORE = 0.5
"""Score from which on a sample is called stable, for the accuracy."""
GLITCH_FIGURES = (FALSE_ALARMS_OF_GLITCH, OTHER_FALSE_ALARMS)
"""Figures of events that are left out: a glitch of the controller is an event here."""
LARGEST_LOG_ODDS = 40.0
BOOTSTRAP_SEED = 0

STABILITY_NOTE = (
    "By sample, of single fingers, all pooled. Class 1 is stable, class 0 everything else; "
    f"'accuracy', FDR and FNR at a score of {DECISION_SCORE:g}. 'AUC contact': without the samples "
    "without contact."
)
EVENTS_NOTE = (
    "Of single fingers. An event is the end of a stable hold of at least 0.5 s; an alarm is the "
    f"end of STABLE, with states held not stable for {HOLD_TIME:g} s. The threshold is the highest "
    "with at most so many false alarms a minute of stable label in the split tuning."
)
SLIPS_NOTE = (
    "Of single fingers, by true sliding. The threshold is chosen in the split tuning, for "
    f"{SLIP_RATE:g} false alarm per minute of held time and at most 2 % of quiet hold raised."
)


class FingerTruth(NamedTuple):
    """A finger of a recording: its scores beside its labels, which are made from the truth.

    Attributes:
        scores: of stability.
        labels: (n,) label codes.
        slip: scores of slips; None if there are none, or the truth is not known.
    """

    scores: Scores
    labels: Codes
    slip: SlipScores | None

    @classmethod
    def of(cls, recording: Recording, finger: str, scores: FingerScores) -> Self:
        """Return the truth of a finger beside its scores."""
        module = recording.modules[finger]
        # A submission says nothing of contact, so every sample counts as known and in contact.
        everywhere = np.ones(module.n_samples, dtype=np.bool_)
        margin = log_odds(scores.stable)
        stable = Scores(module.times, margin, everywhere, everywhere, scores.stable)
        truth = None if scores.slip is None else slip_truth(recording, finger, module.times)
        slip = None
        if truth is not None and scores.slip is not None:
            slip = SlipScores(module.times, log_odds(scores.slip), truth)
        return cls(stable, module.label_states, slip)

    def samples(self) -> FingerDecisions:
        """Return the decision of every sample by itself."""
        times, scores = self.scores.times, self.scores.probability
        states = np.where(scores >= DECISION_SCORE, STABLE, UNSTABLE)
        return FingerDecisions(times, self.labels, states.astype(np.int8), scores)


Scored = Mapping[str, Mapping[str, FingerTruth]]
"""Fingers of each recording of a split, by name."""


@dataclass(frozen=True)
class BenchmarkResult:
    """Tables of a submission.

    Attributes:
        tables: stability, events and, with scores of slips, slips.
        differ: recordings that are not those of the protocol, as SPLIT/NAME.
        left_out: splits without scores.
    """

    tables: list[ResultTable]
    differ: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def score_submission(
    submission: Submission, folder: Path, protocol: BenchmarkProtocol
) -> BenchmarkResult:
    """Return the scores of a submission.

    Args:
        submission: with scores of `tuning` and of at least one scored split.
        folder: with the recordings of the splits.
        protocol: whose splits are scored.

    Raises:
        ValueError: a split, recording or finger is unknown or incomplete, or `tuning` is missing.
        RecordingError: the recordings of a split do not exist.
    """
    # The splits to read, in the order of the protocol.
    usable = [name for name, split in protocol.splits.items() if split.scored or name == TUNING]
    submitted = submission.splits()
    if unknown := [name for name in submitted if name not in usable]:
        raise ValueError(
            f"{submission.name}: unknown split {unknown[0]!r}; recordings are SPLIT/NAME, with "
            f"the splits {', '.join(usable)}"
        )
    if TUNING not in submitted or len(submitted) < 2:
        raise ValueError(
            f"{submission.name}: scores of {TUNING} and of another split expected, "
            f"{', '.join(submitted)} given; thresholds are chosen on {TUNING}"
        )
    names = [name for name in usable if name in submitted]
    differ: list[str] = []
    scored: dict[str, Scored] = {}
    for name in names:
        recordings = load_split(folder, name)
        submission.check_names(name, list(recordings.names))
        digests: dict[str, str] = {}
        fingers: dict[str, dict[str, FingerTruth]] = {}
        for recording in recordings:  # one pass: each pass reads every file anew
            digests[recording.name] = digest_of(recording)
            given = submission.scores_of(name, recording).items()
            fingers[recording.name] = {f: FingerTruth.of(recording, f, own) for f, own in given}
        scored[name] = fingers
        differ += [f"{name}/{d}" for d in differing(protocol.splits[name], digests)]
    # The recordings that thresholds are chosen on are not scored themselves.
    tuning = scored.pop(TUNING)
    tables = [stability_table(scored), events_table(scored, tuning)]
    if submission.has_slips:
        tables.append(slips_table(scored, tuning))
    left_out = [
        name for name, split in protocol.splits.items() if split.scored and name not in scored
    ]
    return BenchmarkResult(tables, differ, left_out)


def log_odds(scores: Array) -> Array:
    """Return the log odds of scores, within limits.

    Example:
        >>> log_odds(np.array([0.0, 0.5, 1.0])).tolist()
        [-40.0, 0.0, 40.0]
    """
    # Scores of exactly 0 and 1 are allowed; their log odds are infinite until they are clipped.
    with np.errstate(divide="ignore"):
        odds = np.log(scores) - np.log1p(-scores)
    return np.asarray(np.clip(odds, -LARGEST_LOG_ODDS, LARGEST_LOG_ODDS))


def stability_table(scored: Mapping[str, Scored]) -> ResultTable:
    """Return the table of stability by sample."""
    rows: list[Row] = []
    for split, recordings in scored.items():
        decisions = (
            Decisions(name, {finger: own.samples() for finger, own in fingers.items()})
            for name, fingers in recordings.items()
        )
        rows += sample_rows({"on": split}, summarise(decisions, seed=BOOTSTRAP_SEED))
    return ResultTable(
        "stability", "Stability by sample", STABILITY_NOTE, rows, ("on",), digits_of=DIGITS,
        has_paper=False,
    )  # fmt: skip


def events_table(scored: Mapping[str, Scored], tuning: Scored) -> ResultTable:
    """Return the table of events, at thresholds chosen on tuning."""
    ranges = [
        FalseAlarmRanges.of(own.scores.hold(HOLD_TIME), AlarmLabels.of(own.labels))
        for fingers in tuning.values()
        for own in fingers.values()
    ]
    rows: list[Row] = []
    for split, recordings in scored.items():
        for budget in EVENT_BUDGETS:
            shift = threshold_shift(ranges, budget)
            # The statistics of all fingers of a recording together.
            alarms = [
                AlarmStatistics.total(
                    [
                        AlarmStatistics.of(
                            own.scores.hold(HOLD_TIME), AlarmLabels.of(own.labels), shift
                        )
                        for own in fingers.values()
                    ]
                )
                for fingers in recordings.values()
            ]
            keys: dict[str, Key] = {"on": split, "threshold": f"for {budget:g}/min"}
            scored_rows = event_rows(keys, alarms, BOOTSTRAP_SEED)
            rows += [row for row in scored_rows if row.keys["figure"] not in GLITCH_FIGURES]
    return ResultTable(
        "events", "Events", EVENTS_NOTE, rows, ("on", "threshold"), digits_of=EVENT_DIGITS,
        has_paper=False,
    )  # fmt: skip


def slips_table(scored: Mapping[str, Scored], tuning: Scored) -> ResultTable:
    """Return the table of slips, at thresholds chosen on tuning."""
    ranks = still_ranks(_slip_scores(tuning))
    if not len(ranks):
        raise ValueError(f"{TUNING}: no scored sample that is held and does not slide")
    chosen_from = [slip_curves(fingers, ranks) for fingers in _slip_scores(tuning)]
    rows: list[Row] = []
    for split, recordings in scored.items():
        curves = [slip_curves(fingers, ranks) for fingers in _slip_scores(recordings)]
        evaluation = summarise_slips(curves, BOOTSTRAP_SEED, training=chosen_from)
        rows += slip_rows({"on": split}, evaluation)
    return ResultTable(
        "slips", "Slips of fingers", SLIPS_NOTE, rows, ("on",), digits_of=SLIP_DIGITS,
        has_paper=False,
    )  # fmt: skip


def _slip_scores(recordings: Scored) -> list[dict[str, SlipScores]]:
    """Return the scores of the fingers whose slips are known, of each recording with such."""
    made = [
        {finger: own.slip for finger, own in fingers.items() if own.slip is not None}
        for fingers in recordings.values()
    ]
    return [fingers for fingers in made if fingers]
