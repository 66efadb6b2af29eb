"""Source of the twin: simulates grasps, then plays them."""

import json
import subprocess
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from holdfast.children import python_command
from holdfast.devices.sources.replay import Player
from holdfast.devices.uri import Address
from holdfast.files import file_stem, whole_file, write_whole
from holdfast.io import read_chunks, save_recording
from holdfast.io.stickers import stamps_path
from holdfast.recordings import Recording
from holdfast.twin.magnetic_faults import MagneticFaults
from holdfast.twin.objects import load_objects
from holdfast.twin.profile import GRASP_ATTEMPTS, profile
from holdfast.twin.scripted import perform
from holdfast.twin.simulation import GRASP_CASES, USKIN, Grasp, simulate

OPEN_SECONDS = 3.0
"""Time with an open hand with which a twin that is taught begins [s]: room for the tare."""
CAMERA_DELAY = 0.04
"""Time from a picture to its stamp, as of a webcam [s]."""
MAX_IDLE = 0.02
"""Longest pause of a read while no grasp is requested [s]; a protocol that does not wait for a
person requests one soon."""
SIMULATION_CODE = "from holdfast.devices.sources.twin import write; write(*sys.argv[1:])"
"""Program of the process that simulates the next grasp."""


class Twin(Player):
    """Source that simulates a grasp of the twin and plays it.

    Entering takes the seconds of the simulation. With `loop`, another process simulates the next
    repeat of the grasp while this one plays.

    Args:
        address: `twin:?object=can&seed=0&case=2&repeat=1&profile=reference&server=false` and
            `&sensor=uskin-curved`; missing parameters have these values. Without `object`, the
            profile `handling` takes another object in each grasp.
        speed: 1 is real time, 2 is twice as fast, 0 is as fast as samples are read.
        loop: play the next repeat of the grasp at the end.

    Raises:
        ValueError: there is no such object, profile, case or sensor, or a parameter is not valid.
    """

    def __init__(self, address: Address, *, speed: float = 1.0, loop: bool = False) -> None:
        # Simulates the next grasp while this one plays; made with the first grasp of a loop.
        self._simulator: _Simulator | None = None
        self._grasp = grasp_of(address)
        in_turn = profile(self._grasp.profile).without_slips and "object" not in address.parameters
        self._objects = list(load_objects(None)) if in_turn else [self._grasp.object]
        self._current: list[Recording] = []  # played again when a client restarts it at once
        super().__init__(address.text, speed=speed, loop=loop)

    def close(self) -> None:
        """Drop the grasp, and end the simulation of the next one."""
        super().close()
        if self._simulator is not None:
            self._simulator.close()
            self._simulator = None

    def chunks_of(self, number: int) -> Iterable[Recording]:
        """Return the chunks of a grasp, and begin to simulate the next one."""
        simulator = self._simulator
        first = replace(self._grasp, object=self._objects[0])
        chunks = iter([simulated(first)]) if simulator is None else simulator.chunks()
        self._current = list(chunks)
        recording = self._current[0]
        n_failed = recording.metadata["attempt"]
        failed = f", after {n_failed} failed attempt{'s' * (n_failed > 1)}" if n_failed else ""
        self._notices.append(f"the twin grasps: {recording.name}{failed}")
        if self._loops:
            self._simulator = simulator = simulator or _Simulator()
            item = self._objects[(number + 1) % len(self._objects)]
            simulator.start(replace(first, object=item, repeat=first.repeat + number + 1))
        return self._current

    def same_chunks(self) -> Iterator[Recording]:
        """Yield the chunks of the current grasp once more."""
        yield from self._current

    def metadata_of(self, first: Recording) -> dict[str, object]:
        """Return the metadata of the first grasp, with this source."""
        return {**first.metadata, "source": self.name}

    def is_ready(self, number: int, timeout: float) -> bool:
        """Return whether a grasp is simulated within `timeout` [s]."""
        return self._simulator is None or self._simulator.is_ready(timeout)


