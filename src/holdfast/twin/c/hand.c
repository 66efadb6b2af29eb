/* Between MuJoCo's state and the contact: motion of fingertips and object, forces on them. */
#include "steps.h"

/* Fill the velocities of a body from MuJoCo's, which refer to the tree's centre of mass. */
static void fill_motion(const hand *h, int64_t i, body *out)
{
    const vec spin = h->cvel[i][0];
    out->velocity =
        add_cross(h->cvel[i][1], spin, subtract(out->position, h->subtree_com[h->roots[i]]));
    out->spin = spin;
}

/* Return a + m . b, added from left to right. */
static double add_dot(double a, vec m, vec b)
{
    return a + m.x * b.x + m.y * b.y + m.z * b.z;
}

/* Fill pose and motion of the fingertip frames and, last, of the object. */
static void fill_bodies(const hand *h, body *out)
{
    for (size_t i = 0; i < h->n_tips; ++i) {
        const int link = h->tips[i];
        const vec at = h->xpos[link], mount = h->mounts[i];
        const mat m = h->xmat[link];
        out[i].position =
            (vec){add_dot(at.x, m.x, mount), add_dot(at.y, m.y, mount), add_dot(at.z, m.z, mount)};
        out[i].rotation = m;
        fill_motion(h, link, &out[i]);
    }
    body *const object = &out[h->n_tips];
    object->position = h->xipos[h->object_body];
    object->rotation = h->ximat[h->object_body];
    fill_motion(h, h->object_body, object);
}

/* Apply forces and torques on fingertips and object in MuJoCo, where torques on a link are about
 * its centre of mass. `bodies` are those of `fill_bodies`. */
static void apply_forces(const hand *h, const tip *tips, const wrench *object, const body *bodies)
{
    for (size_t i = 0; i < h->n_tips; ++i) {
        const int link = h->tips[i];
        const wrench w = tips[i].wrench;
        const vec arm = subtract(bodies[i].position, h->xipos[link]);
        h->xfrc_applied[link] = (wrench){w.force, add_cross(w.torque, arm, w.force)};
    }
    h->xfrc_applied[h->object_body] = *object;
}

/* Sum fingers, operator and the inertia of a turning frame: -m(2 w x v), -I dw/dt, I = R D R^T. */
static wrench on_object(
    const wrench *fingers, const wrench *outside, const body *object, vec inertia, double mass,
    vec spin, vec turn)
{
    const vec coriolis = scaled(cross(spin, object->velocity), 2 * mass);
    const vec rows[3] = {object->rotation.x, object->rotation.y, object->rotation.z};
    const vec torque = add(fingers->torque, outside->torque);
    double left[3] = {torque.x, torque.y, torque.z};
    const double turns[3] = {turn.x, turn.y, turn.z};
    for (size_t r = 0; r < 3; ++r) {
        const vec weighted = {rows[r].x * inertia.x, rows[r].y * inertia.y, rows[r].z * inertia.z};
        for (size_t c = 0; c < 3; ++c) {
            left[r] -= dot(weighted, rows[c]) * turns[c];
        }
    }
    return (wrench){
        subtract(add(fingers->force, outside->force), coriolis), {left[0], left[1], left[2]}};
}
