/* Laws that every living skin keeps: of its readings in time, taxels, axes and modules.
 *
 * They look at changes alone: what is constant, or exactly zero, proves nothing. An update is a
 * sample that changed a reading: a value that is sent twice is no repeat. A sample that breaks a
 * law as a whole is refused (REPEATED, STUCK), or has no features (COPIED); of EQUAL_TAXELS, and of
 * taxels whose noise has gone (STUCK), the taxels are left out.
 *
 * Memory of a finger: sizeof(holdfast_laws), 2.0 KB (1.8 in single precision and with 64 taxels),
 * of which 1.6 for the law of time, whatever the number of taxels; and a number for each taxel. */
#include "finger.h"

enum {
    HF_MIN_VARYING = 12,  /* channels (axes of taxels) that change in a return: few do by chance */
    HF_MIN_RETURNED = 9,  /* the same, where a lane of the taxels is left out */
    HF_MIN_SHARED = 20,   /* changes for which taxels, axes or fingers are equal by a fault */
    HF_MAX_WATCHED = 160, /* updates in which a taxel must change so often, to be compared */
    HF_MAX_STILL = 8      /* updates that leave a taxel as it is, at most, of one with noise */
};
/* An axis is frozen if it rests for this long [s], and for this many times as long as ever. */
#define HF_FROZEN_SECONDS ((hf_real)0.5)
#define HF_FROZEN_RATIO ((hf_real)10)
/* Time between comparisons of the noise of the taxels, and time after a gap without one [s]. */
#define HF_LEVEL_SECONDS ((hf_real)0.25)
#define HF_SETTLING_SECONDS ((hf_real)1)
/* Time for which the noise must have kept its level [s]. */
#define HF_STEADY_SECONDS ((hf_real)5)
/* Share of the second differences that are left when noise has gone: a tenth, squared. */
#define HF_FALLEN_SHARE ((hf_real)0.01)
/* The level follows lower ones by this factor: a hundredth takes it 11 s. */
#define HF_LEVEL_DECAY ((hf_real)0.9)

/* Multipliers of hashes: odd, with bits at random; of a run, and its power HF_RUN. */
#define HF_HASH_FACTOR UINT64_C(0x9E3779B97F4A7C15)
#define HF_RUN_FACTOR UINT64_C(0X9E6C63D0876A9A4B)
#define HF_RUN_POWER UINT64_C(0X2A9DAC3FAA9F06C1)

/* Append a sample to the runs of the lanes. Return how many lanes it changes. */
static size_t hf_append_update(holdfast_laws *w, const hf_scan *scan)
{
    /* run = sum_j B^j h(k - j), of the hashes h of the last HF_RUN updates. */
    uint32_t *const oldest = &w->recent[w->n_updates % HF_RUN * HF_LANES];
    const uint32_t *const newest = &w->recent[(w->n_updates + HF_RUN - 1) % HF_RUN * HF_LANES];
    uint32_t hashes[HF_LANES];
    size_t n_changed = 0;
    for (size_t l = 0; l < HF_LANES; ++l) {
        const double sum = (double)scan->lanes.lane[l];
        uint64_t bits;
        memcpy(&bits, &sum, sizeof bits);
        hashes[l] = (uint32_t)(((bits ^ bits >> 32) + l + 1) * HF_HASH_FACTOR >> 32);
        n_changed += hashes[l] != newest[l];
    }
    if (n_changed == 0) {
        return 0;
    }
    for (size_t l = 0; l < HF_LANES; ++l) {
        w->runs[l] = w->runs[l] * HF_RUN_FACTOR + hashes[l] - oldest[l] * HF_RUN_POWER;
        oldest[l] = hashes[l];
    }
    w->n_updates += 1;
    return n_changed;
}

/* Return whether three of the last updates differ without a lane. Two in turn are no ring: readings
 * with little noise go to and fro by one step. */
static bool hf_has_three_readings(const holdfast_laws *w, size_t left_out)
{
    uint32_t sums[HF_RUN] = {0}, second = 0;
    for (size_t k = 0; k < HF_RUN; ++k) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            sums[k] += l == left_out ? 0 : w->recent[k * HF_LANES + l];
        }
        if (sums[k] != sums[0] && second != 0 && sums[k] != second) {
            return true;
        }
        second = sums[k] != sums[0] ? sums[k] : second;
    }
    return false;
}

