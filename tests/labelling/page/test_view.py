"""view.js, overview.js and signals.js: zoom, overview, and loading of finer signals."""

import pytest

from labelling.page.actions import point, position, ready, shows, until
from labelling.page.fake_service import FakeService, Recording

WINDOW = "[holdfast.view.start, holdfast.view.end]"


@pytest.fixture
def long(visit):
    """Open a page with 20,000 samples per finger; return it and its service."""
    with FakeService(Recording(seconds=20_000 / 150)) as service:
        page = visit(service.url)
        ready(page)
        yield page, service


def wait_for_signals(page):
    """Wait until all signals are loaded and drawn."""
    busy = ("signals.loading", "signals.timer", "plot.frameRequest")
    until(page, " && ".join(f"!holdfast.{each}" for each in busy))


def wheel(page, *turns):
    for turn in turns:
        page.mouse.wheel(0, turn)
        page.wait_for_timeout(30)


def test_the_wheel_zooms_about_the_pointer_and_loads_finer_data(long):
    page, service = long
    wait_for_signals(page)
    assert len(service.requests) == 1
    drawn = page.evaluate("Number(document.body.dataset.drawn)")
    x, y = position(page, "index", 40)
    page.mouse.move(x, y)
    wheel(page, -300)
    start, end = page.evaluate(WINDOW)
    assert 30 < end - start < 80
    assert position(page, "index", 40)[0] == pytest.approx(x, abs=1.1)  # whole pixels
    until(page, "(n) => Number(document.body.dataset.drawn) > n", drawn)
    wait_for_signals(page)
    first, last, points = service.requests[-1]
    assert first < start  # with a margin
    assert last > end
    assert points / (last - first) > 5  # about one per pixel
    wheel(page, *[-300] * 8)
    wait_for_signals(page)
    shows(page, "#window", "every sample")
    start, end = page.evaluate(WINDOW)
    loaded = page.evaluate(f"[...holdfast.signals.segments('index', ...{WINDOW})[0][0].t]")
    own = service.recordings[0].signals["index"][0]
    assert [t for t in loaded if start <= t <= end] == own[(own >= start) & (own <= end)].tolist()
    page.mouse.dblclick(x, y)
    assert page.evaluate("holdfast.view.showsAll")


def test_small_steps_load_nothing(long):
    page, service = long
    page.evaluate("holdfast.view.setWindow(40, 50)")
    wait_for_signals(page)
    n = len(service.requests)
    page.evaluate("holdfast.view.pan(2)")
    page.evaluate("holdfast.view.zoom(0.9, 45)")
    page.wait_for_timeout(200)
    wait_for_signals(page)
    assert len(service.requests) == n
    page.evaluate("holdfast.view.pan(30)")
    until(page, "holdfast.signals.fine.start > 50")
    assert len(service.requests) == n + 1


def test_old_data_are_drawn_while_new_data_are_loading(long):
    page, service = long
    wait_for_signals(page)
    service.delays = [0.6]
    page.evaluate("holdfast.view.setWindow(40, 50)")
    page.wait_for_timeout(200)
    segments = f"holdfast.signals.segments('thumb', ...{WINDOW})"
    (segment,) = page.evaluate(segments + ".map(([{ t }, from, to]) => [t.length, from, to])")
    assert segment[0] > 1000
    assert segment[1:] == [40, 50]
    for start in (60, 70, 80):  # the window moves while data are loading
        page.evaluate(f"holdfast.view.setWindow({start}, {start + 10})")
    until(page, "holdfast.signals.fine?.start > 60")
    wait_for_signals(page)
    # Of the windows in between, only the newest is requested.
    assert [round(start) for start, _, _ in service.requests] == [0, 36, 76]


def test_a_reply_for_another_recording_is_dropped(visit):
    with FakeService(Recording("one", 300), Recording("two", 300)) as service:
        page = visit(service.url)
        ready(page)
        wait_for_signals(page)
        service.delays = [0.5]
        page.evaluate("holdfast.view.setWindow(40, 50)")
        page.wait_for_timeout(100)
        page.keyboard.press("n")
        shows(page, "#name", "two")
        page.wait_for_timeout(700)
        assert page.evaluate("[holdfast.signals.fine, holdfast.signals.id]") == [None, 1]
        assert page.evaluate("holdfast.view.showsAll")


