/* What the parts of the detector share: functions of one file that others call. Each is explained
 * where it is defined. */
#ifndef HF_DECISION_H
#define HF_DECISION_H

#include "holdfast.h"

#include "finger.h"

/* What a force shows. Unsteady: what is left of it is as small as without contact, but it still
 * moves; or a large share of it comes or goes at once. Such a finger closes, opens or is pushed. */
enum { HF_IN_CONTACT, HF_UNSTEADY, HF_WITHOUT_CONTACT };

/* contact.c */
HF_SHARED int hf_find_contact(
    const hf_finger *f, const holdfast_rule *rule, holdfast_decision *d, bool zero_unknown,
    double time);
HF_SHARED void hf_follow(const hf_finger *f, hf_real rest[3]);

/* heads.c */
HF_SHARED hf_real
hf_head_value(const holdfast_head *head, const hf_real *weights, const hf_real *phi);
HF_SHARED hf_real hf_probability(hf_real log_odds);
HF_SHARED int32_t hf_add_scores(
    const holdfast_head *head, const hf_real *weights, const hf_real *phi, hf_real *scores);
HF_SHARED void hf_forget_cause(holdfast_decision *d);
HF_SHARED bool hf_is_held(double time, double last, hf_real hold, hf_real period);
HF_SHARED void hf_decide_slip(
    const holdfast_head *head, holdfast_decision *d, hf_real z, double time, hf_real period);
HF_SHARED void hf_follow_slip(
    const holdfast_head *head, const hf_real *weights, const hf_real *phi, holdfast_decision *d,
    double time, hf_real period);
HF_SHARED void hf_end_slip(const holdfast_rule *rule, holdfast_decision *d, hf_real probability);

/* decision.c */
HF_SHARED hf_real hf_filter(
    holdfast_decision *d, hf_real probability, hf_real threshold, hf_real switching, double time);
HF_SHARED int32_t
hf_classify(hf_real probability, hf_real threshold, hf_real hysteresis, int32_t reported);
HF_SHARED int32_t
hf_hold(holdfast_decision *d, int32_t state, hf_real hold, double time, hf_real period);
HF_SHARED void hf_debounce(
    holdfast_decision *d, int32_t state, hf_real min_duration, double time, hf_real period);
HF_SHARED void hf_decide_unready(
    const holdfast_model *model, const hf_finger *f, const holdfast_rule *rule,
    holdfast_decision *d, bool is_present, double time);
HF_SHARED void hf_decide(
    const holdfast_model *model, const hf_finger *f, const holdfast_rule *rule,
    holdfast_decision *d, const hf_real *phi, int contact, double time);

/* detector.c */
HF_SHARED void hf_start_decision(holdfast_decision *d);

#endif
