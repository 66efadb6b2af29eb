// Operations on the labels of a finger. Pure functions: lists of labels are sorted and do not
// overlap, before and after. Inputs are never changed, so that the undo history needs no copies.

const EDGE_TOLERANCE = 1e-6; // [s], edges that are closer than this are equal

/** Items of a confidence below this are listed for review; the server uses the same limit. */
export const LOW_CONFIDENCE = 0.8;

/** Round a time to a microsecond. */
export const roundTime = (time) => Math.round(1e6 * time) / 1e6;

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));
const sorted = (labels) => labels.sort((a, b) => a.start - b.start);
const sameKind = (a, b) => a.state === b.state && (a.cause ?? null) === (b.cause ?? null);
const middle = (item) => (item.start + item.end) / 2;

/** Return the label that contains a time, or undefined. */
export const labelAt = (labels, time) => labels.find((label) => label.start <= time && time < label.end);

/** Remove [start, end) from labels; drop remainders shorter than `minDuration` [s]. */
const cut = (labels, start, end, minDuration = 0) => labels.flatMap((label) => {
  if (label.end <= start || label.start >= end) return [label];
  const parts = [{ ...label, end: start }, { ...label, start: end }];
  return parts.filter((part) => part.end > part.start && part.end - part.start >= minDuration);
});

/** Add a label; it replaces what other labels cover of its interval. */
export const replaceInterval = (labels, label, minDuration = 0) =>
  sorted([...cut(labels, label.start, label.end, minDuration), label]);

/**
 * Add a label, as `replaceInterval` does, and merge it with labels of the same state and cause
 * that touch or overlap it.
 *
 * @returns {[object[], object]} the labels, and the added label.
 */
export function overwrite(labels, label, minDuration = 0) {
  let { start, end } = label;
  for (const each of labels) {
    if (!sameKind(each, label) || each.start > label.end + EDGE_TOLERANCE || each.end < label.start - EDGE_TOLERANCE) continue;
    start = Math.min(start, each.start);
    end = Math.max(end, each.end);
  }
  const merged = { ...label, start, end };
  return [replaceInterval(labels, merged, minDuration), merged];
}

/** Add the parts of a label that no other label covers. */
export function fillGaps(labels, label, minDuration = 0) {
  let parts = [label];
  for (const each of labels) parts = cut(parts, each.start, each.end, minDuration);
  return sorted([...labels, ...parts]);
}

export const remove = (labels, label) => labels.filter((each) => each !== label);

/**
 * Change fields of a label, but not its times.
 *
 * @returns {[object[], object]} the labels, and the changed label.
 */
export function change(labels, label, fields) {
  const changed = { ...label, ...fields };
  return [labels.map((each) => (each === label ? changed : each)), changed];
}

/**
 * Move an edge of a label.
 *
 * A label that shares the edge moves its own edge with it, and other labels in the way are
 * overwritten. Of two labels that share the edge, the one that grows counts as moved; it may
 * replace the other.
 *
 * @param side "start" or "end".
 * @param bounds `low` and `high` limit the time [s]; `minDuration` is the shortest label [s].
 * @returns {[object[], object]} the labels, and the moved label.
 */
export function moveEdge(labels, label, side, time, { low, high, minDuration }) {
  const other = side === "start" ? "end" : "start";
  const neighbour = labels.find((each) => each !== label && Math.abs(each[other] - label[side]) < EDGE_TOLERANCE);
  const shrinks = side === "start" ? time > label.start : time < label.end;
  if (neighbour && shrinks && (other === "start" ? time < neighbour.start : time > neighbour.end)) {
    return moveEdge(labels, neighbour, other, time, { low, high, minDuration });
  }
  const shortest = Math.min(minDuration, label.end - label.start);
  const edge = side === "start"
    ? clamp(time, low, label.end - shortest) : clamp(time, label.start + shortest, high);
  const moved = { ...label, [side]: edge };
  const rest = labels.filter((each) => each !== label && each !== neighbour);
  if (neighbour) {
    const follower = { ...neighbour, [other]: edge };
    if (follower.end - follower.start >= Math.min(minDuration, neighbour.end - neighbour.start)) rest.push(follower);
  }
  return [replaceInterval(sorted(rest), moved, minDuration), moved];
}

/** Return the nearest candidate within a distance of a time [s], or else the time itself. */
export function snap(time, candidates, maxDistance) {
  let nearest = time, smallest = maxDistance;
  for (const each of candidates) {
    const distance = Math.abs(each - time);
    if (distance <= smallest) [nearest, smallest] = [each, distance];
  }
  return nearest;
}

/** Return a key of a proposal that is the same after the page is loaded again. */
export const itemKey = (finger, item) => `${finger}|${item.start}|${item.end}|${item.state}`;

/** Return the proposals that are neither labelled nor rejected, as { finger, item }, sorted by time. */
export function openProposals({ labels, rejected }, proposals) {
  return Object.entries(proposals).flatMap(([finger, own]) => own
    .filter((item) => !rejected.has(itemKey(finger, item)) && !labelAt(labels[finger] ?? [], middle(item)))
    .map((item) => ({ finger, item })))
    .sort((a, b) => a.item.start - b.item.start);
}

/** Return the items that a person should review, lowest confidence first; `kind` is "label" or "proposal". */
export function findReviewItems(state, proposals) {
  const labels = Object.entries(state.labels).flatMap(([finger, own]) => own
    .filter((item) => item.confidence < LOW_CONFIDENCE)
    .map((item) => ({ kind: "label", finger, item })));
  const open = openProposals(state, proposals)
    .filter(({ item }) => item.confidence < LOW_CONFIDENCE)
    .map((each) => ({ kind: "proposal", ...each }));
  return [...labels, ...open].sort((a, b) => a.item.confidence - b.item.confidence || a.item.start - b.item.start);
}
