/* Readings that are valid but implausible: of a whole finger, or of a taxel that jumps.
 *
 * They are judged by the readings alone, whatever the tare, and refused: they reach no tare, force
 * or window. Each rule costs a few comparisons at a plausible sample. A hold that is at rest at
 * once is found after the tare, by its force. */
#include "finger.h"

/* No sensor sends readings that are all smaller than this but not all zero. It is a number of
 * single precision too. */
#define HF_LEAST_READING ((hf_real)1e-37)

/* A magnetometer that reads zero in all axes was read too early if it jumps there by this many
 * times as far as the other taxels move at this sample. */
#define HF_ZERO_TO_STEPS ((hf_real)20)
/* A hold has at least this many times the noise of the force, and the step of its readings. */
#define HF_LEAST_HOLD ((hf_real)20)
/* Time for which it is not known whether a finger without readings still holds [s]. */
#define HF_REZEROED_SECONDS ((hf_real)0.5)
/* Share of a force within which another is the same. */
#define HF_SAME_FORCE ((hf_real)0.25)
/* A jump of one taxel alone by this many times its noise is implausible until it stays there for a
 * second sample: a touch spreads over the skin. */
#define HF_JUMP_TO_NOISE ((hf_real)50)
/* A jump of one taxel alone by this many times what all others have shown stays implausible. */
#define HF_JUMP_TO_SHOWN ((hf_real)20)
/* Steps of noise, as a root mean square: the others are still below this many times as much. */
#define HF_QUIET_STEPS ((hf_real)3)

/* Return whether more than half of the taxels have a reading near an end of the range. */
static bool hf_is_near_end(const hf_finger *f, const hf_scan *scan)
{
    const hf_real low = f->finger->low_end, high = f->finger->high_end;
    if (!(scan->least < low || scan->most > high)) {
        return false;
    }
    size_t n_near = 0;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        bool near_end = false;
        for (size_t axis = 0; axis < 3; ++axis) {
            const hf_real reading = f->readings[axis * f->n + i];
            near_end = near_end || reading < low || reading > high;
        }
        n_near += near_end && f->used[i] > 0;
    }
    return (hf_real)(2 * n_near) > f->finger->n_used;
}

/* Squared steps of the taxels from the last sample to this one. */
typedef struct {
    hf_real total;
    hf_real largest;
} hf_steps;

static hf_steps hf_find_steps(const hf_finger *f)
{
    const size_t n = f->n;
    hf_sum total, largest;
    for (size_t lane = 0; lane < HF_LANES; lane += HF_WIDTH) {
        hf_wide sum = {0}, most = {0};
        for (size_t i = lane; i < n; i += HF_LANES) {
            const hf_vectors now = hf_load_vectors(f->readings, n, i);
            const hf_wide square = hf_squares(hf_minus(now, hf_load_vectors(f->previous, n, i)));
            sum += square;
            most = hf_greater(square, most);
        }
        hf_put(&total, lane, sum);
        hf_put(&largest, lane, most);
    }
    const hf_steps steps = {hf_total(total), hf_largest_lane(largest)};
    return steps;
}

/* Note how far all taxels but one have moved at once, at a sample that is valid. */
static void hf_note_shown(const hf_finger *f, const hf_scan *scan, const hf_steps *steps)
{
    const hf_real others = steps->total - steps->largest;
    if (others > f->state->shown && scan->least >= f->finger->low &&
        scan->most <= f->finger->high && others < HF_INFINITY) {
        f->state->shown = others;
    }
}

/* Return whether a taxel reads zeros in all axes. */
static bool hf_has_zeros(const hf_finger *f, const hf_scan *scan)
{
    bool has_zeros = false;
    for (size_t i = 0; scan->least <= 0 && scan->most >= 0 && i < f->n_taxels; ++i) {
        has_zeros |= f->readings[i] == 0 && !hf_has_reading(f->readings, f->n, i) && f->used[i] > 0;
    }
    return has_zeros;
}

/* Return whether a jump is one that no touch makes, so that it stays if the next sample agrees.
 *
 * others: sum of the squared steps of all others; calm: squared step of one of them, or of noise;
 * quiet: sum of the squared steps of all others while they are at rest. */
