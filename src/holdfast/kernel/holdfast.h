/* The detector of holdfast: from the readings of a hand at a tactile sample to its contact states.
 *
 * This header is the only definition of what C and Python share: Python reads the layout of the
 * structs from it (structs.py), and an exported header begins with it.
 *
 * What it is
 *   A hand is a few fingers (fingertips, pads). A finger has one sensor of n_taxels taxels, each of
 *   which reports a force in three axes. At a sample, each finger that is present goes through:
 *
 *     readings -> valid? (faults.c) -> plausible? (implausible.c), as of a living skin? (laws.c)
 *              -> changes and faulty taxels (faults.c)
 *              -> tare and noise (tare.c) -> magnetic field taken out (field.c)
 *              -> faulty taxels filled in (masks.c)
 *              -> fingertip force (taxels.c) -> Haar window (window.c), motion (motion.c), sliding
 *                 (sliding.c)
 *              -> features (stream.c)
 *              -> contact? (contact.c) -> heads: stable, slip, slip_speed, cause (heads.c)
 *              -> forward filter, hysteresis, hold, minimum duration (decision.c)
 *              -> state of each finger and of the hand (detector.c)
 *
 *   The first step up to the features that refuses the sample ends it: its `reason` is then not
 *   HOLDFAST_READY, and the finger has no features. The state machine of a finger, by its reason:
 *
 *     TARE ----> WARM_UP ----> READY      the tare is complete; then the windows are full
 *                  ^             |
 *     FAULT <------+---- GAP <---+        a gap, or a fault of the finger, starts the windows again
 *
 *   A finger without features is UNKNOWN at once, but a fault that leaves a force is reported only
 *   when it has lasted. The state machine of a finger in contact:
 *
 *     NO_CONTACT --touch--> UNSTABLE --hold time over, p >= threshold--> STABLE
 *         ^                    ^  |                                        |
 *         +----- at rest ------+  +----- p < threshold, or a jerk <--------+
 *
 * The life of a stream, and of a detector
 *   1. Tables are constants: `holdfast_hand` (sensors, features, tare, rate) of a stream, and
 *      `holdfast_model` (heads and limits of each finger) of a detector. `holdfast_check` and
 *      `holdfast_check_model` refuse tables whose sizes or indices do not fit: once, before the
 *      first sample. No other function checks them again.
 *   2. Memory (memory.h). With sizes as fields, the caller gives `holdfast_memory_size` bytes to
 *      `holdfast_use_memory` (of a detector `holdfast_detector_size`,
 *      `holdfast_detector_use_memory`). With sizes as macros, the structs hold all of it.
 *      Of it, the laws of a living skin take 2.0 KB for each finger (laws.c): on a microcontroller,
 *      HF_N_MARKS of 16 saves 0.6 KB, and finds readings that return within 256 updates.
 *   3. `holdfast_begin` sets a stream to that before the first sample, `holdfast_start` a detector.
 *      Call it again to reset.
 *   4. `holdfast_advance` computes the features of a sample, in `memory->values` and
 *      `memory->features`. `holdfast_detect` does so, decides, and fills estimates of the caller.
 *   In an exported header, `holdfast_init` and `holdfast_update` do 3 and 4 with its tables.
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
#ifndef HF_HOLDFAST_H
#define HF_HOLDFAST_H

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
#define HF_N_SLIDES(hand) ((void)(hand), (size_t)HOLDFAST_N_SLIDES)
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
#define HF_N_SLIDES(hand) ((hand)->n_slides)
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
    HOLDFAST_FAULT = 4,   /* its readings cannot be used, see the faults */
    /* Why a finger is UNSTABLE whatever its probability: */
    HOLDFAST_LOAD = 5, /* a large share of the load comes or goes */
    HOLDFAST_HOLD = 6  /* it was unstable within the hold time, or STABLE has not lasted yet */
};

