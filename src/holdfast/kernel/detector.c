/* The detector: a sample of a hand through the kernel and the decisions; tables and memory. */
#include "decision.h"

/* Return whether a finger is dead as a whole. */
static bool hf_is_absent(const holdfast_values *values)
{
    if (!(values->faults & HOLDFAST_DEAD)) {
        return false;
    }
    uint64_t named = 0;
    for (size_t k = 0; k < HOLDFAST_MASK_WORDS; ++k) {
        named |= values->taxels.words[k];
    }
    return named == 0;
}

static int32_t hf_hand_state(const holdfast_model *model, const holdfast_detector_memory *d)
{
    /* UNSTABLE if any finger is, else UNKNOWN if any is, else STABLE if two are in stable contact
     * (one, for a model of one finger, or if only one is not dead), else NO_CONTACT. Fingers that
     * are dead do not count; a hand of these is UNKNOWN. */
    size_t n_stable = 0, n_unknown = 0, n_alive = HF_N_FINGERS(model->hand);
    for (size_t i = 0; i < HF_N_FINGERS(model->hand); ++i) {
        const int32_t state = d->decisions[i].state;
        if (hf_is_absent(&d->memory.values[i])) {
            n_alive -= 1;
            continue;
        }
        if (state == HOLDFAST_UNSTABLE) {
            return HOLDFAST_UNSTABLE;
        }
        n_unknown += state == HOLDFAST_UNKNOWN;
        n_stable += state == HOLDFAST_STABLE;
    }
    if (n_unknown > 0 || n_alive == 0) {
        return HOLDFAST_UNKNOWN;
    }
    const bool by_one =
        model->n_model_fingers <= 1 || (n_alive == 1 && HF_N_FINGERS(model->hand) > 1);
    return n_stable >= (by_one ? 1 : 2) ? HOLDFAST_STABLE : HOLDFAST_NO_CONTACT;
}

/* Return why the finger has its state, if its probability does not say it. */
static int32_t hf_reason(const hf_finger *f, const holdfast_rule *rule, const holdfast_decision *d)
{
    if (f->values->reason != HOLDFAST_READY || d->state != HOLDFAST_UNSTABLE) {
        return f->values->reason;
    }
    if (d->is_unsteady) {
        return HOLDFAST_LOAD;
    }
    if (d->probability >= rule->heads[HOLDFAST_HEAD_STABLE].threshold) {
        return HOLDFAST_HOLD;
    }
    return HOLDFAST_READY;
}

static void hf_fill_estimate(
    const hf_finger *f, const holdfast_rule *rule, const holdfast_decision *d,
    holdfast_finger_estimate *out)
{
    out->time = f->state->last_time;
    out->state = d->state;
    out->reason = hf_reason(f, rule, d);
    out->cause = d->state == HOLDFAST_UNSTABLE ? d->cause : HOLDFAST_NO_CAUSE;
    if (d->slips) { /* a slip is reported before the state becomes UNSTABLE */
        out->cause = HOLDFAST_CAUSE_SLIP;
    }
    out->faults = f->values->faults;
    memcpy(out->faulty_taxels, f->values->taxels.words, sizeof out->faulty_taxels);
    out->stable_probability = d->probability;
    out->slip_probability = d->slip_probability;
    out->slip_speed = d->speed;
    out->slip_distance = d->distance;
    out->instability = f->values->sigma;
    memcpy(out->force, f->values->force, sizeof out->force);
}

HF_API int32_t holdfast_detect(
    const holdfast_model *model, holdfast_detector_memory *d, double time, const hf_real *readings,
    const bool *present, holdfast_finger_estimate *estimates)
{
    const holdfast_hand *const hand = model->hand;
    holdfast_advance(hand, &d->memory, readings, present, time);
    for (size_t i = 0; i < HF_N_FINGERS(hand); ++i) {
        const hf_finger f = hf_finger_of(hand, &d->memory, i);
        const holdfast_rule *const rule = &model->rules[i];
        holdfast_decision *const decision = &d->decisions[i];
        int contact = HF_IN_CONTACT;
        if (present[i] && f.state->n_seen <= 1) { /* the stream begins, perhaps again */
            hf_start_decision(decision);
        }
        if (present[i] && f.values->reason == HOLDFAST_READY) {
            contact = hf_find_contact(&f, rule, decision, model->hand->zero_unknown, time);
            if (f.state->is_rezeroed) { /* until the next touch; of a start in contact, no zero */
                f.state->is_rezeroed = !model->hand->zero_unknown &&
                                       (contact == HF_WITHOUT_CONTACT || !hf_touches_rezeroed(&f));
                contact = f.state->is_rezeroed ? HF_WITHOUT_CONTACT : contact;
                f.values->faults |= f.state->is_rezeroed ? HOLDFAST_REZEROED : 0;
            }
        }
        if (!f.state->is_alive && contact != HF_WITHOUT_CONTACT &&
            f.values->reason == HOLDFAST_READY) {
            f.values->reason = HOLDFAST_WARM_UP; /* constants prove no contact */
        }
        /* After the contact: it may report a drift of the tare, a fault. */
        if (f.values->reason != HOLDFAST_READY) {
            hf_decide_unready(model, &f, rule, decision, present[i], time);
        } else if (present[i]) {
            const hf_real *const phi = d->memory.features + i * HF_N_FEATURES(hand);
            hf_decide(model, &f, rule, decision, phi, contact, time);
        }
        hf_fill_estimate(&f, rule, decision, &estimates[i]);
    }
    d->state = hf_hand_state(model, d);
    return d->state;
}

