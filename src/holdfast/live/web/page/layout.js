// Positions of the taxels on a flat map, and the directions "up" and "right" at each of them.
// Pure functions of positions [m], rotations and the sensor's normal, for any sensor.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
];
const scaled = (a, by) => a.map((x) => x * by);
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
const plus = (a, b) => a.map((x, k) => x + b[k]);
const column = (rotation, c) => rotation.map((row) => row[c]);

/** Return right, up and out of the map: seen from outside; the distal axis (z, or y of a flat patch) is up. */
function viewOf(normal) {
  const out = unit(normal);
  const axis = Math.abs(out[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0];
  const up = unit(plus(axis, scaled(out, -dot(axis, out))));
  return { right: cross(up, out), up, out };
}

// Fit the radius of a circle to points and the directions of their normals, by least squares.
function radius(sines, cosines, across, depth) {
  const centred = (values) => {
    const mean = values.reduce((sum, x) => sum + x, 0) / values.length;
    return values.map((x) => x - mean);
  };
  const along = [...centred(sines), ...centred(cosines)];
  const points = [...centred(across), ...centred(depth)];
  const spread = along.reduce((sum, x) => sum + x * x, 0);
  const product = along.reduce((sum, x, k) => sum + x * points[k], 0);
  return spread > 1e-6 ? Math.max(0, product / spread) : 0;
}

/**
 * Compute the map of a sensor. A curved sensor is unrolled: its side walls lie beside its pad.
 *
 * Around the up axis, a taxel whose normal is rotated by theta moves outwards by
 * r (theta - sin theta), where r is the fitted radius; likewise over the tip. A flat patch does
 * not change.
 *
 * @returns {{points: number[][], right: number[][], up: number[][], spacing: number}}
 *   points [m] as (right, up); the directions in the fingertip frame that are right and up on
 *   the map at each taxel; the distance between neighbours [m].
 */
export function layout(positions, rotations, normal) {
  const view = viewOf(normal);
  const normals = rotations.map((rotation) => column(rotation, 2));
  const n = normals.map((v) => [dot(v, view.right), dot(v, view.up), dot(v, view.out)]);
  const p = positions.map((v) => [dot(v, view.right), dot(v, view.up), dot(v, view.out)]);
  const level = n.map(([a, , c]) => Math.hypot(a, c));
  // A normal along the axis has no angle around it.
  const theta = n.map(([a, , c], k) => (level[k] > 0.1 ? Math.atan2(a, c) : 0));
  const psi = n.map(([, b], k) => Math.atan2(b, level[k]));
  const pick = (values, axis) => values.map((v) => v[axis]);
  const around = radius(pick(n, 0), pick(n, 2), pick(p, 0), pick(p, 2));
  const over = radius(pick(n, 1), level, pick(p, 1), pick(p, 2));
  const points = spreadOut(p.map(([across, up], k) => [
    across + around * (theta[k] - Math.sin(theta[k])),
    up + over * (psi[k] - Math.sin(psi[k])),
  ]));
  const right = theta.map((t) => plus(scaled(view.right, Math.cos(t)), scaled(view.out, -Math.sin(t))));
  const up = right.map((v, k) => cross(normals[k], v));
  return { points, right, up, spacing: spacing(points) };
}

/** Return the smallest distance between two points; 1 mm for a single taxel. */
function spacing(points) {
  let least = Infinity;
  points.forEach((a, k) => {
    for (const b of points.slice(k + 1)) {
      least = Math.min(least, Math.hypot(a[0] - b[0], a[1] - b[1]));
    }
  });
  return Number.isFinite(least) ? least : 1e-3;
}

// Return a square grid for sensors without positions (all taxels at one point). Else push points
// apart that are much closer than most, so that no disc hides another.
function spreadOut(points) {
  const n = points.length, [width, height] = [0, 1].map((axis) => {
    const values = points.map((point) => point[axis]);
    return Math.max(...values) - Math.min(...values);
  });
  if (n < 2) return points;
  if (spacing(points) < 1e-3 * Math.max(width, height) || !(width + height)) {
    const side = Math.ceil(Math.sqrt(n));
    return points.map((_, k) => [5e-3 * (k % side), -5e-3 * Math.floor(k / side)]);
  }
  const least = 0.8 * Math.sqrt((width * height) / n), moved = points.map((point) => [...point]);
  for (let round = 0; round < 30; round += 1) {
    moved.forEach((a, k) => moved.slice(k + 1).forEach((b) => {
      const [x, y] = [b[0] - a[0], b[1] - a[1]], gap = Math.hypot(x, y), push = 0.5 * (least / gap - 1);
      if (!(gap < least)) return;
      a[0] -= push * x; a[1] -= push * y;
      b[0] += push * x; b[1] += push * y;
    }));
  }
  return moved;
}

/** Rotate a reading from the taxel frame to (right, up, normal) of the map. */
export function toMapFrame(reading, rotation, right, up) {
  const tangent = [0, 1, 2].map((k) => rotation[k][0] * reading[0] + rotation[k][1] * reading[1]);
  return [dot(tangent, right), dot(tangent, up), reading[2]];
}

/** Return the convex hull of the points, counter-clockwise: the outline of the sensor. */
export function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const turn = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
  const half = (points) => {
    const chain = [];
    for (const point of points) {
      while (chain.length > 1 && turn(chain.at(-2), chain.at(-1), point) <= 0) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  return sorted.length < 3 ? sorted : [...half(sorted), ...half(sorted.reverse())];
}
