/* Laws that every living skin keeps: of its readings in time, taxels, axes and modules.
 *
 * They look at changes alone: what is constant, or exactly zero, proves nothing. An update is a
 * sample that changed a reading: a value that is sent twice is no repeat. A sample that breaks a
 * law as a whole is refused (REPEATED, STUCK), or has no features (COPIED); of EQUAL_TAXELS, and of
 * taxels whose noise has gone (STUCK), the taxels are left out.
 *
 * Memory of a finger: sizeof(holdfast_laws), 1.6 KB, of which law of time 1.2; and a number for
 * each taxel. */
#include "finger.h"

enum {
    HF_MIN_VARYING = 12,  /* channels (axes of taxels) that change in a return: few do by chance */
    HF_MIN_RETURNED = 9,  /* the same, where a lane of the taxels is left out */
    HF_MIN_SHARED = 20,   /* changes for which taxels, axes or fingers are equal by a fault */
    HF_MAX_WATCHED = 160, /* updates in which a taxel must change so often, to be compared */
    HF_MIN_AXIS_CHANGES = 10
};
/* An axis is frozen if it rests for this long [s], and for this many times as long as any ever
 * did. */
#define HF_FROZEN_SECONDS ((hf_real)0.5)
#define HF_FROZEN_RATIO ((hf_real)10)
/* Time between comparisons of the noise of the taxels, and time after a gap without one [s]. */
#define HF_LEVEL_SECONDS ((hf_real)0.25)
#define HF_SETTLING_SECONDS ((hf_real)1)
/* Share of the second differences that are left when noise has gone: a tenth, squared. */
#define HF_FALLEN_SHARE ((hf_real)0.01)
/* The level follows lower ones by this factor: a hundredth takes it 11 s. */
#define HF_LEVEL_DECAY ((hf_real)0.9)

/* Multipliers of hashes: odd, with bits at random; of a run, and its power HF_RUN. */
#define HF_HASH_FACTOR UINT64_C(0x9E3779B97F4A7C15)
#define HF_RUN_FACTOR UINT32_C(0x2C1B3C6D)
#define HF_RUN_POWER UINT32_C(0x7E630F21)

/* Return a hash of a number; that of 0 is not 0. */
static uint32_t hf_hash(hf_real value, uint64_t lane)
{
    const double number = (double)value;
    uint64_t bits;
    memcpy(&bits, &number, sizeof bits);
    bits = (bits ^ bits >> 32) + HF_HASH_FACTOR * (lane + 1);
    bits *= HF_HASH_FACTOR;
    return (uint32_t)((bits ^ bits >> 29) * HF_HASH_FACTOR >> 32);
}

/* Append a sample to the runs of the lanes. Return false if it changes nothing. */
static bool hf_append_update(holdfast_laws *w, const hf_scan *scan)
{
    /* run = sum_j B^j h(k - j), of the hashes h of the last HF_RUN updates. */
    uint32_t *const oldest = &w->recent[w->n_updates % HF_RUN * HF_LANES];
    const uint32_t *const newest = &w->recent[(w->n_updates + HF_RUN - 1) % HF_RUN * HF_LANES];
    uint32_t hashes[HF_LANES], changed = 0;
    for (size_t l = 0; l < HF_LANES; ++l) {
        hashes[l] = hf_hash(scan->lanes.lane[l], l);
        changed |= hashes[l] ^ newest[l];
    }
    for (size_t l = 0; changed && l < HF_LANES; ++l) {
        w->runs[l] = w->runs[l] * HF_RUN_FACTOR + hashes[l] - oldest[l] * HF_RUN_POWER;
        oldest[l] = hashes[l];
    }
    w->n_updates += changed != 0;
    return changed != 0;
}