/* Faults, one bit each. The missing bits belong to the transport, which is not part of a kernel. */
enum {
    HOLDFAST_NOT_FINITE = 1,    /* a reading is NaN or infinite */
    HOLDFAST_STUCK = 2,         /* readings changed, and do not any more */
    HOLDFAST_SATURATED = 4,     /* a reading is at a limit of its range */
    HOLDFAST_TARE_LOADED = 8,   /* the tare was taken under load: something pulls the skin */
    HOLDFAST_DEAD = 16,         /* a taxel never changed, while others do; if none is named: the
                                   whole finger, which does not count for the hand */
    HOLDFAST_NOISY = 32,        /* a taxel jumps by far more than its noise */
    HOLDFAST_OUT_OF_RANGE = 64, /* a reading that the sensor cannot send */
    HOLDFAST_TARE_DRIFT = 128,  /* the force without contact crept over the threshold of contact */
    HOLDFAST_OFFSET = 8192,     /* all readings have left the tare together */
    HOLDFAST_REPEATED = 16384,  /* the last samples repeat those before them */
    HOLDFAST_FIELD = 32768,     /* a magnetic field, or a load: all taxels changed nearly alike */
    HOLDFAST_INVALID = 65536,   /* a reading of one taxel that it cannot have: it jumped */
    HOLDFAST_EQUAL_TAXELS = 131072, /* taxels that change, and are equal all the time */
    HOLDFAST_COPIED = 262144,       /* a finger that changes, and is equal to another */
    HOLDFAST_REZEROED = 524288      /* all readings of a hold went to rest at once */
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
    /* ... and relative ones, over a lag (motion.c, sliding.c). */
    HOLDFAST_FIRST_RELATIVE = 8,
    HOLDFAST_N_RELATIVE = 43
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
    /* Those of sliding (sliding.c): of the newest sample, ... */
    HF_FIRST_SLIDING = 7,
    HF_FRICTION = 7,
    HF_TAXEL_FRICTION = 8,
    HF_FORCE_TO_NOISE = 9,
    HF_FRICTION_MARGIN = 10,
    /* ... changes of the force and of what is computed from it, ... */
    HF_SHEAR_BY_LOAD = 11,
    HF_NORMAL_BY_LOAD = 12,
    HF_FORCE_BY_LOAD = 13,
    HF_FRICTION_RISE = 14,
    HF_TAXEL_FRICTION_RISE = 15,
    HF_ALIGNMENT = 16,
    HF_CENTRE_SHIFT = 17,
    /* ... of the taxels, ... */
    HF_DIVERGENCE = 18,
    HF_RELATIVE_DIVERGENCE = 19,
    HF_NORMAL_DIVERGENCE = 20,
    HF_FALLING_SHARE = 21,
    HF_RISING_SHARE = 22,
    /* ... and five energies of fast changes: at once, and over 30, 100 and 400 ms. */
    HF_FAST = 23
};
enum {
    HF_N_ENERGIES = 5,
    HF_N_ENERGY_TIMES = 3,
    HF_N_AVERAGES = 15,       /* of energies at a lag */
    HF_N_FRICTION_BLOCKS = 32 /* blocks of time of which the largest friction is kept */
};

/* What is computed from a value of a force feature. */
enum {
    HOLDFAST_AS_IT_IS = 0,
    HOLDFAST_LOG = 1,     /* log(sqrt(value^2 + floor^2)) */
    HOLDFAST_BY_NOISE = 2 /* log of the ratio to the sigma of noise alone */
};

enum {
    HF_RUN = 16,          /* updates of a finger in a run (laws.c) */
    HF_N_MARKS = 32,      /* runs that are kept: those of the last 512 updates */
    HF_N_SUMS = 3,        /* of a block of pairs: P, D and S (window.c) */
    HF_N_COMPONENTS = 4,  /* of the history: F_a, F_x, F_y, F_z */
    HF_MAX_FINGER_TAXELS = 64 * HOLDFAST_MASK_WORDS,
    HF_MAX_TAXELS = 65536, /* of a hand: bounds all sizes, so that no product overflows */
    HF_MAX_SAMPLES = 1048576,
    HF_MAX_FEATURES = 4096
};

/* State of a finger, and of the hand. */
enum { HOLDFAST_UNKNOWN = 0, HOLDFAST_NO_CONTACT = 1, HOLDFAST_UNSTABLE = 2, HOLDFAST_STABLE = 3 };

