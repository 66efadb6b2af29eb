/* Contact law of one node of a soft skin: normal force, and friction by a bristle.
 *
 * The skin is a Winkler foundation: every node is a separate spring on the fingertip. Along the
 * surface each node has a bristle, which stretches up to Coulomb's limit and then slides. At rest
 * a bristle is a spring, so nothing creeps, and the slip speed of each node is known. */
#include "steps.h"

#define MIN_SLIP_SPEED 1e-12 /* slower slip is set to zero, to avoid denormal numbers [m/s] */

/* A node inside the object. */
typedef struct {
    double depth;     /* below the surface, above 0 [m] */
    double stiffness; /* at small depths [N/m] */
    double pressed;   /* normal force [N] */
} pressed_node;

/* Compute the normal force of a node at rest, N(d) = k d (1 + h d) [N]. */
static double elastic(const skin *s, double stiffness, double depth)
{
    return stiffness * depth * (1.0 + s->hardening * depth);
}

/* Compute the normal force of a moving node, N(d) (1 - c v_n), at least 0 [N]; v_n is the speed
 * along the outward normal. */
static double pressure(const skin *s, double stiffness, double depth, double leaving)
{
    return elastic(s, stiffness, depth) * larger(1.0 - s->damping * leaving, 0.0);
}

/* Return the share of a slip speed that is left after a time in its low-pass filter. */
static double memory_after(const skin *s, double dt)
{
    return exp(-dt / s->memory);
}

/* Friction falls with the slip speed: mu = mu_k + (mu_s - mu_k) exp(-v_f / v_s) (Stribeck). */
static double coefficient(const solid *object, const skin *s, double slip)
{
    const double drop = slip > 0.0 ? exp(-slip / s->stribeck) : 1.0;
    return object->mu_kinetic + (object->mu_static - object->mu_kinetic) * drop;
}

/* Return the slip speed of a node after a first-order low-pass filter [m/s]. */
static double smoothed(double before, double slip, double keep)
{
    if (before == slip) {
        return slip;
    }
    const double after = slip + (before - slip) * keep;
    return after > MIN_SLIP_SPEED ? after : 0.0;
}

/* Return the part of a vector along the surface. */
static vec tangential(vec v, vec normal)
{
    return add(v, scaled(normal, -dot(v, normal)));
}

/* Compute friction on a node in the object's frame [N], and advance its bristle.
 *
 * The bristle b follows the motion along the surface. The friction is T = -k_t (b + tau v_t) with
 * k_t = shear N(d) / (d + d_0), and |T| is at most mu N. A bristle longer than mu N / k_t is
 * shortened to that length (return mapping), and the node slides by the difference.
 *
 * `rotation` leads from the fingertip frame to the object's, in which `normal` and the velocity
 * along the surface, `sliding`, are; `keep` is `memory_after` the step dt. */
static vec friction(
    const solid *object, const skin *s, bristle *held, const mat *rotation, vec normal, vec sliding,
    pressed_node at, double dt, double keep)
{
    const double kt = s->shear * elastic(s, at.stiffness, at.depth) / (at.depth + s->engagement);
    const double limit = at.pressed * coefficient(object, s, held->slip);
    vec b = tangential(add(apply(rotation, held->stretch), scaled(sliding, dt)), normal);
    const double length = sqrt(dot(b, b));
    double slip = 0.0;
    if (length * kt > limit) {
        slip = (length - limit / kt) / dt;
        b = scaled(b, limit / (kt * length));
    }
    held->stretch = apply_transposed(rotation, b);
    held->slip = smoothed(held->slip, slip, keep);
    vec force = scaled(add(b, scaled(sliding, s->shear_time)), -kt);
    const double square = dot(force, force);
    if (square > limit * limit) {
        force = scaled(force, limit / sqrt(square));
    }
    return force;
}
