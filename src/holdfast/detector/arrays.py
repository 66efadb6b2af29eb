"""Arrays of the compiled decision rule: its constants, its memory and its report.

Each row of an array belongs to one finger, and the columns have names. The last name of a tuple of
columns is their number.
"""

from typing import NamedTuple

from holdfast.features.arrays import Floats2, Floats3, Integers1, Integers2

# DecisionRule.limits.
(
    THRESHOLD,  # of the probability
    AMPLITUDE_LIMIT,  # of F_a without contact [unit of the readings]; NaN for none
    AMPLITUDE_TO_NOISE_LIMIT,  # the same as a multiple of the noise; NaN for none
    LOAD_LIMIT,  # of the load without contact, as a multiple of its noise; NaN for none
    LIMITS_WIDTH,
) = range(5)

# DecisionRule.slip_limits.
(
    SLIP_THRESHOLD,  # of the probability of a slip; NaN without a slip rule
    SLIP_GAIN,  # share of a new sample in the smoothed log odds
    SLIP_HOLD,  # time for which a slip is still reported [s]
    HIGHEST_SPEED,  # of a slip [mm/s]; NaN without a speed rule
    SLIP_LIMITS_WIDTH,
) = range(5)

# DecisionMemory.codes.
(
    STATE,  # the state that is reported, as a code of holdfast.contact
    CANDIDATE,  # the state of the last sample, which may not have lasted long enough yet
    EXCESS,  # how the load came over the threshold of contact: one of the next three
    CAUSE,  # code of the cause while unstable; 0 for none
    SLIPS,  # 1 while the finger is decided to slide, else 0
    CODES_WIDTH,
) = range(6)
NO_EXCESS, TOUCH, DRIFT = range(3)
NO_SLIP_RULE = -1.0
"""Probability of a slip of a finger without a slip rule."""
NO_SPEED_RULE = -1.0
"""Speed and distance of a slip of a finger without a speed rule."""

# DecisionMemory.values.
(
    PROBABILITY,
    CANDIDATE_SINCE,  # when the candidate began [s]
    LAST_UNSTABLE,  # time of the last sample that was unstable before the hold time [s]
    SMOOTHED,  # F_a, smoothed over DRIFT_SECONDS [unit of the readings]
    RESTLESS_AT,  # when the finger was last not calm [s]
    REST, _, _,  # F_tip without contact, beyond the tare, in three components
    PEAK,  # largest load so far, slowly forgotten [unit of the readings]
    SHAKEN_AT,  # when sigma was last much larger than that of noise [s]
    SLIP_LOG_ODDS,  # smoothed log odds of a slip; NaN before the first
    SLIP_PROBABILITY,  # NaN without an estimate, NO_SLIP_RULE without a rule
    LAST_SLIP,  # time of the last sample over the threshold of a slip [s]
    SPEED,  # of the slip [mm/s]; NaN without an estimate, NO_SPEED_RULE without a rule
    DISTANCE,  # slid since the slip began [mm]; likewise
    SLID_AT,  # time of the last sample that slides [s]; NaN while it does not slide
    FILTERED,  # log odds of stable to unstable by the forward filter; NaN before the first sample
    FILTERED_AT,  # time of that sample [s]
    LOADED_AT,  # when the load of the stream was last that of a contact [s]
    DECIDED_WIDTH,
) = range(20)  # fmt: skip

# Rows of the report, one for each finger.
(
    REPORT_TIME,  # time of the last sample of the finger [s]
    REPORT_CODE,  # state, reason, faults and cause, see holdfast.detector.fast_step
    REPORT_PROBABILITY,
    REPORT_SIGMA,
    REPORT_FORCE, _, _,  # F_tip, in three components
    REPORT_SLIP,  # probability of a slip; NO_SLIP_RULE without a rule
    REPORT_SPEED,  # of the slip [mm/s]; NO_SPEED_RULE without a speed rule
    REPORT_DISTANCE,  # slid since the slip began [mm]; likewise
    REPORT_WIDTH,
) = range(11)  # fmt: skip


class DecisionRule(NamedTuple):
    """Constants of the decision rule, for every finger of a stream."""

    weights: Floats2  # (n_fingers, n_features + 1)
    n_weights: Integers1  # (n_fingers,)
    causes: Floats3  # (n_fingers, n_causes, n_features + 1); n_causes is 0 without them
    slips: Floats2  # (n_fingers, n_features + 1)
    n_slip_weights: Integers1  # (n_fingers,)
    squares: Floats3  # (n_fingers, 3, n_features) of `Linear.raw_squares`, or n_features is 0
    speeds: Floats2  # (n_fingers, n_features + 1), or (n_fingers, 0) without speed rules
    speed_squares: Floats3  # (n_fingers, 3, n_features) of `Linear.raw_squares`
    slip_limits: Floats2  # (n_fingers, SLIP_LIMITS_WIDTH)
    limits: Floats2  # (n_fingers, LIMITS_WIDTH)
    hysteresis: float
    min_duration: float
    hold: float
    switching: float  # of the forward filter [1/s]; 0 for none
    n_model_fingers: int


class DecisionMemory(NamedTuple):
    """Memory of the decision rule, for every finger of a stream."""

    codes: Integers2  # (n_fingers, CODES_WIDTH)
    values: Floats2  # (n_fingers, DECIDED_WIDTH)
    scores: Floats2  # (n_fingers, n_causes) sums since the contact became unstable
