/* Contact of a skin whose nodes are coupled through an elastic body: a part of contact.c.
 *
 * The body is a half-space of rubber (Poisson's ratio 1/2). The solutions of Boussinesq and
 * Cerruti are then one: a force f at a point moves the surface at the distance r, in the direction
 * e, by
 *
 *     u = (f + e (e . f)) / (4 pi G r),
 *
 * which has no direction of its own, so that the curved surface needs no further assumption. With
 * Coulomb's friction this is the problem of Hertz, Cattaneo and Mindlin.
 *
 * A node that is a depth d inside the object is pushed out by u . n = d, or it is beyond that and
 * carries no force. Along the surface it sticks (u = -stretch) or slides at the limit. Each step
 * goes through the nodes there and back, and solves each with the latest forces of all others,
 * from the forces of the last step (projected Gauss-Seidel). */
#include "steps.h"

enum { MAX_COUPLED = 1024 };
#define OWN_ALONG 1.5 /* mean of 1 + e e^T over all directions along the surface */
#define ROUNDING 1e-9 /* share of its limit by which the force of a sliding node may differ */
#define AWAKE (-1.0)  /* `wake` of a node that presses */
#define APPROACH_MARGIN 1.25 /* by which an approach in a step may exceed speed times step */

/* Return 1 / (4 pi G). */
static double softness_of(const constants *c)
{
    return 1.0 / (4.0 * PI * c->skin->shear_modulus);
}

/* A node inside the object; vectors without a word are in the fingertip frame. */
typedef struct {
    vec point;         /* in the object's frame [m] */
    vec normal, along; /* outward normal of the object; velocity along its surface [m/s] */
    vec stretch;       /* of its bristle if it sticks [m] */
    vec force;
    double depth, leaving;      /* inside the object [m]; speed along the normal [m/s] */
    double pressed, limit, own; /* `own`: displacement by its own unit pressure [m/N] */
} coupled;

/* All nodes of a fingertip that are inside the object, whose displacements are in arrays of their
 * own, so that compilers compute several at a time. */
typedef struct {
    coupled nodes[MAX_COUPLED];
    double x[MAX_COUPLED], y[MAX_COUPLED], z[MAX_COUPLED];    /* positions [m] */
    double ux[MAX_COUPLED], uy[MAX_COUPLED], uz[MAX_COUPLED]; /* displacement by all others [m] */
    double near[MAX_COUPLED];  /* nearness to the node whose force changes */
    size_t index[MAX_COUPLED]; /* of each among all nodes of the skin */
    size_t n;
} patch;

/* Move all nodes of a patch but one, by a change of the force on that one. */
static void move_others(patch *p, const constants *c, size_t node, vec change)
{
    const double softness = softness_of(c);
    const double *const row = &c->nearness[node * c->n_coupled];
    const vec from = c->nodes[node].position, f = scaled(change, softness);
    for (size_t i = 0; i < p->n; ++i) {
        p->near[i] = p->index[i] == node ? 0.0 : row[p->index[i]];
    }
    for (size_t i = 0; i < p->n; ++i) {
        const double dx = p->x[i] - from.x, dy = p->y[i] - from.y, dz = p->z[i] - from.z;
        const double near = p->near[i];
        const double along = near * near * near * (dx * f.x + dy * f.y + dz * f.z);
        p->ux[i] += near * f.x + along * dx;
        p->uy[i] += near * f.y + along * dy;
        p->uz[i] += near * f.z + along * dz;
    }
}

/* Return the displacement of a node of a patch by all others [m]. */
static vec moved(const patch *p, size_t i)
{
    return (vec){p->ux[i], p->uy[i], p->uz[i]};
}

