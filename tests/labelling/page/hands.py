"""What a person does at the label page, and sees."""

import re

WHERE = """([finger, time, zone]) => {
  const { plot, view, editor } = holdfast, row = plot.rows[editor.fingers.indexOf(finger)];
  const box = document.querySelector("#over").getBoundingClientRect();
  const [top, bottom] = row[zone];
  return [box.left + view.x(time), box.top + (top + bottom) / 2];
}"""


def until(page, script, arg=None):
    """Waits until a script is true. (Playwright's own way evals, which the policy forbids.)"""
    for _ in range(600):
        if page.evaluate(script, arg):
            return
        page.wait_for_timeout(25)
    raise AssertionError(f"never true: {script} {arg}")


def shows(page, selector, text):
    """Waits until the text of the first such element matches a pattern."""
    for _ in range(600):
        found = page.evaluate("(at) => document.querySelector(at)?.innerText ?? ''", selector)
        if re.search(text, found):
            return
        page.wait_for_timeout(25)
    raise AssertionError(f"{selector} shows {found!r}, never {text!r}")


def ready(page):
    """Waits until signals are drawn, and change points are there."""
    until(page, "document.body.dataset.painted === '1'")
    until(page, "Object.keys(holdfast.plot.changes).length > 0")


def place(page, finger, time, zone="force"):
    """Where on the screen a time of a finger is."""
    return page.evaluate(WHERE, [finger, time, zone])


def point(page, finger, time, zone="force"):
    page.mouse.move(*place(page, finger, time, zone))


def click(page, finger, time, zone="force"):
    page.mouse.click(*place(page, finger, time, zone))


def drag(page, finger, start, end, zone="force", keys=()):
    """Drags from one time to another."""
    for key in keys:
        page.keyboard.down(key)
    page.mouse.move(*place(page, finger, start, zone))
    page.mouse.down()
    page.mouse.move(*place(page, finger, (start + end) / 2, zone))
    page.mouse.move(*place(page, finger, end, zone))
    page.mouse.up()
    for key in keys:
        page.keyboard.up(key)


def labels(page, finger="thumb"):
    """The labels of a finger on the page: (start, end, state, cause)."""
    found = page.evaluate("(finger) => holdfast.editor.state.labels[finger]", finger)
    return [(each["start"], each["end"], each["state"], each["cause"]) for each in found]


def rough(found):
    """Labels with times to a tenth of a second: what a hand on a mouse can aim at."""
    return [(round(start, 1), round(end, 1), *rest) for start, end, *rest in found]


def saved(page):
    """Waits until all is on the disk."""
    until(page, "!holdfast.saver.dirty")
    shows(page, "#save-text", "^saved")