def test_the_window_never_leaves_the_recording(module):
    found = module.evaluate("""async () => {
      const { View } = await import("/page/view.js"), view = new View(() => {});
      view.open(10, 110, 0.1);
      const bad = [];
      let random = 7;
      const next = () => (random = (random * 16807) % 2147483647) / 2147483647;
      for (let k = 0; k < 5000; k += 1) {
        const what = next();
        if (what < 0.4) view.zoom(10 ** (2 * next() - 1), view.start + next() * view.span);
        else if (what < 0.7) view.pan(200 * next() - 100);
        else if (what < 0.9) view.setWindow(200 * next() - 50, 200 * next() - 50);
        else view.reveal({ start: 10 + 99 * next(), end: 110 });
        const inside = view.start >= 10 - 1e-9 && view.end <= 110 + 1e-9;
        if (!inside || view.span < 0.1 - 1e-9) bad.push([view.start, view.end]);
        const t = view.start + 0.3 * view.span;
        if (Math.abs(view.time(view.x(t)) - t) > 1e-6) bad.push(t);
      }
      view.showAll();
      return [bad, view.showsAll];
    }""")
    assert found == [[], True]


def test_the_overview_moves_the_window(long):
    page, _ = long
    box = page.locator("#overview-canvas").bounding_box()
    page.evaluate("holdfast.view.setWindow(20, 40)")
    x_of = """(t) => 52 + (t / holdfast.view.high) * holdfast.view.plotWidth"""
    middle, right, far = (box["x"] + page.evaluate(x_of, t) for t in (30, 40, 100))
    y = box["y"] + 25
    page.mouse.move(middle, y)
    page.mouse.down()
    page.mouse.move(far, y)
    page.mouse.up()
    assert page.evaluate(WINDOW) == pytest.approx([90, 110], abs=0.5)
    page.mouse.click(middle, y)
    assert page.evaluate(WINDOW) == pytest.approx([20, 40], abs=0.5)
    page.mouse.move(right, y)
    page.mouse.down()
    page.mouse.move(far, y)
    page.mouse.up()
    assert page.evaluate(WINDOW) == pytest.approx([20, 100], abs=0.5)


def test_dragging_with_shift_or_the_right_button_moves_the_window(long):
    page, _ = long
    page.evaluate("holdfast.view.setWindow(20, 40)")
    for button, key in (("left", "Shift"), ("right", None)):
        before = page.evaluate(WINDOW)
        if key:
            page.keyboard.down(key)
        point(page, "thumb", sum(before) / 2)
        page.mouse.down(button=button)
        x, y = position(page, "thumb", before[0] + 5)
        page.mouse.move(x, y, steps=4)
        page.mouse.up(button=button)
        if key:
            page.keyboard.up(key)
        assert page.evaluate(WINDOW) == pytest.approx([each + 5 for each in before], abs=0.2)
    assert page.evaluate("holdfast.editor.history.past.length") == 0


def test_keys_zoom_and_move_the_window(long):
    page, _ = long
    page.keyboard.press("+")
    page.keyboard.press("+")
    start, end = page.evaluate(WINDOW)
    assert end - start < 60
    page.keyboard.press("ArrowRight")
    assert page.evaluate(WINDOW)[0] > start
    page.keyboard.press("0")
    assert page.evaluate("holdfast.view.showsAll")


def test_values_at_the_cursor_and_other_forces(long):
    page, service = long
    page.evaluate("holdfast.view.setWindow(40, 41)")
    wait_for_signals(page)
    times, values = service.recordings[0].signals["ring"]
    k = 6050
    point(page, "ring", float(times[k]))
    shows(page, ".finger-legend:nth-child(4) .value", f"^{values[0, k]:.0f}$")
    page.keyboard.press("f")
    shows(page, ".finger-legend:nth-child(4) .label", "^Fx$")
    point(page, "ring", float(times[k]) + 0.001)
    shows(page, ".finger-legend:nth-child(4) .value", f"^{values[1, k]:.0f}$")
    page.select_option("#force", "xyz")
    names = page.locator(".finger-legend:nth-child(1) .label").all_inner_texts()
    assert names == ["Fx", "Fy", "Fz", "σ"]


def test_missing_values_of_signals(visit):
    class MissingValues(Recording):
        def signals_between(self, start, end, points):
            found = super().signals_between(start, end, points)
            for own in found["fingers"].values():
                for key in ("F_a", "sigma"):
                    own[key] = [None if k % 3 else value for k, value in enumerate(own[key])]
                own["F_x"] = [None] * len(own["t"])
            return found

    with FakeService(MissingValues()) as service:
        page = visit(service.url)
        ready(page)
        page.select_option("#force", "F_x")
        page.keyboard.press("y")
        point(page, "thumb", 10)
        shows(page, ".finger-legend .value", "^–$")
