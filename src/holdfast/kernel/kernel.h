/* The kernel of holdfast: all that happens at a tactile sample of a robot hand, up to the features.
 *
 * What it is
 *   A hand is a few fingers (fingertips, pads). A finger has one sensor of n_taxels taxels, each of
 *   which reports a force in three axes. At a sample, each finger that is present goes through:
 *
 *     readings -> valid? (faults.c) -> plausible? (implausible.c)
 *              -> changes and faulty taxels (faults.c)
 *              -> tare and noise (tare.c) -> magnetic field taken out (field.c)
 *              -> faulty taxels filled in (masks.c)
 *              -> fingertip force (taxels.c) -> Haar window (window.c), motion (motion.c)
 *              -> features (stream.c)
 *
 *   The first step that refuses the sample ends it: its `reason` is then not HOLDFAST_READY, and
 *   the finger has no features. The state machine of a finger, by its reason:
 *
 *     TARE ----> WARM_UP ----> READY      the tare is complete; then the windows are full
 *                  ^             |
 *     FAULT <------+---- GAP <---+        a gap, or a fault of the finger, starts the windows again
 *
 * The life of a stream
 *   1. Tables (`holdfast_hand`) are constants: sensors, features, tare, rate. They come from a
 *      model. `holdfast_check` refuses tables whose sizes or indices do not fit: once, before the
 *      first sample. No other function checks them again.
 *   2. Memory. With sizes as fields, the caller gives `holdfast_memory_size` bytes to
 *      `holdfast_use_memory`. With sizes as macros (see below), `holdfast_memory` holds all of it.
 *   3. `holdfast_begin` sets the memory to that before the first sample. Call it again to reset.
 *   4. `holdfast_advance` processes a sample. The result is in `memory->values` and
 *      `memory->features`, until the next sample.
 *
 * Who owns memory
 *   The caller owns tables and memory; nothing is allocated, and no global changes. Two streams of
 *   one set of tables may run in two threads. Nothing here reads a clock, a file or the locale.
 *
 * Two compilations of one source
 *   Sizes are fields of the tables in Python's extension, and macros in an exported header, so that
 *   a compiler for a microcontroller knows them. HF_ARRAY is a pointer or an array accordingly.
 *   HOLDFAST_SINGLE makes all numbers but times single precision.
 *   Compile with -ffp-contract=off and without -ffast-math: NaN means that there is no value.
 *
 * Units
 *   Readings and forces are in the unit of the sensor (counts, or N), times in seconds on the clock
 *   of the caller. Taxel frames have z along the outward normal, positive when pressed.
 */
#ifndef HF_KERNEL_H
#define HF_KERNEL_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if defined(__FAST_MATH__) || __FINITE_MATH_ONLY__ + 0 || defined(_M_FP_FAST)
#error "holdfast needs arithmetic with NaN: compile without -ffast-math or /fp:fast"
#endif

#ifdef HOLDFAST_SINGLE
typedef float hf_real;
#define hf_sqrt sqrtf
#define hf_log logf
#define hf_exp expf
#define hf_expm1 expm1f
#define hf_tanh tanhf
#define hf_abs fabsf
#define hf_nextafter nextafterf
#define HF_TINY 1e-37f /* keeps a division finite; no load or weight is smaller */
#else
typedef double hf_real;
#define hf_sqrt sqrt
#define hf_log log
#define hf_exp exp
#define hf_expm1 expm1
#define hf_tanh tanh
#define hf_abs fabs
#define hf_nextafter nextafter
#define HF_TINY 1e-300
#endif
#define HF_NAN ((hf_real)NAN)
#define HF_INFINITY ((hf_real)INFINITY)

