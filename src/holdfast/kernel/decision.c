/* The decision about a finger: from its probability of stability to the state that is reported. */
#include "decision.h"

/* Time over which neighbouring samples are one piece of evidence [s]: samples that come faster
 * count less in the forward filter, so that it does the same at any rate. */
#define HF_EVIDENCE_SECONDS ((hf_real)(1.0 / 60))
/* Bound of probabilities and thresholds in the forward filter, from 0 and from 1. */
#ifdef HOLDFAST_SINGLE
#define HF_LEAST_PROBABILITY ((hf_real)1e-6) /* 1 - 1e-12 is 1 in single precision */
#else
#define HF_LEAST_PROBABILITY ((hf_real)1e-12)
#endif

static hf_real hf_bounded_log_odds(hf_real probability)
{
    const hf_real p = hf_min(hf_max(probability, HF_LEAST_PROBABILITY), 1 - HF_LEAST_PROBABILITY);
    return hf_log(p / (1 - p));
}

/* Return the probability of stability by the forward filter of two states.
 *
 * A sample counts for or against stability by how far its probability is from the threshold, so
 * that the filter never decides against samples that are all on one side. */
HF_SHARED hf_real hf_filter(
    holdfast_decision *d, hf_real probability, hf_real threshold, hf_real switching, double time)
{
    /* e = logit p - logit p_0. Prediction over dt: the chance of each state moves towards 1/2,
     * tanh(L/2) -> exp(-2 r dt) tanh(L/2). Update: L -> L + min(1, dt / T_e) e. */
    const hf_real middle = hf_bounded_log_odds(threshold);
    const hf_real evidence = hf_bounded_log_odds(probability) - middle;
    hf_real filtered = evidence;
    if (!isnan(d->filtered)) {
        const hf_real step = (hf_real)(time - d->filtered_at);
        const hf_real lean = hf_exp(-2 * switching * step) * hf_tanh(d->filtered / 2);
        filtered = hf_log((1 + lean) / (1 - lean));
        filtered += hf_min(1, step / HF_EVIDENCE_SECONDS) * evidence;
    }
    d->filtered = filtered;
    d->filtered_at = time;
    return hf_probability(filtered + middle);
}

/* Return STABLE from the threshold on. Hysteresis moves it away from the reported state. */
HF_SHARED int32_t
hf_classify(hf_real probability, hf_real threshold, hf_real hysteresis, int32_t reported)
{
    if (reported == HOLDFAST_STABLE) {
        threshold -= hysteresis;
    } else if (reported != HOLDFAST_UNKNOWN) {
        threshold += hysteresis;
    }
    return probability >= threshold ? HOLDFAST_STABLE : HOLDFAST_UNSTABLE;
}

/* Return UNSTABLE while it is held, else the state of a finger in contact.
 *
 * A contact that has just begun closes: its first sample counts as unstable for the hold time. */
HF_SHARED int32_t
hf_hold(holdfast_decision *d, int32_t state, hf_real hold, double time, hf_real period)
{
    if (state == HOLDFAST_UNSTABLE || d->candidate == HOLDFAST_NO_CONTACT) {
        d->last_unstable = time;
    }
    return hf_is_held(time, d->last_unstable, hold, period) ? HOLDFAST_UNSTABLE : state;
}

/* Report the state if it has lasted long enough, or if the reported state is UNKNOWN. */
HF_SHARED void hf_debounce(
    holdfast_decision *d, int32_t state, hf_real min_duration, double time, hf_real period)
{
    /* Reported once t - t_since + T / 2 >= min_duration: half a period allows for rounding. */
    if (state != d->candidate) {
        d->candidate = state;
        d->candidate_since = time;
    }
    const hf_real lasted = (hf_real)(time - d->candidate_since) + period / 2;
    if (d->state == HOLDFAST_UNKNOWN || lasted >= min_duration) {
        d->state = state;
    }
}

/* Report UNKNOWN for a finger without features, at once.
 *
 * A fault that leaves a force is reported when it has lasted; the probability is kept until then.
 */
