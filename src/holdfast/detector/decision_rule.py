"""The decision rule: from features to contact states, compiled, for one sample or for many."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self, TypeVar

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Onnx
from holdfast.classifiers.linear import (
    add_scores,
    add_squares,
    linear_probability,
    log_odds,
    probability_of,
    smooth,
    speed_of,
)
from holdfast.compiled import compiled_step, inlined, joined_step
from holdfast.contact import (
    NO_CONTACT,
    SLIP_CODE,
    STABLE,
    UNKNOWN,
    UNSTABLE,
    hand_state,
    is_held,
)
from holdfast.detector import arrays as rule_at
from holdfast.detector.arrays import DecisionMemory, DecisionRule
from holdfast.detector.contact_rule import (
    IN_CONTACT,
    UNSTEADY,
    WITHOUT_CONTACT,
    contact_by_force,
    contact_by_load,
    contact_threshold,
    fall_of,
    follow,
    has_drifted,
    update_load,
    update_reference,
)
from holdfast.features import arrays as at
from holdfast.features import kernel
from holdfast.features.arrays import Layout, Memory, Output
from holdfast.features.faults import TARE_DRIFT
from holdfast.features.motion import NOISE_WEIGHT
from holdfast.features.stream import FeatureStream
from holdfast.model import FingerModel
from holdfast.sensors.types import Array, Flags, Integers

_hand_state = compiled_step(hand_state)
_is_held = compiled_step(is_held)
EVIDENCE_SECONDS = 1 / 60
"""Time over which neighbouring samples say the same [s]: samples that come faster count less in
the forward filter, so that it does the same at any rate."""
LEAST_PROBABILITY = 1e-12
"""Bound of probabilities and thresholds in the forward filter, from 0 and from 1."""
CodeT = TypeVar("CodeT", int, Integers)


class TraceRows(NamedTuple):
    """Rows that `run` fills, one for each instant."""

    report: Array  # (n, n_fingers, REPORT_WIDTH), by `fill_report`
    taxels: Integers  # (n, n_fingers) bits of faulty taxels
    hand: npt.NDArray[np.int8]  # (n,)

    @classmethod
    def empty(cls, n: int, n_fingers: int) -> Self:
        """Return rows for n instants."""
        return cls(
            report=np.zeros((n, n_fingers, rule_at.REPORT_WIDTH)),
            taxels=np.zeros((n, n_fingers), dtype=np.int64),
            hand=np.zeros(n, dtype=np.int8),
        )


def estimate_code(state: CodeT, reason: CodeT, faults: CodeT, cause: CodeT) -> CodeT:
    """Return state, reason, faults and cause as one number; `split_code` is the inverse."""
    code: CodeT = state + 4 * (reason + 8 * (faults + 2**16 * cause))
    return code


def split_code(code: CodeT) -> tuple[CodeT, CodeT, CodeT, CodeT]:
    """Return state, reason, faults and cause.

    Example:
        >>> split_code(estimate_code(2, 0, 5, 3))
        (2, 0, 5, 3)
    """
    return code % 4, code // 4 % 8, code // 32 % 2**16, code // 2**21


_estimate_code = compiled_step(estimate_code)


@compiled_step
def reported_cause(codes: Integers) -> int:
    """Return the code of the cause: slip while the finger slides, else that while unstable."""
    if codes[rule_at.SLIPS]:
        return SLIP_CODE
    return int(codes[rule_at.CAUSE]) if codes[rule_at.STATE] == UNSTABLE else 0


@inlined
def fill_report(
    memory: Memory, output: Output, decision: DecisionMemory, report: Array, f: int
) -> None:
    """Fill the row of a finger: all of its estimate but the faulty taxels."""
    state, status = decision.codes[f, rule_at.STATE], output.status[f]
    cause = reported_cause(decision.codes[f])
    report[f, rule_at.REPORT_TIME] = memory.levels[f, at.LAST_TIME]
    report[f, rule_at.REPORT_CODE] = _estimate_code(
        state, status[at.REASON], status[at.FAULTS], cause
    )
    report[f, rule_at.REPORT_PROBABILITY] = decision.values[f, rule_at.PROBABILITY]
    report[f, rule_at.REPORT_SLIP] = decision.values[f, rule_at.SLIP_PROBABILITY]
    report[f, rule_at.REPORT_SPEED] = decision.values[f, rule_at.SPEED]
    report[f, rule_at.REPORT_DISTANCE] = decision.values[f, rule_at.DISTANCE]
    report[f, rule_at.REPORT_SIGMA] = output.values[f, at.SIGMA]
    for axis in range(3):
        report[f, rule_at.REPORT_FORCE + axis] = output.values[f, at.FORCE + axis]


def replace_values(rule: DecisionRule, new: DecisionRule) -> bool:
    """Copy the arrays of another rule into those of a rule, whose addresses stay.

    Returns:
        Whether the rules differ in the values of their arrays alone; else nothing is copied.
    """
    arrays, settings = [], []
    for before, after in zip(rule, new, strict=True):
        if isinstance(before, np.ndarray) and isinstance(after, np.ndarray):
            arrays.append((before, after))
        else:
            settings.append(before == after)
    if not all(settings) or any(before.shape != after.shape for before, after in arrays):
        return False
    for before, after in arrays:
        before[...] = after
    return True


class ProbabilityFeeder:
    """Feeder of a decision rule with probabilities, sample by sample.

    It computes the features once more, gives them to the classifier, and writes the log odds of
    its probability as the offset of a linear classifier without weights. This is slower than the
    compiled rule: an update takes as long as the classifier.

    Args:
        parts: models of the fingers of the stream, in its order.
        stream: before its first sample.
        rule: of the detector; its offsets are changed.
    """

    def __init__(
        self, parts: Sequence[FingerModel], stream: FeatureStream, rule: DecisionRule
    ) -> None:
        self._stream, self._rule = FeatureStream(stream.plan), rule
        self._stream.memory.baseline[:] = stream.memory.baseline  # a tare by interval
        self._rules = {
            place: (part.indices(part.stable), part.stable.rule)
            for place, part in enumerate(parts)
            if isinstance(part.stable.rule, Onnx)
        }

    def update(self, readings: Array, present: Flags, time: float) -> None:
        """Write the log odds of one sample; the arguments are those of `decision_rule.step`."""
        layout, memory, output = self._stream.layout, self._stream.memory, self._stream.output
        kernel.advance(layout, memory, output, readings.copy(), present, time)
        for place, (columns, onnx) in self._rules.items():
            if present[place] and output.status[place, at.REASON] == at.READY:
                probability = onnx.probability(output.features[place, columns][None])[0]
                with np.errstate(divide="ignore"):
                    self._rule.weights[place, 0] = np.log(probability / (1.0 - probability))


def new_decision_memory(
    n_fingers: int, n_causes: int = 0, slip_limits: Array | None = None
) -> DecisionMemory:
    """Return the memory before the first sample; of fingers without slip rules by default."""
    if slip_limits is None:
        slip_limits = np.full((n_fingers, rule_at.SLIP_LIMITS_WIDTH), np.nan)
    values = np.full((n_fingers, rule_at.DECIDED_WIDTH), np.nan)
    values[:, rule_at.REST : rule_at.PEAK + 1] = 0.0
    values[:, [rule_at.SHAKEN_AT, rule_at.LOADED_AT]] = -np.inf
    has_no_rule = np.isnan(slip_limits)
    values[has_no_rule[:, rule_at.SLIP_THRESHOLD], rule_at.SLIP_PROBABILITY] = rule_at.NO_SLIP_RULE
    has_no_speed = has_no_rule[:, rule_at.HIGHEST_SPEED]
    values[has_no_speed, rule_at.SPEED] = rule_at.NO_SPEED_RULE
    values[has_no_speed, rule_at.DISTANCE] = rule_at.NO_SPEED_RULE
    return DecisionMemory(
        codes=np.full((n_fingers, rule_at.CODES_WIDTH), UNKNOWN, dtype=np.int64),
        values=values,
        scores=np.zeros((n_fingers, n_causes)),
    )


@joined_step
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
        contact = IN_CONTACT
        if present[f] and output.status[f, at.REASON] == at.READY:
            contact = _find_contact(layout, memory, output, rule, decision, f, time)
        if output.status[f, at.REASON] != at.READY:
            _decide_unready(output, rule, decision, f, present[f], time, layout.period)
        elif present[f]:
            _decide(output, rule, decision, f, contact, time, layout.period)
    return hand_code(decision, rule)


@compiled_step
def hand_code(decision: DecisionMemory, rule: DecisionRule) -> int:
    """Return the code of the hand's state."""
    return int(_hand_state(decision.codes[:, rule_at.STATE], rule.n_model_fingers))