/* Sizes: macros where HOLDFAST_N_FINGERS is one (an exported header), else fields of the tables. */
#ifdef HOLDFAST_N_FINGERS
#define HF_N_FINGERS(hand) ((void)(hand), (size_t)HOLDFAST_N_FINGERS)
#define HF_N_LANES(hand) ((void)(hand), (size_t)HOLDFAST_N_LANES)
#define HF_N_FEATURES(hand) ((void)(hand), (size_t)HOLDFAST_N_FEATURES)
#define HF_N_LAGS(hand) ((void)(hand), (size_t)HOLDFAST_N_LAGS)
#define HF_N_HISTORY(hand) ((void)(hand), (size_t)HOLDFAST_N_HISTORY)
#define HF_N_CHANNELS(hand) ((void)(hand), (size_t)HOLDFAST_N_CHANNELS)
#define HF_N_LEVELS(hand) ((void)(hand), (size_t)HOLDFAST_N_LEVELS)
#define HF_N_TRACK(hand) ((void)(hand), (size_t)HOLDFAST_N_TRACK)
#define HF_ARRAY(type, name, length) type name[length]
#else
#define HF_N_FINGERS(hand) ((hand)->n_fingers)
#define HF_N_LANES(hand) ((hand)->n_lanes)
#define HF_N_FEATURES(hand) ((hand)->n_features)
#define HF_N_LAGS(hand) ((hand)->n_lags)
#define HF_N_HISTORY(hand) ((hand)->n_history)
#define HF_N_CHANNELS(hand) ((hand)->n_channels)
#define HF_N_LEVELS(hand) ((hand)->n_levels)
#define HF_N_TRACK(hand) ((hand)->n_track)
#define HF_ARRAY(type, name, length) type *name
#endif

/* Parts of which a sum over taxels consists (lanes.h); the taxels of a finger are padded to a
 * multiple of it. */
enum { HF_LANES = 4 };

/* Words of a set of the taxels of a finger: for 512 taxels, or in an exported header for those of
 * its largest finger. */
#ifndef HOLDFAST_MASK_WORDS
#define HOLDFAST_MASK_WORDS 8
#endif

/* Why a finger has no features at a sample. */
enum {
    HOLDFAST_READY = 0,   /* it has features */
    HOLDFAST_TARE = 1,    /* the tare, or the noise, is not complete */
    HOLDFAST_WARM_UP = 2, /* its windows are not full yet */
    HOLDFAST_GAP = 3,     /* they are not full again after a gap */
    HOLDFAST_FAULT = 4    /* its readings cannot be used, see the faults */
};

/* Faults, one bit each. Bit 128 is in detector.h. The other missing bits belong to the transport,
 * which is not part of a kernel. */
enum {
    HOLDFAST_NOT_FINITE = 1,    /* a reading is NaN or infinite */
    HOLDFAST_STUCK = 2,         /* readings changed, and do not any more */
    HOLDFAST_SATURATED = 4,     /* a reading is at a limit of its range */
    HOLDFAST_TARE_LOADED = 8,   /* the tare was taken under load: something pulls the skin */
    HOLDFAST_DEAD = 16,         /* a taxel never changed, while others do */
    HOLDFAST_NOISY = 32,        /* a taxel jumps by far more than its noise */
    HOLDFAST_OUT_OF_RANGE = 64, /* a reading that the sensor cannot send */
    HOLDFAST_OFFSET = 8192,     /* all readings have left the tare together */
    HOLDFAST_REPEATED = 16384,  /* the last samples repeat those before them */
    HOLDFAST_FIELD = 32768,     /* a magnetic field, or a load: all taxels changed nearly alike */
    HOLDFAST_INVALID = 65536    /* a reading of one taxel that its magnetometer cannot have */
};

/* How the baseline is found. */
enum {
    HOLDFAST_TARE_SECONDS = 0, /* mean over the first `tare_seconds` */
    HOLDFAST_TARE_FIRST = 1,   /* first valid sample */
    HOLDFAST_TARE_NONE = 2,    /* none, or that given to `holdfast_begin` */
    HOLDFAST_TARE_INTERVAL = 3 /* that given to `holdfast_begin` */
};

