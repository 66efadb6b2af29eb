"""The decision rule: from features to contact states, compiled, for one sample or for many."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
import numpy.typing as npt

from holdfast.classifiers.cause import CAUSES, add_scores
from holdfast.classifiers.linear import LinearClassifier, linear_probability, log_odds
from holdfast.classifiers.slip import probability_of, smooth
from holdfast.compiled import compiled_step, inlined
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Cause, hand_state, is_held
from holdfast.detector.arrays import (
    CANDIDATE,
    CANDIDATE_SINCE,
    CAUSE,
    CODES_WIDTH,
    DECIDED_WIDTH,
    LAST_SLIP,
    LAST_UNSTABLE,
    LOAD_LIMIT,
    PEAK,
    PROBABILITY,
    REST,
    SHAKEN_AT,
    SLIP_GAIN,
    SLIP_HOLD,
    SLIP_LIMITS_WIDTH,
    SLIP_LOG_ODDS,
    SLIP_PROBABILITY,
    SLIP_THRESHOLD,
    SLIPS,
    STATE,
    THRESHOLD,
    DecisionMemory,
    DecisionRule,
)
from holdfast.detector.contact_rule import (
    contact_threshold,
    follow,
    has_drifted,
    is_at_rest,
    is_empty,
    update_load,
)
from holdfast.features import kernel
from holdfast.features.arrays import (
    AMPLITUDE,
    FAULT,
    FAULTS,
    NOISE,
    READY,
    REASON,
    SIGMA_WINDOW,
    TAXELS,
    VALUES_WIDTH,
    Layout,
    Memory,
    Output,
)
from holdfast.features.faults import TARE_DRIFT
from holdfast.features.stream import StreamPlan
from holdfast.model import ANY_FINGER, FingerModel, Model
from holdfast.sensors.types import Array, Flags, Integers

_hand_state = compiled_step(hand_state)
_is_held = compiled_step(is_held)
SLIP_CODE = CAUSES.index(Cause.SLIP) + 1
"""Code of the cause slip."""


class TraceRows(NamedTuple):
    """Rows that `run` fills, one for each instant."""

    state: npt.NDArray[np.int8]  # (n, n_fingers)
    reason: npt.NDArray[np.int8]
    faults: npt.NDArray[np.int16]
    taxels: Integers  # bits of faulty taxels
    probability: Array
    values: Array  # (n, n_fingers, VALUES_WIDTH), as in Output
    cause: npt.NDArray[np.int8]  # codes of the causes
    slip: Array  # probability of a slip
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
            slip=np.zeros(shape),
            hand=np.zeros(n, dtype=np.int8),
        )


def rule_of(model: Model, plan: StreamPlan) -> DecisionRule:
    """Return the constants of a model for the fingers of a plan, in its order."""
    parts = [model.finger(name) for name in plan.fingers]
    width = max(part.classifier.n_features for part in parts) + 1
    weights = np.zeros((len(parts), width))
    for row, part in zip(weights, parts, strict=True):
        if isinstance(part.classifier, LinearClassifier):
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
    slips, slip_limits = _slip_rules(parts, width, plan.rate)
    any_finger = ANY_FINGER in model.fingers
    return DecisionRule(
        weights=weights,
        n_weights=np.array([_n_weights(part) for part in parts]),
        n_slip_weights=np.array([len(part.features) + 1 for part in parts]),
        causes=_cause_weights(parts, width),
        slips=slips,
        slip_limits=slip_limits,
        limits=np.array(limits, dtype=np.float64),  # None becomes NaN
        hysteresis=float(model.debounce.hysteresis),
        min_duration=float(model.debounce.min_duration),
        hold=float(model.debounce.hold),
        n_model_fingers=len(plan.fingers) if any_finger else len(model.fingers),
    )


def _n_weights(part: FingerModel) -> int:
    """Return the number of weights; of a classifier that is not linear, the offset alone."""
    is_linear = isinstance(part.classifier, LinearClassifier)
    return part.classifier.n_features + 1 if is_linear else 1


def _cause_weights(parts: Sequence[FingerModel], width: int) -> Array:
    """Return (n_fingers, n_causes, width); a finger without causes has the scores 0."""
    if all(part.causes is None for part in parts):
        return np.zeros((len(parts), 0, width))
    weights = np.zeros((len(parts), len(CAUSES), width))
    for row, part in zip(weights, parts, strict=True):
        if part.causes is not None:
            row[:, : part.causes.n_features + 1] = part.causes.weights()
            if part.slip is not None:  # the slip rule decides about slips
                row[SLIP_CODE - 1] = 0.0
                row[SLIP_CODE - 1, 0] = -math.inf
    return weights


def _slip_rules(parts: Sequence[FingerModel], width: int, rate: float) -> tuple[Array, Array]:
    """Return the weights and the limits of the slip rules; NaN without a rule."""
    weights = np.zeros((len(parts), width))
    limits = np.full((len(parts), SLIP_LIMITS_WIDTH), np.nan)
    for row, limit, part in zip(weights, limits, parts, strict=True):
        if part.slip is not None:
            rule = part.slip
            row[: rule.classifier.n_features + 1] = rule.classifier.weights()
            limit[:] = rule.classifier.threshold, rule.gain(rate), rule.hold
    return weights, limits


def new_decision_memory(n_fingers: int, n_causes: int = 0) -> DecisionMemory:
    """Return the memory before the first sample."""
    values = np.full((n_fingers, DECIDED_WIDTH), np.nan)
    values[:, REST : PEAK + 1] = 0.0
    values[:, SHAKEN_AT] = -np.inf
    return DecisionMemory(
        codes=np.full((n_fingers, CODES_WIDTH), UNKNOWN, dtype=np.int64),
        values=values,
        scores=np.zeros((n_fingers, n_causes)),
    )


@compiled_step
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
    for f in range(len(present)):
        unloaded = False
        if present[f] and output.status[f, REASON] == READY:
            unloaded = _find_contact(layout, memory, output, rule, decision, f, time)
        if output.status[f, REASON] != READY:
            _decide_unready(output, rule, decision, f, present[f], time, layout.period)
        elif present[f]:
            _decide(output, rule, decision, f, unloaded, time, layout.period)
    return hand_code(decision, rule)


@compiled_step
def hand_code(decision: DecisionMemory, rule: DecisionRule) -> int:
    """Return the code of the hand's state."""
    return int(_hand_state(decision.codes[:, STATE], rule.n_model_fingers))