@inlined
def _find_contact(
    layout: Layout,
    memory: Memory,
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    f: int,
    time: float,
) -> int:
    """Return what the force of a finger with features shows. Report a drift of its tare."""
    codes, decided, limits = decision.codes[f], decision.values[f], rule.limits[f]
    if not math.isnan(limits[rule_at.LOAD_LIMIT]):
        # By the load of relative features: load < limit noise, at rest.
        return contact_by_load(
            memory.motion[f], decided, layout.normals[f], limits[rule_at.LOAD_LIMIT],
            codes[rule_at.CANDIDATE], time, layout.zero_unknown,
        )  # fmt: skip
    # By F_a: load < threshold; a drift of the tare is a fault.
    noise, values = memory.levels[f, at.NOISE], output.values[f]
    threshold = contact_threshold(noise, limits)
    quiet = kernel.noise_sigma(noise, layout.windows[f, at.SIGMA_WINDOW])
    if layout.zero_unknown:
        update_reference(values, decided, layout.normals[f])
    load = update_load(values, decided, quiet, time, layout.period)
    if layout.zero_unknown:
        fall = fall_of(decided, layout.normals[f])
        if fall < NOISE_WEIGHT * noise:
            return IN_CONTACT
        decided[rule_at.PEAK] = max(decided[rule_at.PEAK], fall)
    elif has_drifted(load, values, codes, decided, threshold, quiet, time, layout.period):
        output.status[f, at.REASON] = at.FAULT
        output.status[f, at.FAULTS] |= TARE_DRIFT
    return contact_by_force(
        load, decided, threshold, codes[rule_at.CANDIDATE], time, layout.zero_unknown
    )


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
    if output.status[f, at.REASON] != at.FAULT or math.isnan(output.values[f, at.AMPLITUDE]):
        codes[rule_at.STATE] = codes[rule_at.CANDIDATE] = UNKNOWN
    elif is_present:
        debounce(codes, decided, UNKNOWN, rule.min_duration, time, period)
    if codes[rule_at.STATE] == UNKNOWN:
        decided[rule_at.PROBABILITY] = decided[rule_at.LAST_UNSTABLE] = math.nan
        decided[rule_at.FILTERED] = math.nan
        _forget_cause(codes, decision.scores, f)
        end_slip(codes, decided, math.nan)
    else:
        output.status[f, at.REASON] = at.READY


