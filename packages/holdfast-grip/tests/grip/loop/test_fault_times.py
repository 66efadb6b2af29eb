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


def ms(seconds):
    return f"{1000 * seconds:.0f} ms"


TICK = ms(runner.TICK)
SHORT = ms(LIMITS.fault_after)
AT_60, AT_150 = ms(repeats.MIN_REPEATS / 60), ms(1 / RATE + LIMITS.stale_after)
N_REPEATS = repeats.MIN_REPEATS
TIMES = [
    ("`stale`", f"1 period + {ms(LIMITS.stale_after)} ({AT_150} at 150 Hz)"),
    ("`frozen`", f"{ms(repeats.FROZEN_TIME)}, at least {N_REPEATS} samples ({AT_60} at 60 Hz)"),
    ("`finger_fault`", f"{ms(STUCK_SECONDS)} of the detector (`stuck`) + {SHORT}"),
    ("`finger_fault`, `stale`", SHORT),
    ("`finger_fault`", f"{ms(MIN_LATE_DELAY)} of the source (`late`) + {SHORT}"),
    ("`lost`", SHORT),
    ("`not_finite`, `overload`", "the same sample"),
    ("`clock`", "the same sample"),
    ("`behind`", f"{ms(runner.MAX_PAUSE)}, at the next step"),
    ("`hand`", "100 ms, or 3 of their periods"),  # of hands that report joints, as those of ROS
    ("the loop ends", "500 ms"),
    ("the loop ends", "the next command"),
    ("`limit`", "the same command"),
    ("`watchdog`", ms(watchdog.TIMEOUT)),
    ("`watchdog`", "at once"),
    ("the loop ends", f"the next heartbeat, within {TICK}"),
    ("the loop ends", ms(watchdog.UNREAD_TIMEOUT)),
]  # fmt: skip


def rows():
    text = (Path(__file__).parents[5] / "docs" / "details" / "grip.md").read_text("utf-8")
    table = text.split("## Times of faults")[1].split("\n\n")[1]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]


def test_the_table_has_the_times_of_the_code():
    assert [(reason, time) for _, reason, time, _ in rows()] == TIMES


def test_the_names_of_faults_have_the_numbers_of_the_code():
    faults = " ".join(fault for fault, *_ in rows())
    assert f"above {OVERLOAD:g} `max_force`" in faults
    assert f"or {loop.MAX_CLOCK_STEP:g} s ahead" in faults