@inlined
def _find_contact(
    layout: Layout,
    memory: Memory,
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    f: int,
    time: float,
) -> bool:
    """Return whether a finger with features is without contact. Report a drift of its tare."""
    codes, decided, limits = decision.codes[f], decision.values[f], rule.limits[f]
    if not math.isnan(limits[LOAD_LIMIT]):
        # By the load of relative features: load < limit noise, at rest.
        return is_at_rest(memory.motion[f], limits[LOAD_LIMIT], codes[CANDIDATE], time)
    # By F_a: load < threshold; a drift of the tare is a fault.
    noise, values = memory.levels[f, NOISE], output.values[f]
    threshold = contact_threshold(noise, limits)
    quiet = kernel.noise_sigma(noise, layout.windows[f, SIGMA_WINDOW])
    load = update_load(values, decided, quiet, time, layout.period)
    if has_drifted(load, values, codes, decided, threshold, quiet, time, layout.period):
        output.status[f, REASON] = FAULT
        output.status[f, FAULTS] = TARE_DRIFT
    return is_empty(load, decided, threshold, codes[CANDIDATE], time)


@inlined
def _decide_unready(
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    f: int,
    is_present: bool,
    time: float,
    period: float,
) -> None:
    """Report UNKNOWN for a finger without features, at once.

    A fault that leaves a force is reported when it has lasted; the probability is kept until then.
    """
    codes, decided = decision.codes[f], decision.values[f]
    if output.status[f, REASON] != FAULT or math.isnan(output.values[f, AMPLITUDE]):
        codes[STATE] = codes[CANDIDATE] = UNKNOWN
    elif is_present:
        debounce(codes, decided, UNKNOWN, rule.min_duration, time, period)
    if codes[STATE] == UNKNOWN:
        decided[PROBABILITY] = decided[LAST_UNSTABLE] = math.nan
        _forget_cause(codes, decision.scores, f)
        end_slip(codes, decided, math.nan)
    else:
        output.status[f, REASON] = READY


@inlined
def _decide(
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    f: int,
    unloaded: bool,
    time: float,
    period: float,
) -> None:
    """Decide the state of a finger from its features, and report it when it has lasted."""
    codes, decided, limits = decision.codes[f], decision.values[f], rule.limits[f]
    by_load = not math.isnan(limits[LOAD_LIMIT])
    state = NO_CONTACT
    decided[PROBABILITY] = 0.0
    if by_load or not unloaded:
        # p = 1 / (1 + exp(-(w . Phi + w_0))), by the weights of the model.
        weights = rule.weights[f, : rule.n_weights[f]]
        decided[PROBABILITY] = linear_probability(output.features[f], weights)
    if not unloaded:
        state = classify_contact(
            decided[PROBABILITY], limits[THRESHOLD], rule.hysteresis, codes[STATE]
        )
        if state == UNSTABLE and rule.causes.shape[1] > 0:
            # cause = argmax over c of sum_k (w_c . Phi(k) + w_c0) since it became unstable.
            codes[CAUSE] = add_scores(output.features[f], rule.causes[f], decision.scores[f])
        state = hold_unstable(state, decided, rule.hold, time, period)
    elif not by_load:
        follow(output.values[f], decided, period)
    if state != UNSTABLE:
        _forget_cause(codes, decision.scores, f)
    if not math.isnan(rule.slip_limits[f, SLIP_THRESHOLD]):
        if unloaded:
            end_slip(codes, decided, 0.0)
        else:
            value = log_odds(output.features[f], rule.slips[f, : rule.n_slip_weights[f]])
            decide_slip(codes, decided, rule.slip_limits[f], value, time, period)
    debounce(codes, decided, state, rule.min_duration, time, period)


