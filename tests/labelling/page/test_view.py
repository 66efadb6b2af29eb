"""Looking at a recording: zoom, the overview, and signals as fine as the window needs."""

import pytest

from labelling.page.desk import Desk, Recording
from labelling.page.hands import place, point, ready, shows, until

WINDOW = "[holdfast.view.start, holdfast.view.end]"


@pytest.fixture
def long(visit):
    """A page of 20,000 samples a finger, and its service."""
    with Desk(Recording(seconds=20_000 / 150)) as desk:
        page = visit(desk.url)
        ready(page)
        yield page, desk


def settled(page):
    """Waits until nothing is asked of the service any more."""
    until(page, "!holdfast.signals.asking && !holdfast.signals.timer && !holdfast.plot.asked")


def wheel(page, *turns):
    for turn in turns:
        page.mouse.wheel(0, turn)
        page.wait_for_timeout(30)


def test_the_wheel_zooms_about_the_pointer_and_asks_for_finer_data(long):
    page, desk = long
    settled(page)
    assert len(desk.asked) == 1
    drawn = page.evaluate("Number(document.body.dataset.drawn)")
    x, y = place(page, "index", 40)
    page.mouse.move(x, y)
    wheel(page, -300)
    start, end = page.evaluate(WINDOW)
    assert 30 < end - start < 80
    assert place(page, "index", 40)[0] == pytest.approx(x, abs=1.1)  # whole pixels
    until(page, "(n) => Number(document.body.dataset.drawn) > n", drawn)
    settled(page)
    first, last, points = desk.asked[-1]
    assert first < start  # with a margin
    assert last > end
    assert points / (last - first) > 5  # about one for each pixel
    wheel(page, *[-300] * 8)
    settled(page)
    shows(page, "#window", "every sample")
    start, end = page.evaluate(WINDOW)
    got = page.evaluate(f"[...holdfast.signals.pieces('index', ...{WINDOW})[0][0].t]")
    own = desk.recordings[0].signals["index"][0]
    assert [t for t in got if start <= t <= end] == own[(own >= start) & (own <= end)].tolist()
    page.mouse.dblclick(x, y)
    assert page.evaluate("holdfast.view.whole")


def test_small_steps_ask_for_nothing(long):
    page, desk = long
    page.evaluate("holdfast.view.look(40, 50)")
    settled(page)
    n = len(desk.asked)
    page.evaluate("holdfast.view.pan(2)")
    page.evaluate("holdfast.view.zoom(0.9, 45)")
    page.wait_for_timeout(200)
    settled(page)
    assert len(desk.asked) == n
    page.evaluate("holdfast.view.pan(30)")
    until(page, "holdfast.signals.part.start > 50")
    assert len(desk.asked) == n + 1


def test_while_data_are_on_their_way_the_old_are_drawn(long):
    page, desk = long
    settled(page)
    desk.delay = [0.6]
    page.evaluate("holdfast.view.look(40, 50)")
    page.wait_for_timeout(200)
    (piece,) = page.evaluate(
        f"holdfast.signals.pieces('thumb', ...{WINDOW}).map(([{{ t }}, a, b]) => [t.length, a, b])"
    )
    assert piece[0] > 1000
    assert piece[1:] == [40, 50]
    for start in (60, 70, 80):  # in the meantime the window moves on
        page.evaluate(f"holdfast.view.look({start}, {start + 10})")
    until(page, "holdfast.signals.part?.start > 60")
    settled(page)
    assert [round(start) for start, _, _ in desk.asked] == [0, 36, 76]  # only the newest


def test_an_answer_for_another_recording_is_dropped(visit):
    with Desk(Recording("one", 300), Recording("two", 300)) as desk:
        page = visit(desk.url)
        ready(page)
        settled(page)
        desk.delay = [0.5]
        page.evaluate("holdfast.view.look(40, 50)")
        page.wait_for_timeout(100)
        page.keyboard.press("n")
        shows(page, "#name", "two")
        page.wait_for_timeout(700)
        assert page.evaluate("[holdfast.signals.part, holdfast.signals.id]") == [None, 1]
        assert page.evaluate("holdfast.view.whole")


