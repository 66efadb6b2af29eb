"""From features to states: the one rule, compiled, for a sample or for a thousand."""

import math
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast import contact
from holdfast.classifiers.linear import linear_probability
from holdfast.compiled import compiled
from holdfast.features import kernel
from holdfast.features.kernel import FAULTS, REASON, Array, Flags, Integers, Layout, Memory, Output
from holdfast.features.stream import StreamPlan
from holdfast.model import Model

UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = (
    contact.UNKNOWN,
    contact.NO_CONTACT,
    contact.UNSTABLE,
    contact.STABLE,
)
_hand_state = compiled(contact.hand_state)


# Columns of Rule.limits.
THRESHOLD = 0  # of the probability
CONTACT, CONTACT_NOISE = 1, 2  # of F_a: absolute, and as a multiple of the noise; NaN for none
N_LIMITS = 3

# Columns of Decision.codes: states as codes of holdfast.contact.
TOLD = 0
CANDIDATE = 1  # a state that has not lasted long enough yet
N_CODES = 2

N_REPORT = 7

# Columns of Decision.values.
PROBABILITY = 0
SINCE = 1  # when the candidate began [s]
N_DECIDED = 2


class Rule(NamedTuple):
    """From features to states: the constants of every finger."""

    weights: Array  # (n_fingers, n_features + 1)
    n_weights: Integers  # (n_fingers,)
    limits: Array  # (n_fingers, N_LIMITS)
    hysteresis: float
    min_duration: float
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
    faults: npt.NDArray[np.int8]
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
            faults=np.zeros(shape, dtype=np.int8),
            probability=np.zeros(shape),
            values=np.zeros((*shape, kernel.N_VALUES)),
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
        n_fingers=len(model.fingers),
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
        if output.status[finger, REASON] != kernel.READY:
            codes[:] = UNKNOWN
            decided[PROBABILITY] = math.nan
        elif present[finger]:
            noise = memory.levels[finger, kernel.NOISE]
            if _is_free(output.values[finger, kernel.AMPLITUDE], noise, rule.limits[finger]):
                decided[PROBABILITY] = 0.0
                state = NO_CONTACT
            else:
                weights = rule.weights[finger, : rule.n_weights[finger]]
                decided[PROBABILITY] = linear_probability(output.features[finger], weights)
                threshold = rule.limits[finger, THRESHOLD]
                state = _judge(decided[PROBABILITY], threshold, rule.hysteresis, codes[TOLD])
            _tell(codes, decided, state, rule.min_duration, time, layout.period)
    return _hand_state(decision.codes[:, TOLD], rule.n_fingers)


def verdict_code(state: int, reason: int, faults: int) -> int:
    """State, reason and faults as one number."""
    return state + 4 * reason + 32 * faults


_verdict_code = compiled(verdict_code)


@compiled
def step_live(
    # Layout
    offsets: Integers, rotations: Array, constants: Array, specs: Integers, floors: Array,
    windows: Integers, tare_kind: int, tare_seconds: float, period: float,
    # Memory
    baseline: Array, previous: Array, history: Array, counts: Integers, levels: Array,
    scratch: Array,
    # Output
    features: Array, output_values: Array, status: Integers,
    # Rule
    weights: Array, n_weights: Integers, limits: Array, hysteresis: float, min_duration: float,
    n_fingers: int,
    # Decision
    codes: Integers, values: Array,
    # the sample
    readings: Array, present: Flags, time: float,
    report: Array,
) -> int:  # fmt: skip
    """The same as `step`, for a caller in Python, which would lose 5 us on tuples of arrays.

    The report (n_fingers, N_REPORT) gets time, verdict, probability, sigma and force.
    """
    hand = step(
        Layout(
            offsets, rotations, constants, specs, floors, windows, tare_kind, tare_seconds, period
        ),
        Memory(baseline, previous, history, counts, levels, scratch),
        Output(features, output_values, status),
        Rule(weights, n_weights, limits, hysteresis, min_duration, n_fingers),
        Decision(codes, values),
        readings,
        present,
        time,
    )
    for f in range(len(present)):
        report[f, 0] = levels[f, kernel.LAST]
        report[f, 1] = _verdict_code(codes[f, TOLD], status[f, REASON], status[f, FAULTS])
        report[f, 2] = values[f, PROBABILITY]
        report[f, 3] = output_values[f, kernel.SIGMA]
        for axis in range(3):
            report[f, 4 + axis] = output_values[f, axis]
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
        traces.probability[k] = decision.values[:, PROBABILITY]
        traces.values[k] = output.values


@compiled
def _is_free(amplitude: float, noise: float, limits: Array) -> bool:
    """Whether F_a is under the threshold of contact; never, where there is none."""
    threshold = limits[CONTACT]
    if math.isnan(threshold):
        threshold = limits[CONTACT_NOISE] * noise
    return bool(amplitude < threshold)


@compiled
def _judge(probability: float, threshold: float, hysteresis: float, told: int) -> int:
    """STABLE from the threshold on; hysteresis moves it away from where the state is."""
    if told == STABLE:
        threshold -= hysteresis
    elif told != UNKNOWN:
        threshold += hysteresis
    return STABLE if probability >= threshold else UNSTABLE


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
