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

# DecisionMemory.codes.
(
    STATE,  # the state that is reported, as a code of holdfast.contact
    CANDIDATE,  # the state of the last sample, which may not have lasted long enough yet
    EXCESS,  # how the load came over the threshold of contact: one of the next three
    CAUSE,  # code of the cause while unstable; 0 for none
    CODES_WIDTH,
) = range(5)
NO_EXCESS, TOUCH, DRIFT = range(3)

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
    DECIDED_WIDTH,
) = range(11)  # fmt: skip

# Rows of the report, one for each finger.
(
    REPORT_TIME,  # time of the last sample of the finger [s]
    REPORT_CODE,  # state, reason, faults and cause, see holdfast.detector.fast_step
    REPORT_PROBABILITY,
    REPORT_SIGMA,
    REPORT_FORCE, _, _,  # F_tip, in three components
    REPORT_WIDTH,
) = range(8)  # fmt: skip


class DecisionRule(NamedTuple):
    """Constants of the decision rule, for every finger of a stream."""

    weights: Floats2  # (n_fingers, n_features + 1)
    n_weights: Integers1  # (n_fingers,)
    causes: Floats3  # (n_fingers, n_causes, n_features + 1); n_causes is 0 without them
    limits: Floats2  # (n_fingers, LIMITS_WIDTH)
    hysteresis: float
    min_duration: float
    hold: float
    n_model_fingers: int


class DecisionMemory(NamedTuple):
    """Memory of the decision rule, for every finger of a stream."""

    codes: Integers2  # (n_fingers, CODES_WIDTH)
    values: Floats2  # (n_fingers, DECIDED_WIDTH)
    scores: Floats2  # (n_fingers, n_causes) sums since the contact became unstable