def test_the_window_never_leaves_the_recording(module):
    found = module.evaluate("""async () => {
      const { View } = await import("/page/view.js"), view = new View(() => {});
      view.limit(10, 110, 0.1);
      const bad = [];
      let random = 7;
      const next = () => (random = (random * 16807) % 2147483647) / 2147483647;
      for (let k = 0; k < 5000; k += 1) {
        const what = next();
        if (what < 0.4) view.zoom(10 ** (2 * next() - 1), view.start + next() * view.span);
        else if (what < 0.7) view.pan(200 * next() - 100);
        else if (what < 0.9) view.look(200 * next() - 50, 200 * next() - 50);
        else view.show({ start: 10 + 99 * next(), end: 110 });
        const inside = view.start >= 10 - 1e-9 && view.end <= 110 + 1e-9;
        if (!inside || view.span < 0.1 - 1e-9) bad.push([view.start, view.end]);
        const t = view.start + 0.3 * view.span;
        if (Math.abs(view.time(view.x(t)) - t) > 1e-6) bad.push(t);
      }
      view.fit();
      return [bad, view.whole];
    }""")
    assert found == [[], True]


def test_the_overview_moves_the_window(long):
    page, _ = long
    box = page.locator("#head").bounding_box()
    page.evaluate("holdfast.view.look(20, 40)")
    x_of = """(t) => 52 + (t / holdfast.view.high) * holdfast.view.inner"""
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


def test_dragging_with_shift_or_the_right_button_moves_it(long):
    page, _ = long
    page.evaluate("holdfast.view.look(20, 40)")
    for button, key in (("left", "Shift"), ("right", None)):
        before = page.evaluate(WINDOW)
        if key:
            page.keyboard.down(key)
        point(page, "thumb", sum(before) / 2)
        page.mouse.down(button=button)
        x, y = place(page, "thumb", before[0] + 5)
        page.mouse.move(x, y, steps=4)
        page.mouse.up(button=button)
        if key:
            page.keyboard.up(key)
        assert page.evaluate(WINDOW) == pytest.approx([each + 5 for each in before], abs=0.2)
    assert page.evaluate("holdfast.editor.history.past.length") == 0


def test_keys_zoom_and_move(long):
    page, _ = long
    page.keyboard.press("+")
    page.keyboard.press("+")
    start, end = page.evaluate(WINDOW)
    assert end - start < 60
    page.keyboard.press("ArrowRight")
    assert page.evaluate(WINDOW)[0] > start
    page.keyboard.press("0")
    assert page.evaluate("holdfast.view.whole")


def test_values_at_the_cursor_and_other_forces(long):
    page, desk = long
    page.evaluate("holdfast.view.look(40, 41)")
    settled(page)
    times, values = desk.recordings[0].signals["ring"]
    k = 6050
    point(page, "ring", float(times[k]))
    shows(page, ".gutter:nth-child(4) .value", f"^{values[0, k]:.0f}$")
    page.keyboard.press("f")
    shows(page, ".gutter:nth-child(4) .label", "^Fx$")
    point(page, "ring", float(times[k]) + 0.001)
    shows(page, ".gutter:nth-child(4) .value", f"^{values[1, k]:.0f}$")
    page.select_option("#force", "xyz")
    assert page.locator(".gutter:nth-child(1) .label").all_inner_texts() == ["Fx", "Fy", "Fz", "σ"]


def test_signals_with_holes_and_nothing_at_all(visit):
    class Holes(Recording):
        def draw(self, start, end, points):
            found = super().draw(start, end, points)
            for own in found["fingers"].values():
                for key in ("F_a", "sigma"):
                    own[key] = [None if k % 3 else value for k, value in enumerate(own[key])]
                own["F_x"] = [None] * len(own["t"])
            return found

    with Desk(Holes()) as desk:
        page = visit(desk.url)
        ready(page)
        page.select_option("#force", "F_x")
        page.keyboard.press("y")
        point(page, "thumb", 10)
        shows(page, ".gutter .value", "^–$")
