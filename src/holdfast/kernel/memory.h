/* The memory of a stream and of a detector: a part of holdfast.h, which includes it. */
#ifndef HF_MEMORY_H
#define HF_MEMORY_H

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
    /* Of each axis of a magnetometer, in intervals of 0.15 s: */
    int32_t n_same[3];       /* intervals since the last with a change */
    int32_t longest_same[3]; /* most of these that were no fault */
    int32_t n_differed[3];   /* intervals with a change */
} holdfast_taxel;

/* What replaces a taxel that is left out (masks.c). */
typedef struct {
    hf_real last_healthy[3]; /* reading beyond rest when the mask last changed */
    hf_real fade[3];         /* is added to the reading of a taxel that came back */
    hf_real jump[3];         /* by which the reading is off since a jump (implausible.c) */
    double masked_at;        /* time from which it is left out [s] */
    bool unweighed;          /* it is left out, and its share of the load is not known */
} holdfast_mask;

/* What shows whether a finger keeps the laws of a living skin (laws.c). 0 before the first sample;
 * an update is a sample that changed a reading. */
typedef struct {
    /* Time: */
    int64_t n_updates;
    uint32_t recent[HF_RUN * HF_LANES];    /* of each of the last updates, a hash of each lane */
    uint64_t runs[HF_LANES];               /* of each lane, a hash of these */
    uint64_t marks[HF_LANES * HF_N_MARKS]; /* of every HF_RUN-th update, see hf_return */
    uint16_t tags[HF_LANES * HF_N_MARKS];  /* their upper bits: these are searched */
    int64_t n_returned;                    /* updates since a return was found; 0 without one */
    int32_t n_left;                        /* updates after which it is over, if no other is found */
    bool is_repeated;                      /* enough readings and channels of it differ */
    /* Axes: */
    hf_real axes[3];      /* sums of the readings */
    int64_t n_wide;       /* updates of all lanes but one; the next three count these */
    int64_t n_rested[3];  /* that left an axis as it was */
    int64_t n_same[3];    /* the last of these in a row */
    int64_t longest_rest[3]; /* most in a row that did, by no fault */
    int64_t n_equal[3];   /* changes of the axis while it was equal to the next one */
    bool is_resting;      /* some axis did not change, or is equal to another */
    /* Taxels: */
    size_t taxel;              /* that is compared with the others at this update */
    bool is_watching;          /* some have been equal to it for some updates */
    holdfast_taxel_set alike;  /* these */
    int32_t n_watched;         /* these updates */
    int32_t n_alike;           /* those that changed it */
    holdfast_taxel_set equals; /* taxels that break the law */
    bool has_equals;           /* there are some */
    holdfast_taxel_set fallen; /* taxels whose noise has gone */
    bool has_fallen;           /* there are some */
    int64_t n_settled;         /* updates since the last gap */
    int64_t n_levelled;        /* updates since these taxels were looked for */
    int64_t n_steady;          /* times that none had fallen */
    /* Modules: */
    hf_real total;     /* weighted sum of the readings, see hf_scan; NaN if they are not valid */
    bool has_changed;  /* with the last sample */
    int64_t n_copied;  /* changes while the finger was equal to another */
    size_t copy_of;    /* index of that finger */
    uint32_t faults;   /* of the finger as a whole at the last update */
} holdfast_laws;