@inlined
def _decide(
    output: Output,
    rule: DecisionRule,
    decision: DecisionMemory,
    f: int,
    contact: int,
    time: float,
    period: float,
) -> None:
    """Decide the state of a finger from its features, and report it when it has lasted."""
    codes, decided, limits = decision.codes[f], decision.values[f], rule.limits[f]
    by_load, unloaded = not math.isnan(limits[rule_at.LOAD_LIMIT]), contact == WITHOUT_CONTACT
    state = NO_CONTACT
    decided[rule_at.PROBABILITY] = 0.0
    if by_load or not unloaded:
        # p = 1 / (1 + exp(-(w . Phi + w_0))), by the weights of the model.
        weights = rule.weights[f, : rule.n_weights[f]]
        decided[rule_at.PROBABILITY] = linear_probability(output.features[f], weights)
    if unloaded:
        decided[rule_at.FILTERED] = math.nan
        if not by_load:
            follow(output.values[f], decided, period)
    else:
        threshold = limits[rule_at.THRESHOLD]
        if rule.switching > 0.0:
            decided[rule_at.PROBABILITY] = filter_probability(
                decided, decided[rule_at.PROBABILITY], threshold, rule.switching, time
            )
        state = classify_contact(
            decided[rule_at.PROBABILITY],
            threshold,
            rule.hysteresis,
            codes[rule_at.STATE],
        )
        if contact == UNSTEADY:
            state = UNSTABLE  # the force decides; the probability stays that of the features
        begins = codes[rule_at.CANDIDATE] == NO_CONTACT  # closes, and is held as unstable below
        if (state == UNSTABLE or begins) and rule.causes.shape[1] > 0:
            # cause = argmax over c of sum_k (w_c . Phi(k) + w_c0) since it became unstable.
            codes[rule_at.CAUSE] = add_scores(
                output.features[f], rule.causes[f], decision.scores[f]
            )
        state = hold_unstable(state, codes[rule_at.CANDIDATE], decided, rule.hold, time, period)
    if state != UNSTABLE:
        _forget_cause(codes, decision.scores, f)
    if unloaded:
        end_slip(codes, decided, 0.0)
    elif decided[rule_at.SLIP_PROBABILITY] != rule_at.NO_SLIP_RULE:
        # z = w . Phi + w_0, by the weights of the slip rule, and its squares.
        value = log_odds(output.features[f], rule.slips[f, : rule.n_slip_weights[f]])
        if rule.squares.shape[2] > 0:
            value = add_squares(value, output.features[f], rule.squares[f])
        decide_slip(codes, decided, rule.slip_limits[f], value, time, period)
        if decided[rule_at.SPEED] != rule_at.NO_SPEED_RULE:
            _follow_slip(output, rule, codes, decided, f, time, period)
    debounce(codes, decided, state, rule.min_duration, time, period)