static bool hf_is_offset(
    const hf_finger *f, const hf_real jump[3], hf_real others, hf_real calm, hf_real quiet)
{
    /* |df_i| > 20 sqrt(max sum |df_j|^2 of all others so far). Before these have moved, the first
     * touch may be that of one taxel: a magnetic skin spreads it, to a hundredth at least. */
    const hf_real square = hf_square(jump), least = f->finger->is_magnetic ? 25 : HF_INFINITY;
    hf_real shown = hf_max(f->state->shown, others);
    shown = shown > quiet ? shown : least * quiet;
    if (f->finger->n_used > HF_MIN_TAXELS && square > HF_JUMP_TO_SHOWN * HF_JUMP_TO_SHOWN * shown) {
        return true;
    }
    /* A byte was lost: 256 or 65536 steps along one axis, to 3 sqrt(calm), a tenth of it at most.
     * False where the step is not known. */
    const hf_real limit = 9 * calm;
    for (size_t axis = 0; axis < 3; ++axis) {
        const hf_real size = hf_abs(jump[axis]), across = square - size * size;
        const hf_real whole = (size > 4096 * f->finger->step ? 65536 : 256) * f->finger->step;
        if (100 * limit <= whole * whole && (size - whole) * (size - whole) + across <= limit) {
            return true;
        }
    }
    return false;
}

/* Subtract from the readings the jumps that stay. They are named and masked until they go back. */
HF_SHARED void hf_take_out_jumps(const hf_finger *f)
{
    holdfast_finger_memory *const s = f->state;
    s->has_offsets = false;
    for (size_t i = 0; i < f->n_taxels; ++i) {
        hf_real *const jump = f->masks[i].jump, square = hf_square(jump);
        hf_real step[3];
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t index = axis * f->n + i;
            step[axis] = f->readings[index] - f->previous[index] - jump[axis];
        }
        if (hf_has(&s->offset_taxels, i)) {
            /* A step by half of the jump is another one. It went back if half of it is left. */
            const bool jumps = hf_square(step) > square / 4;
            for (size_t axis = 0; axis < 3 && jumps; ++axis) {
                jump[axis] += step[axis];
            }
            if (jumps && hf_square(jump) <= square / 4) {
                hf_remove(&s->offset_taxels, i);
                continue;
            }
        } else if (square > 0 && hf_has(&s->jumped, i) && 100 * hf_square(step) <= square) {
            hf_include(&s->offset_taxels, i); /* a touch goes on to move */
        } else {
            continue;
        }
        s->has_offsets = true;
        for (size_t axis = 0; axis < 3; ++axis) {
            f->readings[axis * f->n + i] -= jump[axis];
        }
    }
}

/* Find the magnetometers that read zeros at this sample, and the taxels that jump alone. Return
 * whether there are any. `jumps` is empty before. */
