"""The table of fault times in docs/grip.md, compared with the code."""

from pathlib import Path

from grip.build import RATE
from holdfast.devices.sources.timeline import MIN_LATE_DELAY
from holdfast_grip import Limits, repeats
from holdfast_grip.controller import OVERLOAD
from holdfast_grip.loop import grip_loop as loop
from holdfast_grip.loop import runner, watchdog

LIMITS = Limits()
STUCK_SECONDS = 0.5
"""HF_STUCK_SECONDS of `kernel/faults.c`."""
TIMES = [
    LIMITS.stale_after, 1 / RATE + LIMITS.stale_after, LIMITS.fault_after, STUCK_SECONDS,
    repeats.FROZEN_TIME, repeats.MIN_REPEATS / 60, MIN_LATE_DELAY, runner.MAX_PAUSE, runner.TICK,
    watchdog.TIMEOUT, watchdog.UNREAD_TIMEOUT,
]  # fmt: skip


def test_the_table_has_the_numbers_of_the_code():
    text = (Path(__file__).parents[5] / "docs" / "grip.md").read_text("utf-8")
    table = text.split("## Times of faults")[1].split("\n## ")[0]
    assert [time for time in TIMES if f"{1000 * time:.0f} ms" not in table] == []
    assert f"at least {repeats.MIN_REPEATS} samples" in table
    assert f"above {OVERLOAD:g} `max_force`" in table
    assert f"or {loop.MAX_CLOCK_STEP:g} s ahead" in table
