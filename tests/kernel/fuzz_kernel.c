/* Fuzz target for clang's libFuzzer: tables and samples from bytes.
 *
 *     clang -std=c99 -g -O1 -fsanitize=fuzzer,address,undefined -I src/holdfast/kernel \
 *         tests/kernel/fuzz_kernel.c -o fuzz && ./fuzz -max_len=4096
 *
 * The first bytes make tables that fit; the next change any number in them, sizes too, before the
 * arrays are allocated with exactly the lengths that these say. A hand and a model that
 * `holdfast_check_model` accepts then process samples made from the remaining bytes: whatever they
 * hold, no access may lie outside. */
#include "holdfast.c"

#include <stdlib.h>

enum { MAX_MEMORY = 1 << 24, MAX_LENGTH = 1 << 16 };

/* The bytes of an input; zeros after its end. */
typedef struct {
    const uint8_t *data;
    size_t size;
} input;

static uint64_t take(input *in, size_t n_bytes)
{
    uint64_t value = 0;
    for (size_t i = 0; i < n_bytes && in->size > 0; ++i) {
        value = value << 8 | *in->data++;
        in->size -= 1;
    }
    return value;
}

/* Return a number that may be special, or any at all. */
static double take_number(input *in)
{
    static const double special[] = {0.0,   -0.0,   NAN, INFINITY, -INFINITY, 1e-320,
                                     1e308, -1e308, 1.0, -1.0,     65535.0,   0.005};
    const uint8_t kind = (uint8_t)take(in, 1);
    if (kind < sizeof special / sizeof *special) {
        return special[kind];
    }
    if (kind < 32) {
        const uint64_t bits = take(in, 8);
        double value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    return (double)take(in, 2) - 100.0 * kind;
}

/* Change one of some sizes, by a little or to anything. */
static void spoil(input *in, size_t *const *sizes, size_t n)
{
    size_t *const size = sizes[(size_t)take(in, 1) % n];
    const size_t how = (size_t)take(in, 1) % 4;
    if (how == 0) {
        *size = (size_t)take(in, 8);
    } else if (how == 1) {
        *size = (size_t)take(in, 1);
    } else {
        *size += how == 2 ? 1 + (size_t)take(in, 1) % 8 : (size_t)-1;
    }
}

static void make_finger(input *in, holdfast_finger *finger, size_t n_lags)
{
    finger->n_taxels = 1 + (size_t)take(in, 1) % 70 + (take(in, 1) % 8 ? 0 : 450);
    finger->n_used = (hf_real)finger->n_taxels;
    const bool in_counts = take(in, 1) % 2;
    finger->low = in_counts ? 0 : -HF_INFINITY;
    finger->high = in_counts ? 65535 : HF_INFINITY;
    finger->low_end = in_counts ? 655 : -HF_INFINITY;
    finger->high_end = in_counts ? 64880 : HF_INFINITY;
    finger->max_offset = in_counts ? 50000 * finger->n_used : HF_INFINITY;
    finger->min_noise = in_counts ? 1 : (hf_real)1e-6;
    finger->step = in_counts ? 1 : HF_NAN;
    finger->step_noise = in_counts ? (hf_real)0.3 : (hf_real)1e-6;
    const hf_real fields[4] = {0, 130, HF_INFINITY, 0};
    finger->max_field = fields[take(in, 1) % 4];
    finger->is_magnetic = finger->max_field > 0;
    finger->rests_at_zero = take(in, 1) % 2;
    finger->max_step = (hf_real)0.1;
    finger->normal[2] = 1;
    finger->sigma_window = 6;
    finger->ready_window = 2 + (size_t)take(in, 1) % 12;
    finger->bridges = n_lags > 0 && take(in, 1) % 2;
}

static void make_feature(input *in, holdfast_feature *feature, size_t j, const holdfast_hand *hand)
{
    const int32_t n_kinds = HOLDFAST_FIRST_RELATIVE + HOLDFAST_N_RELATIVE;
    feature->kind = (int32_t)(take(in, 1) % (uint64_t)(n_kinds + 1)) - 1;
    feature->same_as = j;
    feature->of_hand = feature->kind >= 0 && take(in, 1) % 2;
    if (feature->kind >= HOLDFAST_FIRST_RELATIVE) {
        if (hand->n_lags == 0) {
            feature->kind = HOLDFAST_F_A;
        } else {
            feature->lag = (size_t)take(in, 1) % hand->n_lags;
        }
    } else if (feature->kind >= HOLDFAST_M) {
        feature->window = 2 + 2 * (size_t)take(in, 1) % hand->n_history;
        feature->transform = (int32_t)(take(in, 1) % 3);
        feature->floor = 1;
    }
}

/* Make sizes, of which the input then spoils some. */
static void make_sizes(input *in, holdfast_hand *hand)
{
    hand->n_fingers = 1 + (size_t)take(in, 1) % 3;
    hand->n_features = 1 + (size_t)take(in, 1) % 12;
    hand->n_lags = (size_t)take(in, 1) % 3;
    hand->n_history = 14 + 2 * ((size_t)take(in, 1) % 20);
    hand->n_channels = take(in, 1) % 4 ? 4 : 1;
    hand->n_track = hand->n_lags ? 3 + (size_t)take(in, 1) % 60 : 1;
    hand->n_slides = hand->n_lags && take(in, 1) % 2 ? hand->n_track : 0;
    for (size_t n = hand->n_history / 2; n > 0; n /= 2) {
        hand->n_levels += 1;
    }
    hand->period = (hf_real)1 / (hf_real)(1 + take(in, 1) * 4);
    hand->tare_kind = (int32_t)(take(in, 1) % 4);
    hand->tare_seconds = (hf_real)0.05;
    hand->noise_seconds = (hf_real)0.05;
    hand->alike = take(in, 1) % 2;
    hand->has_centres = take(in, 1) % 2;
    hand->zero_unknown = take(in, 1) % 2;
}

/* Make heads and limits of a finger; the input then spoils some. */
static void make_rule(input *in, holdfast_rule *rule, const holdfast_hand *hand)
{
    rule->contact = (int32_t)(take(in, 1) % 4);
    rule->contact_limit = (hf_real)take(in, 1);
    for (size_t name = 0; name < HOLDFAST_N_HEADS; ++name) {
        holdfast_head *const head = &rule->heads[name];
        const size_t most = name == HOLDFAST_HEAD_CAUSE ? (size_t)HOLDFAST_N_CAUSES : 1;
        head->n_outputs = name == HOLDFAST_HEAD_STABLE ? 1 : (size_t)take(in, 1) % (most + 1);
        head->n_features = (size_t)take(in, 1) % (hand->n_features + 1);
        head->has_squares = head->n_outputs == 1 && take(in, 1) % 2;
        head->first = (size_t)take(in, 1) % 8;
        head->threshold = (hf_real)0.5;
        head->gain = (hf_real)0.3;
        head->hold = (hf_real)0.05;
        head->highest = 40;
        for (size_t k = 0; k < most; ++k) {
            head->causes[k] = (int32_t)k + 1;
        }
    }
    if (take(in, 1) % 8 == 0) {
        holdfast_head *const head = &rule->heads[(size_t)take(in, 1) % HOLDFAST_N_HEADS];
        size_t *const sizes[] = {&head->n_outputs, &head->n_features, &head->first};
        spoil(in, sizes, sizeof sizes / sizeof *sizes);
        head->causes[(size_t)take(in, 1) % 6] = (int32_t)take(in, 4);
        rule->contact = (int32_t)take(in, 1) - 100;
        head->gain = (hf_real)take_number(in);
    }
}

/* Process samples until the input ends. */
static void process(
    input *in, const holdfast_model *model, holdfast_detector_memory *d, hf_real *readings,
    size_t n_taxels)
{
    const holdfast_hand *const hand = model->hand;
    bool *const present = (bool *)malloc(hand->n_fingers * sizeof(bool));
    holdfast_finger_estimate *const estimates =
        (holdfast_finger_estimate *)malloc(hand->n_fingers * sizeof *estimates);
    double time = take_number(in);
    while (present && estimates && in->size > 0) {
        const size_t n_changed = (size_t)take(in, 1) % 16, n_times = 1 + (size_t)take(in, 1) % 32;
        for (size_t i = 0; i < n_changed; ++i) {
            readings[(size_t)take(in, 2) % (3 * n_taxels)] = (hf_real)take_number(in);
        }
        for (size_t i = 0; i < hand->n_fingers; ++i) {
            present[i] = take(in, 1) % 8 > 0;
        }
        if (take(in, 1) % 16 == 0) {
            time = take_number(in);
        }
        const bool noisy = take(in, 1) % 2;
        for (size_t k = 0; k < n_times; ++k) {
            for (size_t i = 0; noisy && i < 3 * n_taxels; ++i) {
                readings[i] += (hf_real)((i * 7 + k * 13) % 5) - 2;
            }
            time += (double)hand->period;
            holdfast_detect(model, d, time, readings, present, estimates);
        }
    }
    for (size_t i = 0; i < hand->n_fingers; ++i) {
        holdfast_baseline(model, d, i, readings + 3 * hand->fingers[i].first_taxel);
    }
    free(estimates);
    free(present);
}

/* Make a model for a hand, and run its detector if the model is accepted. */
static void run(input *in, const holdfast_hand *hand, size_t n_taxels)
{
    holdfast_model model;
    memset(&model, 0, sizeof model);
    model.hand = hand;
    model.n_model_fingers = 1 + (size_t)take(in, 1) % 3;
    model.hysteresis = (hf_real)0.1;
    model.min_duration = (hf_real)(take(in, 1) % 2) / 10;
    model.hold = (hf_real)(take(in, 1) % 2) / 10;
    model.has_filter = take(in, 1) % 2;
    model.switching = 15;
    model.n_weights = 8 + (6 + 3) * (hand->n_features + 1);
    holdfast_rule *const rules = (holdfast_rule *)calloc(hand->n_fingers, sizeof *rules);
    hf_real *const weights = (hf_real *)calloc(model.n_weights, sizeof(hf_real));
    hf_real *const readings = (hf_real *)malloc(3 * n_taxels * sizeof(hf_real));
    for (size_t i = 0; i < model.n_weights; ++i) {
        weights[i] = (hf_real)(i % 5) - 2;
    }
    for (size_t i = 0; i < hand->n_fingers; ++i) {
        make_rule(in, &rules[i], hand);
    }
    for (size_t i = 0; i < 3 * n_taxels; ++i) {
        readings[i] = (hf_real)(30000 + i % 7);
    }
    model.rules = rules;
    model.weights = weights;
    const bool fits = !holdfast_check_model(&model);
    const size_t size = fits ? holdfast_detector_size(&model) : 0;
    void *const block = fits && size <= MAX_MEMORY ? malloc(size) : NULL;
    if (block) {
        holdfast_detector_memory d;
        holdfast_detector_use_memory(&model, &d, block);
        holdfast_start(&model, &d, take(in, 1) % 2 ? readings : NULL);
        process(in, &model, &d, readings, n_taxels);
    }
    free(block);
    free(readings);
    free(weights);
    free(rules);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    input in = {data, size};
    holdfast_hand hand;
    memset(&hand, 0, sizeof hand);
    make_sizes(&in, &hand);
    size_t n_taxels = 0;
    holdfast_finger fingers[3];
    memset(fingers, 0, sizeof fingers);
    for (size_t i = 0; i < hand.n_fingers; ++i) {
        make_finger(&in, &fingers[i], hand.n_lags);
        fingers[i].first = hand.n_lanes;
        fingers[i].first_taxel = n_taxels;
        n_taxels += fingers[i].n_taxels;
        hand.n_lanes += hf_n_lanes(fingers[i].n_taxels);
    }
    const size_t n_made = hand.n_fingers, n_spoilt = (size_t)take(&in, 1) % 6;
    if (n_spoilt == 1) {
        size_t *const sizes[] = {&hand.n_fingers, &hand.n_lanes,   &hand.n_features,
                                 &hand.n_lags,    &hand.n_history, &hand.n_channels,
                                 &hand.n_levels,  &hand.n_track,   &hand.n_slides};
        spoil(&in, sizes, sizeof sizes / sizeof *sizes);
    }
    const bool is_small = hand.n_fingers <= MAX_LENGTH && hand.n_lanes <= MAX_LENGTH &&
                          hand.n_features <= MAX_LENGTH && hand.n_lags <= MAX_LENGTH &&
                          hand.n_fingers * hand.n_features <= MAX_LENGTH;
    if (!is_small) { /* no arrays of such lengths: the sizes alone must be refused, or not */
        hf_check_sizes(&hand);
        return 0;
    }
    const size_t n_features = hand.n_fingers * hand.n_features;
    holdfast_finger *const f = (holdfast_finger *)calloc(hand.n_fingers, sizeof *f);
    holdfast_feature *const features = (holdfast_feature *)calloc(n_features, sizeof *features);
    holdfast_lag *const lags = (holdfast_lag *)calloc(hand.n_lags, sizeof *lags);
    hf_real *const used = (hf_real *)calloc(hand.n_lanes, sizeof(hf_real));
    hf_real *const rotations = (hf_real *)calloc(hand.n_lanes, 9 * sizeof(hf_real));
    hf_real *const positions = (hf_real *)calloc(hand.n_lanes, 3 * sizeof(hf_real));
    for (size_t i = 0; i < n_made && i < hand.n_fingers; ++i) {
        f[i] = fingers[i];
        for (size_t j = f[i].first; j < f[i].first + f[i].n_taxels && j < hand.n_lanes; ++j) {
            used[j] = 1;
        }
    }
    for (size_t i = 0; i < 9 * hand.n_lanes; ++i) {
        rotations[i] = (hf_real)(i % 4) / 4;
    }
    for (size_t i = 0; i < 3 * hand.n_lanes; ++i) {
        positions[i] = (hf_real)(i % 5) - 2;
    }
    for (size_t i = 0; i < hand.n_lags; ++i) {
        lags[i].samples = (size_t)take(&in, 1) % 40;
        lags[i].seconds = (double)lags[i].samples * (double)hand.period;
        lags[i].has_changes = take(&in, 1) % 2;
        lags[i].sliding = hand.n_slides ? take(&in, 8) : 0;
    }
    for (size_t i = 0; i < n_features && hand.n_history > 0; ++i) {
        make_feature(&in, &features[i], i % hand.n_features, &hand);
    }
    if (n_spoilt == 2 && hand.n_fingers > 0) {
        holdfast_finger *const finger = &f[(size_t)take(&in, 1) % hand.n_fingers];
        size_t *const sizes[] = {
            &finger->first_taxel, &finger->n_taxels, &finger->first, &finger->sigma_window,
            &finger->ready_window};
        spoil(&in, sizes, sizeof sizes / sizeof *sizes);
    } else if (n_spoilt == 3 && n_features > 0) {
        holdfast_feature *const feature = &features[(size_t)take(&in, 1) % n_features];
        size_t *const sizes[] = {&feature->window, &feature->lag, &feature->same_as};
        spoil(&in, sizes, sizeof sizes / sizeof *sizes);
    } else if (n_spoilt == 4) {
        hand.period = (hf_real)take_number(&in);
        hand.tare_kind = (int32_t)take(&in, 4);
        for (size_t i = 0; i < n_features; ++i) {
            features[i].kind += (int32_t)take(&in, 1) % 16;
            features[i].transform += (int32_t)take(&in, 1) % 2;
        }
        for (size_t i = 0; i < hand.n_lags; ++i) {
            lags[i].samples = (size_t)take(&in, 8);
            lags[i].seconds = take_number(&in);
        }
    } else if (n_spoilt == 5 && hand.n_lanes > 0) {
        used[(size_t)take(&in, 1) % hand.n_lanes] = (hf_real)take_number(&in);
        rotations[(size_t)take(&in, 1) % (9 * hand.n_lanes)] = (hf_real)take_number(&in);
    }
    hand.fingers = f;
    hand.features = features;
    hand.lags = lags;
    hand.used = used;
    hand.rotations = rotations;
    hand.positions = positions;
    if (!holdfast_check(&hand)) {
        n_taxels = 0;
        for (size_t i = 0; i < hand.n_fingers; ++i) {
            n_taxels += f[i].n_taxels;
        }
        run(&in, &hand, n_taxels);
    }
    free(f);
    free(features);
    free(lags);
    free(used);
    free(rotations);
    free(positions);
    return 0;
}
