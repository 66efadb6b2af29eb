/* The detector of holdfast: from the features of a finger to its contact state.
 *
 * What it is
 *   `holdfast_advance` (kernel.h) computes the features of each finger at a sample. The detector
 *   decides from them:
 *
 *     features -> contact? (contact.c) -> heads: stable, slip, slip_speed, cause (heads.c)
 *              -> forward filter, hysteresis, hold, minimum duration (decision.c)
 *              -> state of each finger and of the hand, events (detector.c)
 *
 *   A finger without features is UNKNOWN at once, but a fault that leaves a force is reported only
 *   when it has lasted. The state machine of a finger in contact:
 *
 *     NO_CONTACT --touch--> UNSTABLE --hold time over, p >= threshold--> STABLE
 *         ^                    ^  |                                        |
 *         +----- at rest ------+  +----- p < threshold, or a jerk <--------+
 *
 * The life of a detector
 *   1. Tables (`holdfast_model`) are constants: those of the kernel, and heads and limits of each
 *      finger. `holdfast_check_model` refuses those that do not fit, once.
 *   2. Memory (`holdfast_detector_memory`): the caller's, `holdfast_detector_size` bytes given to
 *      `holdfast_detector_use_memory`; with sizes as macros the struct holds all of it.
 *   3. `holdfast_start` sets the memory to that before the first sample. Call it again to reset.
 *   4. `holdfast_detect` processes a sample and fills an estimate of the caller.
 *   In an exported header, `holdfast_init` and `holdfast_update` do 3 and 4 with its tables.
 */
#ifndef HF_DETECTOR_H
#define HF_DETECTOR_H

#include "kernel.h"

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

/* Fault beside those of the kernel: the force without contact crept over the threshold of contact.
 * Other bits belong to the source of the samples. */
enum { HOLDFAST_TARE_DRIFT = 128 };

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
    size_t n_model_fingers; /* a hand of one is STABLE by one finger, else by two */
    hf_real hysteresis;     /* of the threshold of stability, on both sides */
    hf_real min_duration;   /* that a state must last before it is reported [s] */
    hf_real hold;           /* time for which UNSTABLE is held [s] */
    bool has_filter;        /* the forward filter is used */
    hf_real switching;      /* how often a contact turns from one state to the other [1/s] */
    bool zero_unknown;      /* the first samples are load, and no readings without are known */
} holdfast_model;

/* What is remembered of the decisions about a finger. Times are NaN where there was none.
 *
 * Who changes it: contact.c excess, smoothed, restless_at, rest, peak, shaken_at and loaded_at;
 * heads.c scores and all about slips; decision.c the rest. */
typedef struct {
    int32_t state;            /* that is reported */
    int32_t candidate;        /* of the last sample; may not have lasted long enough yet */
    int32_t excess;           /* how the load came over the threshold of contact, see contact.c */
    int32_t cause;            /* while unstable */
    bool slips;               /* the finger is decided to slide */
    bool is_unsteady;         /* the load came or went at the last sample, see contact.c */
    hf_real probability;      /* of stability; NaN without an estimate */
    double candidate_since;   /* [s] */
    double last_unstable;     /* last sample that was unstable before the hold time [s] */
    hf_real smoothed;         /* F_a, smoothed over 1 s; NaN before */
    double restless_at;       /* when the finger was last not calm [s] */
    hf_real rest[3];          /* F_tip without contact, beyond the tare */
    hf_real peak;             /* largest load so far, slowly forgotten */
    double shaken_at;         /* when sigma was last much larger than that of noise [s] */
    double loaded_at;         /* when the load was last that of a contact [s] */
    hf_real filtered;         /* log odds by the forward filter; NaN before its first sample */
    double filtered_at;       /* time of that sample [s] */
    hf_real slip_log_odds;    /* smoothed; NaN before its first sample */
    hf_real slip_probability; /* NaN without an estimate */
    double last_slip;         /* last sample over the threshold [s] */
    hf_real speed;            /* of the slip [mm/s]; NaN without an estimate */
    hf_real distance;         /* slid since the slip began [mm]; likewise */
    double slid_at;           /* last sample that slides [s]; NaN while it does not slide */
    hf_real scores[6];        /* (HOLDFAST_N_CAUSES) sums of z since the contact is unstable */
} holdfast_decision;

/* Memory of a detector. */
typedef struct {
    holdfast_memory memory;
    HF_ARRAY(holdfast_decision, decisions, HOLDFAST_N_FINGERS);
    int32_t state; /* of the hand */
} holdfast_detector_memory;

/* Why a finger is UNSTABLE whatever its probability. They follow HOLDFAST_FAULT of kernel.h. */
enum {
    HOLDFAST_LOAD = 5, /* a large share of the load comes or goes */
    HOLDFAST_HOLD = 6  /* it was unstable within the hold time, or STABLE has not lasted yet */
};

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

#ifdef __cplusplus
extern "C" {
#endif

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
