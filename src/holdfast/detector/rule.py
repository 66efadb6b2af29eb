"""From features to states: the one rule, compiled, for a sample or for a thousand."""

import math
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast import contact
from holdfast.classifiers.linear import linear_probability
from holdfast.compiled import compiled
from holdfast.detector.table import (
    flags1,
    floats1,
    floats2,
    floats3,
    integers1,
    integers2,
    integers3,
    table_of,
)
from holdfast.features import kernel
from holdfast.features.arrays import (
    AMPLITUDE,
    FAULT,
    FAULTS,
    LAST,
    MEAN,
    N_VALUES,
    NOISE,
    READY,
    REASON,
    SIGMA,
    SIGMA_WINDOW,
    TAXELS,
    Array,
    Flags,
    Integers,
    Layout,
    Memory,
    Output,
)
from holdfast.features.faults import TARE_DRIFT
from holdfast.features.stream import StreamPlan
from holdfast.features.values import noise_sigma
from holdfast.model import ANY_FINGER, Model

UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = (
    contact.UNKNOWN,
    contact.NO_CONTACT,
    contact.UNSTABLE,
    contact.STABLE,
)
_hand_state = compiled(contact.hand_state)
_is_held = compiled(contact.is_held)


# Columns of Rule.limits.
THRESHOLD = 0  # of the probability
CONTACT, CONTACT_NOISE = 1, 2  # of F_a: absolute, and as a multiple of the noise; NaN for none
N_LIMITS = 3

# Columns of Decision.codes: states as codes of holdfast.contact.
TOLD = 0
CANDIDATE = 1  # a state that has not lasted long enough yet
ABOVE = 2  # of F_a: UNDER the threshold of contact, over it by a TOUCH, or by DRIFT of the tare
N_CODES = 3
UNDER, TOUCH, DRIFT = range(3)

N_REPORT = 7

# Columns of Decision.values.
PROBABILITY = 0
SINCE = 1  # when the candidate began [s]
LAST_UNSTABLE = 2  # when the rule last said so [s]
SLOW = 3  # F_a, smoothed over DRIFT_SECONDS [unit of the readings]
ROUSED = 4  # when the finger was last not calm [s]
N_DECIDED = 5

DRIFT_SECONDS = 1.0
"""What brings F_a over the threshold of contact takes less time, but for a drift [s]."""
CALM = 3.0
"""So many times the sigma that noise alone gives: what is more is a transient."""


class Rule(NamedTuple):
    """From features to states: the constants of every finger."""

    weights: Array  # (n_fingers, n_features + 1)
    n_weights: Integers  # (n_fingers,)
    limits: Array  # (n_fingers, N_LIMITS)
    hysteresis: float
    min_duration: float
    hold: float
    n_fingers: int


class Decision(NamedTuple):
    """What has been decided of every finger."""

    codes: Integers  # (n_fingers, N_CODES)
    values: Array  # (n_fingers, N_DECIDED)


def new_decision(n_fingers: int) -> Decision:
    """Nothing decided yet."""
    return Decision(
        codes=np.full((n_fingers, N_CODES), UNKNOWN, dtype=np.int64),
        values=np.full((n_fingers, N_DECIDED), np.nan),
    )


class Traces(NamedTuple):
    """Rows that the kernel fills, one an instant."""

    state: npt.NDArray[np.int8]  # (n, n_fingers)
    reason: npt.NDArray[np.int8]
    faults: npt.NDArray[np.int16]
    taxels: Integers  # bits of those at fault
    probability: Array
    values: Array  # (n, n_fingers, N_VALUES) as in Output
    hand: npt.NDArray[np.int8]  # (n,)

    @classmethod
    def empty(cls, n: int, n_fingers: int) -> Self:
        """Rows for n instants of so many fingers."""
        shape = (n, n_fingers)
        return cls(
            state=np.zeros(shape, dtype=np.int8),
            reason=np.zeros(shape, dtype=np.int8),
            faults=np.zeros(shape, dtype=np.int16),
            taxels=np.zeros(shape, dtype=np.int64),
            probability=np.zeros(shape),
            values=np.zeros((*shape, N_VALUES)),
            hand=np.zeros(n, dtype=np.int8),
        )