/* Return the marks that have one of the keys as bits. */
static uint64_t hf_find_marks(const holdfast_laws *w, const uint32_t keys[HF_LANES])
{
    uint32_t any = 0;
    for (size_t l = 0; l < HF_LANES; ++l) {
        for (size_t m = 0; m < HF_N_MARKS; ++m) {
            any |= w->marks[l * HF_N_MARKS + m] == keys[l];
        }
    }
    uint64_t found = 0;
    for (size_t m = 0; any && m < HF_N_MARKS; ++m) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            found |= (uint64_t)(w->marks[l * HF_N_MARKS + m] == keys[l]) << m;
        }
    }
    return found;
}

/* Return whether three of the last updates differ without a lane. Two in turn are no ring: readings
 * with little noise go to and fro by one step. */
static bool hf_has_three_readings(const holdfast_laws *w, size_t left_out)
{
    uint32_t sums[HF_RUN] = {0}, second = 0;
    bool has_second = false;
    for (size_t k = 0; k < HF_RUN; ++k) {
        for (size_t l = 0; l < HF_LANES; ++l) {
            sums[k] += l == left_out ? 0 : w->recent[k * HF_LANES + l];
        }
        if (has_second && sums[k] != sums[0] && sums[k] != second) {
            return true;
        }
        second = has_second ? second : sums[k];
        has_second |= sums[k] != sums[0];
    }
    return false;
}

/* Return the channels that vary without a lane: that change now, or did when their taxel last did,
 * within two runs. */
static size_t hf_n_varying(const hf_finger *f, size_t left_out)
{
    size_t n_varying = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        const bool is_recent = f->state->n_changes - f->taxels[i].changed_at < 2 * HF_RUN;
        for (size_t k = i; i % HF_LANES != left_out && k < 3 * f->n; k += f->n) {
            n_varying +=
                f->readings[k] != f->previous[k] || (is_recent && f->changes[k] != 0);
        }
    }
    return n_varying;
}

/* Return whether readings return in order, of all taxels but those of one lane at most.
 *
 * Every HF_RUN-th update is marked: by four keys, each of which is a hash of the last HF_RUN
 * updates without one lane. An update returns if it has a key of a mark. Of any lag, one of HF_RUN
 * updates in a row does; so a return that lasts for 2 HF_RUN updates is found after HF_RUN - 1
 * more at most. */
static bool hf_return(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    if (w->n_updates < HF_RUN) {
        return false;
    }
    uint32_t keys[HF_LANES];
    for (size_t l = 0; l < HF_LANES; ++l) {
        keys[l] = (w->runs[0] + w->runs[1]) + (w->runs[2] + w->runs[3]) - w->runs[l];
    }
    const uint64_t found = hf_find_marks(w, keys);
    uint64_t *const before = &w->matches[w->n_updates % HF_RUN];
    /* The update HF_RUN before has returned to the mark before. */
    const uint64_t lasting = found & (*before << 1 | *before >> (HF_N_MARKS - 1));
    *before = found;
    w->n_returning -= w->n_returning > 0;
    for (size_t m = 0; lasting && m < HF_N_MARKS; ++m) {
        size_t left_out = HF_LANES, n_equal = 0;
        for (size_t l = 0; l < HF_LANES; ++l) {
            const bool is_equal = w->marks[l * HF_N_MARKS + m] == keys[l];
            left_out = is_equal ? l : left_out;
            n_equal += is_equal;
        }
        left_out = n_equal == 1 ? left_out : HF_LANES;
        const size_t least = n_equal == 1 ? HF_MIN_RETURNED : HF_MIN_VARYING;
        if (lasting >> m & 1 && hf_has_three_readings(w, left_out) &&
            hf_n_varying(f, left_out) >= least) {
            w->n_returning = HF_RUN;
        }
    }
    for (size_t l = 0; w->n_updates % HF_RUN == 0 && l < HF_LANES; ++l) {
        w->marks[l * HF_N_MARKS + w->n_updates / HF_RUN % HF_N_MARKS] = keys[l];
    }
    return w->n_returning > 0;
}

