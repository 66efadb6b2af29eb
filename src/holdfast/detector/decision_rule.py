"""The decision rule: from features to contact states, compiled, for one sample or for many."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast import contact
from holdfast.classifiers.cause import CAUSES, add_scores
from holdfast.classifiers.linear import linear_probability
from holdfast.compiled import compiled
from holdfast.features import kernel
from holdfast.features.arrays import (
    AMPLITUDE,
    FAULT,
    FAULTS,
    MEAN,
    MOVED_AT,
    NOISE,
    NOISE_NOW,
    PEAK_LOAD,
    READY,
    REASON,
    SIGMA,
    SIGMA_WINDOW,
    TAXELS,
    VALUES_WIDTH,
    Array,
    Flags,
    Integers,
    Layout,
    Memory,
    Output,
)
from holdfast.features.arrays import LOAD as MOTION_LOAD
from holdfast.features.faults import TARE_DRIFT
from holdfast.features.motion import RELEASED_SHARE
from holdfast.features.stream import StreamPlan
from holdfast.model import ANY_FINGER, FingerModel, Model

UNKNOWN, NO_CONTACT, UNSTABLE, STABLE = (
    contact.UNKNOWN,
    contact.NO_CONTACT,
    contact.UNSTABLE,
    contact.STABLE,
)
_hand_state = compiled(contact.hand_state)
_is_held = compiled(contact.is_held)

# Columns of DecisionRule.limits.
THRESHOLD = 0  # of the probability
CONTACT, CONTACT_NOISE = 1, 2  # of F_a: absolute, and as a multiple of the noise; NaN for none
CONTACT_LOAD = 3  # of the load, as a multiple of its noise; NaN for none
LIMITS_WIDTH = 4

# Columns of DecisionMemory.codes.
STATE = 0  # the state that is reported, as a code of holdfast.contact
CANDIDATE = 1  # the state of the last sample, which may not have lasted long enough yet
LOAD = 2  # how F_a came over the threshold of contact: one of the next three
NO_LOAD, TOUCH, DRIFT = range(3)
CAUSE = 3  # code of the cause while unstable; 0 for none
CODES_WIDTH = 4

# Columns of DecisionMemory.values.
PROBABILITY = 0
CANDIDATE_SINCE = 1  # when the candidate began [s]
LAST_UNSTABLE = 2  # time of the last sample that was unstable before the hold time [s]
SMOOTHED = 3  # F_a, smoothed over DRIFT_SECONDS [unit of the readings]
RESTLESS_AT = 4  # when the finger was last not calm [s]
DECIDED_WIDTH = 5

DRIFT_SECONDS = 1.0
"""A touch brings F_a over the threshold of contact in less time than this; a drift does not [s]."""
CONTACT_RELEASE_RATIO = 0.7
"""Share of the threshold of contact on the load below which a contact ends."""
TOUCH_SHARE = 1.5 * RELEASED_SHARE
"""Share of the largest load so far that a touch exceeds."""
REST_SECONDS = 0.2
"""A force is at rest if it has not moved for this time [s]."""
CALM_RATIO = 3.0
"""A finger is calm while sigma is at most this many times the sigma of noise alone."""


class DecisionRule(NamedTuple):
    """Constants of the decision rule, for every finger of a stream."""

    weights: Array  # (n_fingers, n_features + 1)
    n_weights: Integers  # (n_fingers,)
    causes: Array  # (n_fingers, n_causes, n_features + 1); n_causes is 0 without them
    limits: Array  # (n_fingers, LIMITS_WIDTH)
    hysteresis: float
    min_duration: float
    hold: float
    n_model_fingers: int


class DecisionMemory(NamedTuple):
    """Memory of the decision rule, for every finger of a stream."""

    codes: Integers  # (n_fingers, CODES_WIDTH)
    values: Array  # (n_fingers, DECIDED_WIDTH)
    scores: Array  # (n_fingers, n_causes) sums since the contact became unstable


class TraceRows(NamedTuple):
    """Rows that `run` fills, one for each instant."""

    state: npt.NDArray[np.int8]  # (n, n_fingers)
    reason: npt.NDArray[np.int8]
    faults: npt.NDArray[np.int16]
    taxels: Integers  # bits of faulty taxels
    probability: Array
    values: Array  # (n, n_fingers, VALUES_WIDTH), as in Output
    cause: npt.NDArray[np.int8]  # codes of the causes
    hand: npt.NDArray[np.int8]  # (n,)

    @classmethod
    def empty(cls, n: int, n_fingers: int) -> Self:
        """Return rows for n instants."""
        shape = (n, n_fingers)
        return cls(
            state=np.zeros(shape, dtype=np.int8),
            reason=np.zeros(shape, dtype=np.int8),
            faults=np.zeros(shape, dtype=np.int16),
            taxels=np.zeros(shape, dtype=np.int64),
            probability=np.zeros(shape),
            values=np.zeros((*shape, VALUES_WIDTH)),
            cause=np.zeros(shape, dtype=np.int8),
            hand=np.zeros(n, dtype=np.int8),
        )


def rule_of(model: Model, plan: StreamPlan) -> DecisionRule:
    """Return the constants of a model for the fingers of a plan, in its order."""
    parts = [model.finger(name) for name in plan.fingers]
    width = max(part.classifier.n_features for part in parts) + 1
    weights = np.zeros((len(parts), width))
    for row, part in zip(weights, parts, strict=True):
        row[: part.classifier.n_features + 1] = part.classifier.weights()
    limits = [
        (
            part.classifier.threshold,
            part.contact_threshold,
            part.contact_noise,
            part.contact_load,
        )
        for part in parts
    ]
    any_finger = ANY_FINGER in model.fingers
    return DecisionRule(
        weights=weights,
        n_weights=np.array([part.classifier.n_features + 1 for part in parts]),
        causes=_cause_weights(parts, width),
        limits=np.array(limits, dtype=np.float64),  # None becomes NaN
        hysteresis=float(model.debounce.hysteresis),
        min_duration=float(model.debounce.min_duration),
        hold=float(model.debounce.hold),
        n_model_fingers=len(plan.fingers) if any_finger else len(model.fingers),
    )


def _cause_weights(parts: Sequence[FingerModel], width: int) -> Array:
    """Return (n_fingers, n_causes, width); a finger without causes has the scores 0."""
    if all(part.causes is None for part in parts):
        return np.zeros((len(parts), 0, width))
    weights = np.zeros((len(parts), len(CAUSES), width))
    for row, part in zip(weights, parts, strict=True):
        if part.causes is not None:
            row[:, : part.causes.n_features + 1] = part.causes.weights()
    return weights


def new_decision_memory(n_fingers: int, n_causes: int = 0) -> DecisionMemory:
    """Return the memory before the first sample."""
    return DecisionMemory(
        codes=np.full((n_fingers, CODES_WIDTH), UNKNOWN, dtype=np.int64),
        values=np.full((n_fingers, DECIDED_WIDTH), np.nan),
        scores=np.zeros((n_fingers, n_causes)),
    )


@compiled
def step(
    layout: Layout,
    memory: Memory,
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    readings: Array,
    present: Flags,
    time: float,
) -> int:
    """Process one sample of a hand. Return the code of the hand's state after it.

    Args:
        layout: of the feature stream.
        memory: of the feature stream; is changed.
        output: of the feature stream; is filled.
        rule: of the model.
        decision: memory of the rule; is changed.
        readings: (n_taxels, 3) of all fingers.
        present: (n_fingers,) True for each finger with a sample.
        time: of the sample [s].
    """
    kernel.advance(layout, memory, output, readings, present, time)
    for finger in range(len(present)):
        codes, decided = decision.codes[finger], decision.values[finger]
        noise, values = memory.levels[finger, NOISE], output.values[finger]
        threshold = _contact_threshold(noise, rule.limits[finger])
        ready = output.status[finger, REASON] == READY
        by_load = not math.isnan(rule.limits[finger, CONTACT_LOAD])
        if ready and present[finger] and not by_load:
            quiet = kernel.noise_sigma(noise, layout.windows[finger, SIGMA_WINDOW])
            if _has_drifted(values, codes, decided, threshold, quiet, time, layout.period):
                output.status[finger, REASON] = FAULT
                output.status[finger, FAULTS] = TARE_DRIFT
                ready = False
        if not ready:
            codes[STATE] = codes[CANDIDATE] = UNKNOWN
            decided[PROBABILITY] = decided[LAST_UNSTABLE] = math.nan
            _forget_cause(codes, decision.scores, finger)
        elif present[finger]:
            limit = rule.limits[finger, CONTACT_LOAD]
            if by_load and _is_unloaded(memory.motion[finger], limit, codes[STATE], time):
                weights = rule.weights[finger, : rule.n_weights[finger]]
                decided[PROBABILITY] = linear_probability(output.features[finger], weights)
                state = NO_CONTACT
            elif values[AMPLITUDE] < threshold:
                decided[PROBABILITY] = 0.0
                state = NO_CONTACT
            else:
                weights = rule.weights[finger, : rule.n_weights[finger]]
                decided[PROBABILITY] = linear_probability(output.features[finger], weights)
                limit = rule.limits[finger, THRESHOLD]
                state = _contact_state(decided[PROBABILITY], limit, rule.hysteresis, codes[STATE])
                if state == UNSTABLE and rule.causes.shape[1] > 0:
                    codes[CAUSE] = add_scores(
                        output.features[finger], rule.causes[finger], decision.scores[finger]
                    )
                state = _hold(state, decided, rule.hold, time, layout.period)
            if state != UNSTABLE:
                _forget_cause(codes, decision.scores, finger)
            _debounce(codes, decided, state, rule.min_duration, time, layout.period)
    return _hand_state(decision.codes[:, STATE], rule.n_model_fingers)


@compiled
def _forget_cause(codes: Integers, scores: Array, finger: int) -> None:
    """Reset the cause of a finger that is not unstable."""
    codes[CAUSE] = 0
    for place in range(scores.shape[1]):
        scores[finger, place] = 0.0


@compiled
def run(
    layout: Layout,
    memory: Memory,
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    readings: Array,
    present: Flags,
    times: Array,
    rows: TraceRows,
) -> None:
    """Process successive samples of a hand by `step`, and fill one row for each of them.

    Args:
        layout: of the feature stream.
        memory: of the feature stream; is changed.
        output: of the feature stream; is filled.
        rule: of the model.
        decision: memory of the rule; is changed.
        readings: (n, n_taxels, 3) of all fingers.
        present: (n, n_fingers) True for each finger with a sample.
        times: (n,) of the samples [s].
        rows: are filled.
    """
    for k in range(len(times)):
        rows.hand[k] = step(
            layout, memory, output, rule, decision, readings[k], present[k], times[k]
        )
        rows.state[k] = decision.codes[:, STATE]
        rows.reason[k] = output.status[:, REASON]
        rows.faults[k] = output.status[:, FAULTS]
        rows.taxels[k] = output.status[:, TAXELS]
        rows.probability[k] = decision.values[:, PROBABILITY]
        for finger in range(len(decision.codes)):
            if decision.codes[finger, STATE] == UNSTABLE:
                rows.cause[k, finger] = decision.codes[finger, CAUSE]
        rows.values[k] = output.values


@compiled
def _contact_threshold(noise: float, limits: Array) -> float:
    """Return the threshold of contact of F_a; NaN, which no value is under, if there is none."""
    if math.isnan(limits[CONTACT]):
        return float(limits[CONTACT_NOISE] * noise)
    return float(limits[CONTACT])


@compiled
def _is_unloaded(motion: Array, limit: float, reported: int, time: float) -> bool:
    """Return whether a finger is without contact: its load is small, and its force is at rest.

    The threshold of the load is lower while in contact.

    Args:
        motion: of the finger, as in `Memory`.
        limit: threshold of contact, as a multiple of the noise.
        reported: the state that is reported.
        time: of the sample [s].
    """
    threshold = max(limit * motion[NOISE_NOW], TOUCH_SHARE * motion[PEAK_LOAD])
    if reported in (STABLE, UNSTABLE):
        released = RELEASED_SHARE * motion[PEAK_LOAD]
        threshold = max(CONTACT_RELEASE_RATIO * limit * motion[NOISE_NOW], released)
    at_rest = time - motion[MOVED_AT] > REST_SECONDS
    return bool(at_rest and motion[MOTION_LOAD] < threshold)


@compiled
def _has_drifted(
    values: Array,
    codes: Integers,
    decided: Array,
    threshold: float,
    quiet: float,
    time: float,
    period: float,
) -> bool:
    """Return whether F_a crept over the threshold of contact, slower and calmer than a touch.

    Args:
        values: of the finger, as in `Output`.
        codes: of the finger, as in `DecisionMemory`; is changed.
        decided: of the finger, as in `DecisionMemory`; is changed.
        threshold: of contact; NaN for none.
        quiet: the sigma of noise alone; 0 for a window of two samples.
        time: of the sample [s].
        period: of the samples [s].
    """
    amplitude, mean = values[AMPLITUDE], math.sqrt(2.0) * values[MEAN]
    if math.isnan(decided[SMOOTHED]):
        decided[SMOOTHED], decided[RESTLESS_AT] = amplitude, time
    away = abs(mean - decided[SMOOTHED])
    jumped = abs(amplitude - decided[SMOOTHED]) > 0.5 * threshold
    decided[SMOOTHED] += min(1.0, period / DRIFT_SECONDS) * (amplitude - decided[SMOOTHED])
    calm = quiet > 0.0 and values[SIGMA] <= CALM_RATIO * quiet and away <= 0.5 * threshold
    if not calm:
        decided[RESTLESS_AT] = time
    if amplitude < threshold:
        codes[LOAD] = NO_LOAD
    elif not calm:
        codes[LOAD] = TOUCH
    elif codes[LOAD] == NO_LOAD:
        long = time - decided[RESTLESS_AT] + 0.5 * period >= DRIFT_SECONDS
        codes[LOAD] = DRIFT if long and not jumped else TOUCH
    return bool(codes[LOAD] == DRIFT)


@compiled
def _contact_state(probability: float, threshold: float, hysteresis: float, reported: int) -> int:
    """Return STABLE from the threshold on. Hysteresis moves it away from the reported state."""
    if reported == STABLE:
        threshold -= hysteresis
    elif reported != UNKNOWN:
        threshold += hysteresis
    return STABLE if probability >= threshold else UNSTABLE


@compiled
def _hold(state: int, decided: Array, hold: float, time: float, period: float) -> int:
    """Return UNSTABLE while it is held, else the state."""
    if state == UNSTABLE:
        decided[LAST_UNSTABLE] = time
    elif _is_held(time, decided[LAST_UNSTABLE], hold, period):
        return UNSTABLE
    return state


@compiled
def _debounce(
    codes: Integers, decided: Array, state: int, min_duration: float, time: float, period: float
) -> None:
    """Report the state if it has lasted long enough, or if the reported state is UNKNOWN."""
    if state != codes[CANDIDATE]:
        codes[CANDIDATE] = state
        decided[CANDIDATE_SINCE] = time
    lasted = time - decided[CANDIDATE_SINCE] + 0.5 * period
    if codes[STATE] == UNKNOWN or lasted >= min_duration:
        codes[STATE] = state
