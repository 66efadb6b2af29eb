/* Position controller of the hand: PD control with the imperfections of a real controller.
 *
 * Encoders and torques are quantised, torques have noise and limits, and gravity is compensated
 * only in part. The gains of the joints and all random numbers come from control.py. */
#include "steps.h"

/* Gain of each joint [N m s/rad]; the hand rings a little at 6 to 8 Hz, like the real one. */
#define DERIVATIVE 0.03
/* Resolution of the joint angles [rad], from the hand's protocol. */
#define ENCODER_STEP (333.3 / 65536 * PI / 180)
/* Step of the PWM and nominal limit of the hand [N m]. With the limits of the vendor's ROS driver
 * (0.225 N m at the end of the thumb) it could press with at most 2 N. */
#define TORQUE_STEP 1e-3
#define TORQUE_LIMIT 0.7
/* Filter of the vendor's driver for the angles that it publishes: y = 0.6 y + 0.198 (x_last + x) */
#define ANGLE_MEMORY 0.6
#define ANGLE_PART 0.198

/* Compute one step: tau = k_p e - k_d dq/dt + gravity, quantised, with noise and limits.
 *
 * `joints` are angles [rad], `bias` torques that balance gravity and motion [N m], `target`
 * set-points [rad]; the first 16 `torques` are written [N m]. */
static void control(
    const controller *c, int64_t tick, const double *joints, const double *bias,
    const double *target, double period, double *torques)
{
    const size_t number = (size_t)tick;
    const double *const errors = c->errors[number < c->n_errors ? number : c->n_errors - 1];
    const double *const noise = c->noise[number % c->n_noise];
    for (size_t j = 0; j < N_JOINTS; ++j) {
        if (isnan(c->geared[j])) {
            c->geared[j] = joints[j];
        }
        /* A play of width b lets the encoder rest until the joint takes it along. */
        const double half = 0.5 * c->backlash;
        const double geared = smaller(larger(c->geared[j], joints[j] - half), joints[j] + half);
        c->geared[j] = geared;
        const double angle = ENCODER_STEP * rint(geared / ENCODER_STEP);
        double speed = (angle - c->last[j]) / period;
        if (isnan(speed)) {
            speed = 0.0;
            c->last[j] = c->published[j] = angle;
        }
        c->published[j] *= ANGLE_MEMORY;
        c->published[j] += ANGLE_PART * (c->last[j] + angle);
        c->last[j] = angle;
        const double error = target[j] + errors[j] - angle;
        double torque = c->gains[j] * error - DERIVATIVE * speed;
        torque += c->compensation[j] * bias[j];
        torque = TORQUE_STEP * rint(torque / TORQUE_STEP) + noise[j];
        torques[j] = smaller(larger(torque, -TORQUE_LIMIT), TORQUE_LIMIT);
    }
}

/* Return the largest error of a set-point in a step of the controller, in a glitch [rad]. */
static double glitch(const controller *c, int64_t tick)
{
    const size_t number = (size_t)tick;
    const double *const errors = c->errors[number < c->n_errors ? number : c->n_errors - 1];
    double worst = 0.0;
    for (size_t j = 0; j < N_JOINTS; ++j) {
        worst = larger(worst, fabs(errors[j]));
    }
    return worst;
}