/* A sample in the ring of relative features (motion.c). */
typedef struct {
    double time;         /* [s] */
    hf_real force[3];    /* F_tip */
    hf_real pressure[3]; /* centre of pressure, in radii of the patch */
    hf_real moment;      /* about the normal, divided by the radius */
    /* With features of sliding (sliding.c): */
    hf_real amplitude;       /* |F_tip| */
    hf_real centre[3];       /* centre of pressure in the taxels' own frames, in radii */
    hf_real friction;        /* of tangential to normal force */
    hf_real taxel_friction;  /* the same of the taxels, by their share of the load */
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
    hf_real rounding;        /* of both by the rounding of this sample; 0 unless it rests at zero */
    hf_real least_noise;     /* of the blocks that are complete; infinite before */
    hf_real least_taxel_noise;
    hf_real block_squares; /* of the steps of F_tip in the block that is not complete */
    hf_real block_taxel_squares;
    int64_t block_steps;       /* their number */
    double block_start;        /* [s]; NaN before the first sample */
    double moved_at;           /* when the force last moved by much more than its noise [s] */
    hf_real moved_by;          /* change of the force over HF_MOVE_SECONDS */
    hf_real contact_zero[3];   /* F_tip without contact: of the tare, or of a release since */
    int32_t poles;             /* whether the normal readings have opposite signs in a touch */
    hf_real contact_load;      /* force beyond contact_zero, or of the taxels */
    hf_real peak_contact_load; /* the largest so far, slowly forgotten */
} holdfast_motion;

/* What features of sliding remember of a finger (sliding.c). */
typedef struct {
    hf_real noise;       /* s: of a reading */
    hf_real force_noise; /* s sqrt(m) */
    hf_real weight;      /* sum of the normal readings' sizes; not 0 */
    hf_real load;        /* L: the same, or 10 times the noise */
    hf_real tangent[3];  /* direction of the tangential force */
    hf_real friction;    /* averaged over 20 ms; NaN before the first sample */
    double block_start;  /* of the block of time [s] */
    hf_real largest;     /* such friction of this block */
    hf_real past[HF_N_FRICTION_BLOCKS]; /* element j: the largest of the j blocks before it */
} holdfast_slide;

