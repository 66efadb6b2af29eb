/* Tables and memory of a stream: what is checked once, and the state before the first sample. */
#include "finger.h"

HF_SHARED bool hf_are_finite(const hf_real *values, size_t n)
{
    bool are_finite = true;
    for (size_t i = 0; i < n; ++i) {
        are_finite = are_finite && isfinite(values[i]);
    }
    return are_finite;
}

static bool hf_is_window(size_t window, size_t longest)
{
    return window >= 2 && window % 2 == 0 && window <= longest;
}

/* Return NULL if the sizes of a hand are possible and fit each other, else what is wrong. */
static const char *hf_check_sizes(const holdfast_hand *hand)
{
    if (hand->n_fingers < 1 || hand->n_lanes < 1 || hand->n_lanes > HF_MAX_TAXELS ||
        hand->n_fingers > hand->n_lanes) {
        return "n_fingers or n_lanes";
    }
    if (hand->n_features < 1 || hand->n_features > HF_MAX_FEATURES) {
        return "n_features";
    }
    if (!hf_is_window(hand->n_history, HF_MAX_SAMPLES)) {
        return "n_history";
    }
    if (hand->n_channels != 1 && hand->n_channels != HF_N_COMPONENTS) {
        return "n_channels";
    }
    /* As many sizes of blocks as N_w / 2 of the longest window has binary digits; 30 keeps the
     * shift defined. */
    if (hand->n_levels < 1 || hand->n_levels > 30 ||
        (hand->n_history / 2) >> (hand->n_levels - 1) != 1) {
        return "n_levels";
    }
    /* A second difference needs three samples. */
    if (hand->n_lags > HF_MAX_FEATURES || hand->n_track > HF_MAX_SAMPLES ||
        hand->n_track < (hand->n_lags > 0 ? 3u : 1u)) {
        return "n_lags or n_track";
    }
    if (hand->n_slides != 0 && (hand->n_lags == 0 || hand->n_slides != hand->n_track)) {
        return "n_slides";
    }
#ifdef HOLDFAST_N_FINGERS
    if (hand->n_fingers != HF_N_FINGERS(hand) || hand->n_lanes != HF_N_LANES(hand) ||
        hand->n_features != HF_N_FEATURES(hand) || hand->n_lags != HF_N_LAGS(hand) ||
        hand->n_history != HF_N_HISTORY(hand) || hand->n_channels != HF_N_CHANNELS(hand) ||
        hand->n_levels != HF_N_LEVELS(hand) || hand->n_track != HF_N_TRACK(hand) ||
        hand->n_slides != HF_N_SLIDES(hand)) {
        return "a size that differs from its macro";
    }
#endif
    return NULL;
}

/* Return NULL if the numbers of a hand are possible, else what is wrong. */
static const char *hf_check_numbers(const holdfast_hand *hand)
{
    /* Bounds of the period: HF_MOVE_SECONDS / period is a number of samples. */
    if (!(hand->period >= (hf_real)1e-6 && hand->period <= (hf_real)1e6)) {
        return "period";
    }
    if (hand->tare_kind < HOLDFAST_TARE_SECONDS || hand->tare_kind > HOLDFAST_TARE_INTERVAL) {
        return "tare_kind";
    }
    if (!isfinite(hand->tare_seconds) || !isfinite(hand->noise_seconds)) {
        return "tare_seconds or noise_seconds";
    }
    for (size_t i = 0; i < hand->n_lags; ++i) {
        if (!isfinite(hand->lags[i].seconds) || hand->lags[i].samples > HF_MAX_SAMPLES ||
            (hand->lags[i].sliding && hand->n_slides == 0)) {
            return "a lag";
        }
    }
    if (!hf_are_finite(hand->rotations, 9 * hand->n_lanes) ||
        !hf_are_finite(hand->positions, 3 * hand->n_lanes)) {
        return "a rotation or a position of a taxel";
    }
    return NULL;
}

