"""Teaching: a head `slip` of the user's own hand, from a few grasps whose slips are known.

A model that was trained on other hands finds few slips of a hand that it has not seen. Some tens
of slips of the hand itself find more than any of them, so the head is fitted to these alone. Its
threshold and its figures come from predictions about grasps that the head was not fitted to.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from holdfast.blocks import Digests
from holdfast.detection import ANY_FINGER, Head, Model, Training
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan, Tare
from holdfast.detection.specs import SLIDING_FEATURES
from holdfast.errors import DISTRIBUTION, TrainingError
from holdfast.metrics.slip_curves import (
    SLIP_THRESHOLDS,
    SlipSummary,
    choose_threshold,
    slip_curve,
    slip_intervals,
    slip_summary,
)
from holdfast.metrics.slip_truth import slip_truth
from holdfast.metrics.slips import SlipCounts, count_slips, slip_metrics
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.resampling import at_rate
from holdfast.sensors import Sensor
from holdfast.training.classifiers.logreg import LogisticRegression
from holdfast.training.dataset_scan import OneRecording, Progress, show_nothing
from holdfast.training.evaluation import compute_decisions
from holdfast.training.head_fits import fit_slip
from holdfast.training.own_handling import check_shear
from holdfast.training.splits import check_nothing_shared
from holdfast.training.targets import TargetInput, TargetSamples, slip_target
from holdfast.training.thresholds import N_SHOWN, CurvePoint
from holdfast.training.verdict import slips_verdict

WANTED_FALSE_ALARMS = 1.5
"""False alarms per minute of held time of a finger for which the threshold is set by default."""
TAUGHT_C = 0.01
"""C of the fit: a hundredth of that of a model of many recordings, since 97 weights have some tens
of slips. A weaker penalty finds more in grasps like those of the fit, and less in others."""
LOG_ODDS_SHIFT = -2.0
"""Shift of the log odds of what slides, as likely as what is still, that keeps the thresholds with
few false alarms inside of `SLIP_THRESHOLDS`."""
MIN_SLIPS, FEW_SLIPS = 3, 10
"""Slips of fingers below which nothing is fitted, and below which the user is warned."""
MIN_SLIDING = 20
"""Sliding samples below which nothing is fitted: with fewer, the samples of one slip decide."""
MIN_TAUGHT_RECORDINGS, FEW_RECORDINGS = 2, 5
"""Recordings with slips below which nothing is scored, and recordings below which the user is
warned: a fold then leaves out a large part of the slips."""
SURE_ALARMS = 9
"""Number of false alarms, at the wanted rate in what was surely held, from which the rate is known
to a third: the standard deviation of a number n is its root."""
TAUGHT_SUFFIX = ", taught"
"""End of the name of a taught model."""
TRUTH_AUTHOR = "twin"
"""Author of the labels of simulated recordings."""
MAX_TAUGHT_FOLDS = 10
"""Maximum number of heads that are fitted out of fold; of more recordings, every tenth is left out
together."""


SHOWN_FALSE_ALARMS = (0.5, 1.0, 1.5, 3.0, 6.0)
"""Wanted false alarms per minute of a finger, beside that of the model, whose thresholds are shown:
the user moves along them by the option `--false-alarms`."""


class TaughtPoint(msgspec.Struct, frozen=True):
    """What another threshold gives out of fold.

    Attributes:
        wanted: false alarms per minute of a finger for which it is the threshold.
        threshold: of the probability.
        found: share of the slips found within 0.1 s [%].
        before_1mm: share of the slips over 1 mm that are found before 1 mm [%]; None if the
            distances are not known.
        false_alarms: of a finger, per minute of held time.
        hand_false_alarms: of all fingers, per minute in which the hand holds.
    """

    wanted: float
    threshold: float
    found: float | None
    before_1mm: float | None
    false_alarms: float | None
    hand_false_alarms: float


@dataclass(frozen=True)
class Taught:
    """A taught model, and what it gave on grasps that its head was not fitted to.

    Attributes:
        model: with the taught head.
        slips: metrics out of fold, at the threshold of the model.
        base: metrics of the model that was given, on the same grasps; None without a slip rule.
        hand_alarms: false alarms of all fingers per minute in which the hand holds.
        curve: what other thresholds give.
        n_recordings: number of recordings with known slips.
        warnings: for the user.
    """

    model: Model
    slips: SlipSummary
    base: SlipSummary | None
    hand_alarms: float
    curve: tuple[TaughtPoint, ...]
    n_recordings: int
    warnings: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """What the taught head is worth on the next grasps of this hand."""
        return slips_verdict(self.slips, self.n_recordings)

    def document(self, path: Path) -> dict[str, Any]:
        """Return the figures for JSON.

        Args:
            path: of the model.
        """
        slip = {
            "n": self.slips.pooled.n,
            "grasps": self.n_recordings,
            "out_of_fold": self.slips.pooled,
            "intervals": self.slips.intervals,
        }
        return {
            "model": path,
            "steps": [],
            "heads": {"slip": slip},
            "base": None if self.base is None else self.base.pooled,
            "hand_false_alarms_per_minute": self.hand_alarms,
            "curve": self.curve,
            "warnings": self.warnings,
            "verdict": self.verdict,
        }


class TaughtPart(NamedTuple):
    """What is taken from one recording.

    Attributes:
        name: of the recording.
        digest: of its readings.
        blocks: of its readings.
        sensors: sensor of each finger whose slips are known.
        samples: of the target `slip`, of all these fingers; their unit is the recording.
        n_slips: number of slips of these fingers.
    """

    name: str
    digest: str
    blocks: Digests
    sensors: Mapping[str, Sensor]
    samples: TargetSamples | None
    n_slips: int


Curves = Sequence[Mapping[str, SlipCounts]]
"""Counts at each threshold of the fingers of recordings."""
FoldScores = list[tuple[Mapping[str, SlipCounts], Mapping[str, SlipCounts]]]
"""Of each recording of a fold: counts at each threshold of the taught head, and those of the
base."""


def teach(
    model: Model, recordings: Sequence[Recording], *, false_alarms: float = WANTED_FALSE_ALARMS
) -> Model:
    """Return a model with a head `slip` of the user's own hand.

    The slips are those of the labels: of a person, or of a rule, such as
    `holdfast label auto tracking`. Held samples outside them are negatives, so that some grasps
    should have pushes and taps that slide nothing. Two recordings suffice, though with a warning.

    Args:
        model: whose other heads are kept, such as `builtin:any`; its own handling of these sensors
            is kept too.
        recordings: of the hand, with labels of slips; are read more than once.
        false_alarms: maximum number per minute of held time of a finger.

    Raises:
        TrainingError: too few slips or recordings, a sensor has no shear, or no threshold gives so
            few false alarms.
        ModelError: the model lacks a finger of the recordings, or is for another sensor.
        ValueError: the number of false alarms is not above 0.
    """
    return teach_with_report(model, recordings, false_alarms=false_alarms).model


def teach_with_report(
    model: Model,
    recordings: Sequence[Recording],
    *,
    false_alarms: float = WANTED_FALSE_ALARMS,
    seed: int = 0,
    engine: Engine | None = None,
    progress: Progress = show_nothing,
) -> Taught:
    """Teach a model as `teach`, and return what the head gave out of fold.

    Args:
        model: as in `teach`.
        recordings: as in `teach`; may be a lazy dataset.
        false_alarms: as in `teach`.
        seed: of the intervals.
        engine: that reads the recordings and fits; by default this process.
        progress: iterates over recordings and fits.

    Raises:
        TrainingError: as in `teach`.
        ModelError: as in `teach`.
        ValueError: as in `teach`.
    """
    if not (math.isfinite(false_alarms) and false_alarms > 0):
        raise ValueError(f"false alarms per minute above 0 expected, {false_alarms:g} given")
    engine, n = engine or Engine(1), len(recordings)
    calls = ((index, OneRecording(recordings, index)) for index in range(n))
    read = engine.map_ordered(_read_part, calls, shared=(model,))
    parts = {k: part for k, part in enumerate(progress(read, "reading", n)) if part.samples}
    samples = _joined(list(parts.values()), n)
    blocks = [part.blocks for part in parts.values()]
    check_nothing_shared([part.name for part in parts.values()], blocks, np.arange(len(parts)))
    base = _base_of(model, list(parts.values()))

    # A head that is scored on a recording was fitted without it, and without those of its fold.
    n_folds = min(len(parts), MAX_TAUGHT_FOLDS)
    folds = [list(parts)[fold::n_folds] for fold in range(n_folds)]
    tasks = ((fold, [OneRecording(recordings, k) for k in fold]) for fold in folds)
    scored = engine.map_ordered(_score_fold, tasks, shared=(base, model, samples))
    scores = [pair for fold in progress(scored, "fitting", n_folds) for pair in fold]
    curves, counts_of_base = [curve for curve, _ in scores], [counts for _, counts in scores]
    pooled = [SlipCounts.total(fingers.values()) for fingers in curves]
    total = SlipCounts.total(pooled)
    index = choose_threshold(total, false_alarms, "use")
    if index is None:  # one alarm more in so little held time is too many
        index = choose_threshold(total, false_alarms)
    if index is None:
        raise TrainingError(
            f"no threshold gives at most {false_alarms:g} false alarms a minute in "
            f"{total.held_seconds / 60:.2g} min of held time; more grasps expected in which "
            "nothing slides, with pushes and taps"
        )
    slips = slip_summary(
        [{name: curve[index] for name, curve in fingers.items()} for fingers in curves],
        slip_intervals([curve[index].as_curve for curve in pooled], seed=seed),
    )
    head = _fitted(samples, ())
    shown = range(max(index - N_SHOWN, 0), min(index + N_SHOWN + 1, len(total)))
    points = [CurvePoint.of_slips(float(SLIP_THRESHOLDS[k]), total[k]) for k in shown]
    chosen = points[index - shown.start]
    head = head.at(chosen.threshold, chosen.choice(false_alarms, points=points))
    taught = _with_head(base, head)
    record = Training(
        recordings={part.name: part.digest for part in parts.values()},
        split="recording",
        parameters={ANY_FINGER: {**LogisticRegression().reference, "C": TAUGHT_C}},
        seed=seed,
        versions={name: version(name) for name in (DISTRIBUTION, "numpy")},
        sliding_samples={ANY_FINGER: samples.n_positive},
    )
    name = f"{model.name.removesuffix(TAUGHT_SUFFIX)}{TAUGHT_SUFFIX}"
    return Taught(
        msgspec.structs.replace(taught.with_training(record, blocks), name=name),
        slips,
        slip_summary(counts_of_base) if any(counts_of_base) else None,
        _hand_alarms(curves, index),
        tuple(_curve_points(curves, total, {*SHOWN_FALSE_ALARMS, false_alarms})),
        len(parts),
        tuple(_warnings(len(parts), total[index], false_alarms)),
    )


def taught_recording(recording: Recording) -> Recording:
    """Return the recording without its truth where a person or a rule has labelled it.

    Only simulated recordings have a truth. Their own labels come from it, and mark whole episodes
    as slip, so that the truth counts there. Labels that were made since count instead of it, and
    fingers without such labels have none.
    """
    made = {
        name: any(label.author != TRUTH_AUTHOR for label in module.labels)
        for name, module in recording.modules.items()
    }
    if not any(made.values()):
        return recording
    modules = {
        name: module if made[name] else replace(module, labels=())
        for name, module in recording.modules.items()
    }
    return replace(recording, modules=modules, truth=None)


def _read_part(model: Model, index: int, part: Sequence[Recording]) -> TaughtPart:
    """Return the samples of one recording, of all fingers whose slips are known."""
    check_shear(part[0])
    recording = at_rate(taught_recording(part[0]), model.rate)
    modules = recording.modules
    sensors = model.fingers_of({name: module.sensor for name, module in modules.items()})
    truths = {
        name: truth
        for name in sensors
        if name in modules
        and (truth := slip_truth(recording, name, modules[name].times)) is not None
    }
    known = {name: sensors[name] for name in truths}
    plan = StreamPlan(
        known, dict.fromkeys(known, SLIDING_FEATURES), model.window, Tare.parse(model.tare),
        recording.rate,
    )  # fmt: skip
    samples = []
    for name, rows in extract(plan, recording).items() if known else ():
        units = np.full(modules[name].n_samples, index)
        given = TargetInput(recording, name, truths[name], units, index, 1, is_any=False)
        samples.append(slip_target(given, rows.features))
    return TaughtPart(
        recording.name,
        recording.readings_digest,
        part[0].blocks,
        known,
        TargetSamples.joined(samples) if samples else None,
        sum(len(truth.slips) for truth in truths.values()),
    )


def _joined(parts: Sequence[TaughtPart], n_recordings: int) -> TargetSamples:
    """Return the samples of all parts.

    Raises:
        TrainingError: they are too few to fit a head and to score it out of fold.
    """
    n_slips = sum(part.n_slips for part in parts)
    n_with = sum(part.n_slips > 0 for part in parts)
    if n_slips < MIN_SLIPS or n_with < MIN_TAUGHT_RECORDINGS:
        raise TrainingError(
            f"{n_slips} slips in {n_with} of {n_recordings} recordings given; at least "
            f"{MIN_SLIPS} in {MIN_TAUGHT_RECORDINGS} expected (holdfast label, or holdfast label "
            "auto tracking with a video)"
        )
    samples = TargetSamples.joined([part.samples for part in parts if part.samples is not None])
    n_still = samples.n_usable - samples.n_positive
    if samples.n_positive < MIN_SLIDING or not n_still:
        raise TrainingError(
            f"{samples.n_positive} samples that slide and {n_still} that hold still given; at "
            f"least {MIN_SLIDING} and 1 expected"
        )
    return samples


def _base_of(model: Model, parts: Sequence[TaughtPart]) -> Model:
    """Return the model without its slip heads, for the sensors that are taught.

    Own handling goes into the weights of `stable`: it may not move the taught head, whose features
    already are those of this hand.
    """
    sensors = {name: sensor for part in parts for name, sensor in part.sensors.items()}
    model = model.with_handling_of(sensors)
    return model.changed(
        lambda part: msgspec.structs.replace(
            part.without_heads("slip", "slip_changes", "slip_speed"), normalised=False
        )
    )


def _fitted(samples: TargetSamples, left_out: Collection[int]) -> Head:
    """Fit the head to the samples of all recordings but some.

    Raises:
        TrainingError: nothing that slides, or nothing that holds still, is left.
    """
    head = fit_slip(samples, left_out, SLIDING_FEATURES, is_any=False, n_min=1, c=TAUGHT_C)
    if head is None:
        raise TrainingError(
            "without one of the recordings no slip is left; slips in at least three of them "
            "expected"
        )
    # Each fit with its own odds, so that the thresholds of the folds mean the same.
    odds = math.log((samples.n_usable - samples.n_positive) / samples.n_positive) + LOG_ODDS_SHIFT
    rule = msgspec.structs.replace(head.rule, offset=head.rule.offset + odds)
    return msgspec.structs.replace(head, rule=rule)


def _with_head(model: Model, head: Head) -> Model:
    return model.changed(lambda part: part.with_heads(head))


def _score_fold(
    base: Model,
    given: Model,
    samples: TargetSamples,
    fold: Collection[int],
    parts: Sequence[Sequence[Recording]],
) -> FoldScores:
    """Return the counts about each recording of a fold, of a head that was fitted without them."""
    model = _with_head(base, _fitted(samples, fold))
    scores: FoldScores = []
    for part in parts:
        recording = taught_recording(part[0])
        known = compute_decisions(model, recording).known_slips
        base_slips = compute_decisions(given, recording).known_slips
        counts = {name: count_slips(slips) for name, slips in base_slips.items()}
        scores.append(({name: slip_curve(slips) for name, slips in known.items()}, counts))
    return scores


def _hand_alarms(curves: Sequence[Mapping[str, SlipCounts]], index: int) -> float:
    """Return the false alarms of all fingers per minute in which a finger of the hand holds."""
    counts = [[curve[index] for curve in fingers.values()] for fingers in curves]
    seconds = sum(max((c.held_seconds for c in own), default=0.0) for own in counts)
    n: int = sum(c.false_held for own in counts for c in own)
    return 60 * n / seconds


def _curve_points(
    curves: Sequence[Mapping[str, SlipCounts]], total: SlipCounts, wanted: Collection[float]
) -> Iterator[TaughtPoint]:
    """Yield what the thresholds for the wanted rates give, where one fits."""
    for rate in sorted(wanted):
        index = choose_threshold(total, rate, "use")
        if index is not None:
            metrics = slip_metrics(total[index])
            yield TaughtPoint(
                rate, float(SLIP_THRESHOLDS[index]), metrics.incipient["0.1"], metrics.before_1mm,
                metrics.false_alarms_per_minute["held"], _hand_alarms(curves, index),
            )  # fmt: skip


def _warnings(n_recordings: int, counts: SlipCounts, false_alarms: float) -> Iterator[str]:
    n_slips, minutes = len(counts.delays), counts.held_seconds / 60
    if n_slips < FEW_SLIPS:
        yield f"{n_slips} slips of fingers given; {FEW_SLIPS} or more, better 30, expected"
    if n_recordings < FEW_RECORDINGS:
        yield (
            f"{n_recordings} recordings given: the figures out of fold are rough below "
            f"{FEW_RECORDINGS}"
        )
    if minutes < (needed := SURE_ALARMS / false_alarms):
        yield (
            f"{false_alarms:g} a minute needs {needed:.2g} minutes of hold with pushes: "
            f"{minutes:.2g} were seen, so the next grasps may have more false alarms"
        )
