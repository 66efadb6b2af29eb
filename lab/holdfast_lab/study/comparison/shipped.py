"""Part of the study: the models that ship, and taught ones, on a hand that `any` never met.

`builtin:any` was trained on drawn hands; the hand of the study is not one of them. `builtin:twin`
was trained on other grasps of this hand. A taught model is `builtin:any` with a slip rule from the
first grasps of `taught`, whose slips are the true ones.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, pairwise, zip_longest
from typing import Any

import msgspec
import numpy as np

from holdfast.contact import STABLE, UNKNOWN, ContactState
from holdfast.detection import Model
from holdfast.errors import TrainingError
from holdfast.metrics import Decisions, score_recording
from holdfast.metrics.events import POST_DURATIONS
from holdfast.metrics.slips import SlipCounts, count_slips
from holdfast.recordings import Recording
from holdfast.training.evaluation import compute_decisions
from holdfast.training.teaching import teach
from holdfast_lab.report.result_tables import ResultTable, Row
from holdfast_lab.study.comparison.rows import RowKeys, count_row, quantile_row, ratio_row
from holdfast_lab.study.plan import Corpus, StudyPlan
from holdfast_lab.tasks import Task

SHIPPED_MODELS = ("builtin:noise-floor", "builtin:any", "builtin:twin")
TESTED = {
    "others": "unseen objects",
    "aged": "skins aged by 4 months",
    "impacts": "knocks",
    "slips": "slips without a push",
}
"""Corpora that the models are tested on, and their titles; none of them trained one."""
TEACHING = ("taught", "taught-pushes")
"""Corpora whose grasps teach, in turn."""
N_TAUGHT = (2, 4, 8, 12)
"""Numbers of grasps that teach."""
SPEED_LIMITS = (0.0, 2.0, 5.0, 10.0, 15.0, 18.0, math.inf)
"""Limits of the mean speed of a slip [mm/s]."""
SOON = (0.05, 0.1)
"""Delays up to which a slip counts as found [s]."""
NO_REPORT = "always stable, never a slip"
FIGURES_NOTE = (
    "Each model as it ships, at its own thresholds, without calibration. Events are of the hand, "
    "slips of single fingers, as in the tables of methods. False slip alarms: of a finger, for a "
    "minute in which it holds, and of all fingers, for a minute in which the hand holds. Impacts: "
    "those with a slip alarm, of the impacts on each finger that move it by no slip."
)


class ModelCounts(msgspec.Struct, frozen=True):
    """What a model decided about one recording.

    Attributes:
        stable: samples of fingers labelled stable, and those of them called STABLE.
        unstable: the same of all other labelled samples, and those not called STABLE.
        events: of the hand, and those without an alarm within 50 ms.
        alarms: false alarms of the hand under a stable label, and its minutes.
        delays: of each slip of a finger [s]; infinite without an alarm.
        speeds: mean speed of each of these slips [mm/s].
        over_1mm: slips over 1 mm, and those of them found before.
        false_slips: false slip alarms of all fingers.
        finger_minutes: in which a finger holds.
        hand_minutes: in which the hand holds.
        impacts: on fingers, and those of them with a slip alarm.
    """

    stable: tuple[int, int]
    unstable: tuple[int, int]
    events: tuple[int, float]
    alarms: tuple[int, float]
    delays: list[float]
    speeds: list[float]
    over_1mm: tuple[int, int]
    false_slips: int
    finger_minutes: float
    hand_minutes: float
    impacts: tuple[int, int]


Counted = dict[str, list[ModelCounts]]
"""Counts of each recording, by role of the corpus."""


def tasks(plan: StudyPlan) -> list[Task]:
    """Return a task for each model; none without recordings of the twin and other objects."""
    tests = {role: plan.corpora[role] for role in TESTED if role in plan.corpora}
    if not tests or not plan.main.has_truth:
        return []
    made = [
        Task(f"shipped/{name}", shipped_counts, (name, tests), Counted, cost=10.0)
        for name in SHIPPED_MODELS
    ]
    if all(role in plan.corpora for role in TEACHING):
        teaching = [plan.corpora[role] for role in TEACHING]
        for n in N_TAUGHT:
            arguments = (n, teaching, tests)
            made.append(Task(f"taught/{n}", taught_counts, arguments, Counted, cost=30.0))
    return made


def tables(plan: StudyPlan, results: Mapping[str, Any]) -> list[ResultTable]:
    """Return the tables of the models, and of the delay by the speed of a slip."""
    del plan
    found = {model_title(name): r for name, r in results.items()
             if name.startswith(("shipped/", "taught/")) and r}  # fmt: skip
    if not found:
        return []
    # From a model with a slip rule, or there would be no slips to miss.
    counted_by = found["builtin:twin"]
    found[NO_REPORT] = {role: list(map(silenced, counts)) for role, counts in counted_by.items()}
    rows, by_speed = [], []
    for role, title in TESTED.items():
        for name, counted in found.items():
            if role in counted:
                keys = {"on": title, "model": name}
                rows += list(model_rows(keys, counted[role]))
                delays = chain.from_iterable(counts.delays for counts in counted[role])
                # Of models that never report a slip there is no delay.
                if role in ("others", "slips") and min(delays, default=math.inf) < math.inf:
                    by_speed += list(speed_rows(keys, counted[role]))
    speed_note = (
        "Delay of the slip alarm of a finger after its first sliding, by the mean speed of the "
        "slip. A negative delay is an alarm before it; a missed slip counts as infinite. 90 % and "
        "worst: so many slips, and all, have at most this delay."
    )
    digits = {"found within 0.1 s [%]": 1, "slips": 0}
    return [
        ResultTable("models", "Models that ship, and taught ones", FIGURES_NOTE, rows,
                    ("on", "model"), digits_of={"slips": 0, "events": 0}),
        ResultTable("slip_speeds", "Delay by the speed of the slip", speed_note, by_speed,
                    ("on", "model", "speed [mm/s]"), digits=3, digits_of=digits),
    ]  # fmt: skip


def model_title(task: str) -> str:
    """Return the title of a model by the name of its task.

    Example:
        >>> model_title("taught/8"), model_title("shipped/builtin:any")
        ('builtin:any, taught by 8 grasps', 'builtin:any')
    """
    kind, _, name = task.partition("/")
    return f"builtin:any, taught by {name} grasps" if kind == "taught" else name


def shipped_counts(name: str, tests: Mapping[str, Corpus]) -> Counted:
    """Return the counts of a built-in model on each corpus."""
    return counts_of(Model.load(name), tests)


def taught_counts(n: int, teaching: Sequence[Corpus], tests: Mapping[str, Corpus]) -> Counted:
    """Return the counts of `builtin:any` that was taught by n grasps; none if they are too few."""
    in_turn = chain(*zip_longest(*(corpus.load() for corpus in teaching)))
    grasps = [grasp for grasp in in_turn if grasp is not None][:n]
    try:
        model = teach(Model.load("builtin:any"), grasps)
    except TrainingError:
        return {}
    return counts_of(model, tests)


def counts_of(model: Model, tests: Mapping[str, Corpus]) -> Counted:
    """Return the counts of a model on each corpus."""
    return {
        role: [count_recording(model, recording) for recording in corpus.load()]
        for role, corpus in tests.items()
    }


def count_recording(model: Model, recording: Recording) -> ModelCounts:
    """Return what a model decides about a recording."""
    decisions = compute_decisions(model, recording)
    stable, unstable = np.zeros(2, dtype=int), np.zeros(2, dtype=int)
    for finger in decisions.fingers.values():
        known = (finger.labels != UNKNOWN) & (finger.states != UNKNOWN)
        is_stable, called = finger.labels == STABLE, finger.states == STABLE
        stable += ((known & is_stable).sum(), (known & is_stable & called).sum())
        unstable += ((known & ~is_stable).sum(), (known & ~is_stable & ~called).sum())
    hand = score_recording(decisions).metrics.events.hand
    missed = hand.n_events * (hand.missed[str(POST_DURATIONS[0])] or 0.0) / 100
    slips = slip_counts(decisions)
    counted = SlipCounts.total(counts for counts, _ in slips)
    return ModelCounts(
        stable=(int(stable[0]), int(stable[1])),
        unstable=(int(unstable[0]), int(unstable[1])),
        events=(hand.n_events, missed),
        alarms=(hand.false_alarms.get(ContactState.STABLE.value, 0), hand.stable_minutes),
        delays=[float(delay) for delay in counted.delays],
        speeds=list(chain.from_iterable(speeds for _, speeds in slips)),
        over_1mm=(int(counted.n_reached[0]), int(counted.found_before[0])),
        false_slips=int(counted.false_held),
        finger_minutes=counted.held_seconds / 60,
        hand_minutes=max((counts.held_seconds for counts, _ in slips), default=0.0) / 60,
        impacts=(int(counted.n_impacts), int(counted.false_impacts)),
    )


def slip_counts(decisions: Decisions) -> list[tuple[SlipCounts, list[float]]]:
    """Return the counts of the slips of each finger, and the mean speed of each slip [mm/s]."""
    counted = []
    for finger in decisions.fingers.values():
        if finger.slip is not None and finger.slip.truth is not None:
            slips = finger.slip.truth.slips
            speeds = [1e3 * slip.distance / (slip.end - slip.onset) for slip in slips]
            counted.append((count_slips(finger.slip), speeds))
    return counted


def silenced(counts: ModelCounts) -> ModelCounts:
    """Return what a hand gives that is always called stable and never slips."""
    return msgspec.structs.replace(
        counts,
        stable=(counts.stable[0], counts.stable[0]),
        unstable=(counts.unstable[0], 0),
        events=(counts.events[0], float(counts.events[0])),
        alarms=(0, counts.alarms[1]),
        delays=[math.inf] * len(counts.delays),
        over_1mm=(counts.over_1mm[0], 0),
        false_slips=0,
        impacts=(counts.impacts[0], 0),
    )


def model_rows(keys: RowKeys, counts: Sequence[ModelCounts]) -> Iterator[Row]:
    """Yield the rows of one model on one corpus."""
    pairs = {
        "stable called STABLE [%]": [each.stable for each in counts],
        "unstable or open, not STABLE [%]": [each.unstable for each in counts],
        "events missed at 50 ms [%]": [each.events for each in counts],
        "micro-slips [%]": [
            (len(each.delays), len(each.delays) - each.over_1mm[0]) for each in counts
        ],
        "before 1 mm [%]": [each.over_1mm for each in counts],
        **{
            f"slips found within {limit:g} s [%]": [
                (len(each.delays), sum(delay <= limit for delay in each.delays)) for each in counts
            ]
            for limit in SOON
        },
        "impacts with a slip alarm [%]": [each.impacts for each in counts],
    }
    for figure, both in pairs.items():
        n, part = np.array(both, dtype=np.float64).reshape(-1, 2).T
        yield ratio_row({**keys, "figure": figure}, part, n, 0)
    false = [each.false_slips for each in counts]
    rates = {
        "false alarms of the hand, per minute": (
            [each.alarms[0] for each in counts], [each.alarms[1] for each in counts],
        ),
        "false slips of a finger, per minute": (false, [each.finger_minutes for each in counts]),
        "false slips of the hand, per minute": (false, [each.hand_minutes for each in counts]),
    }  # fmt: skip
    for figure, (n_false, minutes) in rates.items():
        yield ratio_row({**keys, "figure": figure}, n_false, minutes, 0, scale=1.0)
    yield count_row({**keys, "figure": "events"}, [each.events[0] for each in counts])
    yield count_row({**keys, "figure": "slips"}, [len(each.delays) for each in counts])


def speed_rows(keys: RowKeys, counts: Sequence[ModelCounts]) -> Iterator[Row]:
    """Yield the delays of the slips by their mean speed."""
    for low, high in pairwise(SPEED_LIMITS):
        delays = [
            [d for d, speed in zip(each.delays, each.speeds, strict=True) if low <= speed < high]
            for each in counts
        ]
        name = f"{low:g} to {high:g}" if high < math.inf else f"over {low:g}"
        group = {**keys, "speed [mm/s]": name}
        for figure, share in (("median [s]", 0.5), ("90 % [s]", 0.9), ("worst [s]", 1.0)):
            yield quantile_row({**group, "figure": figure}, delays, share, 0)
        found = [sum(delay <= SOON[-1] for delay in own) for own in delays]
        n = [len(own) for own in delays]
        yield ratio_row({**group, "figure": "found within 0.1 s [%]"}, found, n, 0)
        yield count_row({**group, "figure": "slips"}, n)