class AskedTwin(Twin):
    """Twin that performs each step of `holdfast teach`, and is filmed by its own webcam.

    It begins with an open hand, and is silent until `perform` is called. Without `object` in the
    address, it takes another object in each grasp.

    Args:
        address: as of `Twin`; case, repeat and profile do not apply.
        speed: as of `Twin`.
    """

    def __init__(self, address: Address, *, speed: float = 1.0) -> None:
        super().__init__(address, speed=speed, loop=True)
        self._objects = [self._grasp.object] if "object" in address.parameters else []
        self._objects = self._objects or list(load_objects(None))
        self._asked: tuple[str, int, float] | None = ("open", 0, OPEN_SECONDS)
        self._repeat = 1

    def perform(self, number: int, action: str, n_actions: int, seconds: float) -> None:
        """Begin a grasp, as `holdfast.twin.scripted.perform` says.

        Args:
            number: of the grasp; each has random numbers of its own.
            action: of the script.
            n_actions: as of the script.
            seconds: as of the script [s].
        """
        self._repeat, self._asked = number, (action, n_actions, seconds)

    @property
    def is_idle(self) -> bool:
        """Whether the grasp is over, and no other is requested."""
        return self._asked is None and self._peek() is None

    def film(self, path: Path) -> None:
        """Write the video of the newest grasp, and the times of its pictures beside it."""
        from holdfast.twin.webcam import film_stickers

        with whole_file(path, force=True) as part:
            taken = film_stickers(self._current[0], part)
        stamps = taken + self._shift + CAMERA_DELAY
        lines = "".join(f"{stamp:.6f}\n" for stamp in stamps.tolist())
        write_whole(stamps_path(path), lines.encode(), force=True)

    def chunks_of(self, number: int) -> Iterable[Recording]:
        """Return the requested grasp."""
        asked, self._asked = self._asked or ("open", 0, OPEN_SECONDS), None
        name = self._objects[self._repeat % len(self._objects)]
        self._current = [perform(replace(self._grasp, object=name, repeat=self._repeat), *asked)]
        return self._current

    def is_ready(self, number: int, timeout: float) -> bool:
        """Return whether a grasp is requested."""
        if self._asked is None:
            time.sleep(min(timeout, MAX_IDLE))
        return self._asked is not None


class _Simulator:
    """Simulation of grasps in another process, one at a time."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="holdfast-")
        self._path = self._previous_path = Path(self._folder.name) / "none"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, grasp: Grasp) -> None:
        """Begin to simulate a grasp. Delete the one before the last, which was played."""
        self._previous_path.unlink(missing_ok=True)
        self._previous_path = self._path
        self._path = self._path.with_name(f"{file_stem(grasp.name)}.parquet")
        self._grasp, self._process = grasp, None
        with suppress(OSError):  # without a process, `chunks` simulates
            self._process = self._run(json.dumps(asdict(grasp)))

    def _run(self, grasp: str) -> subprocess.Popen[bytes]:
        null = subprocess.DEVNULL
        command = python_command(SIMULATION_CODE, grasp, str(self._path))
        return subprocess.Popen(command, stdin=null, stdout=null, stderr=null)

    def is_ready(self, timeout: float) -> bool:
        """Return whether the simulation ends within `timeout` [s]."""
        if self._process is None:
            return True
        with suppress(subprocess.TimeoutExpired):  # then `poll` gives None
            self._process.wait(max(timeout, 0.0))
        return self._process.poll() is not None

    def chunks(self) -> Iterator[Recording]:
        """Return the chunks of the grasp; simulate it here if the process failed."""
        if self._path.exists():
            return read_chunks(self._path, labels=False)
        return iter([simulated(self._grasp)])

    def close(self) -> None:
        """End the process, and delete its files."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()


def grasp_of(address: Address) -> Grasp:
    """Return the grasp of a URI.

    Raises:
        ValueError: there is no such object, profile, case or sensor, or a parameter is not valid.

    Example:
        >>> from holdfast.devices.uri import parse
        >>> grasp_of(parse("twin:?object=ball&repeat=3")[1]).name
        'ball-case2-3'
    """
    address.only("object", "seed", "case", "repeat", "profile", "server", "sensor")
    if address.host or address.path:
        raise ValueError(f"{address.text}: twin:?object=can&seed=1 expected, without a path")
    parameters = address.parameters
    grasp = Grasp(
        parameters.get("object", "can"),
        address.integer("case", 2),
        address.integer("repeat", 1),
        parameters.get("profile", "reference"),
        address.integer("seed", 0),
        server=address.choice("server", "false", "true") == "true",
        sensor=parameters.get("sensor", USKIN),
    )
    try:
        profile(grasp.profile)
        grasp.item, grasp.fingertip  # noqa: B018 (refuses an unknown object or sensor)
    except ValueError as cause:
        raise ValueError(f"{address.text}: {cause}") from cause
    if grasp.case not in GRASP_CASES or grasp.repeat < 1:
        raise ValueError(
            f"{address.text}: case 1 or 2 and a repeat of at least 1 expected, "
            f"{grasp.case} and {grasp.repeat} given"
        )
    return grasp


def simulated(grasp: Grasp) -> Recording:
    """Return the recording of a grasp; after a failure, try again more gently."""
    for attempt in range(GRASP_ATTEMPTS):
        recording = simulate(replace(grasp, attempt=attempt))
        if recording.metadata["case"] != "failed":
            break
    return recording


def write(grasp: str, path: str) -> None:
    """Simulate a grasp, given as JSON, and save it. It runs in another process."""
    fields = json.loads(grasp)
    fields["faults"] = MagneticFaults(**fields["faults"])  # the one field that is no plain value
    save_recording(simulated(Grasp(**fields)), path)