/* Return whether an axis of all taxels is frozen, or equal to another, while others change. */
static bool hf_has_stuck_axis(const hf_finger *f, const hf_scan *scan)
{
    /* Frozen: changed 10 times, and the same for max(0.5 s, 10 (rest + 1 sample)) of updates, where
     * rest is the longest so far of any axis, and that of the others now: a skin with little noise
     * rests. */
    holdfast_laws *const w = f->laws;
    const hf_real least = HF_FROZEN_SECONDS / f->hand->period;
    bool is_stuck = false;
    int64_t longest = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        longest = w->longest[axis] > longest ? w->longest[axis] : longest;
    }
    for (size_t axis = 0; axis < 3; ++axis) {
        const size_t next = (axis + 1) % 3;
        const bool has_changed = scan->axes[axis] != w->axes[axis];
        int64_t rest = longest;
        for (size_t other = 0; other < 3; ++other) { /* not of those that froze together */
            if (w->n_same[other] > rest && w->n_same[other] != w->n_same[axis] &&
                w->n_changed[other] > 0) {
                rest = w->n_same[other];
            }
        }
        const bool is_frozen =
            w->n_changed[axis] >= HF_MIN_AXIS_CHANGES &&
            (hf_real)w->n_same[axis] >= hf_max(least, HF_FROZEN_RATIO * (hf_real)(rest + 1));
        if (!has_changed) {
            w->n_same[axis] += 1;
            is_stuck |= is_frozen && scan->axes[axis] != 0;
        } else {
            if (!is_frozen && w->n_same[axis] > w->longest[axis]) {
                w->longest[axis] = w->n_same[axis];
            }
            w->n_same[axis] = 0;
            w->n_changed[axis] += w->n_changed[axis] < HF_MIN_AXIS_CHANGES;
        }
        const bool is_equal = scan->axes[axis] == scan->axes[next];
        w->n_equal[axis] = is_equal ? w->n_equal[axis] + has_changed : 0;
        is_stuck |= w->n_equal[axis] >= HF_MIN_SHARED;
    }
    memcpy(w->axes, scan->axes, sizeof w->axes);
    return is_stuck;
}

/* Return whether two taxels have the same reading in all axes. */
static bool hf_are_alike(const hf_finger *f, size_t i, size_t j)
{
    const hf_real *const r = f->readings;
    const size_t n = f->n;
    return r[i] == r[j] && r[n + i] == r[n + j] && r[2 * n + i] == r[2 * n + j];
}

/* Go on to the next taxel, and find those that have its reading now, if it has just changed. */
static void hf_find_alike(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    const size_t n = f->n, i = w->taxel = (w->taxel + 1) % f->n_taxels;
    const hf_real *const now = f->readings, *const then = f->previous;
    if ((now[i] == then[i] && now[n + i] == then[n + i] && now[2 * n + i] == then[2 * n + i]) ||
        !hf_has_reading(now, n, i) || f->used[i] == 0) {
        return;
    }
    size_t n_near = 0;
    for (size_t j = 0; j < f->n_taxels; ++j) {
        n_near += now[j] == now[i];
    }
    bool has_alike = false;
    for (size_t j = 0; n_near > 1 && j < f->n_taxels; ++j) {
        if (j != i && hf_are_alike(f, i, j)) {
            hf_include(&w->alike, j);
            has_alike = true;
        }
    }
    if (!has_alike && w->has_equals) { /* no more */
        const uint64_t bit = (uint64_t)1 << i % 64;
        w->equals.words[i / 64] &= ~bit;
        w->has_equals = !hf_is_empty(f, &w->equals);
    }
    w->n_watched = w->n_alike = 0;
}