/* Kinds of features, from the force (equations 1 and 2 of the paper) ... */
enum {
    HOLDFAST_F_A = 0, /* |F_tip| */
    HOLDFAST_F_X = 1,
    HOLDFAST_F_Y = 2,
    HOLDFAST_F_Z = 3,
    HOLDFAST_M = 4,         /* equation 1, of F_a */
    HOLDFAST_SIGMA = 5,     /* equation 2, of F_a */
    HOLDFAST_SIGMA_XYZ = 6, /* root of the sum of the squared sigmas of F_x, F_y and F_z */
    HOLDFAST_CHANGE = 7,    /* |F_tip(k) - F_tip(k - N_w + 1)| */
    /* ... and relative ones, over a lag (motion.c). */
    HOLDFAST_FIRST_RELATIVE = 8,
    HOLDFAST_N_RELATIVE = 20
};

/* Relative features: HOLDFAST_FIRST_RELATIVE plus one of these. */
enum {
    HF_FORCE_CHANGE = 0,
    HF_SHEAR_CHANGE = 1,
    HF_RESIDUAL = 2,
    HF_SHEAR_RESIDUAL = 3,
    HF_PRESSURE_SHIFT = 4,
    HF_MOMENT_CHANGE = 5,
    HF_LOAD_TO_NOISE = 6,
    /* Five second differences of the taxels, see hf_fill_seconds: of all; weighted by pressure; the
     * part of that across the normal; without the motion that all share; of the pressed taxel that
     * has the largest. Then the same, averaged. */
    HF_SECOND = 7,
    HF_MEAN_SECOND = 12,
    HF_SHEAR_GAIN = 17,
    HF_NORMAL_GAIN = 18,
    HF_RATIO_GAIN = 19
};
enum { HF_N_SECONDS = 5 };

/* What is computed from a value of a force feature. */
enum {
    HOLDFAST_AS_IT_IS = 0,
    HOLDFAST_LOG = 1,     /* log(sqrt(value^2 + floor^2)) */
    HOLDFAST_BY_NOISE = 2 /* log of the ratio to the sigma of noise alone */
};

enum {
    HF_N_RING_SUMS = 128, /* kept sums of samples: two of the longest periods (implausible.c) */
    HF_N_SUMS = 3,        /* of a block of pairs: P, D and S (window.c) */
    HF_N_COMPONENTS = 4,  /* of the history: F_a, F_x, F_y, F_z */
    HF_MAX_FINGER_TAXELS = 64 * HOLDFAST_MASK_WORDS,
    HF_MAX_TAXELS = 65536, /* of a hand: bounds all sizes, so that no product overflows */
    HF_MAX_SAMPLES = 1048576,
    HF_MAX_FEATURES = 4096
};

/* Constants of a finger. */
typedef struct {
    size_t first_taxel; /* its first row of the readings of a sample */
    size_t n_taxels;
    size_t first;           /* its first lane in the arrays of taxels; a multiple of HF_LANES */
    hf_real n_used;         /* number of taxels that are not ignored */
    hf_real low;            /* smallest reading that the sensor can send; -inf without a range */
    hf_real high;           /* largest */
    hf_real low_end;        /* readings below this are near an end of the range */
    hf_real high_end;       /* readings above this, too */
    hf_real max_offset;     /* largest change of the weighted sum of the readings, see hf_scan */
    hf_real min_noise;      /* least noise of a component of the force: by the step of readings */
    hf_real max_field;      /* largest common field, see field.c; 0 where none is found, inf where
                               the unit of the readings is not known */
    hf_real rounding_noise; /* noise of a reading by its step; NaN where the step is not known */
    hf_real max_step;       /* a longer step in time is a gap of the finger [s] */
    hf_real normal[3];      /* of the patch, in the fingertip frame; of length 1 */
    size_t sigma_window;    /* N_w of the m and the sigma that are reported [samples] */
    size_t ready_window;    /* samples of a stretch from which on all features are known */
    bool is_magnetic;       /* each taxel is a magnetometer */
    bool bridges;           /* all windows are in seconds: gaps of up to 0.1 s are bridged */
} holdfast_finger;

