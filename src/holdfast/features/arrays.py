"""Arrays of a compiled feature stream: its constants, its memory and its output.

Each row of an array belongs to one finger, and the columns have names. The numbers of the
columns are compiled into the kernels.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# Codes of holdfast.contact.Reason.
READY, TARE, WARM_UP, GAP, FAULT = range(5)

TARE_SECONDS, TARE_FIRST, TARE_NONE, TARE_INTERVAL = range(4)

# Columns of Memory.counts.
N_SEEN = 0  # valid samples so far
N_STRETCH = 1  # forces in the present stretch
AFTER_GAP = 2  # 1 while a stretch after a gap warms up
N_TARED = 3  # samples in the baseline so far; -1 once it is frozen
N_UNCHANGED = 4  # samples since the readings last changed
N_CHANGES = 5  # samples that changed the readings
N_PULLED = 6  # successive samples whose normal readings add up to a pull
HISTORY_END = 7  # one past the newest value in the history; windows before it are contiguous
TAXEL_FAULTS = 8  # faults of single taxels at the last sample that changed any reading
FAULTY_TAXELS = 9  # bits of those taxels
LONGEST_REST = 10  # most successive samples without a change, if long and not by a fault
COUNTS_WIDTH = 11

# Columns of Memory.levels.
FIRST_TIME = 0  # time of the first finite sample [s]
LAST_TIME = 1  # time of the last sample [s]
SQUARED_STEPS = 2  # sum of squared steps of the force, while the noise is measured
N_STEPS = 3  # their number
NOISE = 4  # standard deviation of a force component by noise alone; NaN while unknown
MAX_AMPLITUDE = 5  # largest F_a so far, of samples without a serious fault
LEVELS_WIDTH = 6

# Columns of Memory.taxels.
LAST_CHANGE = 0  # last change of the taxel, in three axes
N_CHANGED = 3  # samples that changed the taxel
CHANGED_AT = 4  # N_CHANGES of its finger when the taxel last changed
FIRST_POWER = 5  # smoothed mean square of its first differences
SECOND_POWER = 6  # smoothed mean square of its second differences
LONGEST_STILL = 7  # most successive samples without a change, among those that changed the finger
TAXELS_WIDTH = 8

# Columns of Layout.constants.
LOW_LIMIT, HIGH_LIMIT = 0, 1  # smallest and largest reading that the sensor can send
MIN_NOISE = 2  # noise of a force component by the step of the readings alone
ROUNDING_NOISE = 3  # noise of a reading by its step; NaN where the step is not known
N_USED = 4  # taxels that are not ignored
CONSTANTS_WIDTH = 5

# Columns of Layout.specs.
KIND, WINDOW, TRANSFORM, SCOPE, SAME_AS = range(5)

# Columns of Layout.windows.
SIGMA_WINDOW, LONGEST_WINDOW = 0, 1
READY_WINDOW = 2  # samples of a stretch from which on all features are known

N_CHANNELS = 4  # of the history: F_a, F_x, F_y, F_z

# Columns of Output.values: F_tip, then
AMPLITUDE, MEAN, SIGMA = 3, 4, 5  # F_a, and m and sigma over the reported window
VALUES_WIDTH = 6

# Kinds of features, in the order of holdfast.features.specs.KINDS.
FIRST_WINDOWED = 4  # the kinds before it need one sample: they are the channels of the history
SIGMA_XYZ, CHANGE = 6, 7
FIRST_RELATIVE = 8  # the kinds from it on look back by a lag in seconds

# Rows of Memory.relative: kinds from FIRST_RELATIVE on.
FORCE_CHANGE, SHEAR_CHANGE, RESIDUAL, SHEAR_RESIDUAL = range(4)
PRESSURE_SHIFT, MOMENT_CHANGE, LOAD_TO_NOISE = range(4, 7)
N_RELATIVE = 7

# Rows of Memory.track: F_tip, then
TRACK_PRESSURE = 3  # centre of pressure, in radii of the patch, in three axes
TRACK_MOMENT = 6  # moment about the normal, divided by the radius
TRACK_WIDTH = 7

# Columns of Memory.motion.
LEAST_NORMAL = 0  # normal force of the reference: the least since the start, at most 0
LOAD = 1  # force beyond the reference
TAXEL_LOAD = 2  # root of the sum of squares of the taxel forces beyond the reference
PEAK_LOAD, PEAK_TAXEL_LOAD = 3, 4  # the largest so far, slowly forgotten
NOISE_NOW, TAXEL_NOISE_NOW = 5, 6  # of F_tip and of all taxels, standard deviation of the norm
LEAST_NOISE, LEAST_TAXEL_NOISE = 7, 8  # of the blocks that are complete; infinite before
BLOCK_SQUARES, BLOCK_TAXEL_SQUARES, BLOCK_STEPS = 9, 10, 11  # of the block that is not
BLOCK_START = 12  # time [s]; NaN before the first sample
REFERENCE = 13  # the reference: F_tip at the least normal force, three components
MOVED_AT = 16  # when the force last moved by much more than its noise [s]
MOTION_WIDTH = 17

# Columns of Output.status.
REASON, FAULTS = 0, 1
TAXELS = 2  # bit i is set if taxel i of the finger is faulty by itself
STATUS_WIDTH = 3


class Layout(NamedTuple):
    """Constants of a stream. The taxels of all fingers stand one after the other."""

    offsets: Integers  # (n_fingers + 1,) first taxel of each finger
    rotations: Array  # (n_taxels, 3, 3)
    constants: Array  # (n_fingers, CONSTANTS_WIDTH)
    specs: Integers  # (n_fingers, n_features, 5), see `spec_codes`
    floors: Array  # (n_fingers, n_features)
    windows: Integers  # (n_fingers, 3) samples in the reported window, the longest, and to be ready
    ignored: Flags  # (n_taxels,) taxels that contribute nothing
    alike: bool  # whether all fingers have the same features
    tare_kind: int
    tare_seconds: float
    period: float
    lags: Integers  # (n_lags,) of relative features [samples], ascending; empty without any
    places: Array  # (n_taxels, 3) from the centroid of the used taxels, in radii of the patch
    normals: Array  # (n_fingers, 3)
    n_levels: int  # sizes of blocks of pairs, see holdfast.features.haar


class Memory(NamedTuple):
    """Memory of a stream."""

    baseline: Array  # (n_taxels, 3) a sum while the tare runs, then the mean
    previous: Array  # (n_taxels, 3) readings of the last valid sample
    taxels: Array  # (n_taxels, TAXELS_WIDTH)
    history: Array  # (n_fingers, 4, 2 * longest) F_a, F_x, F_y, F_z, each written twice
    counts: Integers  # (n_fingers, COUNTS_WIDTH)
    levels: Array  # (n_fingers, LEVELS_WIDTH)
    own: Array  # (n_fingers, n_features) values of each finger, before the maximum of the hand
    taxel_forces: Array  # (longest lag + 1, n_taxels, 3) in the fingertip frame, a ring
    reference: Array  # (n_taxels, 3) taxel forces at the least normal force since the start
    track: Array  # (n_fingers, TRACK_WIDTH, longest lag + 1), a ring
    motion: Array  # (n_fingers, MOTION_WIDTH)
    relative: Array  # (n_fingers, N_RELATIVE, n_lags) relative features of the last sample
    blocks: Array  # (n_fingers, longest, n_channels * n_levels * 3) sums of blocks of pairs, a ring


class Output(NamedTuple):
    """Result of the last sample; NaN where there is none."""

    features: Array  # (n_fingers, n_features)
    values: Array  # (n_fingers, VALUES_WIDTH)
    status: Integers  # (n_fingers, STATUS_WIDTH)
