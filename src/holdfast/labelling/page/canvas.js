// Drawing tools for canvases. All lengths are in CSS pixels.

/** Set the size of a canvas, clear it, and return its drawing context, scaled to CSS pixels. */
export function prepareCanvas(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) {
    [canvas.width, canvas.height] = [w, h];
    [canvas.style.width, canvas.style.height] = [`${width}px`, `${height}px`];
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}

/** Call `draw` and show only what lies in a box. */
export function drawClipped(context, left, top, width, height, draw) {
  context.save();
  context.beginPath();
  context.rect(left, top, width, height);
  context.clip();
  draw();
  context.restore();
}

export function drawLine(context, x0, y0, x1, y1, colour, width = 1, dash = []) {
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
  context.setLineDash([]);
}

/** Draw the outline of a box; the line lies inside the box. */
export function drawFrame(context, left, top, width, height, colour, thickness = 2, dash = []) {
  context.strokeStyle = colour;
  context.lineWidth = thickness;
  context.setLineDash(dash);
  context.strokeRect(left + thickness / 2, top + thickness / 2, Math.max(1, width - thickness), height - thickness);
  context.setLineDash([]);
}

/** Fill a box with slanted lines. Their positions do not depend on the edges of the box. */
export function drawHatch(context, left, top, width, height, colour, step = 7, thickness = 2) {
  drawClipped(context, left, top, width, height, () => {
    context.strokeStyle = colour;
    context.lineWidth = thickness;
    context.beginPath();
    for (let x = Math.floor((left - height) / step) * step; x < left + width; x += step) {
      context.moveTo(x, top + height);
      context.lineTo(x + height, top);
    }
    context.stroke();
  });
}

// Shapes of the states on a grid of 32 by 32, equal to the symbols in index.html.
const DISC = new Path2D("M16 3a13 13 0 1 0 .01 0z");
const CHECK_MARK = new Path2D("M9.5 16.5l4.5 4.5 8.5-9.5");
const TRIANGLE = new Path2D("M16 3.5 30 28.5H2z");
const EXCLAMATION_MARK = new Path2D("M16 12v8M16 24.2v.1");
const RING = new Path2D("M16 5a11 11 0 1 0 .01 0z");

/** Draw the shape of a state in a square of `size` pixels. */
export function drawStateShape(context, key, x, y, size, colour, markColour) {
  context.save();
  context.translate(x, y);
  context.scale(size / 32, size / 32);
  context.lineCap = context.lineJoin = "round";
  context.fillStyle = context.strokeStyle = colour;
  context.lineWidth = 4;
  if (key === "no-contact") context.stroke(RING);
  else {
    context.fill(key === "stable" ? DISC : TRIANGLE);
    context.strokeStyle = markColour;
    context.stroke(key === "stable" ? CHECK_MARK : EXCLAMATION_MARK);
  }
  context.restore();
}

/** Return a text shortened to a width, with an ellipsis; "" if fewer than two letters fit. */
export function shortenText(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let short = text;
  while (short.length > 1 && context.measureText(`${short}…`).width > width) short = short.slice(0, -1);
  return short.length > 2 ? `${short}…` : "";
}
