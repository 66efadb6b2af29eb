"""Time from slip to command through the wire: XELA packets out, commands back by DDS.

The twin runs in this process behind a XELA server, as `holdfast play --hand` does. `holdfast
hold`, armed, is another process: it reads the packets and publishes commands of a hand. In the
trials of `holdfast trial`, the twin takes the commands, so that the loop is closed. The onset of
slip is that of the twin's truth: the instant at which the first sample with a sliding fingertip
is due. The time of a command is that of its arrival here. All clocks are that of this machine.

    python benchmarks/grip_wire.py [TRIALS] [--seed S] [--kind KIND]
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import numpy as np

from holdfast.contact import CONTACT_FORCE, SLIP_SPEED
from holdfast.io.cdr import MessageDecoder, MessageEncoder
from holdfast.live.publishers.xela_server import XelaServer
from holdfast.twin.hand import RATE
from holdfast.twin.loads import LoadKind
from holdfast.twin.simulation import Simulation
from holdfast.twin.steps import TIP_LOAD, TIP_SLIP
from holdfast_lab.trial.run import RISE
from holdfast_lab.trial.trials import LOAD_KINDS, Trial, draw_trials
from holdfast_ros import dds
from holdfast_ros.hands.driven_twin import DrivenTwin
from holdfast_ros.topic_messages import FLOAT_ARRAY, JOINT_STATE, joint_message, topic_definition

EFFORT = 0.1
PLEXUS = f"ros2:plexus?effort={EFFORT}&max_effort=1"
SIXTEEN = ",".join([str(EFFORT)] * 16)
V5 = f"ros2:v5?effort={SIXTEEN}&max_effort=1&stiffness=1&home={SIXTEEN}"
V5_TOPIC, V5_STATES = "/allegroHand/joint_cmd", "/allegroHand/joint_states"
DOMAIN = 151
HOLDFAST = Path(sys.executable).with_name("holdfast")
START_TIMEOUT = 120.0
N_STAMPED = 4
"""Number of trials in which the time from sample to command is measured."""
IDLE_TIME = 6.0
"""Time before the hand closes, in which the loop gets ready [s]."""


class TrialTwin(DrivenTwin):
    """The twin in a trial, with the truth and the time of each sample."""

    def __init__(self, trial: Trial) -> None:
        super().__init__("twin:", PLEXUS)
        self._trial = trial
        self.slips: list[tuple[float, float, bool]] = []  # due [s], speed [m/s], under load
        self.sent: list[float] = []  # time at which each sample was complete [s]

    def open(self) -> None:
        super().open()
        trial = self._trial
        plan = trial.plan()._replace(before=IDLE_TIME)
        self.simulation = Simulation(trial.grasp, plan=plan, loads=[trial.load])

    @property
    def ended(self) -> bool:
        simulation = self.simulation
        return super().ended or (
            simulation is not None
            and (
                simulation.held_for > self._trial.duration
                or simulation.protocol.lost_at is not None
            )
        )

    def read(self, timeout: float):
        arrival = super().read(timeout)
        if arrival is not None and self.simulation is not None and self._begun_at is not None:
            tips = self.simulation.world.contact.tips
            speed = np.where(tips[:, TIP_LOAD] > CONTACT_FORCE, tips[:, TIP_SLIP], 0.0).max()
            due = self._begun_at + (self.simulation.n_samples - 1) / RATE
            loaded = self.simulation.held_for >= self._trial.load.start
            self.slips.append((due, float(speed), bool(loaded)))
            self.sent.append(time.monotonic())
        return arrival


class Listener:
    """Subscription in a thread, with the time of arrival of each message [s]."""

    def __init__(self, topic: str, kind: str) -> None:
        self.messages: list[tuple[float, dict]] = []
        definition = topic_definition(kind)
        self._node = dds.Node(DOMAIN)
        self._reader = self._node.reader(topic, definition)
        self._decode = MessageDecoder(definition, ros2=True)
        self._ending = Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ending.is_set():
            for data in self._reader.take(0.05):
                self.messages.append((time.monotonic(), self._decode(data)))

    def close(self) -> None:
        self._ending.set()
        self._thread.join()


@contextmanager
def holding(uri: str, hand: str, output) -> Iterator[subprocess.Popen]:
    """`holdfast hold`, armed, until the end of the block."""
    process = subprocess.Popen(
        [HOLDFAST, "hold", "builtin:any", uri, "--hand", hand, "--armed", "--confirm", hand],
        stdout=output, stderr=output, text=True,
    )  # fmt: skip
    try:
        yield process
        process.send_signal(signal.SIGINT)
        process.wait(30)
    finally:
        process.kill()
        process.wait()


def serve(twin: TrialTwin, hand: str, output) -> XelaServer:
    """Play the trial to a loop, to its end."""
    with twin, XelaServer(twin, port=0, wait=True, whole_hand=True) as server:
        with holding(server.uri, hand, output) as process:
            end = time.monotonic() + START_TIMEOUT
            while not server.wait(0.05) and process.poll() is None:
                if time.monotonic() > end:
                    raise SystemExit("the trial does not end")
        if server.failure is not None:
            raise server.failure
        return server


def sample_to_command(trial: Trial, output) -> np.ndarray:
    """Return the time from each complete sample to the command that rests on it [s].

    Commands of V5 have the time of their sample as their stamp.
    """
    definition, stop = topic_definition(JOINT_STATE), Event()
    write, encode = dds.Node(DOMAIN).writer(V5_STATES, definition), MessageEncoder(definition)
    values = np.full(16, EFFORT)
    names = [f"joint_{k}.0" for k in range(16)]
    state = encode(joint_message(0.0, names, positions=values, efforts=values))

    def publish() -> None:
        while not stop.wait(0.02):
            write(state)

    driver, listener = Thread(target=publish, daemon=True), Listener(V5_TOPIC, JOINT_STATE)
    driver.start()
    twin = TrialTwin(trial)
    server = serve(twin, V5, output)
    stop.set()
    driver.join()
    listener.close()
    delays, seen = [], set()
    for arrived, message in listener.messages:
        stamp = message["header"]["stamp"]
        place = (stamp["sec"] + stamp["nanosec"] * 1e-9 - server._time_offset) * RATE
        number = round(place)
        if abs(place - number) < 0.05 and 0 <= number < len(twin.sent) and number not in seen:
            seen.add(number)  # later ones, between two samples, have the time of their update
            delays.append(arrived - twin.sent[number])
    print(f"{len(delays)} of {len(listener.messages)} commands have the time of a sample")
    return np.array(delays)


def reaction(trial: Trial, output) -> float | None:
    """Return the time from the onset of slip to the rise of a command [s].

    Returns:
        0 if it rose before the slip, infinite if never; None if nothing slipped or the loop had
        not begun.
    """
    listener = Listener("/allegro_hand_position_effort_controller/efforts", FLOAT_ARRAY)
    twin = TrialTwin(trial)
    serve(twin, PLEXUS, output)
    listener.close()
    onsets = [due for due, speed, loaded in twin.slips if loaded and speed > SLIP_SPEED]
    loads = [due for due, _, loaded in twin.slips if loaded]
    before = [one for one in listener.messages if loads and one[0] <= loads[0]]
    if not onsets or not before:
        return None
    first = np.asarray(before[-1][1]["data"])
    for arrived, message in listener.messages:
        if arrived > loads[0] and (np.asarray(message["data"]) > RISE * first).any():
            return max(0.0, arrived - onsets[0])
    return float("inf")


def show(name: str, seconds: np.ndarray) -> None:
    if not len(seconds):
        print(f"{name}: none")
        return
    p50, p99 = np.percentile(seconds, [50, 99], method="higher") * 1e3
    print(f"{name}: p50 {p50:.1f} ms, p99 {p99:.1f} ms, largest {seconds.max() * 1e3:.1f} ms, "
          f"n {len(seconds)}")  # fmt: skip


def main(n_trials: int, seed: int, kind: str, output) -> None:
    os.environ["ROS_LOCALHOST_ONLY"], os.environ["ROS_DOMAIN_ID"] = "1", str(DOMAIN)
    sys.setswitchinterval(5e-4)  # the threads of this process shall not delay each other
    kinds = [LoadKind(kind)] if kind else LOAD_KINDS
    drawn = draw_trials(n_trials * len(LOAD_KINDS) // len(kinds), seed)
    trials = [trial for trial in drawn if trial.load.kind in kinds]
    delays = [sample_to_command(trial, output) for trial in trials[:N_STAMPED]]
    show("sample to command", np.concatenate(delays))
    found = [reaction(trial, output) for trial in trials]
    slips = np.array([one for one in found if one is not None])
    print(f"{len(slips)} of {len(found)} trials slipped while the loop held the object")
    print(f"the command rose before the slip in {int((slips == 0).sum())} of them, "
          f"never in {int(np.isinf(slips).sum())}")  # fmt: skip
    show("slip onset to command, all slips (0 if it rose before)", slips)
    show("slip onset to command, where it rose after", slips[(slips > 0) & np.isfinite(slips)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("trials", type=int, nargs="?", default=48)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", default="", help="of the load: friction drops without notice")
    parser.add_argument("--log", type=Path, default=None, help="output of holdfast hold")
    given = parser.parse_args()
    with open(given.log or os.devnull, "w") as file:  # noqa: PTH123
        main(given.trials, given.seed, given.kind, file)
