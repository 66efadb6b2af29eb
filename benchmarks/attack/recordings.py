"""Attacks on recordings: damaged and cut files, headers that lie, recorders that are killed."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from attack.mutations import cut, damaged, encoded, flipped, lying
from attack.result import CpuResult
from holdfast.contact import ContactState
from holdfast.devices.sources import Arrival
from holdfast.errors import RecordingError
from holdfast.io import load_recording, mcap_writer, parquet, read_chunks, save_recording
from holdfast.io.header import encode_header
from holdfast.live.recorder import Recorder
from holdfast.recordings import Label, Recording, Tactile, Truth
from holdfast.sensors import sensor

Damage = Callable[[bytes, Random], bytes]

N_SAMPLES = 90
KILL_RATE = 150.0
"""Samples per second of a recorder that is killed [Hz]."""
MAX_LOSS = 0.5
"""Longest time that a kill may lose [s]."""


def make_recording() -> Recording:
    """Return a short recording with two modules, labels, truth and markers."""
    chance = np.random.default_rng(0)
    times = np.arange(N_SAMPLES) / 100
    modules = {
        name: Tactile(
            sensor("anyskin"),
            times,
            chance.integers(0, 60000, (N_SAMPLES, 5, 3)).astype(np.uint16),
            labels=(Label(0.1, 0.5, ContactState.STABLE),),
        )
        for name in ("thumb", "index/1")
    }
    truth = Truth(times, {"phase": np.array(["free", "locked"])[np.arange(N_SAMPLES) // 50]})
    return Recording("can", modules, {"object": "can"}, truth, ((0.2, "grasped"),))


def attack_damage(n_tried: int, suffix: str, name: str, damage: Damage) -> CpuResult:
    """Read damaged copies of a file; what is read must be the recording or its beginning."""
    from holdfast.labelling.server.workspace import summary_of

    result = CpuResult(f"recording, {suffix}: {name}")
    chance, want = Random(0), make_recording()
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"can{suffix}"
        save_recording(want, path)
        data = path.read_bytes()
        found: list[Recording] = []

        def read() -> bool:
            found.append(load_recording(path))
            return True

        for k in range(n_tried):
            path.write_bytes(damage(data, chance))
            found.clear()
            result.timed(read, RecordingError)
            result.n_wrong += not all(_is_beginning(one, want) for one in found)
            if k % 8 == 0:
                _must_not_raise(result, lambda: sum(1 for _ in read_chunks(path, 16)))
                _must_not_raise(result, lambda: summary_of(path))
    return result


def attack_sealed(n_tried: int) -> CpuResult:
    """Damage Parquet files and give them a valid checksum, as an attacker would."""
    result = CpuResult("recording, .parquet: damaged, with a valid checksum")
    chance = Random(1)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "can.parquet"
        save_recording(make_recording(), path)
        data = path.read_bytes()
        for _ in range(n_tried):
            path.write_bytes(damaged(data, chance))
            try:
                parquet.write_checksum(path)
            except RecordingError:
                continue
            result.timed(lambda: bool(load_recording(path)), RecordingError)
    return result


def attack_headers(n_tried: int, suffix: str) -> CpuResult:
    """Read files whose header is a valid JSON document with one odd value."""
    result = CpuResult(f"recording, {suffix}: headers that lie")
    chance, recording = Random(2), make_recording()
    module = parquet if suffix == ".parquet" else mcap_writer
    header: list[object] = []

    def encode(given: object) -> bytes:
        header[:] = [msgspec.json.decode(encode_header(given))]  # type: ignore[arg-type]
        return encoded(lying(header[0], chance))

    with TemporaryDirectory() as folder, _replaced(module, "encode_header", encode):
        path = Path(folder) / f"can{suffix}"
        for _ in range(n_tried):
            save_recording(recording, path, force=True)
            result.timed(lambda: bool(load_recording(path)), RecordingError)
            _must_not_raise(result, lambda: sum(1 for _ in read_chunks(path, 16)))
    return result


def attack_kills(n_tried: int) -> CpuResult:
    """Kill a process while it records; nothing older than half a second may be lost."""
    result = CpuResult("recorder: kills")
    chance, worst = Random(3), 0.0
    for _ in range(n_tried):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "can.mcap"
            newest = _killed_recorder(path, chance.uniform(0.2, 1.2))
            try:
                found = load_recording(path)
            except RecordingError as refusal:
                result.n_refused += 1
                result.n_wrong += newest > MAX_LOSS or "cut so early" not in str(refusal)
            else:
                module = found.modules["thumb"]
                expected = np.arange(module.n_samples)
                lost = newest - float(module.times[-1])
                worst = max(worst, lost)
                result.n_accepted += 1
                result.n_wrong += lost > MAX_LOSS or bool(
                    (module.readings[:, 0, 0] != expected).any()
                )
            result.n_tried += 1
    result.note = f"at most {worst:.2f} s lost"
    return result


def _killed_recorder(path: Path, seconds: float) -> float:
    """Record in a process that is killed; return the time of the newest sample [s]."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        _record_forever(path, write)
    os.close(write)
    os.read(read, 8)  # the file exists
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    n_bytes = 0
    while part := os.read(read, 1 << 16):
        n_bytes += len(part)
    os.close(read)
    return n_bytes / KILL_RATE


def _record_forever(path: Path, pipe: int) -> None:
    recorder = Recorder(path, {"thumb": sensor("anyskin")})
    os.write(pipe, b"\x00" * 8)
    begin, k = time.monotonic(), 0
    while True:
        while k / KILL_RATE > time.monotonic() - begin:
            time.sleep(1e-3)
        readings = {"thumb": np.full((5, 3), k, np.uint16)}
        recorder.put(Arrival(k / KILL_RATE, readings, received=time.monotonic()))
        os.write(pipe, b"\x00")
        k += 1


def _is_beginning(got: Recording, want: Recording) -> bool:
    if got.complete:
        return got.digest == want.digest and got.name == want.name
    return all(
        np.array_equal(module.times, want.modules[name].times[: module.n_samples])
        and np.array_equal(module.readings, want.modules[name].readings[: module.n_samples])
        for name, module in got.modules.items()
    )


def _must_not_raise(result: CpuResult, work: Callable[[], object]) -> None:
    """Count an error that is no `RecordingError`; the input itself is counted already."""
    try:
        work()
    except RecordingError:
        return
    except Exception as error:
        result.n_foreign += 1
        result.note = result.note or f"{type(error).__name__}: {error}"[:120]


@contextmanager
def _replaced(module: object, name: str, function: object) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, function)
    try:
        yield
    finally:
        setattr(module, name, before)


DAMAGES: dict[str, Damage] = {
    "flipped bits": flipped,
    "any damage": damaged,
    "cut": cut,
    "cut, then damaged": lambda data, chance: damaged(cut(data, chance), chance),
}
"""Kinds of damage to a file."""
