// Where things are in the row of a finger: force, sigma, labels, and proposals under them.

const GAP = 8, TOP = 5; // [px]
const INNER = 4;

/** Rows of so many fingers over a height [px]; each part as [top, bottom]. */
export function rowsOf(n, height) {
  const each = height / Math.max(1, n);
  const tall = each > 170;
  const strip = tall ? 28 : 22, proposals = tall ? 14 : 10;
  return Array.from({ length: n }, (_, k) => {
    const top = k * each, bottom = top + each - GAP;
    const under = [bottom - proposals, bottom];
    const labels = [under[0] - 2 - strip, under[0] - 2];
    const plots = labels[0] - INNER - (top + TOP);
    const split = top + TOP + Math.round(0.62 * plots);
    return { top, bottom, force: [top + TOP, split - INNER], sigma: [split + INNER, labels[0] - INNER], labels, proposals: under };
  });
}

/** The place of the row at a height, kept within the rows. */
export const rowAt = (rows, y) =>
  Math.max(0, Math.min(rows.length - 1, rows.findIndex((row) => y < row.bottom + GAP / 2) >>> 0));

/** Which part of a row is at a height: "labels", "proposals" or "plot". */
export function zoneAt(row, y) {
  if (y >= row.labels[0] && y < row.labels[1] + 1) return "labels";
  return y >= row.proposals[0] - 1 ? "proposals" : "plot";
}