/* A feature of a finger. */
typedef struct {
    int32_t kind; /* HOLDFAST_F_A, ...; -1 is padding, whose value is 0 */
    int32_t transform;
    bool of_hand;   /* the largest value of all fingers */
    size_t window;  /* N_w [samples], of kinds with a window; else 0 */
    size_t lag;     /* index of the lag, of relative kinds; else 0 */
    size_t same_as; /* first feature of the finger that is the same but for `of_hand` */
    hf_real floor;  /* of HOLDFAST_LOG [unit of the readings] */
} holdfast_feature;

/* A lag of relative features. */
typedef struct {
    size_t samples; /* at even times */
    double seconds;
    bool has_changes; /* some feature needs HF_FORCE_CHANGE to HF_LOAD_TO_NOISE at this lag */
    bool has_seconds; /* some feature needs second differences, or their averages */
    bool has_means;   /* their averages */
    bool has_ratios;  /* HF_SHEAR_GAIN to HF_RATIO_GAIN */
} holdfast_lag;

/* Tables: constants of a hand. Values of taxels stand in lanes: for each finger all x, then all y,
 * then all z, of `n` lanes each, where n is n_taxels rounded up to HF_LANES. */
typedef struct {
    size_t n_fingers;
    size_t n_lanes;    /* of all fingers */
    size_t n_features; /* of the finger that has most */
    size_t n_lags;     /* 0 without relative features */
    size_t n_history;  /* samples of the longest window */
    size_t n_channels; /* with Haar windows: 1 (F_a), or 4 (its components too) */
    size_t n_levels;   /* sizes of blocks in the longest window, see window.c */
    size_t n_track;    /* samples of the ring of relative features; at least 1 */
    hf_real period;    /* of the samples [s] */
    int32_t tare_kind;
    hf_real tare_seconds;
    hf_real noise_seconds; /* time over which the noise is measured */
    hf_real average_gain;  /* share of a new sample in averages of second differences */
    bool alike;            /* all fingers have the same features */
    bool has_centres;      /* some lag has changes: centre of pressure and moment are needed */
    bool has_ratios;       /* some lag has ratios */
    const holdfast_finger *fingers;   /* (n_fingers) */
    const holdfast_feature *features; /* (n_fingers, n_features) */
    const holdfast_lag *lags;         /* (n_lags), ascending */
    const hf_real *used;              /* (n_lanes) 1 for taxels that contribute; 0 for ignored
                                         ones, and for lanes without a taxel */
    const hf_real *rotations;         /* (9 n_lanes) from taxel frame to fingertip frame: of each
                                         finger R_00 of all lanes, R_01, ...; 0 of ignored taxels */
    const hf_real *positions;         /* (3 n_lanes) from the centroid, in radii of the patch */
} holdfast_hand;

/* A set of taxels of a finger: bit i % 64 of word i / 64 is taxel i. Other bits are 0. */
typedef struct {
    uint64_t words[HOLDFAST_MASK_WORDS];
} holdfast_taxel_set;

/* Changes of a taxel, to find whether it is faulty (faults.c). */
typedef struct {
    int64_t n_changed;     /* samples that changed the taxel */
    int64_t changed_at;    /* n_changes of its finger when the taxel last changed */
    int64_t longest_still; /* most successive samples without a change, of those that changed the
                              finger */
    /* Of each axis of a magnetometer, which is compared every 0.15 s: */
    hf_real compared[3];     /* reading */
    int32_t n_same[3];       /* comparisons since it last differed */
    int32_t longest_same[3]; /* most of these that were no fault */
    int32_t n_differed[3];   /* comparisons at which it differed */
} holdfast_taxel;

/* What replaces a taxel that is left out (masks.c). */
typedef struct {
    hf_real last_healthy[3]; /* reading beyond rest when the mask last changed */
    hf_real fade[3];         /* is added to the reading of a taxel that came back */
    double masked_at;        /* time from which it is left out [s] */
    bool unweighed;          /* it is left out, and its share of the load is not known */
} holdfast_mask;

