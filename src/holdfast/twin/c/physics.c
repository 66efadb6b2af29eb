/* One sample of physics: a few steps of MuJoCo, contact, operator and controller.
 *
 * MuJoCo's half steps are called by their addresses, because a call from Python with its arrays
 * costs as much as the half step; see physics.py. */
#include "steps.h"

/* Addresses of MuJoCo's half steps, of a model and of its state. */
typedef struct {
    int64_t first_half, second_half, model, data;
} half_steps;

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

/* The steps of a sample. */
typedef struct {
    int64_t n;
    double period;       /* of a step, that of the model [s] */
    int64_t per_control; /* steps in a step of the controller */
} steps;

/* Force and torque on the object: of operator and loads, and with the fingers'. */
typedef struct {
    wrench *outside, *total;
} wrenches;

/* State of hand, object and contact, which a step writes in place, and what it needs. */
typedef struct {
    steps steps;
    hand arrays;
    contact contact;
    constants constants;
    controller controller;
    body *bodies;
    wrenches wrenches;
} physics;

static void add_wrench(wrench *sum, wrench w)
{
    sum->force = add(sum->force, w.force);
    sum->torque = add(sum->torque, w.torque);
}

/* Fill force and torque on the object: of operator and loads, and with the fingers'. */
static void operate(
    const action *a, const body *object, const wrench *fingers, double time, double elapsed,
    const wrenches *out)
{
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
    *out->total = outside;
    add_wrench(out->total, *fingers);
    add_wrench(&outside, *a->pull);
    add_wrench(out->total, *a->pull);
    *out->outside = outside;
}

/* Apply all forces of step k of a sample, between MuJoCo's half steps.
 *
 * Return the largest error of a set-point, in a glitch of the controller [rad]; 0 between the steps
 * of the controller. */
static double apply_all(
    const physics *p, int64_t tick, int64_t k, const double *target, const action *a, double time)
{
    const steps *const s = &p->steps;
    fill_bodies(&p->arrays, p->bodies);
    touch(&p->contact, &p->constants, p->bodies, s->period);
    const double elapsed = a->elapsed + (double)k * s->period;
    const body *const object = &p->bodies[p->contact.n_tips];
    operate(a, object, p->contact.wrench, time, elapsed, &p->wrenches);
    apply_forces(&p->arrays, p->contact.tips, p->wrenches.total, p->bodies);
    if ((tick + k) % s->per_control != 0) {
        return 0.0;
    }
    const int64_t number = (tick + k) / s->per_control;
    control(
        &p->controller, number, p->arrays.qpos, p->arrays.qfrc_bias, target,
        (double)s->per_control * s->period, p->arrays.qfrc_applied);
    return glitch(&p->controller, number);
}

/* Advance the physics by one sample, whose first step has the number `tick`.
 *
 * `target` are set-points of the joints [rad]. Return the largest error of a set-point, in a glitch
 * of the controller [rad]. */
static double advance_sample(
    const half_steps *engine, const physics *p, int64_t tick, const double *target, const action *a)
{
    typedef void half_step(void *model, void *data);
    half_step *const first_half = (half_step *)(uintptr_t)engine->first_half;
    half_step *const second_half = (half_step *)(uintptr_t)engine->second_half;
    void *const model = (void *)(uintptr_t)engine->model, *const data =
                                                              (void *)(uintptr_t)engine->data;
    double worst = 0.0, time = a->time;
    for (int64_t k = 0; k < p->steps.n; ++k) {
        first_half(model, data);
        worst = larger(worst, apply_all(p, tick, k, target, a, time));
        second_half(model, data);
        time += p->steps.period; /* as MuJoCo adds it */
    }
    return worst;
}