/* Fill the displacement of a node that was not inside the object before. */
static void settle_new(patch *p, const constants *c, size_t i)
{
    const double softness = softness_of(c);
    const size_t node = p->index[i];
    const double *const row = &c->nearness[node * c->n_coupled];
    vec sum = {0.0, 0.0, 0.0};
    for (size_t j = 0; j < p->n; ++j) {
        const coupled *const k = &p->nodes[j];
        const double near = j == i ? 0.0 : row[p->index[j]];
        const vec apart = subtract(c->nodes[node].position, c->nodes[p->index[j]].position);
        const double along = near * near * near * dot(apart, k->force);
        sum = add(sum, add(scaled(k->force, near), scaled(apart, along)));
    }
    p->ux[i] = softness * sum.x;
    p->uy[i] = softness * sum.y;
    p->uz[i] = softness * sum.z;
    p->nodes[i].stretch = tangential(scaled(moved(p, i), -1.0), p->nodes[i].normal);
}

/* Solve a node with the forces of all others; return how much its force changes [N]. */
static double solve_node(patch *p, const constants *c, size_t i, double slip)
{
    coupled *const k = &p->nodes[i];
    const vec others = moved(p, i);
    k->pressed = larger((k->depth - dot(others, k->normal)) / k->own, 0.0);
    k->limit = 0.0;
    vec held = {0.0, 0.0, 0.0};
    if (k->pressed > 0.0) {
        k->limit = k->pressed * coefficient(c->solid, c->skin, slip);
        held = scaled(tangential(add(k->stretch, others), k->normal), -1.0 / (OWN_ALONG * k->own));
        const double length = sqrt(dot(held, held));
        if (length > k->limit) {
            held = scaled(held, k->limit / length);
        }
    }
    const vec force = add(scaled(k->normal, k->pressed), held);
    const vec change = subtract(force, k->force);
    const double square = dot(change, change);
    if (square > 0.0) {
        k->force = force;
        move_others(p, c, p->index[i], change);
    }
    return sqrt(square);
}

/* Return the force on a node with damping, in the fingertip frame, and advance its bristle. */
static vec finish_node(
    const constants *c, const coupled *k, vec others, double dt, double keep, bristle *b)
{
    const skin *const material = c->skin;
    const vec held = tangential(k->force, k->normal);
    double slip = 0.0;
    b->stretch = k->stretch;
    if (dot(held, held) >= k->limit * k->limit * (1.0 - ROUNDING)) { /* it slides */
        const vec pushed = add(others, scaled(held, OWN_ALONG * k->own));
        b->stretch = scaled(tangential(pushed, k->normal), -1.0);
        const vec slid = subtract(k->stretch, b->stretch);
        slip = sqrt(dot(slid, slid)) / dt;
    }
    b->slip = smoothed(b->slip, slip, keep);
    b->force = k->force;
    b->moved = others;
    b->wake = AWAKE;
    const double damped = larger(1.0 - material->damping * k->leaving, 0.0);
    const double kt = material->shear * k->pressed / (k->depth + material->engagement);
    vec friction = subtract(held, scaled(k->along, kt * material->shear_time));
    const double limit = k->limit * damped, square = dot(friction, friction);
    if (square > limit * limit) {
        friction = scaled(friction, limit / sqrt(square));
    }
    return add(scaled(k->normal, k->pressed * damped), friction);
}

/* Fill an empty patch with the nodes of a fingertip that are inside the object.
 *
 * A node that presses nothing sleeps until the fingertip may have come as much closer as it lacks:
 * `travel` adds up all approach and all displacement, and `wake` is its value then. */
