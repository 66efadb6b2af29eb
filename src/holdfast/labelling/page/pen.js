// Canvases in CSS pixels, and the few shapes that are drawn on them.

/** Fits a canvas to its size on the page; gives its pen, cleared, in CSS pixels. */
export function penOf(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    [canvas.width, canvas.height] = [w, h];
    [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return pen;
}

/** Draws only within a box. */
export function within(pen, left, top, width, height, draw) {
  pen.save();
  pen.beginPath();
  pen.rect(left, top, width, height);
  pen.clip();
  draw();
  pen.restore();
}

export function line(pen, x0, y0, x1, y1, colour, width = 1, dash = []) {
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
  pen.setLineDash([]);
}

/** Slanted lines over a box, that stay where they are while its edges move. */
export function hatch(pen, left, top, width, height, colour, step = 7, thick = 2) {
  within(pen, left, top, width, height, () => {
    pen.strokeStyle = colour;
    pen.lineWidth = thick;
    pen.beginPath();
    for (let x = Math.floor((left - height) / step) * step; x < left + width; x += step) {
      pen.moveTo(x, top + height);
      pen.lineTo(x + height, top);
    }
    pen.stroke();
  });
}

// Shapes of the states, as in the sheet of symbols: on 32 by 32.
const DISC = new Path2D("M16 3a13 13 0 1 0 .01 0z");
const TICK = new Path2D("M9.5 16.5l4.5 4.5 8.5-9.5");
const ROOF = new Path2D("M16 3.5 30 28.5H2z");
const CALL = new Path2D("M16 12v8M16 24.2v.1");
const RING = new Path2D("M16 5a11 11 0 1 0 .01 0z");

/** The shape of a state, `size` wide. */
export function shape(pen, key, x, y, size, colour, cut) {
  pen.save();
  pen.translate(x, y);
  pen.scale(size / 32, size / 32);
  pen.lineCap = pen.lineJoin = "round";
  pen.fillStyle = pen.strokeStyle = colour;
  pen.lineWidth = 4;
  if (key === "no-contact") pen.stroke(RING);
  else {
    pen.fill(key === "stable" ? DISC : ROOF);
    pen.strokeStyle = cut;
    pen.stroke(key === "stable" ? TICK : CALL);
  }
  pen.restore();
}

/** A text cut to a width, with dots; nothing where not even that has room. */
export function cutText(pen, text, width) {
  if (pen.measureText(text).width <= width) return text;
  let short = text;
  while (short.length > 1 && pen.measureText(`${short}…`).width > width) short = short.slice(0, -1);
  return short.length > 2 ? `${short}…` : "";
}