@compiled_step
def decide_slip(
    codes: Integers, decided: Array, limits: Array, value: float, time: float, period: float
) -> None:
    """Decide whether a finger slides, from the log odds of its last sample."""
    # s(k) = s(k-1) + gain (z(k) - s(k-1)), p = 1 / (1 + exp(-s)).
    decided[SLIP_LOG_ODDS] = smooth(decided[SLIP_LOG_ODDS], value, limits[SLIP_GAIN])
    decided[SLIP_PROBABILITY] = probability_of(decided[SLIP_LOG_ODDS])
    # It slides while p >= threshold, and until t - t_last reaches the hold time.
    if decided[SLIP_PROBABILITY] >= limits[SLIP_THRESHOLD]:
        decided[LAST_SLIP] = time
        codes[SLIPS] = 1
    else:
        codes[SLIPS] = int(_is_held(time, decided[LAST_SLIP], limits[SLIP_HOLD], period))


@compiled_step
def end_slip(codes: Integers, decided: Array, probability: float) -> None:
    """Report no slip, with a probability of 0 without contact or NaN without an estimate."""
    codes[SLIPS] = 0
    decided[SLIP_LOG_ODDS] = decided[LAST_SLIP] = math.nan
    decided[SLIP_PROBABILITY] = probability


@compiled_step
def reported_cause(codes: Integers) -> int:
    """Return the code of the cause: slip while the finger slides, else that while unstable."""
    if codes[SLIPS]:
        return SLIP_CODE
    return int(codes[CAUSE]) if codes[STATE] == UNSTABLE else 0


@compiled_step
def _forget_cause(codes: Integers, scores: Array, finger: int) -> None:
    """Reset the cause of a finger that is not unstable."""
    codes[CAUSE] = 0
    for place in range(scores.shape[1]):
        scores[finger, place] = 0.0


@compiled_step
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
        for f in range(len(decision.codes)):
            state = decision.codes[f, STATE]
            rows.state[k, f] = state
            rows.reason[k, f] = output.status[f, REASON]
            rows.faults[k, f] = output.status[f, FAULTS]
            rows.taxels[k, f] = output.status[f, TAXELS]
            rows.probability[k, f] = decision.values[f, PROBABILITY]
            rows.cause[k, f] = reported_cause(decision.codes[f])
            rows.slip[k, f] = decision.values[f, SLIP_PROBABILITY]
            for column in range(VALUES_WIDTH):
                rows.values[k, f, column] = output.values[f, column]


@compiled_step
def classify_contact(probability: float, threshold: float, hysteresis: float, reported: int) -> int:
    """Return STABLE from the threshold on. Hysteresis moves it away from the reported state."""
    # STABLE: p >= threshold - h if STABLE was reported, + h if another state, h the hysteresis.
    if reported == STABLE:
        threshold -= hysteresis
    elif reported != UNKNOWN:
        threshold += hysteresis
    return STABLE if probability >= threshold else UNSTABLE


@compiled_step
def hold_unstable(state: int, decided: Array, hold: float, time: float, period: float) -> int:
    """Return UNSTABLE while it is held, else the state."""
    # UNSTABLE until t - t_unstable reaches the hold time.
    if state == UNSTABLE:
        decided[LAST_UNSTABLE] = time
    elif _is_held(time, decided[LAST_UNSTABLE], hold, period):
        return UNSTABLE
    return state


@compiled_step
def debounce(
    codes: Integers, decided: Array, state: int, min_duration: float, time: float, period: float
) -> None:
    """Report the state if it has lasted long enough, or if the reported state is UNKNOWN."""
    # Reported once t - t_since + T / 2 >= min_duration: half a period allows for rounding.
    if state != codes[CANDIDATE]:
        codes[CANDIDATE] = state
        decided[CANDIDATE_SINCE] = time
    lasted = time - decided[CANDIDATE_SINCE] + 0.5 * period
    if codes[STATE] == UNKNOWN or lasted >= min_duration:
        codes[STATE] = state