HF_SHARED void hf_decide_unready(
    const holdfast_model *model, const hf_finger *f, const holdfast_rule *rule,
    holdfast_decision *d, bool is_present, double time)
{
    if (f->values->reason != HOLDFAST_FAULT || isnan(f->values->amplitude)) {
        d->state = d->candidate = HOLDFAST_UNKNOWN;
    } else if (is_present) {
        hf_debounce(d, HOLDFAST_UNKNOWN, model->min_duration, time, f->hand->period);
    }
    if (d->state == HOLDFAST_UNKNOWN) {
        d->probability = d->filtered = HF_NAN;
        d->last_unstable = NAN;
        hf_forget_cause(d);
        hf_end_slip(rule, d, HF_NAN);
    } else {
        f->values->reason = HOLDFAST_READY;
    }
}

/* Return the state of a finger in contact, before the minimum duration, from its probability. */
static int32_t hf_decide_contact(
    const holdfast_model *model, const hf_finger *f, const holdfast_rule *rule,
    holdfast_decision *d, const hf_real *phi, double time)
{
    const hf_real threshold = rule->heads[HOLDFAST_HEAD_STABLE].threshold;
    if (model->has_filter) {
        d->probability = hf_filter(d, d->probability, threshold, model->switching, time);
    }
    int32_t state = hf_classify(d->probability, threshold, model->hysteresis, d->state);
    if (d->is_unsteady) {
        /* The force decides the state alone; the probability stays that of the features. A
         * probability of 0 put samples that hold below those that slip, and the filter kept it. */
        state = HOLDFAST_UNSTABLE;
    }
    /* The cause comes before the hold: a contact that begins closes, and is held as unstable. */
    const holdfast_head *const causes = &rule->heads[HOLDFAST_HEAD_CAUSE];
    if ((state == HOLDFAST_UNSTABLE || d->candidate == HOLDFAST_NO_CONTACT) &&
        causes->n_outputs > 0) {
        d->cause = hf_add_scores(causes, model->weights, phi, d->scores);
    }
    return hf_hold(d, state, model->hold, time, f->hand->period);
}

/* Decide the state of a finger from its features, and report it when it has lasted. */
HF_SHARED void hf_decide(
    const holdfast_model *model, const hf_finger *f, const holdfast_rule *rule,
    holdfast_decision *d, const hf_real *phi, int contact, double time)
{
    const holdfast_head *const heads = rule->heads, *const slip = &heads[HOLDFAST_HEAD_SLIP];
    const bool by_load = rule->contact == HOLDFAST_CONTACT_BY_LOAD;
    const bool unloaded = contact == HF_WITHOUT_CONTACT;
    const hf_real period = f->hand->period;
    int32_t state = HOLDFAST_NO_CONTACT;
    d->is_unsteady = contact == HF_UNSTEADY;
    d->probability = 0;
    /* By the load, the probability stays that of the features, also without contact. */
    if (by_load || !unloaded) {
        d->probability =
            hf_probability(hf_head_value(&heads[HOLDFAST_HEAD_STABLE], model->weights, phi));
    }
    if (unloaded) {
        d->filtered = HF_NAN;
        hf_follow(f, by_load ? f->state->motion.contact_zero : d->rest);
    } else {
        state = hf_decide_contact(model, f, rule, d, phi, time);
    }
    if (state != HOLDFAST_UNSTABLE) {
        hf_forget_cause(d);
    }
    if (unloaded) {
        hf_end_slip(rule, d, 0);
    } else if (slip->n_outputs > 0) {
        hf_decide_slip(slip, d, hf_head_value(slip, model->weights, phi), time, period);
        if (heads[HOLDFAST_HEAD_SPEED].n_outputs > 0) {
            hf_follow_slip(&heads[HOLDFAST_HEAD_SPEED], model->weights, phi, d, time, period);
        }
    }
    hf_debounce(d, state, model->min_duration, time, period);
}