HF_SHARED void hf_start_decision(holdfast_decision *d)
{
    memset(d, 0, sizeof *d); /* UNKNOWN, no excess, no cause */
    d->probability = d->smoothed = d->filtered = HF_NAN;
    d->slip_log_odds = d->slip_probability = d->speed = d->distance = HF_NAN;
    d->candidate_since = d->last_unstable = d->restless_at = d->filtered_at = NAN;
    d->last_slip = d->slid_at = d->block_start = NAN;
    d->shaken_at = d->loaded_at = -INFINITY;
}

HF_API void holdfast_estimates(
    const holdfast_model *model, holdfast_detector_memory *d, holdfast_finger_estimate *estimates)
{
    for (size_t i = 0; i < HF_N_FINGERS(model->hand); ++i) {
        const hf_finger f = hf_finger_of(model->hand, &d->memory, i);
        hf_fill_estimate(&f, &model->rules[i], &d->decisions[i], &estimates[i]);
    }
}

HF_API void holdfast_start_decisions(const holdfast_model *model, holdfast_detector_memory *d)
{
    d->state = HOLDFAST_UNKNOWN;
    for (size_t i = 0; i < HF_N_FINGERS(model->hand); ++i) {
        hf_start_decision(&d->decisions[i]);
    }
}

HF_API void holdfast_start(
    const holdfast_model *model, holdfast_detector_memory *d, const hf_real *baseline)
{
    holdfast_begin(model->hand, &d->memory, baseline);
    holdfast_start_decisions(model, d);
}

HF_API bool holdfast_baseline(
    const holdfast_model *model, const holdfast_detector_memory *d, size_t finger, hf_real *out)
{
    const holdfast_finger *const own = &model->hand->fingers[finger];
    const size_t n = hf_n_lanes(own->n_taxels);
    const hf_real *const lanes = d->memory.baseline + 3 * own->first;
    for (size_t i = 0; i < own->n_taxels; ++i) {
        for (size_t axis = 0; axis < 3; ++axis) {
            out[3 * i + axis] = lanes[axis * n + i];
        }
    }
    return d->memory.fingers[finger].is_tared;
}

/* Return NULL if a head fits the finger and the weights, else what is wrong. */
static const char *hf_check_head(
    const holdfast_model *model, const holdfast_head *head, size_t name)
{
    const size_t n = head->n_features;
    const size_t most = name == HOLDFAST_HEAD_CAUSE ? (size_t)HOLDFAST_N_CAUSES : 1;
    if (head->n_outputs > most || (name == HOLDFAST_HEAD_STABLE && head->n_outputs != 1)) {
        return "n_outputs of a head";
    }
    if (n > model->hand->n_features || (head->has_squares && head->n_outputs != 1)) {
        return "n_features or has_squares of a head";
    }
    const size_t n_numbers = head->n_outputs * (n + 1) + (head->has_squares ? 3 * n : 0);
    if (head->first > model->n_weights || n_numbers > model->n_weights - head->first) {
        return "first of a head";
    }
    if (!hf_are_finite(model->weights + head->first, n_numbers)) {
        return "a weight of a head";
    }
    if (!isfinite(head->threshold) || !isfinite(head->gain) || !isfinite(head->hold) ||
        !isfinite(head->highest)) {
        return "a number of a head";
    }
    for (size_t k = 0; name == HOLDFAST_HEAD_CAUSE && k < head->n_outputs; ++k) {
        if (head->causes[k] < HOLDFAST_CAUSE_CLOSING || head->causes[k] > HOLDFAST_N_CAUSES) {
            return "causes of a head";
        }
    }
    return NULL;
}

HF_API const char *holdfast_check_model(const holdfast_model *model)
{
    const char *wrong = holdfast_check(model->hand);
    if (!wrong && (!isfinite(model->hysteresis) || !isfinite(model->min_duration) ||
                   !isfinite(model->hold) || !isfinite(model->switching))) {
        wrong = "hysteresis, min_duration, hold or switching";
    }
    for (size_t i = 0; !wrong && i < model->hand->n_fingers; ++i) {
        const holdfast_rule *const rule = &model->rules[i];
        if (rule->contact < HOLDFAST_ALWAYS_CONTACT || rule->contact > HOLDFAST_CONTACT_BY_LOAD ||
            !isfinite(rule->contact_limit)) {
            wrong = "contact or contact_limit of a finger";
        } else if (rule->contact == HOLDFAST_CONTACT_BY_LOAD && model->hand->n_lags == 0) {
            wrong = "contact by the load of a hand without lags";
        }
        for (size_t name = 0; !wrong && name < HOLDFAST_N_HEADS; ++name) {
            wrong = hf_check_head(model, &rule->heads[name], name);
        }
    }
    return wrong;
}

#ifndef HOLDFAST_N_FINGERS
HF_API size_t holdfast_detector_size(const holdfast_model *model)
{
    return holdfast_memory_size(model->hand) + model->hand->n_fingers * sizeof(holdfast_decision);
}

HF_API void holdfast_detector_use_memory(
    const holdfast_model *model, holdfast_detector_memory *d, void *block)
{
    holdfast_use_memory(model->hand, &d->memory, block);
    d->decisions =
        (holdfast_decision *)((unsigned char *)block + holdfast_memory_size(model->hand));
}
#endif
