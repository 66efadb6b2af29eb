/* Contact of soft fingertips with an object: forces and slip.
 *
 * Every node of a fingertip's skin inside the object presses and sticks on its own (skin.c), or
 * all of them are coupled through an elastic body (coupled.c). The computation is in the frame of
 * the object, where its shape is known. */
#include "steps.h"

/* Pose and motion of a fingertip relative to the object, in the object's frame. */
typedef struct {
    mat rotation;
    vec offset;
    vec velocity, spin;
} relative;

static relative relative_to(const body *object, const body *finger)
{
    const mat *const back = &object->rotation;
    const mat axes = transposed(&finger->rotation);
    const mat turned = {
        apply_transposed(back, axes.x), apply_transposed(back, axes.y),
        apply_transposed(back, axes.z)};
    relative r;
    r.rotation = transposed(&turned);
    r.offset = apply_transposed(back, subtract(finger->position, object->position));
    const vec carried = cross(apply_transposed(back, object->spin), r.offset);
    r.velocity =
        subtract(apply_transposed(back, subtract(finger->velocity, object->velocity)), carried);
    r.spin = apply_transposed(back, subtract(finger->spin, object->spin));
    return r;
}

/* Return whether the ball that contains all nodes is clear of the object. */
static bool is_far(const constants *c, const relative *r)
{
    const vec centre = add(apply(&r->rotation, c->skin->ball_centre), r->offset);
    const double clear = c->skin->ball_radius + MAX_RELIEF * c->solid->texture_amplitude;
    return probe(c->solid, centre).distance > clear;
}

/* Clear the state of a node that touches nothing. */
static void clear_node(bristle *b, vec *force)
{
    *b = (bristle){{0.0, 0.0, 0.0}, 0.0, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, 0.0};
    *force = (vec){0.0, 0.0, 0.0};
}

/* Return force and torque about the object of all nodes of a fingertip, in the object's frame.
 *
 * If a node is at distance d from the object, no later node whose path from it is shorter than d
 * can touch either. So most nodes are skipped. */
static wrench sum_nodes(
    const constants *c, const relative *r, double dt, bristle *bristles, vec *forces, tip *out)
{
    const solid object = *c->solid; /* copies: they are not read again after every store */
    const skin material = *c->skin;
    const double keep = memory_after(&material, dt);
    const double reach = MAX_RELIEF * object.texture_amplitude;
    double load = 0.0, slip = 0.0, slipping = 0.0, clear = -1.0;
    wrench sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    for (size_t i = 0; i < c->n_nodes; ++i) {
        const node *const n = &c->nodes[i];
        if (n->path_length < clear) {
            clear_node(&bristles[i], &forces[i]);
            continue;
        }
        const vec arm = apply(&r->rotation, n->position);
        const vec point = add(arm, r->offset);
        const nearest found = probe(&object, point);
        const vec normal = found.gradient;
        if (found.distance >= reach) {
            clear_node(&bristles[i], &forces[i]);
            clear = n->path_length + found.distance - reach;
            continue;
        }
        const double depth = -found.distance - relief(&object, point);
        if (depth <= 0.0) {
            clear_node(&bristles[i], &forces[i]);
            continue;
        }
        const vec velocity = add(r->velocity, cross(r->spin, arm));
        const double pressed = pressure(&material, n->stiffness, depth, dot(velocity, normal));
        if (pressed <= 0.0) {
            clear_node(&bristles[i], &forces[i]);
            continue;
        }
        const vec held = friction(
            &object, &material, &bristles[i], &r->rotation, normal, tangential(velocity, normal),
            (pressed_node){depth, n->stiffness, pressed}, dt, keep);
        const vec total = add(scaled(normal, pressed), held);
        forces[i] = apply_transposed(&r->rotation, total);
        sum.force = add(sum.force, total);
        sum.torque = add(sum.torque, cross(point, total));
        load += pressed;
        slip += pressed * bristles[i].slip;
        slipping += bristles[i].slip > material.slipping ? pressed : 0.0;
    }
    const double weight = larger(load, 1e-300);
    out->slip = slip / weight;
    out->slipping_share = slipping / weight;
    out->load = load;
    return sum;
}

#include "coupled.c"

/* Compute one step of the contact: forces at these poses and velocities, new bristles.
 *
 * Forces on fingertips and object act at the same points in opposite directions, so momentum and
 * angular momentum are conserved up to rounding. `bodies` are the fingertip frames, then the
 * object, whose origin is its centre of mass; dt is the time since the last step [s]. */
static void touch(const contact *state, const constants *c, const body *bodies, double dt)
{
    const body *const object = &bodies[state->n_tips];
    vec force = {0.0, 0.0, 0.0}, torque = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < state->n_tips; ++i) {
        tip *const out = &state->tips[i];
        bristle *const bristles = &state->bristles[i * c->n_nodes];
        vec *const forces = &state->node_forces[i * c->n_nodes];
        const relative r = relative_to(object, &bodies[i]);
        if (is_far(c, &r)) {
            if (out->load != 0.0 || out->travel != 0.0) {
                for (size_t k = 0; k < c->n_nodes; ++k) {
                    clear_node(&bristles[k], &forces[k]);
                }
                *out = (tip){{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}, 0.0, 0.0, 0.0, 0.0};
            }
            continue;
        }
        const wrench sum = c->skin->shear_modulus > 0.0
                               ? sum_coupled_nodes(c, &r, dt, bristles, forces, out)
                               : sum_nodes(c, &r, dt, bristles, forces, out);
        force = add(force, sum.force);
        torque = add(torque, sum.torque);
        const vec about_tip = subtract(sum.torque, cross(r.offset, sum.force));
        out->wrench.force = apply(&object->rotation, sum.force);
        out->wrench.torque = apply(&object->rotation, about_tip);
    }
    force = apply(&object->rotation, force);
    torque = apply(&object->rotation, torque);
    state->wrench->force = (vec){-force.x, -force.y, -force.z};
    state->wrench->torque = (vec){-torque.x, -torque.y, -torque.z};
}