/* Compare one taxel with the others, until it has changed 20 times, or no other is equal. */
static void hf_compare_taxel(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    const size_t n = f->n, i = w->taxel;
    const hf_real now[3] = {f->readings[i], f->readings[n + i], f->readings[2 * n + i]};
    w->n_watched += 1;
    w->n_alike +=
        now[0] != w->reading[0] || now[1] != w->reading[1] || now[2] != w->reading[2];
    for (size_t j = 0; j < f->n_taxels; ++j) {
        if (hf_has(&w->alike, j) && !hf_are_alike(f, i, j)) {
            w->alike.words[j / 64] &= ~((uint64_t)1 << j % 64);
        }
    }
    if (w->n_alike >= HF_MIN_SHARED && !hf_is_empty(f, &w->alike)) {
        hf_include(&w->alike, i);
        hf_unite(f, &w->equals, &w->alike);
        w->has_equals = true;
    }
    if (w->n_alike >= HF_MIN_SHARED || w->n_watched >= HF_MAX_WATCHED) {
        hf_clear(&w->alike);
    }
}

/* Find taxels that are equal while they change: one taxel at an update is compared with all. */
static void hf_find_equal_taxels(const hf_finger *f)
{
    holdfast_laws *const w = f->laws;
    if (hf_is_empty(f, &w->alike)) {
        hf_find_alike(f);
    } else {
        hf_compare_taxel(f);
    }
    for (size_t axis = 0; axis < 3; ++axis) {
        w->reading[axis] = f->readings[axis * f->n + w->taxel];
    }
}

/* Return the faults of a finger whose readings, all valid, break a law as a whole; 0 without any.
 * Find the taxels that break one. */
HF_SHARED uint32_t hf_broken_laws(const hf_finger *f, const hf_scan *scan)
{
    holdfast_laws *const w = f->laws;
    w->total = scan->total;
    w->has_changed = hf_append_update(w, scan);
    if (!w->has_changed) {
        return w->faults;
    }
    w->faults = hf_return(f) ? HOLDFAST_REPEATED : 0;
    if (hf_has_stuck_axis(f, scan)) {
        w->faults |= HOLDFAST_STUCK;
    }
    hf_find_equal_taxels(f);
    return w->faults;
}

/* Note the taxels that are STUCK though a digit of theirs toggles: their noise has gone. */
HF_SHARED void hf_find_fallen_taxels(const hf_finger *f, bool after_gap)
{
    /* P2 < L / 100, with the least L = max(P2, 0.9 L) of the taxel so far. */
    holdfast_finger_memory *const s = f->state;
    const hf_real period = f->hand->period;
    const double turns = (double)(HF_LEVEL_SECONDS / period);
    const int64_t interval = turns > 1 ? (int64_t)lrint(turns) : 1;
    if (after_gap) {
        f->laws->settled_at = s->n_changes;
    }
    if (s->n_changes % interval == 0) {
        const bool settled =
            (hf_real)(s->n_changes - f->laws->settled_at) * period >= HF_SETTLING_SECONDS;
        hf_clear(&f->laws->fallen);
        f->laws->has_fallen = false;
        for (size_t i = 0; settled && i < f->n_taxels; ++i) {
            const holdfast_taxel *const taxel = &f->taxels[i];
            const hf_real power = f->powers[f->n + i], level = f->levels[i];
            const bool is_live = 2 * taxel->n_changed > taxel->changed_at &&
                                 (hf_real)taxel->longest_still * period < HF_FROZEN_SECONDS;
            if (is_live && power < HF_FALLEN_SHARE * level) {
                hf_include(&f->laws->fallen, i);
                f->laws->has_fallen = true;
            } else if (f->used[i] > 0) {
                f->levels[i] = level > 0 ? hf_min(level, hf_max(power, HF_LEVEL_DECAY * level)) : power;
            }
        }
    }
    if (f->laws->has_fallen) {
        s->taxel_faults |= HOLDFAST_STUCK;
        hf_unite(f, &s->faulty_taxels, &f->laws->fallen);
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
