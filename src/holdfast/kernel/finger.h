/* What the parts of the kernel share: a finger at a sample, and small functions on numbers. */
#ifndef HF_FINGER_H
#define HF_FINGER_H

#include "holdfast.h"
#include "lanes.h"

#define HF_SQRT_2 ((hf_real)1.4142135623730951)

/* A step in time of more sample periods is a gap, as in recordings (GAP_PERIODS). The part over 3
 * allows for rounding. */
#define HF_GAP_LIMIT_PERIODS ((hf_real)3.0003)
/* Longest gap that windows in seconds bridge: 0.1 s, with an allowance for rounding. */
#define HF_MAX_BRIDGED_SECONDS ((hf_real)0.10001)

/* Squares of features are of values of at most this many standard deviations: a moderate jolt of
 * the taxels is a slip, a larger one no stronger sign of it. */
#define HF_MAX_DEVIATION ((hf_real)5)

/* Least share of a finger's second differences in one noisy taxel: a touch spreads over the skin
 * to neighbouring taxels. */
#define HF_LONE_SHARE ((hf_real)0.9)
/* Taxels from which one may count as noisy; of fewer, one may be touched alone. */
#define HF_MIN_TAXELS ((hf_real)4)
/* Time constant with which the largest load so far is forgotten [s]. */
#define HF_LOAD_DECAY_SECONDS ((hf_real)5)
/* Noise in the denominator: changes of a load below this many times its noise count less. It is
 * also the least load of a grip (contact.c). */
#define HF_NOISE_WEIGHT ((hf_real)100)
/* Share of the largest load that a released skin may still show. */
#define HF_RELEASED_SHARE ((hf_real)0.08)

/* Faults of a finger whose samples no window may hold, though they have a force. */
enum { HF_SERIOUS = HOLDFAST_STUCK | HOLDFAST_NOISY };

/* One finger: its constants, and its part of the memory. Lanes of taxels count from its first. */
typedef struct {
    const holdfast_hand *hand;
    const holdfast_finger *finger;
    holdfast_finger_memory *state;
    const holdfast_finger_memory *fingers; /* of all */
    holdfast_values *values;
    size_t n_taxels;
    size_t n;                 /* lanes: n_taxels rounded up */
    const hf_real *used;      /* (n) 1 for taxels that contribute, else 0 */
    const hf_real *rotations; /* (9, n) */
    const hf_real *positions; /* (3, n) */
    hf_real *readings;        /* (3, n), as those that follow */
    hf_real *previous;
    hf_real *baseline;
    hf_real *reference;
    hf_real *changes;
    hf_real *moved;
    hf_real *pressed; /* (n) */
    hf_real *shares;  /* (4, n) */
    hf_real *powers;  /* (2, n) */
    holdfast_taxel *taxels;
    holdfast_mask *masks;
    hf_real *levels; /* (n) */
    holdfast_laws *laws;
    hf_real *history;
    hf_real *blocks;
    holdfast_track *track;
    hf_real *taxel_forces; /* of the first sample in the ring */
    hf_real *slides;       /* likewise */
    hf_real *relative;
    hf_real *averages;
} hf_finger;

static inline size_t hf_n_lanes(size_t n_taxels)
{
    return (n_taxels + HF_LANES - 1) / HF_LANES * HF_LANES;
}

/* Return the taxel forces of a finger (3, n) at an index of the ring. */
static inline hf_real *hf_forces_at(const hf_finger *f, size_t index)
{
    return f->taxel_forces + index * 3 * HF_N_LANES(f->hand);
}

/* Return the words of a set that a finger needs. */
static inline size_t hf_n_words(const hf_finger *f)
{
    return HOLDFAST_MASK_WORDS > 1 ? (f->n_taxels + 63) / 64 : 1;
}

static inline bool hf_has(const holdfast_taxel_set *set, size_t taxel)
{
    return set->words[taxel / 64] >> taxel % 64 & 1;
}

static inline void hf_include(holdfast_taxel_set *set, size_t taxel)
{
    set->words[taxel / 64] |= (uint64_t)1 << taxel % 64;
}

static inline void hf_clear(holdfast_taxel_set *set)
{
    const holdfast_taxel_set none = {{0}};
    *set = none;
}

static inline void hf_remove(holdfast_taxel_set *set, size_t taxel)
{
    set->words[taxel / 64] &= ~((uint64_t)1 << taxel % 64);
}

/* Add the taxels of another set. */
static inline void hf_unite(
    const hf_finger *f, holdfast_taxel_set *set, const holdfast_taxel_set *other)
{
    for (size_t k = 0; k < hf_n_words(f); ++k) {
        set->words[k] |= other->words[k];
    }
}

