"""Mouse, keyboard and waiting for tests of the labelling page."""

from browser import DESKTOP, shows, until

POSITION = """([finger, time, zone]) => {
  const { rows, view } = holdfast;
  const part = rows.rows.find((row) => row.finger === finger).parts[zone];
  const { top, height } = part.getBoundingClientRect();
  const { left } = document.querySelector("#surface").getBoundingClientRect();
  return [left + view.x(time), top + height / 2];
}"""


def ready(page):
    """Wait until the signals are drawn and the change points are loaded."""
    until(page, "document.body.dataset.painted === '1'")
    until(page, "Object.keys(holdfast.rows.changePoints).length > 0")


def opened(visit, service, size=DESKTOP, **options):
    page = visit(service.url, size, **options)
    ready(page)
    return page


def position(page, finger, time, zone="force"):
    """Return the position on the screen of a time in the row of a finger [px]."""
    return page.evaluate(POSITION, [finger, time, zone])


def point(page, finger, time, zone="force"):
    page.mouse.move(*position(page, finger, time, zone))


def click(page, finger, time, zone="force"):
    page.mouse.click(*position(page, finger, time, zone))


def drag(page, finger, start, end, zone="force", key=None):
    """Drag from one time to another while a key is pressed."""
    if key:
        page.keyboard.down(key)
    point(page, finger, start, zone)
    page.mouse.down()
    point(page, finger, (start + end) / 2, zone)
    point(page, finger, end, zone)
    page.mouse.up()
    if key:
        page.keyboard.up(key)


def labels(page, finger="thumb"):
    """Return the labels of a finger on the page: (start, end, state, cause), in 0.1 s."""
    found = page.evaluate("(finger) => holdfast.editor.state.labels[finger]", finger)
    return [(round(x["start"], 1), round(x["end"], 1), x["state"], x["cause"]) for x in found]


def saved(page):
    """Wait until all labels are saved."""
    until(page, "!holdfast.saver.dirty")
    shows(page, "#save-text", "^saved")