/* Return how many channels vary without a lane: change now, or did when their taxel last did, while
 * readings returned. */
static size_t hf_count_varying(const hf_finger *f, size_t left_out)
{
    size_t n_varying = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const int64_t still = f->state->n_changes - f->taxels[i].changed_at;
        const bool is_recent = still < HF_RUN + f->laws->n_returned;
        for (size_t k = i; i % HF_LANES != left_out && k < 3 * f->n; k += f->n) {
            n_varying += f->readings[k] != f->previous[k] || (is_recent && f->changes[k] != 0);
        }
    }
    return n_varying;
}

/* Return whether readings return in order, of all taxels but those of one lane at most.
 *
 * Every HF_RUN-th update is marked: by four keys, each of which is a hash of the last HF_RUN
 * updates without one lane. An update returns if it has the key of a mark. Of any lag, one of
 * HF_RUN updates in a row meets a mark: a return that goes on is found after HF_RUN - 1 more. */
static bool hf_return(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    const uint64_t sum = (w->runs[0] + w->runs[1]) + (w->runs[2] + w->runs[3]);
    const size_t mark = (size_t)(w->n_updates / HF_RUN % HF_N_MARKS);
    const bool is_mark = w->n_updates % HF_RUN == 0;
    uint64_t keys[HF_LANES];
    uint16_t is_near = 0;
    for (size_t l = 0; l < HF_LANES; ++l) {
        keys[l] = sum - w->runs[l];
        const uint16_t tag = (uint16_t)(keys[l] >> 48);
        for (size_t m = 0; m < HF_N_MARKS; ++m) {
            is_near |= w->tags[l * HF_N_MARKS + m] == tag;
        }
    }
    w->n_left -= w->n_left > 0;
    w->n_returned = w->n_left > 0 ? w->n_returned + 1 : 0;
    w->is_repeated &= w->n_left > 0;
    for (size_t m = 0; is_near && m < HF_N_MARKS; ++m) {
        size_t left_out = 0, n_equal = 0;
        for (size_t l = 0; l < HF_LANES; ++l) {
            const bool is_equal = w->marks[l * HF_N_MARKS + m] == keys[l];
            left_out = is_equal ? l : left_out;
            n_equal += is_equal;
        }
        left_out = n_equal > 1 ? (size_t)HF_LANES : left_out; /* all returned */
        if (n_equal > 0 && hf_has_three_readings(w, left_out)) {
            w->n_left = HF_RUN;
            const size_t least = left_out < HF_LANES ? HF_MIN_RETURNED : HF_MIN_VARYING;
            w->is_repeated = w->is_repeated || hf_count_varying(f, left_out) >= least;
        }
    }
    for (size_t l = 0; is_mark && l < HF_LANES; ++l) {
        w->marks[l * HF_N_MARKS + mark] = keys[l];
        w->tags[l * HF_N_MARKS + mark] = (uint16_t)(keys[l] >> 48);
    }
    return w->is_repeated;
}

/* Forget the readings to which a finger may return. */
HF_SHARED void hf_forget_returns(const hf_finger *f)
{
    memset(f->laws->marks, 0, sizeof f->laws->marks);
    memset(f->laws->tags, 0, sizeof f->laws->tags);
    f->laws->n_left = 0;
}

/* Return whether an axis of all taxels is frozen, or equal to another, while others change.
 *
 * is_wide: taxels of all lanes but one change. In a hold of a sensor with steps, one or two taxels
 * go on to toggle, of which any axis may rest. */