/* Memory of a finger. */
typedef struct {
    /* Time and stretches (stream.c). */
    double first_time; /* of the first valid sample [s]; NaN before */
    double last_time;  /* of the last sample [s]; NaN before */
    int64_t n_seen;    /* valid samples so far */
    int64_t n_stretch; /* forces since a gap, a refused sample or a fault: the windows hold these */
    bool after_gap;    /* a stretch after a gap warms up */
    bool is_alive;     /* a reading has changed, or the finger rests at zero as it may (faults.c) */
    size_t row;        /* of the newest force in the rings of history and blocks */
    /* Tare and noise (tare.c). */
    int32_t zero;           /* whether the first sample is confirmed to be a reading */
    double provisional_end; /* when it is at the latest [s] */
    hf_real first_step;     /* norm of the first change of the readings; 0 before */
    hf_real first_size;     /* norm of the readings before it */
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
    /* All readings went to rest at once, in a hold (implausible.c). */
    bool is_rezeroed;      /* and nothing has touched since */
    double rezeroed_at;    /* when [s] */
    hf_real lost_force[3]; /* F_tip of the sample before */
    hf_real least_normal;  /* least F_tip . n since */
    /* Jumps that stay (implausible.c). */
    holdfast_taxel_set offset_taxels; /* taxels that have one */
    bool has_offsets; /* there are some, or a jump of the last sample that may stay */
    hf_real shown;    /* most that all taxels but one moved at once: sum of squares */
    /* Implausible samples (implausible.c). */
    holdfast_taxel_set jumped; /* taxels that were refused as a jump at the last sample */
    hf_real rest_sum;          /* weighted sum of the readings at rest, see hf_scan; NaN before */
    holdfast_motion motion;
    holdfast_slide slide;
    /* Readings that never changed (faults.c): last, as a living finger does not read it. */
    int64_t n_constant;   /* samples before the first that changed a reading */
    hf_real constant_sum; /* weighted sum of their readings, see hf_scan */
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
    HF_ARRAY(holdfast_laws, laws, HOLDFAST_N_FINGERS);
    HF_ARRAY(hf_real, readings, 3 * HOLDFAST_N_LANES);  /* of this sample */
    HF_ARRAY(hf_real, previous, 3 * HOLDFAST_N_LANES);  /* of the last valid sample */
    HF_ARRAY(hf_real, baseline, 3 * HOLDFAST_N_LANES);  /* a sum while the tare runs */
    HF_ARRAY(hf_real, reference, 3 * HOLDFAST_N_LANES); /* forces at the least normal force */
    HF_ARRAY(hf_real, pressed, HOLDFAST_N_LANES);       /* |h_i . n| of the last sample */
    HF_ARRAY(hf_real, shares, 4 * HOLDFAST_N_LANES);    /* likewise, see sliding.c */
    HF_ARRAY(hf_real, changes, 3 * HOLDFAST_N_LANES);   /* last change of each taxel */
    HF_ARRAY(hf_real, moved, 3 * HOLDFAST_N_LANES);     /* sum of the sizes of the changes of this
                                                           interval of 0.15 s */
    HF_ARRAY(hf_real, powers, 2 * HOLDFAST_N_LANES);    /* smoothed mean squares of its first and
                                                           of its second differences */
    HF_ARRAY(hf_real, levels, HOLDFAST_N_LANES);        /* least of the second differences of each
                                                           taxel; 0 before */
    /* (n_fingers, n_history, 4) and (n_fingers, n_history, n_channels, n_levels, 3): rings. */
    HF_ARRAY(hf_real, history, HOLDFAST_N_FINGERS * HOLDFAST_N_HISTORY * HF_N_COMPONENTS);
    HF_ARRAY(hf_real, blocks, HOLDFAST_N_FINGERS * HOLDFAST_N_HISTORY * HOLDFAST_N_CHANNELS *
                                  HOLDFAST_N_LEVELS * HF_N_SUMS);
    /* (n_fingers, n_track) and (n_track, 3 n_lanes): rings. */
    HF_ARRAY(holdfast_track, track, HOLDFAST_N_FINGERS * HOLDFAST_N_TRACK);
    HF_ARRAY(hf_real, taxel_forces, HOLDFAST_N_TRACK * 3 * HOLDFAST_N_LANES);
    /* (n_slides, 3 n_lanes): the same in the taxels' own frames, a ring. */
    HF_ARRAY(hf_real, slides, (HOLDFAST_N_SLIDES + 1) * 3 * HOLDFAST_N_LANES);
    /* (n_fingers, n_lags, HOLDFAST_N_RELATIVE) and (n_fingers, n_lags, HF_N_AVERAGES). */
    HF_ARRAY(hf_real, relative, HOLDFAST_N_FINGERS * (HOLDFAST_N_LAGS + 1) * HOLDFAST_N_RELATIVE);
    HF_ARRAY(hf_real, averages, HOLDFAST_N_FINGERS * (HOLDFAST_N_LAGS + 1) * HF_N_AVERAGES);
    HF_ARRAY(hf_real, own, HOLDFAST_N_FINGERS * HOLDFAST_N_FEATURES); /* before `of_hand` */
    HF_ARRAY(hf_real, of_hand, HOLDFAST_N_FEATURES); /* that maximum, if the fingers are alike */
} holdfast_memory;
/* clang-format on */

/* What is remembered of the decisions about a finger. Times are NaN where there was none.
 *
 * Who changes it: contact.c excess, all from smoothed to echo; heads.c scores and all about slips;
 * decision.c the rest. */
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
    hf_real smoothed;         /* F_a over 1 s, or the load over 3 s; NaN before */
    double block_start;       /* of a block of 0.5 s [s]; NaN before */
    hf_real loads[2];         /* largest loads of the block before, and of this one */
    double restless_at;       /* when the finger was last not calm [s] */
    hf_real rest[3];          /* F_tip without contact, beyond the tare */
    hf_real peak;             /* largest load so far, slowly forgotten */
    double shaken_at;         /* when sigma was last much larger than that of noise [s] */
    double loaded_at;         /* when the load was last that of a contact [s] */
    hf_real echo;             /* least load since it was; 0 before */
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

#endif