def rule_of(model: Model, plan: StreamPlan) -> Rule:
    """The model's constants for the fingers of the plan, in its order."""
    parts = [model.finger(name) for name in plan.fingers]
    width = max(part.classifier.n_features for part in parts) + 1
    weights = np.zeros((len(parts), width))
    for row, part in zip(weights, parts, strict=True):
        row[: part.classifier.n_features + 1] = part.classifier.weights()
    limits = [
        (part.classifier.threshold, part.contact_threshold, part.contact_noise) for part in parts
    ]
    return Rule(
        weights=weights,
        n_weights=np.array([part.classifier.n_features + 1 for part in parts]),
        limits=np.array(limits, dtype=np.float64),  # None becomes NaN
        hysteresis=float(model.debounce.hysteresis),
        min_duration=float(model.debounce.min_duration),
        hold=float(model.debounce.hold),
        n_fingers=len(plan.fingers) if ANY_FINGER in model.fingers else len(model.fingers),
    )


@compiled
def step(
    layout: Layout,
    memory: Memory,
    output: Output,
    rule: Rule,
    decision: Decision,
    readings: Array,
    present: Flags,
    time: float,
) -> int:
    """Takes one sample of a hand; the code of the hand's state after it."""
    kernel.advance(layout, memory, output, readings, present, time)
    for finger in range(len(present)):
        codes, decided = decision.codes[finger], decision.values[finger]
        noise, values = memory.levels[finger, NOISE], output.values[finger]
        threshold = _contact(noise, rule.limits[finger])
        ready = output.status[finger, REASON] == READY
        if ready and present[finger]:
            quiet = noise_sigma(noise, layout.windows[finger, SIGMA_WINDOW])
            if _drifted(values, codes, decided, threshold, quiet, time, layout.period):
                output.status[finger, REASON] = FAULT
                output.status[finger, FAULTS] = TARE_DRIFT
                ready = False
        if not ready:
            codes[TOLD] = codes[CANDIDATE] = UNKNOWN
            decided[PROBABILITY] = decided[LAST_UNSTABLE] = math.nan
        elif present[finger]:
            if values[AMPLITUDE] < threshold:
                decided[PROBABILITY] = 0.0
                state = NO_CONTACT
            else:
                weights = rule.weights[finger, : rule.n_weights[finger]]
                decided[PROBABILITY] = linear_probability(output.features[finger], weights)
                limit = rule.limits[finger, THRESHOLD]
                state = _judge(decided[PROBABILITY], limit, rule.hysteresis, codes[TOLD])
                state = _held(state, decided, rule.hold, time, layout.period)
            _tell(codes, decided, state, rule.min_duration, time, layout.period)
    return _hand_state(decision.codes[:, TOLD], rule.n_fingers)


def verdict_code(state: int, reason: int, faults: int) -> int:
    """State, reason and faults as one number."""
    return state + 4 * reason + 32 * faults


_verdict_code = compiled(verdict_code)


class Live(NamedTuple):
    """What a detector hands to the kernel by address: its memory, the sample and the report."""

    layout: Layout
    memory: Memory
    output: Output
    rule: Rule
    decision: Decision
    readings: Array  # (n_taxels, 3) of all fingers
    present: Flags  # (n_fingers,)
    report: Array  # (n_fingers, N_REPORT) time, verdict, probability, sigma and force

    def table(self) -> tuple[Integers, list[npt.NDArray[Any]]]:
        """The table that `step_live` takes, and the arrays that must live as long."""
        layout, rule = self.layout, self.rule
        integers = np.array([layout.tare_kind, rule.n_fingers, layout.alike], dtype=np.int64)
        floats = np.array(
            [layout.tare_seconds, layout.period, rule.hysteresis, rule.min_duration, rule.hold]
        )
        arrays = [
            integers, floats, *layout[:7], *self.memory, *self.output, *rule[:3], *self.decision,
            self.readings, self.present, self.report,
        ]  # fmt: skip
        return table_of(arrays), arrays