/* Likely cause while a finger is UNSTABLE; slip also whenever the head `slip` decides so. */
enum {
    HOLDFAST_NO_CAUSE = 0,
    HOLDFAST_CAUSE_CLOSING = 1,
    HOLDFAST_CAUSE_DISTURBANCE = 2,
    HOLDFAST_CAUSE_SLIP = 3,
    HOLDFAST_CAUSE_LOST = 4,
    HOLDFAST_CAUSE_RELEASED = 5,
    HOLDFAST_CAUSE_GLITCH = 6,
    HOLDFAST_N_CAUSES = 6
};

/* How contact is found. */
enum {
    HOLDFAST_ALWAYS_CONTACT = 0,   /* the model has no threshold */
    HOLDFAST_CONTACT_BY_FORCE = 1, /* F_a over a limit [unit of the readings] */
    HOLDFAST_CONTACT_BY_NOISE = 2, /* F_a over a multiple of its noise */
    HOLDFAST_CONTACT_BY_LOAD = 3   /* load of relative features over a multiple of its noise */
};

/* Answers about a finger. */
enum {
    HOLDFAST_HEAD_STABLE = 0, /* p = 1 / (1 + exp(-z)) */
    HOLDFAST_HEAD_SLIP = 1,   /* likewise, of the smoothed z */
    HOLDFAST_HEAD_SPEED = 2,  /* min(max(z, 0)^2, highest) [mm/s] */
    HOLDFAST_HEAD_CAUSE = 3,  /* the cause with the largest sum of z since the finger is unstable */
    HOLDFAST_N_HEADS = 4
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
    hf_real step;           /* smallest change of a reading; NaN where it is not known */
    hf_real step_noise;     /* noise of a reading by its step, or the least in newtons */
    hf_real max_step;       /* a longer step in time is a gap of the finger [s] */
    hf_real normal[3];      /* of the patch, in the fingertip frame; of length 1 */
    size_t sigma_window;    /* N_w of the m and the sigma that are reported [samples] */
    size_t ready_window;    /* samples of a stretch from which on all features are known */
    bool is_magnetic;       /* each taxel is a magnetometer */
    bool rests_at_zero;     /* without contact all readings are exactly 0: they prove no fault */
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
    uint64_t sliding; /* bit i: some feature needs HF_FIRST_SLIDING + i */
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
    size_t n_slides;   /* of that of features of sliding: as many, or 0 without such features */
    hf_real period;    /* of the samples [s] */
    int32_t tare_kind;
    hf_real tare_seconds;
    hf_real noise_seconds; /* time over which the noise is measured */
    bool alike;            /* all fingers have the same features */
    bool has_centres;      /* some lag has changes: centre of pressure and moment are needed */
    bool zero_unknown;     /* the first samples are load, and no readings without are known */
    const holdfast_finger *fingers;   /* (n_fingers) */
    const holdfast_feature *features; /* (n_fingers, n_features) */
    const holdfast_lag *lags;         /* (n_lags), ascending */
    const hf_real *used;              /* (n_lanes) 1 for taxels that contribute; 0 for ignored
                                         ones, and for lanes without a taxel */
    const hf_real *rotations;         /* (9 n_lanes) from taxel frame to fingertip frame: of each
                                         finger R_00 of all lanes, R_01, ...; 0 of ignored taxels */
    const hf_real *positions;         /* (3 n_lanes) from the centroid, in radii of the patch */
} holdfast_hand;

/* A head. Output k has the value
 *
 *     z_k = w_k0 + sum_j w_kj phi_j + sum_j q_j min(|u_j|, 5)^2,  u_j = (phi_j - mean_j) / scale_j
 *
 * over the first features of the finger, in their order. Mean, scale and calibration are folded
 * into w. Its numbers stand in `weights` of the model: (n_outputs, 1 + n_features) w, then with
 * squares (3, n_features) mean, 1 / scale and q. */
typedef struct {
    size_t n_outputs;  /* 0: the model has no such head */
    size_t n_features; /* up to the last one that it uses */
    size_t first;      /* its first number in `weights` */
    bool has_squares;
    hf_real threshold; /* of the probability */
    hf_real gain;      /* share of a new sample in the smoothed z; 1 without smoothing */
    hf_real hold;      /* time for which a slip is still reported [s] */
    hf_real highest;   /* speed [mm/s] */
    int32_t causes[6]; /* (n_outputs) cause of each output, ascending; of the cause alone */
} holdfast_head;