static bool hf_has_stuck_axis(const hf_finger *f, const hf_scan *scan, bool is_wide)
{
    /* Frozen: more than half of the wide updates before the rest changed it, 0.5 s of them at
     * least, and the rest lasts max(0.5 s, 10 (longest rest before + 1 sample)) of them. Of few
     * channels that vary, those of an axis may rest by chance. */
    holdfast_laws *const w = f->laws;
    const hf_real *const now = scan->axes;
    const hf_real then[3] = {w->axes[0], w->axes[1], w->axes[2]};
    memcpy(w->axes, now, sizeof w->axes);
    w->n_wide += is_wide;
    if (!w->is_resting && now[0] != then[0] && now[1] != then[1] && now[2] != then[2] &&
        now[0] != now[1] && now[1] != now[2] && now[2] != now[0]) {
        return false; /* as usual */
    }
    const hf_real least = HF_FROZEN_SECONDS / f->hand->period;
    const size_t n_least =
        f->n_taxels < HF_MIN_VARYING ? f->n_taxels : (size_t)HF_MIN_VARYING;
    bool is_stuck = false;
    w->is_resting = false;
    for (size_t axis = 0; axis < 3; ++axis) {
        const bool is_new = now[axis] != then[axis];
        const int64_t same = w->n_same[axis], n_changed = w->n_wide - w->n_rested[axis];
        const hf_real limit = HF_FROZEN_RATIO * (hf_real)(w->longest_rest[axis] + 1);
        const bool is_frozen = 2 * n_changed > w->n_wide - same && (hf_real)n_changed >= least &&
                               (hf_real)same >= hf_max(least, limit) &&
                               hf_count_varying(f, HF_LANES) >= n_least;
        if (is_new && same > w->longest_rest[axis] && !is_frozen) {
            w->longest_rest[axis] = same;
        }
        w->n_same[axis] = is_new ? 0 : same + is_wide;
        w->n_rested[axis] += is_wide && !is_new;
        w->n_equal[axis] = now[axis] == now[(axis + 1) % 3] ? w->n_equal[axis] + is_new : 0;
        w->is_resting |= !is_new || w->n_equal[axis] > 0;
        is_stuck |= w->n_equal[axis] >= HF_MIN_SHARED || (is_frozen && !is_new && now[axis] != 0);
    }
    return is_stuck;
}

/* Return whether two taxels have the same reading in all axes. */
static bool hf_are_alike(const hf_finger *f, size_t i, size_t j)
{
    const hf_real *const r = f->readings;
    const size_t n = f->n;
    return r[i] == r[j] && r[n + i] == r[n + j] && r[2 * n + i] == r[2 * n + j];
}

/* Go on to the next taxel. Watch those that are equal to it, if it has just changed. */
static void hf_begin_watch(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    const size_t i = w->taxel = w->taxel + 1 < f->n_taxels ? w->taxel + 1 : 0;
    const hf_wide none = {0}, one = none + 1, own = none + f->readings[i];
    hf_wide counts = none; /* of x, of which most differ */
    for (size_t j = 0; j < f->n; j += HF_WIDTH) {
        counts += hf_where(hf_load(f->readings + j) == own, one, none);
    }
    hf_real n_near[HF_WIDTH], n_equal = 0;
    hf_store(n_near, counts);
    for (size_t l = 0; l < HF_WIDTH; ++l) {
        n_equal += n_near[l];
    }
    if ((n_equal <= 1 && !w->has_equals) || !hf_has_moved(f, i) ||
        !hf_has_reading(f->readings, f->n, i)) {
        return;
    }
    for (size_t j = 0; j < f->n_taxels; ++j) {
        if (j != i && hf_are_alike(f, i, j)) {
            hf_include(&w->alike, j);
            w->is_watching = true;
        }
    }
    w->n_watched = w->n_alike = 0;
    if (!w->is_watching) { /* it is equal to none any more */
        hf_remove(&w->equals, i);
        w->has_equals = !hf_is_empty(f, &w->equals);
    }
}

/* Compare a taxel with those that are watched, until it has changed 20 times. */
static void hf_go_on_watching(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    const size_t i = w->taxel;
    w->n_watched += 1;
    w->n_alike += hf_has_moved(f, i);
    for (size_t j = 0; j < f->n_taxels; ++j) {
        if (hf_has(&w->alike, j) && !hf_are_alike(f, i, j)) {
            hf_remove(&w->alike, j);
        }
    }
    w->is_watching = !hf_is_empty(f, &w->alike) && w->n_watched < HF_MAX_WATCHED;
    if (w->is_watching && w->n_alike >= HF_MIN_SHARED) {
        hf_include(&w->alike, i);
        hf_unite(f, &w->equals, &w->alike);
        w->has_equals = true;
        w->is_watching = false;
    }
    if (!w->is_watching) {
        hf_clear(&w->alike);
    }
}

/* Return the faults of a finger whose readings, all valid, break a law as a whole; 0 without any.
 * Find the taxels that break one. */