/* Return NULL if a finger's taxels follow those of the finger before, else what is wrong. */
static const char *hf_check_finger(
    const holdfast_hand *hand, const holdfast_finger *finger, size_t first, size_t first_taxel)
{
    if (finger->first != first || finger->first_taxel != first_taxel || finger->n_taxels < 1 ||
        finger->n_taxels > HF_MAX_FINGER_TAXELS || finger->n_taxels > hand->n_lanes - first ||
        hf_n_lanes(finger->n_taxels) > hand->n_lanes - first) {
        return "first, first_taxel or n_taxels of a finger";
    }
    size_t n_used = 0;
    for (size_t i = 0; i < hf_n_lanes(finger->n_taxels); ++i) {
        const hf_real used = hand->used[first + i];
        if (!(used == 0 || (used == 1 && i < finger->n_taxels))) {
            return "used";
        }
        n_used += used > 0;
    }
    if (!(finger->n_used == (hf_real)n_used)) {
        return "n_used of a finger";
    }
    if (!hf_is_window(finger->sigma_window, hand->n_history) ||
        finger->ready_window > hand->n_history) {
        return "sigma_window or ready_window of a finger";
    }
    if (finger->bridges && hand->n_lags == 0) {
        return "bridges of a finger without lags";
    }
    if (!hf_are_finite(finger->normal, 3) || !(finger->max_field >= 0)) {
        return "normal or max_field of a finger";
    }
    return NULL;
}

/* Return NULL if feature j of a finger has what it needs, else what is wrong. */
static const char *hf_check_feature(
    const holdfast_hand *hand, const holdfast_feature *features, size_t j)
{
    const holdfast_feature *const feature = &features[j];
    if (feature->kind < -1 || feature->kind >= HOLDFAST_FIRST_RELATIVE + HOLDFAST_N_RELATIVE) {
        return "kind of a feature";
    }
    if (feature->kind < 0) {
        return feature->of_hand ? "of_hand of a padding" : NULL;
    }
    if (feature->transform < HOLDFAST_AS_IT_IS || feature->transform > HOLDFAST_BY_NOISE ||
        !isfinite(feature->floor)) {
        return "transform or floor of a feature";
    }
    if (feature->same_as > j || features[feature->same_as].kind != feature->kind) {
        return "same_as of a feature";
    }
    const bool has_lag = feature->kind >= HOLDFAST_FIRST_RELATIVE;
    const bool has_window = feature->kind >= HOLDFAST_M && !has_lag;
    if (has_lag ? feature->lag >= hand->n_lags : feature->lag != 0) {
        return "lag of a feature";
    }
    if (has_window ? !hf_is_window(feature->window, hand->n_history) : feature->window != 0) {
        return "window of a feature";
    }
    if (feature->kind == HOLDFAST_SIGMA_XYZ && hand->n_channels != HF_N_COMPONENTS) {
        return "n_channels, too few for a feature";
    }
    return NULL;
}

#ifndef HOLDFAST_N_FINGERS
/* Take n elements of a block for an array; NULL without a block. Arrays begin at multiples of 16
 * bytes, as blocks of malloc do: then no vector of lanes.h lies in two cache lines. */
static void *hf_take(void *block, uint64_t *used, uint64_t n, size_t size)
{
    void *const array = block ? (unsigned char *)block + (size_t)*used : NULL;
    *used += (n * size + 15) / 16 * 16;
    return array;
}

/* Set the arrays of a stream to parts of a block, if it is one. Return its size [bytes]. */
static uint64_t hf_lay_out(const holdfast_hand *hand, holdfast_memory *m, void *block)
{
    const uint64_t fingers = hand->n_fingers, lanes = hand->n_lanes, features = hand->n_features;
    const uint64_t rows = fingers * hand->n_history, samples = hand->n_track;
    const uint64_t lags = fingers * hand->n_lags;
    const size_t width = sizeof(hf_real);
    uint64_t used = 0;
    /* The values first: `holdfast_begin` clears the block from them on. */
    m->values = (holdfast_values *)hf_take(block, &used, fingers, sizeof *m->values);
    m->features = (hf_real *)hf_take(block, &used, fingers * features, width);
    m->fingers = (holdfast_finger_memory *)hf_take(block, &used, fingers, sizeof *m->fingers);
    m->taxels = (holdfast_taxel *)hf_take(block, &used, lanes, sizeof *m->taxels);
    m->masks = (holdfast_mask *)hf_take(block, &used, lanes, sizeof *m->masks);
    m->laws = (holdfast_laws *)hf_take(block, &used, fingers, sizeof *m->laws);
    m->readings = (hf_real *)hf_take(block, &used, 3 * lanes, width);
    m->previous = (hf_real *)hf_take(block, &used, 3 * lanes, width);
    m->baseline = (hf_real *)hf_take(block, &used, 3 * lanes, width);
    m->reference = (hf_real *)hf_take(block, &used, 3 * lanes, width);
    m->pressed = (hf_real *)hf_take(block, &used, lanes, width);
    m->shares = (hf_real *)hf_take(block, &used, 4 * lanes, width);
    m->changes = (hf_real *)hf_take(block, &used, 3 * lanes, width);
    m->moved = (hf_real *)hf_take(block, &used, 3 * lanes, width);
    m->powers = (hf_real *)hf_take(block, &used, 2 * lanes, width);
    m->levels = (hf_real *)hf_take(block, &used, lanes, width);
    m->history = (hf_real *)hf_take(block, &used, rows * HF_N_COMPONENTS, width);
    m->blocks = (hf_real *)hf_take(
        block, &used, rows * hand->n_channels * hand->n_levels * HF_N_SUMS, width);
    m->track = (holdfast_track *)hf_take(block, &used, fingers * samples, sizeof *m->track);
    m->taxel_forces = (hf_real *)hf_take(block, &used, samples * 3 * lanes, width);
    m->slides = (hf_real *)hf_take(block, &used, hand->n_slides * 3 * lanes, width);
    m->relative = (hf_real *)hf_take(block, &used, lags * HOLDFAST_N_RELATIVE, width);
    m->averages = (hf_real *)hf_take(block, &used, lags * HF_N_AVERAGES, width);
    m->own = (hf_real *)hf_take(block, &used, fingers * features, width);
    m->of_hand = (hf_real *)hf_take(block, &used, features, width);
    return used;
}