/* Heads and limits of a finger. */
typedef struct {
    holdfast_head heads[4]; /* (HOLDFAST_N_HEADS) */
    int32_t contact;        /* HOLDFAST_ALWAYS_CONTACT, ... */
    hf_real contact_limit;  /* [unit of the readings], or a multiple of the noise */
} holdfast_rule;

/* Tables of a detector: constants. */
typedef struct {
    const holdfast_hand *hand;
    const holdfast_rule *rules; /* (n_fingers) */
    const hf_real *weights;     /* (n_weights) */
    size_t n_weights;
    size_t n_model_fingers; /* a hand of one is STABLE by one finger, else by two; but by one if
                               all others are dead */
    hf_real hysteresis;     /* of the threshold of stability, on both sides */
    hf_real min_duration;   /* that a state must last before it is reported [s] */
    hf_real hold;           /* time for which UNSTABLE is held [s] */
    bool has_filter;        /* the forward filter is used */
    hf_real switching;      /* how often a contact turns from one state to the other [1/s] */
} holdfast_model;

/* Estimate of a finger. Numbers that the model does not give are NaN. */
typedef struct {
    double time;     /* of its last sample [s] */
    int32_t state;   /* HOLDFAST_UNKNOWN, ... */
    int32_t reason;  /* HOLDFAST_TARE, ...: why it is UNKNOWN; HOLDFAST_LOAD, ... */
    int32_t cause;   /* HOLDFAST_CAUSE_CLOSING, ... */
    uint32_t faults; /* HOLDFAST_NOT_FINITE, ... */
    /* Bit i % 64 of word i / 64: taxel i of the finger is faulty by itself. */
    uint64_t faulty_taxels[HOLDFAST_MASK_WORDS];
    hf_real stable_probability; /* NaN while UNKNOWN */
    hf_real slip_probability;
    hf_real slip_speed;    /* [mm/s] */
    hf_real slip_distance; /* slid since the slip began [mm] */
    hf_real instability;   /* sigma [unit of the readings] */
    hf_real force[3];      /* F_tip in the fingertip frame [unit of the readings] */
} holdfast_finger_estimate;

#include "memory.h"

/* Each file can be compiled by itself: then HF_SHARED, before functions that files share, and
 * HF_API, before those of the interface, give names to the linker. A file that joins the others
 * (holdfast.c) defines HF_SHARED as static: compilers then see all functions, and an exported
 * header is part of each source file that includes it. */
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

/* Return NULL if the tables fit each other and `holdfast_check` passes, else what is wrong. */
HF_API const char *holdfast_check_model(const holdfast_model *model);

#ifndef HOLDFAST_N_FINGERS
/* Return the size of the memory of a detector, beside its struct [bytes]. */
HF_API size_t holdfast_detector_size(const holdfast_model *model);

/* Set the arrays of a detector to parts of a block of that size, aligned as for double. */
HF_API void holdfast_detector_use_memory(
    const holdfast_model *model, holdfast_detector_memory *d, void *block);
#endif

/* Set a detector to that before the first sample.
 *
 * baseline: (n_taxels, 3) readings without contact, of all fingers; NULL for none. */
HF_API void holdfast_start(
    const holdfast_model *model, holdfast_detector_memory *d, const hf_real *baseline);

/* Set the decisions alone to those before the first sample. */
HF_API void holdfast_start_decisions(const holdfast_model *model, holdfast_detector_memory *d);

/* Fill (n_taxels, 3) with the tare of a finger. Return whether it is complete. */
HF_API bool holdfast_baseline(
    const holdfast_model *model, const holdfast_detector_memory *d, size_t finger, hf_real *out);

/* Process one sample of a hand, and fill (n_fingers) estimates. Return the state of the hand.
 *
 * time, readings, present: as of `holdfast_advance`. */
HF_API int32_t holdfast_detect(
    const holdfast_model *model, holdfast_detector_memory *d, double time, const hf_real *readings,
    const bool *present, holdfast_finger_estimate *estimates);

/* Fill (n_fingers) estimates of the last sample again. */
HF_API void holdfast_estimates(
    const holdfast_model *model, holdfast_detector_memory *d, holdfast_finger_estimate *estimates);

#ifdef __cplusplus
}
#endif

#endif