/* A taxel in a ring of samples that may repeat (implausible.c). */
typedef struct {
    hf_real anchor[3]; /* reading of the sample from which on the ring is followed */
    bool varies[3];    /* the reading differed from it in the period after it */
} holdfast_ring;

/* A sample in the ring of relative features (motion.c). */
typedef struct {
    double time;         /* [s] */
    hf_real force[3];    /* F_tip */
    hf_real pressure[3]; /* centre of pressure, in radii of the patch */
    hf_real moment;      /* about the normal, divided by the radius */
    hf_real ratio;       /* of tangential to normal force, beyond the reference */
} holdfast_track;

/* Load and noise of a finger with relative features (motion.c). */
typedef struct {
    int64_t n_samples;       /* since the last fault, or gap that is not bridged */
    hf_real least_normal;    /* normal force of the reference: the least so far, at most 0 */
    hf_real reference[3];    /* F_tip at the least normal force */
    hf_real load;            /* force beyond the reference */
    hf_real peak_load;       /* the largest so far, slowly forgotten */
    hf_real taxel_load;      /* root of the sum of squares of the taxel forces beyond it */
    hf_real peak_taxel_load; /* the largest so far, slowly forgotten */
    hf_real noise;           /* of F_tip, standard deviation of the norm */
    hf_real taxel_noise;     /* of all taxels, standard deviation of the norm */
    hf_real least_noise;     /* of the blocks that are complete; infinite before */
    hf_real least_taxel_noise;
    hf_real block_squares; /* of the steps of F_tip in the block that is not complete */
    hf_real block_taxel_squares;
    int64_t block_steps;       /* their number */
    double block_start;        /* [s]; NaN before the first sample */
    double moved_at;           /* when the force last moved by much more than its noise [s] */
    hf_real moved_by;          /* change of the force over HF_MOVE_SECONDS */
    hf_real pressure;          /* sum of |h_i . n| over the taxels */
    hf_real pressure_squares;  /* sum of their squares */
    hf_real normal_floor;      /* |normal force| beyond the reference and 10 times its noise */
    hf_real tangent[3];        /* direction of the tangential force */
    hf_real contact_zero[3];   /* F_tip without contact: of the tare, or of a release since */
    hf_real contact_load;      /* force beyond contact_zero */
    hf_real peak_contact_load; /* the largest so far, slowly forgotten */
} holdfast_motion;