HF_SHARED bool hf_find_jumps(const hf_finger *f, const hf_scan *scan, holdfast_taxel_set *jumps)
{
    holdfast_finger_memory *const s = f->state;
    if (s->n_seen == 0) {
        return false;
    }
    hf_steps steps = hf_find_steps(f);
    const bool is_magnetic = f->finger->is_magnetic;
    const bool is_lone = steps.largest >= HF_LONE_SHARE * steps.total;
    if (!is_lone && !(is_magnetic && hf_has_zeros(f, scan))) {
        hf_note_shown(f, scan, &steps);
        hf_clear(&s->jumped);
        return false;
    }
    const holdfast_taxel_set before = s->jumped;
    hf_clear(&s->jumped);
    /* Steps of noise: two samples in three axes. Before it is known, those of the others. */
    const size_t n = f->n;
    hf_real of_noise = isnan(s->noise) ? 0 : 6 * s->noise * s->noise / f->finger->n_used;
    bool has_zeros = false;
    hf_real n_others = f->finger->n_used;
    for (size_t i = 0; i < f->n_taxels && is_magnetic; ++i) {
        if (f->used[i] > 0 && !hf_has_reading(f->readings, n, i)) {
            const hf_real *const then = f->previous + i;
            const hf_real fallen[3] = {then[0], then[n], then[2 * n]};
            steps.total -= hf_square(fallen);
            n_others -= 1;
            has_zeros |= hf_square(fallen) > 0;
        }
    }
    const hf_real others = hf_max(0, steps.total - steps.largest);
    const hf_real each = others / hf_max(n_others - 1, 1);
    if (isnan(s->noise) && !has_zeros) {
        of_noise = each;
    }
    /* Zero: |f_i(k-1)|^2 > (20)^2 max(mean |df|^2 of the others, of noise). */
    const hf_real typical = hf_max(of_noise, hf_max(0, steps.total) / hf_max(n_others, 1));
    for (size_t i = 0; has_zeros && i < f->n_taxels; ++i) {
        const hf_real *const then = f->previous + i;
        const hf_real fallen[3] = {then[0], then[n], then[2 * n]};
        const hf_real square = hf_square(fallen);
        if (f->used[i] > 0 && !hf_has_reading(f->readings, n, i) && square > 0 &&
            !(square <= HF_ZERO_TO_STEPS * HF_ZERO_TO_STEPS * typical)) {
            hf_include(jumps, i);
        }
    }
    /* Jump: |df_i|^2 > (50)^2 of noise, and the others' mean |df|^2 <= (3)^2 of noise. Their sum is
     * at most `quiet`, so a taxel beyond it is the one that jumps. */
    const hf_real quiet = HF_QUIET_STEPS * HF_QUIET_STEPS * of_noise * (n_others - 1);
    const bool is_loud = is_magnetic && n_others >= HF_MIN_TAXELS && of_noise > 0 &&
                         steps.largest > HF_JUMP_TO_NOISE * HF_JUMP_TO_NOISE * of_noise &&
                         others <= quiet;
    const hf_real least = is_loud ? quiet : steps.largest / 2;
    for (size_t i = 0; (is_loud || is_lone) && i < f->n_taxels; ++i) {
        hf_real step[3];
        for (size_t axis = 0; axis < 3; ++axis) {
            step[axis] = f->readings[axis * n + i] - f->previous[axis * n + i];
        }
        if (hf_has(jumps, i) || hf_has(&before, i) || !(hf_square(step) > least)) {
            continue; /* at its second sample, a jump is plausible */
        }
        /* A sensor with a dead band jumps to and from zeros, too; one at an end of its range is
         * saturated. */
        bool is_between = hf_has_reading(f->readings, n, i) && hf_has_reading(f->previous, n, i);
        for (size_t axis = 0; axis < 3; ++axis) {
            const hf_real reading = f->readings[axis * n + i];
            is_between = is_between && f->finger->low < reading && reading < f->finger->high;
        }
        const bool stays = is_lone && is_between && !hf_has(&s->offset_taxels, i) &&
                           hf_is_offset(f, step, others, hf_max(of_noise, each), quiet);
        if (is_loud || stays) {
            hf_include(&s->jumped, i);
        }
        if (stays) {
            memcpy(f->masks[i].jump, step, sizeof step);
            s->has_offsets = true;
        } else if (!hf_has(&s->offset_taxels, i)) {
            hf_fill(f->masks[i].jump, 3, 0);
        }
    }
    if (hf_is_empty(f, &s->jumped)) {
        hf_note_shown(f, scan, &steps);
    }
    hf_unite(f, jumps, &s->jumped);
    return !hf_is_empty(f, jumps);
}

/* Return the faults of a finger whose readings, all valid, are implausible; 0 without any. */
HF_SHARED uint32_t hf_find_implausible(const hf_finger *f, const hf_scan *scan)
{
    holdfast_finger_memory *const s = f->state;
    uint32_t faults = hf_broken_laws(f, scan);
    if (hf_is_near_end(f, scan)) {
        faults |= HOLDFAST_SATURATED;
    }
    if (s->is_tared && s->zero == HF_CONFIRMED) {
        if (isnan(s->rest_sum)) { /* that of the tare; of the first sample where there is none */
            s->rest_sum = f->hand->tare_kind == HOLDFAST_TARE_NONE
                              ? scan->total
                              : hf_scan_readings(f, f->baseline).total;
        }
        /* |sum f_i - sum f_i(rest)|: all readings have left together. */
        if (hf_abs(scan->total - s->rest_sum) > f->finger->max_offset) {
            faults |= HOLDFAST_OFFSET;
        }
    }
    /* 0 < max |f| < 1e-37: bytes of another number type. */
    const hf_real largest = hf_max(scan->most, -scan->least);
    if (0 < largest && largest < HF_LEAST_READING) {
        faults |= HOLDFAST_OUT_OF_RANGE;
    }
    return faults;
}

