/* The forces between MuJoCo's half steps: contact, operator, controller. */
#include "steps.h"

/* What the operator does during a sample, and the loads on the object: see `Action`. */
typedef struct {
    const pose *anchor;
    double hold, weight;
    const sinusoid *tremors; /* (2, 3, n_sinusoids) of the hand that holds, of what disturbs */
    double rms, time;
    const disturbance *parameters;
    const pose *origin;
    int64_t style;
    double duration, elapsed;
    const wrench *pull;
    const guide *guide;
    size_t n_sinusoids;
} action;

/* State of hand, object and contact, which a step writes in place, and what it needs. */
typedef struct {
    hand arrays;
    contact contact;
    constants constants;
    controller controller;
    body *bodies;
    wrench *outside, *total; /* on the object: of operator and loads, and with the fingers' */
    int64_t n_steps;         /* of a sample */
    double period;           /* of a step, that of the model [s] */
    int64_t per_control;     /* steps in a step of the controller */
} physics;

static void add_wrench(wrench *sum, wrench w)
{
    sum->force = add(sum->force, w.force);
    sum->torque = add(sum->torque, w.torque);
}

/* Fill force and torque on the object: of operator and loads, and with the fingers'. */
static void operate(const physics *p, const action *a, double time, double elapsed)
{
    const body *const object = &p->bodies[p->contact.n_tips];
    const tremor holding = {a->tremors, a->n_sinusoids};
    const tremor disturbing = {a->tremors + 3 * a->n_sinusoids, a->n_sinusoids};
    wrench outside = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    if (a->hold > 0.0) {
        add_wrench(
            &outside, hold_wrench(object, a->anchor, a->hold, a->weight, holding, a->rms, time));
    }
    if (a->style >= 0) {
        add_wrench(
            &outside, disturb_wrench(
                          object, a->origin, a->parameters, a->style, a->duration, disturbing,
                          a->rms, elapsed));
    }
    if (a->guide->stiffness > 0.0) {
        add_wrench(&outside, guide_wrench(object, a->guide, time - a->time, disturbing, time));
    }
    *p->total = outside;
    add_wrench(p->total, *p->contact.wrench);
    add_wrench(&outside, *a->pull);
    add_wrench(p->total, *a->pull);
    *p->outside = outside;
}

/* Apply all forces of step k of a sample, whose first step has the number `tick`.
 *
 * `target` are set-points of the joints [rad], `time` is MuJoCo's [s]. Return the largest error of
 * a set-point, in a glitch of the controller [rad]; 0 between the steps of the controller.
 */
static double apply_all(
    const physics *p, int64_t tick, int64_t k, const double *target, const action *a, double time)
{
    fill_bodies(&p->arrays, p->bodies);
    touch(&p->contact, &p->constants, p->bodies, p->period);
    operate(p, a, time, a->elapsed + (double)k * p->period);
    apply_forces(&p->arrays, p->contact.tips, p->total, p->bodies);
    if ((tick + k) % p->per_control != 0) {
        return 0.0;
    }
    const int64_t number = (tick + k) / p->per_control;
    control(
        &p->controller, number, p->arrays.qpos, p->arrays.qfrc_bias, target,
        (double)p->per_control * p->period, p->arrays.qfrc_applied);
    return glitch(&p->controller, number);
}