/* Memory of a finger. */
typedef struct {
    /* Time and stretches (stream.c). */
    double first_time; /* of the first valid sample [s]; NaN before */
    double last_time;  /* of the last sample [s]; NaN before */
    int64_t n_seen;    /* valid samples so far */
    int64_t n_stretch; /* forces since a gap, a refused sample or a fault: the windows hold these */
    bool after_gap;    /* a stretch after a gap warms up */
    size_t row;        /* of the newest force in the rings of history and blocks */
    /* Tare and noise (tare.c). */
    bool is_tared;         /* the baseline is frozen */
    int64_t n_tared;       /* samples in the baseline so far */
    hf_real squared_steps; /* sum of squared steps of the force, while the noise is measured */
    int64_t n_steps;       /* their number */
    hf_real noise;         /* standard deviation of a component by noise alone; NaN before */
    hf_real max_amplitude; /* largest F_a so far, of samples without a fault of HF_SERIOUS */
    int64_t n_pulled;      /* successive samples whose normal readings add up to a pull */
    /* Changes and faulty taxels (faults.c). */
    int64_t n_unchanged;   /* samples since the readings last changed */
    int64_t n_changes;     /* samples that changed the readings */
    int64_t longest_rest;  /* most samples without a change, if long and not by a fault */
    uint32_t taxel_faults; /* faults of single taxels at the last sample that changed a reading */
    holdfast_taxel_set faulty_taxels; /* those taxels */
    holdfast_taxel_set noisy_taxels;  /* the noisy ones among them */
    holdfast_taxel_set stuck_axes[3]; /* magnetometers of which this axis does not change */
    bool has_stuck_axis[3];           /* there are some */
    /* Taxels that are left out (masks.c). */
    int64_t n_refused;         /* successive samples of the tare with a reading that is not valid */
    holdfast_taxel_set lost;   /* taxels that have no tare */
    uint32_t lost_faults;      /* their faults; 0 without any */
    holdfast_taxel_set masked; /* taxels that are left out */
    bool has_masked;           /* there are some */
    bool too_many;             /* the others carry too little of the load */
    bool load_known;           /* the load was known when the mask last changed */
    bool unloaded;             /* this load has gone */
    bool fading;               /* the value of a taxel that came back still fades */
    hf_real fill_squares;      /* sum of the squares of last_healthy, of the healthy taxels */
    hf_real fill_ratio;        /* load of the healthy taxels, beside that when the mask changed */
    /* Magnetic field that all taxels read (field.c). */
    hf_real field[3];       /* that is taken out of all readings */
    hf_real still_field[3]; /* the same, when the readings did not move together last */
    bool field_is_turned;   /* these are in the fingertip frame, not in the taxel frames */
    hf_real common[6];      /* the readings' mean beyond the tare in both frames, smoothed */
    hf_real speed[6];       /* of these, smoothed, too [unit of the readings / s] */
    hf_real field_speed;    /* square of the field's, if it moves and the finger is open; else 0 */
    bool field_is_load;     /* the taxels moved alike, as no field does */
    bool is_shared;         /* the field was found by the help of another module */
    bool is_deep;           /* a load hides the field */
    int32_t n_skipped;      /* samples whose field was not looked for since, under such a load */
    bool has_new_field;     /* the field changed at this sample */
    bool is_untouched;      /* but for it, all taxels read what they did in the tare */
    int64_t n_unclear;      /* successive samples that may be of a field or of a load */
    /* Implausible samples (implausible.c). */
    holdfast_taxel_set jumped; /* taxels that were refused as a jump at the last sample */
    hf_real rest_sum;          /* weighted sum of the readings at rest, see hf_scan; NaN before */
    uint64_t n_valid;          /* samples whose readings are all valid, or were replaced */
    uint64_t ring_period;      /* of the ring of samples that is followed; 0 without one */
    uint64_t ring_length;      /* successive samples with the sum of that a period before */
    uint64_t ring_age;         /* samples since the ring is followed */
    bool ring_varies;          /* enough readings and samples of the ring differ */
    holdfast_motion motion;
} holdfast_finger_memory;

/* Result of a finger at its last sample; NaN where there is none. */
typedef struct {
    int32_t reason;            /* HOLDFAST_READY, ... */
    uint32_t faults;           /* HOLDFAST_NOT_FINITE, ... */
    holdfast_taxel_set taxels; /* that are faulty by themselves; if there are, so are faults */
    hf_real force[3];          /* F_tip */
    hf_real amplitude;         /* F_a = |F_tip| */
    hf_real m;                 /* equation 1, over sigma_window */
    hf_real sigma;             /* equation 2, over sigma_window */
} holdfast_values;