@compiled_step
def decide_slip(
    codes: Integers, decided: Array, limits: Array, value: float, time: float, period: float
) -> None:
    """Decide whether a finger slides, from the log odds of its last sample."""
    # s(k) = s(k-1) + gain (z(k) - s(k-1)), p = 1 / (1 + exp(-s)).
    smoothed = smooth(decided[rule_at.SLIP_LOG_ODDS], value, limits[rule_at.SLIP_GAIN])
    probability = probability_of(smoothed)
    decided[rule_at.SLIP_LOG_ODDS], decided[rule_at.SLIP_PROBABILITY] = smoothed, probability
    # It slides while p >= threshold, and until t - t_last reaches the hold time.
    if probability >= limits[rule_at.SLIP_THRESHOLD]:
        decided[rule_at.LAST_SLIP] = time
        codes[rule_at.SLIPS] = 1
    else:
        hold = limits[rule_at.SLIP_HOLD]
        codes[rule_at.SLIPS] = int(_is_held(time, decided[rule_at.LAST_SLIP], hold, period))


@inlined
def _follow_slip(
    output: Output,
    rule: DecisionRule,
    codes: Integers,
    decided: Array,
    f: int,
    time: float,
    period: float,
) -> None:
    """Report speed and distance of the slip of a finger; both are 0 while it does not slide."""
    if codes[rule_at.SLIPS] == 0:
        decided[rule_at.SPEED] = decided[rule_at.DISTANCE] = 0.0
        decided[rule_at.SLID_AT] = math.nan
        return
    # z by the weights of the speed rule, v = min(max(z, 0)^2, highest).
    value = log_odds(output.features[f], rule.speeds[f, : rule.n_slip_weights[f]])
    value = add_squares(value, output.features[f], rule.speed_squares[f])
    speed = speed_of(value, rule.slip_limits[f, rule_at.HIGHEST_SPEED])
    # s = sum_k v(k) (t(k) - t(k-1)), the first step one period.
    if math.isnan(decided[rule_at.SLID_AT]):
        decided[rule_at.DISTANCE] = speed * period
    else:
        decided[rule_at.DISTANCE] += speed * (time - decided[rule_at.SLID_AT])
    decided[rule_at.SPEED], decided[rule_at.SLID_AT] = speed, time