static void fill_patch(
    patch *p, const constants *c, const relative *r, double dt, bristle *bristles, vec *forces,
    double travel)
{
    const double reach = MAX_RELIEF * c->solid->texture_amplitude;
    struct {
        size_t node;
        vec force;
    } gone[MAX_COUPLED]; /* nodes that pressed in the last step and are outside now */
    size_t n_gone = 0;
    for (size_t i = 0; i < c->n_nodes; ++i) {
        bristle *const b = &bristles[i];
        if (b->wake > travel) {
            continue;
        }
        coupled *const k = &p->nodes[p->n];
        const vec arm = apply(&r->rotation, c->nodes[i].position);
        k->point = add(arm, r->offset);
        const nearest found = probe(c->solid, k->point);
        k->depth = -found.distance;
        if (found.distance < reach) {
            k->depth -= relief(c->solid, k->point);
        }
        if (k->depth <= 0.0) {
            if (dot(b->force, b->force) > 0.0) {
                gone[n_gone].node = i;
                gone[n_gone++].force = b->force;
            }
            clear_node(b, &forces[i]);
            b->wake = travel + larger(found.distance - reach, 0.0);
            continue;
        }
        const vec velocity = add(r->velocity, cross(r->spin, arm));
        k->leaving = dot(velocity, found.gradient);
        k->own = c->nearness[i * c->n_coupled + i] * softness_of(c);
        k->normal = apply_transposed(&r->rotation, found.gradient);
        k->along = apply_transposed(&r->rotation, tangential(velocity, found.gradient));
        k->stretch = tangential(add(b->stretch, scaled(k->along, dt)), k->normal);
        k->force = b->force;
        p->index[p->n] = i;
        p->x[p->n] = c->nodes[i].position.x;
        p->y[p->n] = c->nodes[i].position.y;
        p->z[p->n] = c->nodes[i].position.z;
        p->ux[p->n] = b->moved.x;
        p->uy[p->n] = b->moved.y;
        p->uz[p->n] = b->moved.z;
        p->n += 1;
    }
    for (size_t i = 0; i < n_gone; ++i) {
        move_others(p, c, gone[i].node, scaled(gone[i].force, -1.0));
    }
    for (size_t i = 0; i < p->n; ++i) {
        if (bristles[p->index[i]].wake >= 0.0) {
            settle_new(p, c, i);
        }
    }
}

/* Return force and torque about the object of all nodes of a fingertip, which are coupled. */
static wrench sum_coupled_nodes(
    const constants *c, const relative *r, double dt, bristle *bristles, vec *forces, tip *out)
{
    const double keep = memory_after(c->skin, dt);
    const double arm = sqrt(dot(c->skin->ball_centre, c->skin->ball_centre)) + c->skin->ball_radius;
    patch here;
    patch *const p = &here;
    p->n = 0;
    out->travel += APPROACH_MARGIN * dt *
                   (sqrt(dot(r->velocity, r->velocity)) + sqrt(dot(r->spin, r->spin)) * arm);
    fill_patch(p, c, r, dt, bristles, forces, out->travel);
    double changed = 0.0;
    for (size_t i = 0; i < p->n; ++i) {
        changed += solve_node(p, c, i, bristles[p->index[i]].slip);
    }
    out->travel += softness_of(c) * c->nearness[0] * changed;
    double load = 0.0, slip = 0.0, slipping = 0.0;
    wrench sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
    for (size_t i = 0; i < p->n; ++i) {
        const coupled *const k = &p->nodes[i];
        bristle *const b = &bristles[p->index[i]];
        const vec others = moved(p, i);
        if (k->pressed == 0.0) {
            clear_node(b, &forces[p->index[i]]);
            b->wake = out->travel + dot(others, k->normal) - k->depth;
            continue;
        }
        const vec force = finish_node(c, k, others, dt, keep, b);
        forces[p->index[i]] = force;
        const vec total = apply(&r->rotation, force);
        const double pressed = dot(force, k->normal);
        sum.force = add(sum.force, total);
        sum.torque = add(sum.torque, cross(k->point, total));
        load += pressed;
        slip += pressed * b->slip;
        slipping += b->slip > c->skin->slipping ? pressed : 0.0;
    }
    const double weight = larger(load, 1e-300);
    out->slip = slip / weight;
    out->slipping_share = slipping / weight;
    out->load = load;
    return sum;
}