HF_SHARED uint32_t hf_broken_laws(const hf_finger *f, const hf_scan *scan)
{
    holdfast_laws *const w = f->laws;
    w->total = scan->total;
    const size_t n_changed = hf_append_update(w, scan);
    w->has_changed = n_changed > 0;
    if (!w->has_changed) {
        return w->faults;
    }
    w->faults = hf_return(f) ? HOLDFAST_REPEATED : 0;
    if (hf_has_stuck_axis(f, scan, n_changed >= HF_LANES - 1 || n_changed >= f->n_taxels)) {
        w->faults |= HOLDFAST_STUCK;
    }
    if (w->is_watching) {
        hf_go_on_watching(f);
    } else if (w->n_updates % 2 == 0) { /* to save time */
        hf_begin_watch(f);
    }
    return w->faults;
}

/* Find the taxels whose noise has gone, and let the levels follow the others. */
static void hf_compare_levels(const hf_finger *f)
{
    /* P2 < L / 100, with the least L = max(P2, 0.9 L) of the taxel so far; L is known if none has
     * fallen so far for 5 s. */
    holdfast_laws *const w = f->laws;
    const bool is_known = (hf_real)w->n_steady * HF_LEVEL_SECONDS >= HF_STEADY_SECONDS;
    bool has_fallen = false;
    hf_clear(&w->fallen);
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const holdfast_taxel *const taxel = &f->taxels[i];
        const hf_real power = f->powers[f->n + i], level = f->levels[i];
        if (hf_has(&f->values->taxels, i)) { /* its reading is replaced */
            continue;
        }
        const bool is_lively = taxel->n_changed > 0 && taxel->longest_still < HF_MAX_STILL &&
                               f->state->n_changes - taxel->changed_at < HF_MAX_STILL;
        if (is_lively && power < HF_FALLEN_SHARE * level) {
            has_fallen = true;
            if (is_known) {
                hf_include(&w->fallen, i);
                continue;
            }
        }
        const hf_real lower = hf_min(level, hf_max(power, HF_LEVEL_DECAY * level));
        f->levels[i] = level > 0 && is_known ? lower : hf_min(level > 0 ? level : power, power);
    }
    w->has_fallen = has_fallen && is_known;
    w->n_steady = has_fallen && !is_known ? 0 : w->n_steady + 1;
}

/* Note the taxels that are STUCK though a digit of theirs toggles. */
HF_SHARED void hf_find_fallen_taxels(const hf_finger *f, bool after_gap)
{
    holdfast_finger_memory *const s = f->state;
    holdfast_laws *const w = f->laws;
    w->n_settled = after_gap ? 0 : w->n_settled + 1;
    w->n_levelled += 1;
    if ((hf_real)w->n_levelled * f->hand->period >= HF_LEVEL_SECONDS) {
        w->n_levelled = 0;
        w->has_fallen = false;
        if ((hf_real)w->n_settled * f->hand->period >= HF_SETTLING_SECONDS) {
            hf_compare_levels(f);
        }
    }
    if (w->has_fallen) {
        s->taxel_faults |= HOLDFAST_STUCK;
        hf_unite(f, &s->faulty_taxels, &w->fallen);
    }
}

/* Name the fingers of a sample that are equal while they change, by the sums of their readings. */
HF_SHARED void hf_find_copies(
    const holdfast_hand *hand, holdfast_memory *memory, const bool *present)
{
    for (size_t i = 1; i < HF_N_FINGERS(hand); ++i) {
        holdfast_laws *const w = &memory->laws[i];
        size_t other = present[i] ? 0 : i;
        while (other < i && !(present[other] && memory->laws[other].total == w->total)) {
            ++other;
        }
        w->n_copied = other < i && other == w->copy_of ? w->n_copied + w->has_changed : 0;
        w->copy_of = present[i] ? other : w->copy_of;
        w->has_changed = false;
        if (w->n_copied >= HF_MIN_SHARED) {
            const size_t pair[2] = {i, other};
            for (size_t k = 0; k < 2; ++k) {
                memory->values[pair[k]].reason = HOLDFAST_FAULT;
                memory->values[pair[k]].faults |= HOLDFAST_COPIED;
                memory->fingers[pair[k]].n_stretch = memory->fingers[pair[k]].motion.n_samples = 0;
            }
        }
    }
}