@compiled_step
def end_slip(codes: Integers, decided: Array, probability: float) -> None:
    """Report no slip, with a probability of 0 without contact or NaN without an estimate.

    Speed and distance are that number, too.
    """
    if decided[rule_at.SLIP_PROBABILITY] != rule_at.NO_SLIP_RULE:
        codes[rule_at.SLIPS] = 0
        decided[rule_at.SLIP_LOG_ODDS] = decided[rule_at.LAST_SLIP] = math.nan
        decided[rule_at.SLIP_PROBABILITY] = probability
    if decided[rule_at.SPEED] != rule_at.NO_SPEED_RULE:
        decided[rule_at.SPEED] = decided[rule_at.DISTANCE] = probability
        decided[rule_at.SLID_AT] = math.nan


@compiled_step
def _forget_cause(codes: Integers, scores: Array, finger: int) -> None:
    """Reset the cause of a finger that is not unstable."""
    codes[rule_at.CAUSE] = 0
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
            fill_report(memory, output, decision, rows.report[k], f)
            rows.taxels[k, f] = output.status[f, at.TAXELS]


@compiled_step
def filter_probability(
    decided: Array, probability: float, threshold: float, switching: float, time: float
) -> float:
    """Return the probability of stability by the forward filter of two states.

    A sample counts for or against stability by how far its probability is from the threshold, so
    that the filter never decides against samples that are all on one side.

    Args:
        decided: of the finger, as in `DecisionMemory`; is changed.
        probability: of stability, of this sample alone.
        threshold: from which a contact is stable.
        switching: how often a contact turns from one state to the other [1/s].
        time: of the sample [s].
    """
    # e = logit p - logit p_0. Prediction over dt: the chance of each state moves towards 1/2,
    # tanh(L/2) -> exp(-2 r dt) tanh(L/2). Update: L -> L + min(1, dt / T_e) e.
    middle = _bounded_log_odds(threshold)
    evidence, before = _bounded_log_odds(probability) - middle, decided[rule_at.FILTERED]
    if math.isnan(before):
        filtered = evidence
    else:
        step = time - decided[rule_at.FILTERED_AT]
        lean = math.exp(-2.0 * switching * step) * math.tanh(0.5 * before)
        filtered = math.log((1.0 + lean) / (1.0 - lean))
        filtered += min(1.0, step / EVIDENCE_SECONDS) * evidence
    decided[rule_at.FILTERED], decided[rule_at.FILTERED_AT] = filtered, time
    return float(probability_of(filtered + middle))


@compiled_step
def _bounded_log_odds(probability: float) -> float:
    bounded = min(max(probability, LEAST_PROBABILITY), 1.0 - LEAST_PROBABILITY)
    return math.log(bounded / (1.0 - bounded))


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
def hold_unstable(
    state: int, latest: int, decided: Array, hold: float, time: float, period: float
) -> int:
    """Return UNSTABLE while it is held, else the state.

    A contact that has just begun closes: its first sample counts as unstable for the hold time.

    Args:
        state: of a finger in contact.
        latest: the state of the last sample, before debouncing.
        decided: of the finger, as in `DecisionMemory`; is changed.
        hold: hold time [s].
        time: of the sample [s].
        period: of the samples [s].
    """
    # UNSTABLE until t - t_unstable reaches the hold time.
    if state == UNSTABLE or latest == NO_CONTACT:
        decided[rule_at.LAST_UNSTABLE] = time
    if _is_held(time, decided[rule_at.LAST_UNSTABLE], hold, period):
        return UNSTABLE
    return state


@compiled_step
def debounce(
    codes: Integers, decided: Array, state: int, min_duration: float, time: float, period: float
) -> None:
    """Report the state if it has lasted long enough, or if the reported state is UNKNOWN."""
    # Reported once t - t_since + T / 2 >= min_duration: half a period allows for rounding.
    if state != codes[rule_at.CANDIDATE]:
        codes[rule_at.CANDIDATE] = state
        decided[rule_at.CANDIDATE_SINCE] = time
    lasted = time - decided[rule_at.CANDIDATE_SINCE] + 0.5 * period
    if codes[rule_at.STATE] == UNKNOWN or lasted >= min_duration:
        codes[rule_at.STATE] = state
