"""Check the layout of a page: nothing overlaps, overflows or is too small to touch."""

PHONE, TABLET, DESKTOP = (390, 844), (768, 1024), (1440, 900)
SCREENS = [PHONE, (700, 900), TABLET, DESKTOP]

# Blocks that draw on purpose over each other, and what lies over the page for a short time.
BLOCKS = ".holder, .rows, .map, .bar:not(.plots > .bar), .overview"
IGNORED = ".toasts, .toasts *, .spoken, .symbols *, dialog, dialog *, option, svg, svg *, .paused"
TEXTS = "button, select, h1, h2, h3, label, output, .word, .values *, .entry, .alert"

FLAWS = """([blocks, ignored, texts, minSize]) => {
  const flaws = [];
  const inBlock = (e) => e.parentElement?.closest(blocks);
  const isShown = (e) => e.checkVisibility() && !e.matches(ignored) && !inBlock(e);
  const hasText = (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim());
  const visiblePart = (e) => {
    let { left, top, right, bottom } = e.getBoundingClientRect();
    for (let up = e.parentElement; up && up !== document.documentElement; up = up.parentElement) {
      const style = getComputedStyle(up);
      if (style.overflowX === "visible" && style.overflowY === "visible") continue;
      const box = up.getBoundingClientRect();
      [left, right] = [Math.max(left, box.left), Math.min(right, box.right)];
      [top, bottom] = [Math.max(top, box.top), Math.min(bottom, box.bottom)];
    }
    return { e, left, top, right, bottom };
  };
  const tag = (e) => e.tagName.toLowerCase() + (e.id && `#${e.id}`);
  const label = (e) => `${tag(e)} ${e.textContent.trim().slice(0, 30)}`;
  const all = [...document.body.querySelectorAll("*")].filter(isShown);
  const boxes = all
    .filter((e) => hasText(e) || e.matches(`button, input, select, textarea, canvas, ${blocks}`))
    .map(visiblePart).filter((b) => b.right - b.left > 1 && b.bottom - b.top > 1);
  for (const [k, a] of boxes.entries()) {
    for (const b of boxes.slice(k + 1)) {
      if (a.e.contains(b.e) || b.e.contains(a.e)) continue;
      const width = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const height = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (width > 1.5 && height > 3) flaws.push(`overlap: ${label(a.e)} | ${label(b.e)}`);
    }
  }
  const { scrollWidth, clientWidth } = document.documentElement;
  if (scrollWidth > clientWidth) flaws.push(`the page is ${scrollWidth} px wide`);
  for (const { e, left, right } of boxes) {
    if (right > clientWidth + 0.5 || left < -0.5) flaws.push(`outside: ${label(e)}`);
  }
  for (const e of all.filter((one) => one.matches("button, input, select, textarea"))) {
    const { width, height } = e.getBoundingClientRect();
    if (minSize && Math.min(width, height) < minSize) {
      flaws.push(`small: ${label(e)} ${width} x ${height}`);
    }
  }
  for (const e of all.filter((one) => one.matches(texts))) {
    if (getComputedStyle(e).display === "inline") continue;
    if (e.scrollWidth > e.clientWidth + 1) flaws.push(`cut off: ${label(e)}`);
  }
  return flaws;
}"""


def flaws(page, size):
    """Return what is wrong with the layout of a page; buttons must be large on small screens."""
    return page.evaluate(FLAWS, [BLOCKS, IGNORED, TEXTS, 40 if size[0] <= 700 else 0])