/* Remove the taxels of another set. */
static inline void hf_exclude(
    const hf_finger *f, holdfast_taxel_set *set, const holdfast_taxel_set *other)
{
    for (size_t k = 0; k < hf_n_words(f); ++k) {
        set->words[k] &= ~other->words[k];
    }
}

static inline bool hf_is_empty(const hf_finger *f, const holdfast_taxel_set *set)
{
    uint64_t any = 0;
    for (size_t k = 0; k < hf_n_words(f); ++k) {
        any |= set->words[k];
    }
    return any == 0;
}

static inline bool hf_are_equal(
    const hf_finger *f, const holdfast_taxel_set *a, const holdfast_taxel_set *b)
{
    uint64_t differences = 0;
    for (size_t k = 0; k < hf_n_words(f); ++k) {
        differences |= a->words[k] ^ b->words[k];
    }
    return differences == 0;
}

/* Return the row of a ring that lies n rows before another; faster than a remainder. */
static inline size_t hf_row_before(size_t row, size_t n, size_t length)
{
    return row >= n ? row - n : row + length - n;
}

/* Return the force in the ring of the history that lies `back` samples before the newest. */
static inline const hf_real *hf_history(const hf_finger *f, size_t back)
{
    return f->history + hf_row_before(f->state->row, back, HF_N_HISTORY(f->hand)) * HF_N_COMPONENTS;
}

static inline void hf_fill(hf_real *values, size_t n, hf_real value)
{
    for (size_t i = 0; i < n; ++i) {
        values[i] = value;
    }
}