/* Memory of a stream. (clang-format takes the products for pointers.) */
/* clang-format off */
typedef struct {
    HF_ARRAY(holdfast_values, values, HOLDFAST_N_FINGERS);
    HF_ARRAY(hf_real, features, HOLDFAST_N_FINGERS * HOLDFAST_N_FEATURES);
    HF_ARRAY(holdfast_finger_memory, fingers, HOLDFAST_N_FINGERS);
    HF_ARRAY(holdfast_taxel, taxels, HOLDFAST_N_LANES);
    HF_ARRAY(holdfast_mask, masks, HOLDFAST_N_LANES);
    HF_ARRAY(holdfast_ring, rings, HOLDFAST_N_LANES);
    HF_ARRAY(hf_real, readings, 3 * HOLDFAST_N_LANES);  /* of this sample */
    HF_ARRAY(hf_real, previous, 3 * HOLDFAST_N_LANES);  /* of the last valid sample */
    HF_ARRAY(hf_real, baseline, 3 * HOLDFAST_N_LANES);  /* a sum while the tare runs */
    HF_ARRAY(hf_real, reference, 3 * HOLDFAST_N_LANES); /* forces at the least normal force */
    HF_ARRAY(hf_real, pressed, HOLDFAST_N_LANES);       /* |h_i . n| of the last sample */
    HF_ARRAY(hf_real, changes, 3 * HOLDFAST_N_LANES);   /* last change of each taxel */
    HF_ARRAY(hf_real, powers, 2 * HOLDFAST_N_LANES);    /* smoothed mean squares of its first and
                                                           of its second differences */
    HF_ARRAY(hf_real, sums, HOLDFAST_N_FINGERS * HF_N_RING_SUMS); /* of samples, a ring */
    /* (n_fingers, n_history, 4) and (n_fingers, n_history, n_channels, n_levels, 3): rings. */
    HF_ARRAY(hf_real, history, HOLDFAST_N_FINGERS * HOLDFAST_N_HISTORY * HF_N_COMPONENTS);
    HF_ARRAY(hf_real, blocks, HOLDFAST_N_FINGERS * HOLDFAST_N_HISTORY * HOLDFAST_N_CHANNELS *
                                  HOLDFAST_N_LEVELS * HF_N_SUMS);
    /* (n_fingers, n_track) and (n_track, 3 n_lanes): rings. */
    HF_ARRAY(holdfast_track, track, HOLDFAST_N_FINGERS * HOLDFAST_N_TRACK);
    HF_ARRAY(hf_real, taxel_forces, HOLDFAST_N_TRACK * 3 * HOLDFAST_N_LANES);
    /* (n_fingers, n_lags, HOLDFAST_N_RELATIVE) and (n_fingers, n_lags, HF_N_SECONDS). */
    HF_ARRAY(hf_real, relative, HOLDFAST_N_FINGERS * (HOLDFAST_N_LAGS + 1) * HOLDFAST_N_RELATIVE);
    HF_ARRAY(hf_real, averages, HOLDFAST_N_FINGERS * (HOLDFAST_N_LAGS + 1) * HF_N_SECONDS);
    HF_ARRAY(hf_real, own, HOLDFAST_N_FINGERS * HOLDFAST_N_FEATURES); /* before `of_hand` */
    HF_ARRAY(hf_real, of_hand, HOLDFAST_N_FEATURES); /* that maximum, if the fingers are alike */
} holdfast_memory;
/* clang-format on */

/* Each file can be compiled by itself: then HF_SHARED, before functions that files share, and
 * HF_API, before those of the interface, give names to the linker. A file that joins the others
 * (kernel.c) defines HF_SHARED as static: compilers then see all functions, and an exported header
 * is part of each source file that includes it. */
#ifndef HF_API
#ifdef HF_SHARED
#define HF_API static inline
#else
#define HF_API extern
#endif
#endif
#ifndef HF_SHARED
#define HF_SHARED
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Return NULL if all sizes, indices and numbers of the tables fit, else what is wrong. */
HF_API const char *holdfast_check(const holdfast_hand *hand);

#ifndef HOLDFAST_N_FINGERS
/* Return the size of the memory of a stream [bytes]. */
HF_API size_t holdfast_memory_size(const holdfast_hand *hand);

/* Set the arrays of a stream to parts of a block of that size, aligned as for double. */
HF_API void holdfast_use_memory(const holdfast_hand *hand, holdfast_memory *memory, void *block);
#endif

/* Set the memory to that before the first sample.
 *
 * baseline: (n_taxels, 3) readings without contact, of all fingers; NULL for none. */
HF_API void holdfast_begin(
    const holdfast_hand *hand, holdfast_memory *memory, const hf_real *baseline);

/* Process one sample of a hand.
 *
 * readings: (n_taxels, 3) of all fingers; those of absent fingers are not read.
 * present: (n_fingers) whether the finger has a sample.
 * time: [s]; later than that of the sample before. */
HF_API void holdfast_advance(
    const holdfast_hand *hand, holdfast_memory *memory, const hf_real *readings,
    const bool *present, double time);

#ifdef __cplusplus
}
#endif

#endif
