/* Signed distance of a point from an object, and its gradient.
 *
 * The shape of an object is a core that is extended on all sides by a rounding, so that distances
 * and their gradients near the surface are exact and smooth. */
#include "steps.h"

/* Maximum height of a texture's three waves together, in amplitudes. */
#define MAX_RELIEF 2.5

/* The distance of a point from a surface, negative inside [m], and its gradient. */
typedef struct {
    double distance;
    vec gradient; /* outward unit vector */
} nearest;

static nearest probe_box(const double half[3], vec p)
{
    const vec e = {fabs(p.x) - half[0], fabs(p.y) - half[1], fabs(p.z) - half[2]};
    const vec over = {larger(e.x, 0.0), larger(e.y, 0.0), larger(e.z, 0.0)};
    const double d = sqrt(dot(over, over));
    if (d > 0.0) {
        const vec unit = scaled(over, 1.0 / d);
        return (nearest){d, {copysign(unit.x, p.x), copysign(unit.y, p.y), copysign(unit.z, p.z)}};
    }
    if (e.x >= e.y && e.x >= e.z) {
        return (nearest){e.x, {copysign(1.0, p.x), 0.0, 0.0}};
    }
    if (e.y >= e.z) {
        return (nearest){e.y, {0.0, copysign(1.0, p.y), 0.0}};
    }
    return (nearest){e.z, {0.0, 0.0, copysign(1.0, p.z)}};
}

/* Six faces; the normal of the first is x. */
static nearest probe_hexagon(double inner, double height, vec p)
{
    const bool is_first = !(fabs(p.y) * sqrt(3.0) > fabs(p.x));
    const double nx = copysign(is_first ? 1.0 : 0.5, p.x);
    const double ny = copysign(is_first ? 0.0 : sqrt(0.75), p.y);
    double face = nx * p.x + ny * p.y - inner;
    const double side = nx * p.y - ny * p.x;
    const double half = inner / sqrt(3.0);
    const double over = side - smaller(larger(side, -half), half);
    double tall = fabs(p.z) - height;
    if (face <= 0.0 && tall <= 0.0) {
        if (face >= tall) {
            return (nearest){face, {nx, ny, 0.0}};
        }
        return (nearest){tall, {0.0, 0.0, copysign(1.0, p.z)}};
    }
    face = larger(face, 0.0);
    tall = copysign(larger(tall, 0.0), p.z);
    const double d = sqrt(face * face + over * over + tall * tall);
    return (nearest){d, scaled((vec){face * nx - over * ny, face * ny + over * nx, tall}, 1.0 / d)};
}

/* A point (q, z) in the plane through the axis, and a trapezium: the gradient is along q and z. */
static nearest probe_meridian(const solid *s, double q, double z)
{
    const double foot = s->size[0], top = s->size[1], height = s->size[2];
    const double nq = s->side_out, nz = s->side_up;
    const double side = (q - foot) * nq + (z + height) * nz;
    const double tall = fabs(z) - height;
    if (side <= 0.0 && tall <= 0.0) {
        if (side >= tall) {
            return (nearest){side, {nq, 0.0, nz}};
        }
        return (nearest){tall, {0.0, 0.0, copysign(1.0, z)}};
    }
    const double along = smaller(larger((z + height) * nq - (q - foot) * nz, 0.0), s->side_length);
    double dq = q - foot + along * nz, dz = z + height - along * nq;
    double square = dq * dq + dz * dz;
    if (tall > 0.0) {
        const double cap = larger(q - (z > 0.0 ? top : foot), 0.0);
        if (cap * cap + tall * tall < square) {
            dq = cap;
            dz = copysign(tall, z);
            square = dq * dq + dz * dz;
        }
    }
    const double d = sqrt(square), share = 1.0 / larger(d, 1e-12);
    return (nearest){d, {dq * share, 0.0, dz * share}};
}

/* Compute the distance of a point in the object's frame from the smooth object. */
static nearest probe(const solid *s, vec p)
{
    nearest found;
    p.z += s->centre;
    if (s->code == BOX) {
        found = probe_box(s->size, p);
    } else if (s->code == HEXAGON) {
        found = probe_hexagon(s->size[0], s->size[1], p);
    } else if (s->code == CAPSULE) {
        p.z -= smaller(larger(p.z, -s->size[0]), s->size[0]);
        found.distance = sqrt(dot(p, p));
        found.gradient = scaled(p, 1.0 / larger(found.distance, 1e-12));
    } else {
        const double q = sqrt(p.x * p.x + p.y * p.y);
        found = probe_meridian(s, q, p.z);
        const double share = found.gradient.x / larger(q, 1e-12);
        found.gradient.x = p.x * share;
        found.gradient.y = p.y * share;
    }
    found.distance -= s->extension;
    return found;
}

/* Compute the depth of the texture at a point in the object's frame [m].
 *
 * The sum of three waves: A (sin a z + 0.7 sin(0.6 b z + b s + 1) + 0.8 sin(a s + 0.3)), where s
 * is the arc about the axis, a = 2 pi / L and b = a / 0.37 (own choice). */
static double relief(const solid *s, vec p)
{
    if (s->texture_amplitude == 0.0) {
        return 0.0;
    }
    const double angle = atan2(p.y, p.x);
    double waves = sin(s->wave * p.z);
    waves += 0.7 * sin(s->wave_2 * p.z + s->around_2 * angle + 1.0);
    waves += 0.8 * sin(s->around * angle + 0.3);
    return s->texture_amplitude * waves;
}

/* Fill the distances of n points in the object's frame from its textured surface [m]. */
static void distances(const solid *s, const vec *points, size_t n, double *out)
{
    for (size_t i = 0; i < n; ++i) {
        out[i] = probe(s, points[i]).distance + relief(s, points[i]);
    }
}