static bool hf_is_same_force(const hf_real force[3], const hf_real other[3])
{
    hf_real change[3];
    for (size_t axis = 0; axis < 3; ++axis) {
        change[axis] = force[axis] - other[axis];
    }
    return hf_square(change) <= HF_SAME_FORCE * HF_SAME_FORCE * hf_square(other);
}

/* Return whether the readings of a hold went to those of the tare within one sample. */
static bool hf_goes_to_rest(const hf_finger *f)
{
    const holdfast_finger_memory *const s = f->state;
    const size_t window = f->finger->sigma_window;
    const hf_real *const held = hf_history(f, 1);
    if (f->values->amplitude > HF_RELEASED_SHARE * held[0] || s->n_stretch < (int64_t)window) {
        return false;
    }
    /* Held: F(k-1) . n > 0, |F(k-1)| >= 20 max(noise, step), and F(k - l) is F(k-1) to a quarter
     * for l = 2 and l = N_w - 1: a hand that lets go takes some samples. */
    const hf_real *const before = hf_history(f, window > 2 ? 2 : 1);
    const hf_real *const first = hf_history(f, window - 1);
    /* A step that is NaN does not count. */
    const hf_real least = HF_LEAST_HOLD * hf_max(s->noise, f->finger->step);
    if (!(held[0] >= least && hf_dot(held + 1, f->finger->normal) > 0 &&
          hf_is_same_force(before + 1, held + 1) && hf_is_same_force(first + 1, held + 1))) {
        return false;
    }
    /* At rest: sum |f_i - b_i|^2 <= 4 times that of noise. */
    hf_sum squares = {{0}};
    for (size_t i = 0; i < f->n_taxels; ++i) {
        hf_real beyond[3];
        for (size_t axis = 0; axis < 3; ++axis) {
            const size_t index = axis * f->n + i;
            beyond[axis] = f->used[i] * (f->readings[index] - f->baseline[index]);
        }
        hf_add(&squares, i, hf_square(beyond));
    }
    return hf_total(squares) <= 12 * s->noise * s->noise;
}

/* Follow a finger whose readings all went to rest at once, in a hold. Return the fault of its first
 * half second.
 *
 * The driver took a new baseline in the grip, or the object left within a sample: the readings
 * cannot tell. A force that returns to what it was shows that there was neither. */
HF_SHARED uint32_t hf_follow_rezero(const hf_finger *f, double time)
{
    holdfast_finger_memory *const s = f->state;
    if (hf_goes_to_rest(f)) {
        s->is_rezeroed = true;
        s->rezeroed_at = time;
        memcpy(s->lost_force, hf_history(f, 1) + 1, sizeof s->lost_force);
        s->least_normal = 0;
        s->n_stretch = s->motion.n_samples = 0;
        hf_clear_values(f->values); /* UNKNOWN at once */
        return HOLDFAST_REZEROED;
    }
    if (!s->is_rezeroed) {
        return 0;
    }
    s->least_normal = hf_min(s->least_normal, hf_dot(f->values->force, f->finger->normal));
    if ((hf_real)(time - s->rezeroed_at) + f->hand->period / 2 >= HF_REZEROED_SECONDS) {
        return 0;
    }
    if (hf_is_same_force(f->values->force, s->lost_force)) {
        s->is_rezeroed = false;
        s->n_stretch = s->motion.n_samples = 0;
    }
    return s->is_rezeroed ? HOLDFAST_REZEROED : 0;
}

/* Return whether a finger whose readings went to rest at once is pressed again.
 *
 * After a new baseline, the force of an open hand is below zero by the load that was lost. */
HF_SHARED bool hf_touches_rezeroed(const hf_finger *f)
{
    /* F . n - least F . n since > 0.08 |F| lost. */
    const holdfast_finger_memory *const s = f->state;
    const hf_real risen = hf_dot(f->values->force, f->finger->normal) - s->least_normal;
    return risen > HF_RELEASED_SHARE * hf_sqrt(hf_square(s->lost_force));
}