@compiled
def step_live(table: Integers, time: float) -> int:
    """The same as `step`, for a caller in Python, with all arrays in the table of a `Live`.

    The report is filled.
    """
    kind, numbers = integers1(table, 0), floats1(table, 1)
    layout = Layout(
        integers1(table, 2), floats3(table, 3), floats2(table, 4), integers3(table, 5),
        floats2(table, 6), integers2(table, 7), flags1(table, 8), kind[2] != 0, kind[0],
        numbers[0], numbers[1],
    )  # fmt: skip
    memory = Memory(
        floats2(table, 9), floats2(table, 10), floats2(table, 11), floats3(table, 12),
        integers2(table, 13), floats2(table, 14), floats2(table, 15),
    )  # fmt: skip
    output = Output(floats2(table, 16), floats2(table, 17), integers2(table, 18))
    rule = Rule(
        floats2(table, 19), integers1(table, 20), floats2(table, 21), numbers[2], numbers[3],
        numbers[4], kind[1],
    )  # fmt: skip
    decision = Decision(integers2(table, 22), floats2(table, 23))
    readings, present, report = floats2(table, 24), flags1(table, 25), floats2(table, 26)
    hand = step(layout, memory, output, rule, decision, readings, present, time)
    for f in range(len(present)):
        state, status = decision.codes[f, TOLD], output.status[f]
        report[f, 0] = memory.levels[f, LAST]
        report[f, 1] = _verdict_code(state, status[REASON], status[FAULTS])
        report[f, 2] = decision.values[f, PROBABILITY]
        report[f, 3] = output.values[f, SIGMA]
        for axis in range(3):
            report[f, 4 + axis] = output.values[f, axis]
    return hand


@compiled
def run(
    layout: Layout,
    memory: Memory,
    output: Output,
    rule: Rule,
    decision: Decision,
    readings: Array,
    present: Flags,
    times: Array,
    traces: Traces,
) -> None:
    """Takes successive samples of a hand, and writes down what each of them led to."""
    for k in range(len(times)):
        traces.hand[k] = step(
            layout, memory, output, rule, decision, readings[k], present[k], times[k]
        )
        traces.state[k] = decision.codes[:, TOLD]
        traces.reason[k] = output.status[:, REASON]
        traces.faults[k] = output.status[:, FAULTS]
        traces.taxels[k] = output.status[:, TAXELS]
        traces.probability[k] = decision.values[:, PROBABILITY]
        traces.values[k] = output.values


@compiled
def _contact(noise: float, limits: Array) -> float:
    """The threshold of contact of F_a; NaN, which nothing is under, where there is none."""
    if math.isnan(limits[CONTACT]):
        return float(limits[CONTACT_NOISE] * noise)
    return float(limits[CONTACT])


@compiled
def _drifted(
    values: Array,
    codes: Integers,
    decided: Array,
    threshold: float,
    quiet: float,
    time: float,
    period: float,
) -> bool:
    """Whether F_a crept over the threshold of contact: a touch is neither so slow nor so calm.

    `quiet` is the sigma that noise alone gives; a window of two samples has none.
    """
    amplitude, mean = values[AMPLITUDE], math.sqrt(2.0) * values[MEAN]
    if math.isnan(decided[SLOW]):
        decided[SLOW], decided[ROUSED] = amplitude, time
    away, jumped = abs(mean - decided[SLOW]), abs(amplitude - decided[SLOW]) > 0.5 * threshold
    decided[SLOW] += min(1.0, period / DRIFT_SECONDS) * (amplitude - decided[SLOW])
    calm = quiet > 0.0 and values[SIGMA] <= CALM * quiet and away <= 0.5 * threshold
    if not calm:
        decided[ROUSED] = time
    if amplitude < threshold:
        codes[ABOVE] = UNDER
    elif not calm:
        codes[ABOVE] = TOUCH
    elif codes[ABOVE] == UNDER:
        long = time - decided[ROUSED] + 0.5 * period >= DRIFT_SECONDS
        codes[ABOVE] = DRIFT if long and not jumped else TOUCH
    return bool(codes[ABOVE] == DRIFT)


@compiled
def _judge(probability: float, threshold: float, hysteresis: float, told: int) -> int:
    """STABLE from the threshold on; hysteresis moves it away from where the state is."""
    if told == STABLE:
        threshold -= hysteresis
    elif told != UNKNOWN:
        threshold += hysteresis
    return STABLE if probability >= threshold else UNSTABLE


@compiled
def _held(state: int, decided: Array, hold: float, time: float, period: float) -> int:
    """UNSTABLE for a while after the rule last said so."""
    if state == UNSTABLE:
        decided[LAST_UNSTABLE] = time
    elif _is_held(time, decided[LAST_UNSTABLE], hold, period):
        return UNSTABLE
    return state


@compiled
def _tell(
    codes: Integers, decided: Array, state: int, min_duration: float, time: float, period: float
) -> None:
    """Tells the state, if it has lasted long enough or nothing was known."""
    if state != codes[CANDIDATE]:
        codes[CANDIDATE] = state
        decided[SINCE] = time
    if codes[TOLD] == UNKNOWN or time - decided[SINCE] + 0.5 * period >= min_duration:
        codes[TOLD] = state
