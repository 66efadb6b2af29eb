/* Forces of the operator, who holds the object until it is locked, disturbs it, and takes it back.
 *
 * There are two kinds of disturbances. A hand grips the object and moves it to and fro without
 * losing contact, as in the paper. Or a finger approaches from outside, pushes and leaves. Hand and
 * finger have finite stiffness and tremor, because a pure force would make every object fall at
 * once. All wrenches are in the world frame, about the object's centre of mass. */
#include "steps.h"

/* Stiffness [N/m] and damping [N s/m] of the hand that holds the object: a relaxed human arm. */
#define HOLD_STIFFNESS 250.0
#define HOLD_DAMPING 10.0
/* Stiffness [N m/rad] and damping [N m s/rad] of that hand in rotation. */
#define HOLD_TURN_STIFFNESS 0.25
#define HOLD_TURN_DAMPING 0.01
/* Damping of the pushing finger [N s/m]. */
#define PUSH_DAMPING 8.0
/* Maximum force of the pushing finger [N]. */
#define PUSH_LIMIT 14.0
/* Distance from the object at which the pushing finger starts [m]. */
#define PUSH_GAP 0.002
/* Time in which a hand that moves the object closes on it, and opens again [s]. */
#define MOVE_GRASP_TIME 0.15

/* Displacement [m] and speed [m/s] along an axis; of a tremor, those of an rms of 1. */
typedef struct {
    double position, speed;
} motion;

static motion tremor_at(tremor t, double time, size_t axis)
{
    motion m = {0.0, 0.0};
    for (size_t k = 0; k < t.n; ++k) {
        const sinusoid s = t.sinusoids[axis * t.n + k];
        m.position += s.amplitude * sin(s.rate * time + s.phase);
        m.speed += s.amplitude * s.rate * cos(s.rate * time + s.phase);
    }
    return m;
}

/* Return the displacement of a tremor in all axes, and its speed. */
static vec tremble(tremor t, double rms, double time, vec *speed)
{
    const motion x = tremor_at(t, time, 0), y = tremor_at(t, time, 1), z = tremor_at(t, time, 2);
    *speed = scaled((vec){x.speed, y.speed, z.speed}, rms);
    return scaled((vec){x.position, y.position, z.position}, rms);
}

/* Return the rotation to an anchor, small angles: half the sum of r x r_anchor [rad]. */
static vec turn_to(const mat *from, const mat *anchor)
{
    const mat columns = transposed(from), others = transposed(anchor);
    vec turn = {0.0, 0.0, 0.0};
    turn = add(turn, scaled(cross(columns.x, others.x), 0.5));
    turn = add(turn, scaled(cross(columns.y, others.y), 0.5));
    return add(turn, scaled(cross(columns.z, others.z), 0.5));
}

/* Compute the wrench of the hand that holds the object, a damped spring to an anchor.
 *
 * The gain goes from 0 (released) to 1; the hand carries the weight of the object [N]. */
static wrench hold_wrench(
    const body *b, const pose *anchor, double gain, double weight, tremor t, double rms,
    double time)
{
    vec speed;
    const vec position = tremble(t, rms, time, &speed);
    const vec stretch = subtract(add(anchor->position, position), b->position);
    vec force =
        add(scaled(stretch, HOLD_STIFFNESS), scaled(subtract(speed, b->velocity), HOLD_DAMPING));
    const vec turn = turn_to(&b->rotation, &anchor->rotation);
    const vec torque =
        subtract(scaled(turn, HOLD_TURN_STIFFNESS), scaled(b->spin, HOLD_TURN_DAMPING));
    force.z += weight;
    return (wrench){scaled(force, gain), scaled(torque, gain)};
}

/* Compute the wrench of a steady hand that takes the object along: a damped spring to a pose that
 * moves with a constant velocity and spin, and was set the time `ahead` ago. */