/* Return |v|^2. */
static inline hf_real hf_square(const hf_real v[3])
{
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

static inline hf_real hf_dot(const hf_real a[3], const hf_real b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#ifdef __GNUC__
#define HF_APART __attribute__((noinline))
#else
#define HF_APART
#endif

/* Functions of one file that others call. Each is explained where it is defined. */

/* Sums over the taxels at a sample. */
typedef struct {
    hf_real force[3];         /* F_tip */
    hf_real normal;           /* sum of the normal readings: z in the taxel frames */
    hf_real weight;           /* sum p_i */
    hf_real squares;          /* sum |h_i|^2 */
    hf_real moved;            /* sum of the squared steps of the taxels */
} hf_taxel_sums;

/* Squared motion of the taxels against their mean, and its part along the normal. */
typedef struct {
    hf_real moved;
    hf_real pressed;
} hf_residual;

/* Three samples of a second difference: a g(k) - 2 g(k-s) + c g(k-2s). */
typedef struct {
    size_t now; /* indices in the ring */
    size_t before;
    size_t first;
    hf_real newest; /* weight a; 1 at even times */
    hf_real oldest; /* weight c; 1 at even times */
} hf_second;

/* Sums over the normal parts p_i = g_i . n of the taxels. */
typedef struct {
    hf_real risen;         /* sum max(p_i, 0) */
    hf_real risen_squares; /* sum max(p_i, 0)^2 */
    hf_real squares;       /* sum p_i^2 */
    hf_real all;           /* sum |g_i|^2 */
} hf_normal_sums;

/* taxels.c */
HF_SHARED hf_real hf_sum_taxels(const hf_finger *f, const hf_real *baseline, hf_real force[3]);
HF_SHARED hf_taxel_sums hf_turn_taxels(const hf_finger *f, size_t now, size_t before);
HF_SHARED hf_real hf_moment(const hf_finger *f, size_t now, hf_real centre[3]);
HF_SHARED hf_residual
hf_residual_of(const hf_finger *f, size_t now, size_t then, const hf_real mean[3]);
HF_SHARED hf_normal_sums hf_sum_normals(const hf_finger *f, size_t now);

/* Mean and spread of a window. */
typedef struct {
    hf_real m;        /* equation 1 */
    hf_real variance; /* the square of sigma, equation 2 */
} hf_moments;

/* window.c */
HF_SHARED hf_moments hf_newest_moments(const hf_finger *f, size_t channel, size_t window);
HF_SHARED hf_real hf_noise_sigma(hf_real noise, size_t window);
HF_SHARED void hf_append_force(const hf_finger *f, const hf_real force[3]);

/* Summary of the readings of a finger. */
typedef struct {
    hf_real total; /* weighted sum; finite if all readings are */
    hf_real least;
    hf_real most;
    hf_real axes[3]; /* sum of each axis */
    hf_sum lanes;    /* weighted sum of each lane */
} hf_scan;

/* faults.c */
HF_SHARED hf_scan hf_scan_readings(const hf_finger *f, const hf_real *readings);
HF_SHARED holdfast_taxel_set hf_taxels_outside(const hf_finger *f, hf_real low, hf_real high);
HF_SHARED holdfast_taxel_set hf_find_invalid(const hf_finger *f, uint32_t *faults);
HF_SHARED bool hf_is_dead(const hf_finger *f);
HF_SHARED bool hf_has_moved(const hf_finger *f, size_t i);
HF_SHARED bool hf_are_moving(const hf_finger *f);
HF_SHARED void hf_note_constant(const hf_finger *f, const hf_scan *scan);
HF_SHARED bool hf_is_stuck(const hf_finger *f);
HF_SHARED bool hf_is_pulled(const hf_finger *f, hf_real normal);
HF_SHARED bool hf_has_reading(const hf_real *readings, size_t n, size_t i);
HF_SHARED void hf_track_changes(const hf_finger *f, double time, bool after_gap);

/* After this time without a sample, a recording that is played again may return [s]. */
#define HF_PAUSE_SECONDS ((hf_real)0.5)

/* laws.c */
HF_SHARED void hf_forget_returns(const hf_finger *f);
HF_SHARED uint32_t hf_broken_laws(const hf_finger *f, const hf_scan *scan);
HF_SHARED void hf_find_fallen_taxels(const hf_finger *f, bool after_gap);
HF_SHARED void hf_find_copies(
    const holdfast_hand *hand, holdfast_memory *memory, const bool *present);

/* implausible.c */
HF_SHARED void hf_take_out_jumps(const hf_finger *f);
HF_SHARED bool hf_find_jumps(const hf_finger *f, const hf_scan *scan, holdfast_taxel_set *jumps);
HF_SHARED uint32_t hf_find_implausible(const hf_finger *f, const hf_scan *scan);
HF_SHARED uint32_t hf_follow_rezero(const hf_finger *f, double time);
HF_SHARED bool hf_touches_rezeroed(const hf_finger *f);

/* tare.c: how far the first sample is known to be a reading */
enum { HF_PROVISIONAL, HF_SETTLES, HF_CONFIRMED };
HF_SHARED void hf_begin_again(const hf_finger *f, double time);
HF_SHARED void hf_confirm_zero(const hf_finger *f, double time);
HF_SHARED bool hf_update_tare(const hf_finger *f, hf_real elapsed);

/* field.c */
HF_SHARED uint32_t hf_take_out_field(const hf_finger *f);

/* masks.c */
HF_SHARED void hf_note_saturated(const hf_finger *f);
HF_SHARED void hf_hold_lost(const hf_finger *f);
HF_SHARED void hf_lose_taxels(
    const hf_finger *f, uint32_t faults, const holdfast_taxel_set *invalid);
HF_SHARED bool hf_replace_invalid(const hf_finger *f, const holdfast_taxel_set *invalid);
HF_SHARED bool hf_mask_taxels(const hf_finger *f, const holdfast_taxel_set *faulty, double time);

/* How the normal readings of the taxels change in the first touch (motion.c). */
enum { HF_FIRST_TOUCH, HF_ALIKE, HF_OPPOSED };

/* motion.c. Not inline: gcc computes them 4 % slower as a part of their caller. */
HF_SHARED HF_APART hf_real hf_append_taxels(const hf_finger *f, double time, hf_real force[3]);
HF_SHARED HF_APART void hf_update_motion(const hf_finger *f, double time);

/* sliding.c */
HF_SHARED HF_APART void hf_append_slide(
    const hf_finger *f, size_t now, double time, hf_real step);
HF_SHARED HF_APART void hf_fill_slide(
    const hf_finger *f, const holdfast_lag *lag, size_t now, size_t then, hf_real *out);
HF_SHARED HF_APART void hf_fill_energies(
    const hf_finger *f, uint64_t kinds, hf_second at, hf_real step, hf_real *averages,
    hf_real *out);

/* stream.c */
HF_SHARED hf_finger hf_finger_of(const holdfast_hand *hand, holdfast_memory *memory, size_t index);
HF_SHARED void hf_copy_to_lanes(const hf_finger *f, const hf_real *rows, hf_real *lanes);
HF_SHARED void hf_clear_values(holdfast_values *values);

/* tables.c */
HF_SHARED bool hf_are_finite(const hf_real *values, size_t n);
HF_SHARED void hf_begin_finger(const hf_finger *f);

#endif
