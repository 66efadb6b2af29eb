"""SIGKILL of `holdfast hold --armed` at named steps: what the hand gets last, what is recorded."""

import signal
import subprocess
import sys

import pytest

from holdfast.errors import RecordingError
from holdfast.io import load_recording, save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_grip.loop.watchdog import N_SAFE_COMMANDS

GRIPPER = """
import os, signal
def move(scale):
    with open("calls", "a") as file:
        print(os.getpid(), scale, file=file)
    if os.path.exists("kill"):
        os.remove("kill")
        os.kill(os.getpid(), signal.SIGKILL)
"""
PROGRAM = """
import os, signal, sys, time
from holdfast.cli import main
from holdfast_grip.hands.local import ScalarGripper
from holdfast_grip.loop.grip_loop import GripLoop
from holdfast_grip.loop.watchdog import Watchdog
from holdfast.live.recorder import Recorder

def kill(target, name, at, n=1, wait=0.0):
    original, calls = getattr(target, name), [0]
    def patched(*given, **options):
        calls[0] += 1
        now = calls[0] == n
        result = None if now and at == "before" else original(*given, **options)
        if now:
            time.sleep(wait)
            os.kill(os.getpid(), signal.SIGKILL)
        return result
    setattr(target, name, patched)

Watchdog.__init__.__defaults__ = (300.0,)  # it sees the death by its pipe
if sys.argv[1]:
    eval(f"kill({sys.argv[1]})")
sys.exit(main(sys.argv[2:]))
"""
STEPS = {
    "before the watchdog starts": "Watchdog, 'start', 'before'",
    "after it is connected": "Watchdog, 'start', 'after'",
    "before the first heartbeat": "Watchdog, 'beat', 'before'",
    "between the first heartbeat and its command": "Watchdog, 'beat', 'after'",
    "before the first command": "ScalarGripper, '_send', 'before'",
    "in the first command": "",
    "after the first command": "ScalarGripper, '_send', 'after'",
    "after the third command": "ScalarGripper, '_send', 'after', 3",
    "between heartbeat and command": "Watchdog, 'beat', 'after', 800",
    "while recording": "Recorder, 'put', 'after', 900, 1.0",
    "while the recording is closed": "Recorder, 'close', 'before'",
    "when the loop ends": "GripLoop, '__exit__', 'before'",
    "before the farewell": "Watchdog, 'stop', 'before'",
}
"""Where a process is killed: class, method, before or after it, at which call, after seconds; empty
for a kill in the function of the gripper."""
NOTHING_COMMANDED = tuple(STEPS)[:3]
BEFORE_GRIP = "between the first heartbeat and its command"
LOOP_ENDED = "while the recording is closed"
RECORDED = "while recording"
"""The step at which there was time to write what was recorded."""
ALSO_HELD = (BEFORE_GRIP, "in the first command", tuple(STEPS)[8], RECORDED, LOOP_ENDED)
"""Steps after which the hand gets something else if it is to hold and not to open."""
LARGEST_STEP = 0.2
"""Rise of the scale in one step of the loop."""


@pytest.fixture(scope="module")
def grasp(tmp_path_factory):
    path = tmp_path_factory.mktemp("grasp") / "grasp.parquet"
    save_recording(synthetic_recording("grasp", 1), path)
    return path


def killed(folder, step, *words):
    """Run `hold` until it is killed, and wait for its watchdog, which has the same stderr."""
    (folder / "gripper.py").write_text(GRIPPER)
    if not STEPS[step]:
        (folder / "kill").touch()
    command = [sys.executable, "-c", PROGRAM, STEPS[step], "hold", "builtin:twin", *words]
    command += ["--armed", "--speed", "0", "--record", "held.mcap"]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=False, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert "Traceback" not in done.stderr


def check_recording(path):
    """Check that a recording can be read, or is cut before its first sample."""
    try:
        assert not load_recording(path).complete
    except RecordingError as refusal:
        assert "cut so early that nothing can be recovered" in str(refusal)


@pytest.mark.parametrize(
    ("step", "on_fault"),
    [*((step, "open") for step in STEPS), *((step, "hold") for step in ALSO_HELD)],
)
def test_the_watchdog_brings_the_hand_into_its_safe_state(tmp_path, grasp, step, on_fault):
    hand = "call:gripper:move"
    killed(tmp_path, step, str(grasp), "--hand", hand, "--confirm", hand, "--on-fault", on_fault)
    file = tmp_path / "calls"
    lines = [line.split() for line in file.read_text().splitlines()] if file.exists() else []
    scales = [float(scale) for _, scale in lines]
    own = [float(scale) for process, scale in lines if process == lines[0][0]]
    if step in NOTHING_COMMANDED or (step == BEFORE_GRIP and on_fault == "hold"):
        assert not lines
    elif on_fault == "open":
        assert scales[-1] == 0.0
    elif step == LOOP_ENDED:
        assert scales == own and own[-1] > 0.0
    else:
        # Of a command that was on its way nobody knows whether it left: it is sent once more.
        assert len(set(scales[-N_SAFE_COMMANDS:])) == 1
        assert scales[-1] in (own[-1], pytest.approx(own[-1] + LARGEST_STEP))
    if step not in NOTHING_COMMANDED[:2]:
        check_recording(tmp_path / "held.mcap")
    if step == RECORDED:
        assert load_recording(tmp_path / "held.mcap").duration > 5.0