static wrench guide_wrench(const body *b, const guide *g, double ahead, tremor t, double time)
{
    vec speed;
    const vec position = tremble(t, g->rms, time, &speed);
    const vec moved = add(g->pose.position, scaled(g->velocity, ahead));
    const vec stretch = subtract(add(moved, position), b->position);
    const vec pace = subtract(add(g->velocity, speed), b->velocity);
    const vec turn = add(turn_to(&b->rotation, &g->pose.rotation), scaled(g->spin, ahead));
    return (wrench){
        add(scaled(stretch, g->stiffness), scaled(pace, g->damping)),
        add(scaled(turn, g->turn_stiffness), scaled(subtract(g->spin, b->spin), g->turn_damping))};
}

/* Return the set-point of the pushing finger along its direction, and its speed. */
static motion aim(int64_t style, double depth, double rate, double elapsed, double duration)
{
    const double way = depth + PUSH_GAP, pulse = PI / duration;
    if (style == PUSH) { /* a raised cosine, there and back */
        return (motion){
            0.5 * way * (1 - cos(2 * pulse * elapsed)), way * pulse * sin(2 * pulse * elapsed)};
    }
    const double wave = sin(pulse * elapsed), square = wave * wave;
    if (style == JERK) { /* a sharper blow: the fourth power of a half sine */
        return (motion){
            way * (square * square), 4 * way * (wave * square) * cos(pulse * elapsed) * pulse};
    }
    const double turning = 2 * PI * rate;
    const double swing = 0.5 - 0.5 * cos(turning * elapsed); /* shaking swells and fades */
    return (motion){
        way * wave * swing, way * (pulse * cos(pulse * elapsed) * swing +
                                   wave * 0.5 * turning * sin(turning * elapsed))};
}

/* Compute the wrench of the pushing finger, which never pulls; `origin` is where the centre of mass
 * was when the push began, `elapsed` the time since then. */
static wrench push_wrench(
    const body *b, vec origin, const disturbance *d, int64_t style, double duration, tremor t,
    double rms, double elapsed)
{
    const motion shaken = tremor_at(t, elapsed, 0);
    motion aimed = aim(style, d->depth, d->rate, elapsed, duration);
    aimed.position += rms * shaken.position - PUSH_GAP;
    aimed.speed += rms * shaken.speed;
    const double along = dot(d->direction, subtract(b->position, origin));
    const double pace = dot(d->direction, add_cross(b->velocity, b->spin, d->arm));
    double pressed = d->stiffness * (aimed.position - along) + PUSH_DAMPING * (aimed.speed - pace);
    if (aimed.position <= along) {
        pressed = 0.0;
    }
    const vec force = scaled(d->direction, smaller(larger(pressed, 0.0), PUSH_LIMIT));
    return (wrench){force, cross(d->arm, force)};
}

/* Compute the wrench of a hand that grips the object and moves it to and fro.
 *
 * The hand is a damped spring to the pose in which it gripped the object, displaced along the
 * direction by depth * sin(2 pi n t / T), n whole cycles in the duration T. It does not carry the
 * weight of the object. The point of contact is not used. */
static wrench move_wrench(
    const body *b, const pose *origin, const disturbance *d, double duration, tremor t, double rms,
    double elapsed)
{
    const double turning = 2 * PI * larger(1.0, rint(d->rate * duration)) / duration;
    const double way = d->depth * sin(turning * elapsed);
    const double speed = d->depth * turning * cos(turning * elapsed);
    const double closed = smaller(elapsed, duration - elapsed) / MOVE_GRASP_TIME;
    const double gain = smaller(larger(closed, 0.0), 1.0) * d->stiffness / HOLD_STIFFNESS;
    const pose anchor = {add(origin->position, scaled(d->direction, way)), origin->rotation};
    wrench w = hold_wrench(b, &anchor, gain, 0.0, t, rms, elapsed);
    w.force = add(w.force, scaled(d->direction, gain * HOLD_DAMPING * speed));
    return w;
}

/* Compute the wrench of a disturbance of any style. */
static wrench disturb_wrench(
    const body *b, const pose *origin, const disturbance *d, int64_t style, double duration,
    tremor t, double rms, double elapsed)
{
    if (style == MOVE) {
        return move_wrench(b, origin, d, duration, t, rms, elapsed);
    }
    return push_wrench(b, origin->position, d, style, duration, t, rms, elapsed);
}
