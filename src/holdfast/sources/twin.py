"""The twin as a source: grasps that are simulated, then played."""

import json
import subprocess
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

from holdfast.io import read_chunks, save_recording
from holdfast.recordings import Recording
from holdfast.sources.player import Player
from holdfast.sources.uri import Address
from holdfast.twin.profile import ATTEMPTS, profile
from holdfast.twin.simulation import CASES, Grasp, simulate

WORK = "import sys; from holdfast.sources.twin import write; write(*sys.argv[1:])"
"""What the process does that simulates the next grasp."""


class Twin(Player):
    """A grasp of the twin, as if it came now.

    Entering takes the seconds of the simulation. Where it loops, the next repeat of the grasp
    is simulated by another process while this one plays.

    Args:
        address: `twin:?object=can&seed=0&case=2&repeat=1&profile=reference&server=false`;
            what is missing is as here.
        speed: 1 is real time, 2 twice as fast, 0 as fast as samples are taken.
        loop: after a grasp comes its next repeat.

    Raises:
        ValueError: there is no such object, profile or case, or a parameter is not as expected.
    """

    def __init__(self, address: Address, *, speed: float = 1.0, loop: bool = False) -> None:
        self._ahead: _Ahead | None = None
        self._grasp = grasp_of(address)
        super().__init__(address.text, speed=speed, loop=loop)

    def close(self) -> None:
        """Forgets the grasp, and the next one."""
        super().close()
        if self._ahead is not None:
            self._ahead.close()
            self._ahead = None

    def _begin(self, number: int) -> Iterable[Recording]:
        pieces = iter([grasped(self._grasp)]) if self._ahead is None else self._ahead.pieces()
        first = next(pieces)
        attempt = first.metadata["attempt"]
        again = f", after {attempt} that failed" if attempt else ""
        self._notices.append(f"the twin grasps: {first.name}{again}")
        if self._loops:
            self._ahead = self._ahead or _Ahead()
            self._ahead.start(replace(self._grasp, repeat=self._grasp.repeat + number + 1))
        return chain([first], pieces)

    def _metadata(self, first: Recording) -> dict[str, object]:
        return {**first.metadata, "source": self.name}

    def _is_ready(self, number: int, timeout: float) -> bool:
        return self._ahead is None or self._ahead.is_ready(timeout)


class _Ahead:
    """Simulates grasps in another process, one at a time."""

    def __init__(self) -> None:
        self._folder = TemporaryDirectory(prefix="holdfast-")
        self._path = self._before = Path(self._folder.name) / "none"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, grasp: Grasp) -> None:
        """Begins to simulate a grasp; the one before the last is played, and forgotten."""
        self._before.unlink(missing_ok=True)
        self._before, self._path = self._path, self._path.with_name(f"{grasp.name}.parquet")
        self._grasp, self._process = grasp, None
        with suppress(OSError):  # where no process can be made, it is simulated here
            self._process = self._run(json.dumps(asdict(grasp)))

    def _run(self, grasp: str) -> subprocess.Popen[bytes]:
        silent = subprocess.DEVNULL
        work = [sys.executable, "-c", WORK, grasp, str(self._path)]
        return subprocess.Popen(work, stdin=silent, stdout=silent, stderr=silent)

    def is_ready(self, timeout: float) -> bool:
        """Whether it is over within `timeout` [s]."""
        if self._process is None:
            return True
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(max(timeout, 0.0))
        return self._process.poll() is not None

    def pieces(self) -> Iterator[Recording]:
        """The grasp, when it is ready; simulated here where the process died."""
        if self._path.exists():
            return read_chunks(self._path, labels=False)
        return iter([grasped(self._grasp)])

    def close(self) -> None:
        """Ends the process, and removes its files."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()


def grasp_of(address: Address) -> Grasp:
    """The grasp that a URI asks for.

    Raises:
        ValueError: there is no such object, profile or case, or a parameter is not as expected.

    Example:
        >>> from holdfast.sources.uri import parse
        >>> grasp_of(parse("twin:?object=ball&repeat=3")[1]).name
        'ball-case2-3'
    """
    address.only("object", "seed", "case", "repeat", "profile", "server")
    if address.host or address.path:
        raise ValueError(f"{address.text}: twin:?object=can&seed=1 expected, without a path")
    given = address.parameters
    grasp = Grasp(
        given.get("object", "can"),
        _whole(address, "case", 2),
        _whole(address, "repeat", 1),
        given.get("profile", "reference"),
        _whole(address, "seed", 0),
        server=_yes(address, "server"),
    )
    try:
        profile(grasp.profile)
        grasp.thing  # noqa: B018 (refuses an unknown object)
    except ValueError as cause:
        raise ValueError(f"{address.text}: {cause}") from cause
    if grasp.case not in CASES or grasp.repeat < 1:
        raise ValueError(
            f"{address.text}: case 1 or 2 and a repeat of at least 1 expected, "
            f"{grasp.case} and {grasp.repeat} given"
        )
    return grasp


def grasped(grasp: Grasp) -> Recording:
    """The recording of a grasp, tried again and calmer as long as it fails."""
    for attempt in range(ATTEMPTS):
        recording = simulate(replace(grasp, attempt=attempt))
        if recording.metadata["case"] != "failed":
            break
    return recording


def write(grasp: str, path: str) -> None:
    """Simulates a grasp, given as JSON, into a file: for a process of its own."""
    save_recording(grasped(Grasp(**json.loads(grasp))), path)


def _whole(address: Address, name: str, default: int) -> int:
    text = address.parameters.get(name, str(default))
    if not (text.isascii() and text.isdecimal()):
        raise ValueError(f"{address.text}: {name}=1, a whole number, expected, {text!r} given")
    return int(text)


def _yes(address: Address, name: str) -> bool:
    text = address.parameters.get(name, "false")
    if text not in ("true", "false"):
        raise ValueError(f"{address.text}: {name}=true or false expected, {text!r} given")
    return text == "true"
