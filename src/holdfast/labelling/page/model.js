// Arithmetic of labels. Pure functions: lists go in sorted and without overlap, and come out so;
// what goes in is never changed, so that undo needs no copies.

const TOUCH = 1e-6; // [s], nearer edges are one edge

/** Confidence below which a person should look, as the server has it. */
export const DOUBTFUL = 0.8;

/** Times to the microsecond: finer digits are only noise of the pointer. */
export const tidy = (time) => Math.round(1e6 * time) / 1e6;

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));
const inOrder = (labels) => labels.sort((a, b) => a.start - b.start);
const alike = (a, b) => a.state === b.state && (a.cause ?? null) === (b.cause ?? null);
const middle = (item) => (item.start + item.end) / 2;

/** Whether labels are in order, forward in time, and apart. */
export const sound = (labels) => labels.every((label, k) => label.start < label.end
  && (k === 0 || labels[k - 1].end <= label.start));

/** The label that holds a time, or undefined. */
export const at = (labels, time) => labels.find((label) => label.start <= time && time < label.end);

/** What is left of the labels outside [start, end); pieces shorter than `least` go [s]. */
export function clear(labels, start, end, least = 0) {
  const kept = [];
  for (const label of labels) {
    if (label.end <= start || label.start >= end) {
      kept.push(label);
      continue;
    }
    if (label.start < start && start - label.start >= least) kept.push({ ...label, end: start });
    if (label.end > end && label.end - end >= least) kept.push({ ...label, start: end });
  }
  return kept;
}

/** Puts a label over whatever is there. */
export const put = (labels, label, least = 0) =>
  inOrder([...clear(labels, label.start, label.end, least), label]);

/**
 * Puts a label over whatever is there; labels of the same kind that it meets become one with it.
 *
 * @returns {[object[], object]} the labels, and the one that was put.
 */
export function overwrite(labels, label, least = 0) {
  let { start, end } = label;
  for (const each of labels) {
    if (!alike(each, label) || each.start > label.end + TOUCH || each.end < label.start - TOUCH) continue;
    start = Math.min(start, each.start);
    end = Math.max(end, each.end);
  }
  const whole = { ...label, start, end };
  return [put(labels, whole, least), whole];
}

/** Adds of a label what no other label holds; a person's work stays as it is. */
export function fill(labels, label, least = 0) {
  let pieces = [label];
  for (const each of labels) pieces = clear(pieces, each.start, each.end, least);
  return inOrder([...labels, ...pieces]);
}

export const remove = (labels, label) => labels.filter((each) => each !== label);

/** Changes fields of a label other than its times. */
export function change(labels, label, fields) {
  const changed = { ...label, ...fields };
  return [labels.map((each) => (each === label ? changed : each)), changed];
}

/**
 * Moves an edge. A label that shares the edge follows, and others in the way are overwritten;
 * of two that share it, the one that grows is the one that is moved, and may eat the other.
 *
 * @param side "start" or "end".
 * @param bounds of time: `low` and `high`; `least` is how short a label may become [s].
 * @returns {[object[], object]} the labels, and the one that was moved.
 */
export function moveEdge(labels, label, side, time, { low, high, least }) {
  const other = side === "start" ? "end" : "start";
  const sharing = labels.find((each) => each !== label && Math.abs(each[other] - label[side]) < TOUCH);
  const shrinks = side === "start" ? time > label.start : time < label.end;
  if (sharing && shrinks && (other === "start" ? time < sharing.start : time > sharing.end)) {
    return moveEdge(labels, sharing, other, time, { low, high, least });
  }
  const short = Math.min(least, label.end - label.start);
  const to = side === "start"
    ? clamp(time, low, label.end - short) : clamp(time, label.start + short, high);
  const moved = { ...label, [side]: to };
  const rest = labels.filter((each) => each !== label && each !== sharing);
  if (sharing) {
    const follower = { ...sharing, [other]: to };
    if (follower.end - follower.start >= Math.min(least, sharing.end - sharing.start)) rest.push(follower);
  }
  return [put(inOrder(rest), moved, least), moved];
}

/** The nearest of some times within a distance [s]; the time itself where there is none. */
export function snap(time, times, within) {
  let best = time, least = within;
  for (const each of times) {
    const distance = Math.abs(each - time);
    if (distance <= least) [best, least] = [each, distance];
  }
  return best;
}

/** A name for a proposal or suspect that survives a reload. */
export const nameOf = (finger, item) =>
  `${finger}|${item.start}|${item.end}|${item.state ?? `${item.given}>${item.expected}`}`;

/** Proposals that are neither labelled nor rejected, with their finger, in order of time. */
export function openProposals({ labels, rejected }, proposals) {
  return Object.entries(proposals).flatMap(([finger, own]) => own
    .filter((item) => !rejected.has(nameOf(finger, item)) && !at(labels[finger] ?? [], middle(item)))
    .map((item) => ({ finger, item })))
    .sort((a, b) => a.item.start - b.item.start);
}

/** Suspects whose label still says what the audit contradicts. */
export const openSuspects = ({ labels, rejected }, suspects) => suspects.filter((item) =>
  !rejected.has(nameOf(item.finger, item)) && at(labels[item.finger] ?? [], middle(item))?.state === item.given);

/** What a person should look at, the most doubtful first. */
export function doubts(state, proposals, suspects) {
  const labels = Object.entries(state.labels).flatMap(([finger, own]) => own
    .filter((item) => item.confidence < DOUBTFUL)
    .map((item) => ({ kind: "label", finger, item, doubt: item.confidence })));
  const open = openProposals(state, proposals)
    .filter(({ item }) => item.confidence < DOUBTFUL)
    .map((each) => ({ kind: "proposal", ...each, doubt: each.item.confidence }));
  // The surer the audit is, the more doubtful is the label.
  const audit = openSuspects(state, suspects)
    .map((item) => ({ kind: "suspect", finger: item.finger, item, doubt: 1 - item.confidence }));
  return [...audit, ...labels, ...open].sort((a, b) => a.doubt - b.doubt || a.item.start - b.item.start);
}
