"""Arrays of a compiled feature stream: its constants, its memory and its output.

Each row of an array belongs to one finger, and the columns have names. The numbers of the
columns are compiled into the kernels. The annotation of a field says what its array is, for
`holdfast.detector.address_table`.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.sensors.types import Array, Flags, Integers


class ArrayKind(NamedTuple):
    """Type of the elements of an array, number of its axes, and the axis of its taxels, if any."""

    dtype: type[np.generic]
    n_axes: int
    taxel_axis: int | None = None

    def fits(self, array: npt.NDArray[Any]) -> bool:
        """Return whether an array is of this kind."""
        return array.dtype == self.dtype and array.ndim == self.n_axes


Floats1 = Annotated[Array, ArrayKind(np.float64, 1)]
Floats2 = Annotated[Array, ArrayKind(np.float64, 2)]
Floats3 = Annotated[Array, ArrayKind(np.float64, 3)]
Integers1 = Annotated[Integers, ArrayKind(np.int64, 1)]
Integers2 = Annotated[Integers, ArrayKind(np.int64, 2)]
Integers3 = Annotated[Integers, ArrayKind(np.int64, 3)]
Flags1 = Annotated[Flags, ArrayKind(np.bool_, 1)]
# Of all taxels: the C header has the values of neighbouring taxels next to each other.
Taxels1 = Annotated[Array, ArrayKind(np.float64, 1, taxel_axis=0)]
Taxels2 = Annotated[Array, ArrayKind(np.float64, 2, taxel_axis=0)]
Taxels3 = Annotated[Array, ArrayKind(np.float64, 3, taxel_axis=0)]
TaxelRing = Annotated[Array, ArrayKind(np.float64, 3, taxel_axis=1)]

# Codes of holdfast.contact.Reason.
READY, TARE, WARM_UP, GAP, FAULT = range(5)

TARE_SECONDS, TARE_FIRST, TARE_NONE, TARE_INTERVAL = range(4)

# Columns of the arrays below. The last name of each tuple is the number of columns.

# Memory.counts.
(
    N_SEEN,  # valid samples so far
    N_STRETCH,  # forces in the present stretch
    AFTER_GAP,  # 1 while a stretch after a gap warms up
    N_TARED,  # samples in the baseline so far; -1 once it is frozen
    N_UNCHANGED,  # samples since the readings last changed
    N_CHANGES,  # samples that changed the readings
    N_PULLED,  # successive samples whose normal readings add up to a pull
    HISTORY_END,  # one past the newest value in the history; windows before it are contiguous
    TAXEL_FAULTS,  # faults of single taxels at the last sample that changed any reading
    FAULTY_TAXELS,  # bits of those taxels
    LONGEST_REST,  # most successive samples without a change, if long and not by a fault
    N_MOTION,  # forces since the last gap that is not bridged
    NOISY_TAXELS,  # bits of the noisy taxels among the faulty ones
    MASKED,  # bits of the taxels that are left out, see holdfast.features.masks
    TOO_MANY,  # 1 if the others carry too little of the load
    LOAD_KNOWN,  # 1 if the load was known when the mask last changed
    UNLOADED,  # 1 once this load has gone
    FADING,  # 1 while the value of a taxel that came back still fades
    N_REFUSED,  # successive samples of the tare with a reading that is not valid
    LOST,  # bits of the taxels that have no tare
    LOST_FAULTS,  # their faults
    N_FRAMES,  # samples without an invalid reading, see holdfast.features.untrue
    RING_PERIOD,  # of the ring of samples that is followed [samples]; 0 without one
    RING_LENGTH,  # successive samples with the sum of the sample a period before
    RING_AGE,  # samples since the ring is followed
    RING_VARIES,  # 1 if enough readings and samples of the ring differ
    COUNTS_WIDTH,
) = range(27)

# Memory.levels.
(
    FIRST_TIME,  # time of the first finite sample [s]
    LAST_TIME,  # time of the last sample [s]
    SQUARED_STEPS,  # sum of squared steps of the force, while the noise is measured
    N_STEPS,  # their number
    NOISE,  # standard deviation of a force component by noise alone; NaN while unknown
    MAX_AMPLITUDE,  # largest F_a so far, of samples without a serious fault
    FILL_SQUARES,  # sum of the squares of Memory.masks LAST_HEALTHY, of the healthy taxels
    FILL_RATIO,  # load of the healthy taxels, beside that when the mask last changed
    REST_SUM,  # weighted sum of the readings at rest, see `scan_readings`; NaN while unknown
    LEVELS_WIDTH,
) = range(10)

# Memory.taxels.
(
    LAST_CHANGE, _, _,  # last change of the taxel, in three axes
    N_CHANGED,  # samples that changed the taxel
    CHANGED_AT,  # N_CHANGES of its finger when the taxel last changed
    FIRST_POWER,  # smoothed mean square of its first differences
    SECOND_POWER,  # smoothed mean square of its second differences
    LONGEST_STILL,  # most successive samples without a change, among those that changed the finger
    TAXELS_WIDTH,
) = range(9)  # fmt: skip

# Memory.masks.
(
    LAST_HEALTHY, _, _,  # reading beyond rest when the mask last changed
    FADE, _, _,  # is added to the reading of a taxel that came back
    MASKED_AT,  # time from which it is left out [s]
    UNWEIGHED,  # 1 while it is left out and its share of the load is not known
    MASKS_WIDTH,
) = range(9)  # fmt: skip

# Memory.rings.
(
    ANCHOR, _, _,  # reading of the sample from which on a ring is followed
    VARIES, _, _,  # 1 if the reading differed from it in the period after it
    RINGS_WIDTH,
) = range(7)  # fmt: skip

# Layout.constants.
(
    LOW_LIMIT,  # smallest reading that the sensor can send
    HIGH_LIMIT,  # largest reading that the sensor can send
    LOW_END,  # readings below this are near the end of the range
    HIGH_END,  # readings above this are near the end of the range
    MAX_OFFSET,  # largest change of the weighted sum of the readings, see `scan_readings`
    MIN_NOISE,  # noise of a force component by the step of the readings alone
    ROUNDING_NOISE,  # noise of a reading by its step; NaN where the step is not known
    N_USED,  # taxels that are not ignored
    MAX_STEP,  # a longer step in time is a gap of the finger [s]
    CONSTANTS_WIDTH,
) = range(10)

# Layout.specs.
KIND, WINDOW, TRANSFORM, SCOPE, SAME_AS, SPECS_WIDTH = range(6)

# Layout.windows.
(
    SIGMA_WINDOW,  # samples in the window that is reported
    LONGEST_WINDOW,  # samples in the longest window
    READY_WINDOW,  # samples of a stretch from which on all features are known
    BRIDGES,  # 1 if all windows are in seconds, so that short gaps are bridged
    WINDOWS_WIDTH,
) = range(5)

N_CHANNELS = 4  # of the history: F_a, F_x, F_y, F_z

# Output.values.
(
    FORCE, _, _,  # F_tip, in three components
    AMPLITUDE,  # F_a
    MEAN,  # m over the reported window
    SIGMA,  # sigma over the reported window
    VALUES_WIDTH,
) = range(7)  # fmt: skip

# Rows of Memory.track.
(
    _, _, _,  # F_tip
    TRACK_PRESSURE, _, _,  # centre of pressure, in radii of the patch, in three axes
    TRACK_MOMENT,  # moment about the normal, divided by the radius
    TRACK_RATIO,  # of tangential to normal force, beyond the reference
    TRACK_TIME,  # of the sample [s]
    TRACK_WIDTH,
) = range(10)  # fmt: skip

# Memory.motion.
(
    LEAST_NORMAL,  # normal force of the reference: the least since the start, at most 0
    LOAD,  # force beyond the reference
    TAXEL_LOAD,  # root of the sum of squares of the taxel forces beyond the reference
    PEAK_LOAD,  # the largest LOAD so far, slowly forgotten
    PEAK_TAXEL_LOAD,  # the largest TAXEL_LOAD so far, slowly forgotten
    NOISE_NOW,  # of F_tip, standard deviation of the norm
    TAXEL_NOISE_NOW,  # of all taxels, standard deviation of the norm
    LEAST_NOISE,  # of F_tip, of the blocks that are complete; infinite before
    LEAST_TAXEL_NOISE,  # of all taxels, of the blocks that are complete; infinite before
    BLOCK_SQUARES,  # of the steps of F_tip in the block that is not complete
    BLOCK_TAXEL_SQUARES,  # of the steps of all taxels
    BLOCK_STEPS,  # their number
    BLOCK_START,  # time [s]; NaN before the first sample
    REFERENCE, _, _,  # F_tip at the least normal force, in three components
    MOVED_AT,  # when the force last moved by much more than its noise [s]
    MOVED_BY,  # change of the force over MOVE_SECONDS of holdfast.features.motion
    PRESSURE,  # sum over the taxels of |h . n|, beyond the reference
    PRESSURE_SQUARES,  # sum of their squares
    NORMAL_FLOOR,  # |normal force| beyond the reference and ten times its noise
    TANGENT, _, _,  # direction of the tangential force, in three components
    CONTACT_ZERO, _, _,  # F_tip without contact: of the tare, or of a release since
    CONTACT_LOAD,  # force beyond CONTACT_ZERO
    PEAK_CONTACT_LOAD,  # the largest CONTACT_LOAD so far, slowly forgotten
    MOTION_WIDTH,
) = range(30)  # fmt: skip

# Layout.families: which relative kinds a lag needs, of those lists of holdfast.features.specs.
(
    LAGS,  # LAG_KINDS
    SECONDS,  # SECOND_KINDS, or their averages
    MEAN_SECONDS,  # MEAN_SECOND_KINDS
    RATIOS,  # RATIO_KINDS
    FAMILIES_WIDTH,
) = range(5)

N_SECONDS = 5  # sums of second differences: of all taxels, shared, shear, own and top

# Output.status.
(
    REASON,
    FAULTS,
    TAXELS,  # bit i is set if taxel i of the finger is faulty by itself
    STATUS_WIDTH,
) = range(4)


class Layout(NamedTuple):
    """Constants of a stream. The taxels of all fingers stand one after the other."""

    offsets: Integers1  # (n_fingers + 1,) first taxel of each finger
    n_taxels: Integers1  # (n_fingers,) of each finger: where all are alike, a known length in C
    rotations: Taxels3  # (n_taxels, 3, 3)
    constants: Floats2  # (n_fingers, CONSTANTS_WIDTH)
    specs: Integers3  # (n_fingers, n_features, SPECS_WIDTH), see `spec_codes`
    floors: Floats2  # (n_fingers, n_features)
    windows: Integers2  # (n_fingers, WINDOWS_WIDTH)
    ignored: Flags1  # (n_taxels,) taxels that contribute nothing
    alike: bool  # whether all fingers have the same features
    tare_kind: int
    tare_seconds: float
    noise_seconds: float  # time over which the noise is measured
    zero_unknown: bool  # whether it begins in contact, with a load that is not known
    period: float
    lags: Integers1  # (n_lags,) of relative features [samples], ascending; empty without any
    lag_seconds: Floats1  # (n_lags,) the same [s]
    average_gain: float  # share of a new sample in averages of second differences, after a period
    has_centres: bool  # whether a lag needs the centre of pressure and the moment
    has_ratios: bool  # whether a lag needs the ratio of tangential to normal force
    families: Integers2  # (n_lags, FAMILIES_WIDTH) 1 where a lag needs these kinds, else 0
    places: Taxels2  # (n_taxels, 3) from the centroid of the used taxels, in radii of the patch
    normals: Floats2  # (n_fingers, 3)
    normal_axes: Integers1  # (n_fingers,) axis that the normal is; 3 if it is none
    n_levels: int  # sizes of blocks of pairs, see holdfast.features.haar


class Memory(NamedTuple):
    """Memory of a stream."""

    baseline: Taxels2  # (n_taxels, 3) a sum while the tare runs, then the mean
    previous: Taxels2  # (n_taxels, 3) readings of the last valid sample
    taxels: Taxels2  # (n_taxels, TAXELS_WIDTH)
    masks: Taxels2  # (n_taxels, MASKS_WIDTH)
    history: Floats3  # (n_fingers, 4, 2 * longest) F_a, F_x, F_y, F_z, each written twice
    counts: Integers2  # (n_fingers, COUNTS_WIDTH)
    levels: Floats2  # (n_fingers, LEVELS_WIDTH)
    own: Floats2  # (n_fingers, n_features) values of each finger, before the maximum of the hand
    hand: Floats1  # (n_features,) this maximum, if all fingers have the same features
    taxel_forces: TaxelRing  # (length, n_taxels, 3) in the fingertip frame, a ring
    reference: Taxels2  # (n_taxels, 3) taxel forces at the least normal force since the start
    track: Floats3  # (n_fingers, TRACK_WIDTH, length), a ring
    motion: Floats2  # (n_fingers, MOTION_WIDTH)
    relative: Floats3  # (n_fingers, n_kinds, n_lags) relative features of the last sample
    pressed: Taxels1  # (n_taxels,) |h . n| of the last sample
    averages: Floats3  # (n_fingers, N_SECONDS, n_lags) smoothed squares of second differences
    blocks: Floats3  # (n_fingers, longest, n_channels * n_levels * 3) sums of blocks, a ring
    sums: Floats2  # (n_fingers, N_RING_SUMS of holdfast.features.untrue) of the readings, a ring
    rings: Taxels2  # (n_taxels, RINGS_WIDTH)


class Output(NamedTuple):
    """Result of the last sample; NaN where there is none."""

    features: Floats2  # (n_fingers, n_features)
    values: Floats2  # (n_fingers, VALUES_WIDTH)
    status: Integers2  # (n_fingers, STATUS_WIDTH)