HF_API size_t holdfast_memory_size(const holdfast_hand *hand)
{
    holdfast_memory memory;
    return (size_t)hf_lay_out(hand, &memory, NULL);
}

HF_API void holdfast_use_memory(const holdfast_hand *hand, holdfast_memory *memory, void *block)
{
    hf_lay_out(hand, memory, block);
}
#endif

HF_API const char *holdfast_check(const holdfast_hand *hand)
{
    const char *wrong = hf_check_sizes(hand);
    if (!wrong) {
        wrong = hf_check_numbers(hand);
    }
    size_t first = 0, first_taxel = 0;
    for (size_t i = 0; i < hand->n_fingers && !wrong; ++i) {
        const holdfast_finger *const finger = &hand->fingers[i];
        wrong = hf_check_finger(hand, finger, first, first_taxel);
        first += hf_n_lanes(finger->n_taxels);
        first_taxel += finger->n_taxels;
        for (size_t j = 0; j < hand->n_features && !wrong; ++j) {
            wrong = hf_check_feature(hand, hand->features + i * hand->n_features, j);
        }
    }
    if (!wrong && first != hand->n_lanes) {
        wrong = "n_lanes, other than those of the fingers";
    }
#ifndef HOLDFAST_N_FINGERS
    holdfast_memory memory;
    if (!wrong && hf_lay_out(hand, &memory, NULL) > SIZE_MAX / 2) {
        wrong = "the sizes: more memory than there can be";
    }
#endif
    return wrong;
}

HF_SHARED void hf_begin_finger(const hf_finger *f)
{
    holdfast_finger_memory *const s = f->state;
    s->first_time = s->last_time = NAN;
    s->noise = s->rest_sum = HF_NAN;
    s->motion.least_noise = s->motion.least_taxel_noise = HF_INFINITY;
    s->motion.block_start = NAN;
    s->motion.moved_at = -INFINITY;
    hf_clear_values(f->values);
    f->values->reason =
        f->hand->tare_kind == HOLDFAST_TARE_SECONDS ? HOLDFAST_TARE : HOLDFAST_WARM_UP;
    memset(f->laws, 0, sizeof *f->laws);
    hf_fill(f->relative, HF_N_LAGS(f->hand) * HOLDFAST_N_RELATIVE, HF_NAN);
    hf_fill(f->averages, HF_N_LAGS(f->hand) * HF_N_AVERAGES, HF_NAN);
    for (size_t i = 0; i < f->n; ++i) {
        f->taxels[i].changed_at = f->used[i] > 0 ? 0 : INT64_MAX; /* never still */
    }
}

HF_API void holdfast_begin(
    const holdfast_hand *hand, holdfast_memory *memory, const hf_real *baseline)
{
    const size_t width = HF_N_FEATURES(hand);
#ifdef HOLDFAST_N_FINGERS
    memset(memory, 0, sizeof *memory);
#else
    memset(memory->values, 0, holdfast_memory_size(hand)); /* the first array of the block */
#endif
    hf_fill(memory->features, HF_N_FINGERS(hand) * width, HF_NAN);
    hf_fill(memory->own, HF_N_FINGERS(hand) * width, HF_NAN);
    hf_fill(memory->of_hand, width, HF_NAN);
    for (size_t i = 0; i < HF_N_FINGERS(hand); ++i) {
        const hf_finger f = hf_finger_of(hand, memory, i);
        hf_begin_finger(&f);
        if (baseline) {
            hf_copy_to_lanes(&f, baseline, f.baseline);
        }
    }
}
