"""`holdfast hold` while the clock of its source jumps."""

import math

import msgspec
import numpy as np
import pytest

from holdfast.cli import main
from holdfast.devices.sources import Arrival
from holdfast.devices.sources.assembler import Assembler, Device
from holdfast_grip import GripCommand
from holdfast_grip.loop import watchdog
from live.build import Script, grasp

pytestmark = pytest.mark.slow

HELD, SHAKEN = 5.0, 5.9
"""Times at which the clock jumps: in the calm grip, and while the object is shaken [s]."""
HOUR = 3600.0
PAUSE = 0.25
"""Time after a jump in which no force may rise; later the object is shaken in fact [s]."""
JUMPS = {
    "an hour ahead": lambda times, jump: times + HOUR * (times >= jump),
    "an hour ahead, for one sample": lambda times, jump: (
        times + HOUR * (np.arange(len(times)) == np.searchsorted(times, jump))
    ),
    "an hour back": lambda times, jump: times - HOUR * (times >= jump),
    "a second back": lambda times, jump: times - 1.0 * (times >= jump),
    "still": lambda times, jump: np.minimum(times, times[np.searchsorted(times, jump)]),
    "no number": lambda times, jump: np.where(times < jump, times, np.nan),
}


class Jumping(Script):
    """Source of a grasp whose times are those of `stamps`, received at an even pace."""

    def read(self, timeout):
        return self.steps.popleft() if self.steps else None


def raw(recording, stamps):
    """Return arrivals that break the contract of sources: their times are the stamps."""
    times = recording.modules["thumb"].times.tolist()
    return [
        Arrival(stamp, {name: m.readings[k] for name, m in recording.modules.items()}, time)
        for k, (stamp, time) in enumerate(zip(stamps, times, strict=True))
    ]


def assembled(recording, stamps):
    """Return arrivals as a device makes them of its stamps."""
    assembler = Assembler()
    names = enumerate(recording.modules.items())
    assembler.devices = {k: Device(k, "", {name: m.sensor}) for k, (name, m) in names}
    arrivals = []
    for row, time in enumerate(recording.modules["thumb"].times.tolist()):
        if math.isnan(stamps[row]):  # decoders refuse it
            continue
        assembler.stamp(stamps[row], time)
        for k, module in enumerate(recording.modules.values()):
            assembler.add(k, module.readings[row])
        arrivals += assembler.finish(time)
    return arrivals


def hold(folder, monkeypatch, arrivals, recording):
    """Run the verb; return its exit code and the commands that reached the hand."""
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    source = Jumping(sensors, arrivals)
    monkeypatch.setattr("holdfast.devices.sources.open_source", lambda *_, **__: source)
    monkeypatch.setattr(watchdog.Watchdog.__init__, "__defaults__", (300.0,))
    hand = f"log:{folder / 'hand'}"
    words = ["hold", "builtin:twin", "source", "--hand", hand, "--armed", "--confirm", hand]
    code = main(words)
    lines = (folder / "hand").read_bytes().splitlines()
    return code, [msgspec.json.decode(line, type=GripCommand) for line in lines]


def scale(command):
    return max((finger.scale for finger in command.fingers.values()), default=1.0)


@pytest.mark.parametrize(("arrivals", "jump"), [(raw, HELD), (assembled, SHAKEN)])
@pytest.mark.parametrize("kind", JUMPS)
def test_no_jump_raises_a_force(tmp_path, monkeypatch, kind, arrivals, jump):
    recording = grasp()
    times = recording.modules["thumb"].times
    stamps = JUMPS[kind](times, jump).tolist()
    code, commands = hold(tmp_path, monkeypatch, arrivals(recording, stamps), recording)
    before = [command for command in commands if command.time < jump]
    after = [c for c in commands[len(before) :] if abs((c.time - jump + 1) % HOUR - 1) < PAUSE]
    assert before and before[-1].fingers
    assert {scale(command) for command in after} <= {scale(before[-1])}
    assert commands[-1].state.value == "FAULT"
    # What breaks the contract of sources ends the verb; a jump ahead does not break it.
    assert code == (2 if arrivals is raw and kind != "an hour ahead" else 0)
