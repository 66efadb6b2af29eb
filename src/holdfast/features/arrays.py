"""What a compiled stream keeps and fills: its constants, its memory, its output.

What belongs to one finger is a row of an array, and columns have names. Their numbers are
compiled into the kernels.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Codes of holdfast.contact.Reason.
READY, TARE, WARM_UP, GAP, FAULT = range(5)

TARE_SECONDS, TARE_FIRST, TARE_NONE, TARE_GIVEN = range(4)

# Columns of Memory.counts.
SEEN = 0  # samples that made sense
RUN = 1  # forces in the present stretch
GAPPED = 2  # 1 while a stretch that follows a gap warms up
TARED = 3  # samples in the baseline so far; -1 once it is frozen
FROZEN = 4  # samples since the readings last changed
CHANGES = 5  # samples that changed the readings
PULLING = 6  # samples since the normal readings together turned negative
END = 7  # one past the newest value in the history, before which a window is contiguous
WRONG = 8  # faults of taxels by themselves, by the last sample that changed any
WRONG_TAXELS = 9  # bits of those taxels
N_COUNTS = 10

# Columns of Memory.levels.
FIRST = 0  # time of the first finite sample [s]
LAST = 1  # time of the last sample [s]
STEPS = 2  # sum of squared steps of the force, while the noise is measured
N_STEPS = 3  # their number
NOISE = 4  # standard deviation of a force component by noise alone; NaN while unknown
LARGEST = 5  # largest F_a so far, of samples that nothing spoiled
N_LEVELS = 6

# Columns of Layout.constants.
LEAST, MOST = 0, 1  # readings that the sensor can send
LEAST_NOISE = 2  # of a force component, by the step of the readings
ROUNDING = 3  # noise of a reading by its step; NaN where the step is not known
N_USED = 4  # taxels that are not ignored
N_CONSTANTS = 5

# Columns of Layout.specs.
KIND, WINDOW, TRANSFORM, SCOPE, SAME_AS = range(5)

# Columns of Layout.windows.
SIGMA_WINDOW, LONGEST = 0, 1

# Columns of Output.values: F_tip, then
AMPLITUDE, MEAN, SIGMA = 3, 4, 5  # F_a, and m and sigma over the reported window
N_VALUES = 6

FIRST_WINDOWED = 4
"""Kinds of features before it look at one sample: the channels of the history."""
SIGMA_XYZ, CHANGE = 6, 7
"""Kinds beyond the paper's six, in the order of holdfast.features.specs.KINDS."""

# Columns of Output.status.
REASON, FAULTS = 0, 1
TAXELS = 2  # bit i is taxel i of the finger, where it is at fault by itself
N_STATUS = 3


class Layout(NamedTuple):
    """What does not change while a stream runs; taxels of all fingers one after the other."""

    offsets: Integers  # (n_fingers + 1,) first taxel of each finger
    rotations: Array  # (n_taxels, 3, 3)
    constants: Array  # (n_fingers, N_CONSTANTS)
    specs: Integers  # (n_fingers, n_features, 5) as `spec_codes` gives them
    floors: Array  # (n_fingers, n_features)
    windows: Integers  # (n_fingers, 2) of the reported sigma, and the longest
    ignored: Flags  # (n_taxels,) those that contribute nothing
    alike: bool  # whether all fingers have the same features
    tare_kind: int
    tare_seconds: float
    period: float


class Memory(NamedTuple):
    """What a stream remembers."""

    baseline: Array  # (n_taxels, 3) a sum while the tare runs, then the mean
    previous: Array  # (n_taxels, 3) readings of the last sample that made sense
    taxels: Array  # (n_taxels, N_TAXEL) of holdfast.features.faults
    history: Array  # (n_fingers, 4, 2 * longest) F_a, F_x, F_y, F_z, each written twice
    counts: Integers  # (n_fingers, N_COUNTS)
    levels: Array  # (n_fingers, N_LEVELS)
    own: Array  # (n_fingers, n_features) each finger's own values, before the hand's largest


class Output(NamedTuple):
    """What is known after a sample; NaN where nothing is."""

    features: Array  # (n_fingers, n_features)
    values: Array  # (n_fingers, N_VALUES)
    status: Integers  # (n_fingers, N_STATUS)
