"""Packets that are damaged at random, for the decoders of XELA, ROS and serial boards."""

import json
import random
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from attack.result import Result
from holdfast.contact import ContactState
from holdfast.devices.sources import Source
from holdfast.devices.sources.anyskin import AnySkinDecoder
from holdfast.devices.sources.xela.decoder import XelaDecoder
from holdfast.devices.sources.xela.encoder import XelaEncoder
from holdfast.io.cdr import MessageDecoder, MessageEncoder
from holdfast.live.stream_detector import StreamDetector
from holdfast.model import Model
from holdfast.recordings import Recording
from holdfast.sensors import hand, sensor
from holdfast.synthetic import synthetic_recording
from holdfast_ros.sensor_messages import SampleDecoder, known_definition
from holdfast_ros.sources.message_assembler import MessageAssembler

EPOCH = 1.7e9
JSON_PARTS = (
    b"null", b"NaN", b"-Infinity", b"1e308", b"-1", b"1e999", b"18446744073709551616", b'""', b"[]",
    b"{}", b"true", b"[" * 3000, b'"\\ud800"', b'"\xff"', b"0x1", b"\x00", b'{"a":' * 2000,
)  # fmt: skip
"""Values that a damaged packet may contain."""


def damaged(data: bytes, dice: random.Random, parts: tuple[bytes, ...] = ()) -> bytes:
    """Return bytes with one to four faults: flips, cuts, repeats, insertions, other values."""
    for _ in range(dice.randint(1, 4)):
        if not data:
            return data
        kind, at = dice.randrange(6 if parts else 5), dice.randrange(len(data))
        upto = min(len(data), at + dice.randrange(1, 40))
        if kind == 0:
            data = data[:at] + bytes((data[at] ^ 1 << dice.randrange(8),)) + data[at + 1 :]
        elif kind == 1:
            data = data[:at] + data[upto:]
        elif kind == 2:
            data = data[:at] + data[at:upto] * dice.choice((2, 2, 50)) + data[upto:]
        elif kind == 3:
            data = data[:at] + dice.randbytes(dice.randrange(1, 9)) + data[at:]
        elif kind == 4:
            data = data[:at]
        else:  # another value after a colon
            colon = data.find(b":", at)
            end = min((k for k in (data.find(c, colon) for c in (b",", b"}")) if k > 0), default=-1)
            if 0 < colon < end:
                data = data[: colon + 1] + dice.choice(parts) + data[end:]
    return data


def attack_xela(n: int, version: str, *, whole: bool = False, seed: int = 0) -> Result:
    """Damage packets of XELA's server; compare what is accepted with an independent reader."""
    result = Result(f"XELA {version}{', whole hand' if whole else ''}: packets")
    dice, numbers = random.Random(seed), np.random.default_rng(seed)
    kinds = (
        {name: one.sensor for name, one in hand("allegro-uskin").modules.items()}
        if whole
        else {"a": sensor("uskin-4x4"), "b": sensor("uskin-curved")}
    )
    encoder = XelaEncoder(kinds, version=version)
    decoder, original = XelaDecoder(), b""
    for k in range(n):
        if k % 2 == 0:  # a new packet to damage, and a new server now and then
            shapes = {name: (one.n_taxels, 3) for name, one in kinds.items()}
            samples = {m: numbers.integers(0, 65536, s, np.uint16) for m, s in shapes.items()}
            original = encoder.packet(samples, EPOCH + k / 150, EPOCH + k / 150)
            if k % 5000 == 0:
                decoder = XelaDecoder()
                decoder.identify(original)
        packet = damaged(original, dice, JSON_PARTS)
        result.timed(lambda d=decoder, p=packet, at=k: _check_xela(d, p, at / 150, result))
    return result


def _check_xela(decoder: XelaDecoder, packet: bytes, received: float, result: Result) -> bool:
    found: dict[str, list[list[int]]] = {}
    for arrival in decoder.decode(packet, received):
        found |= {name: sample.tolist() for name, sample in arrival.samples.items()}
    if found and len(found) <= 2 and found != {n: _xela_reading(packet, n) for n in found}:
        result.n_wrong += 1
    return bool(found)


def _xela_reading(packet: bytes, module: str) -> list[list[int]] | None:
    """Return the readings of a module of separate sensors, read with Python's JSON only."""
    text = packet.decode("utf-8", "replace")
    one = json.loads(text)[module.removeprefix("finger")]
    values = [int(v, 16) for v in one["data"].split(",")] if one.get("data") else one["integer"]
    return [values[k : k + 3] for k in range(0, len(values), 3)]


def sens_stream(k: int, dice: random.Random) -> dict[str, object]:
    """Return a message of XELA's ROS node as fields, with two sensors."""
    return {
        "sensors": [
            {
                "message": k, "time": EPOCH + k / 150, "model": "uSPa44", "sensor_pos": number,
                "taxels": [dict.fromkeys("xyz", dice.randrange(65536)) for _ in range(16)],
                "forces": [],
            }
            for number in (1, 2)
        ]
    }  # fmt: skip


def attack_cdr(n: int, seed: int = 0) -> Result:
    """Damage CDR messages; what is accepted must give the same fields when encoded again."""
    result = Result("ROS 2 CDR: messages")
    dice = random.Random(seed)
    definition = known_definition("xela_server_ros2/SensStream", ros2=True)
    if definition is None:
        raise RuntimeError("the definition of SensStream is missing")
    encode, decode = MessageEncoder(definition), MessageDecoder(definition, ros2=True)
    samples = SampleDecoder(definition, ros2=True)
    assembler, original = MessageAssembler(), b""

    def check(data: bytes, received: float) -> bool:
        found = samples(data)
        assembler.assemble(found, received)
        fields = decode(data)
        result.n_wrong += repr(decode(encode(_as_points(fields)))) != repr(fields)
        return True

    for k in range(n):
        if k % 50 == 0:
            original = encode(sens_stream(k, dice))
            if k % 5000 == 0:
                assembler = MessageAssembler()
                assembler.identify(samples(original))
        data = damaged(original, dice)
        result.timed(lambda d=data, at=k: check(d, at / 150), ValueError)
    return result


def _as_points(fields: dict[str, Any]) -> dict[str, Any]:
    """Return decoded fields with dictionaries instead of arrays of points."""
    points = ("taxels", "forces")
    return {
        "sensors": [
            one
            | {name: [dict(zip("xyz", row, strict=True)) for row in one[name]] for name in points}
            for one in fields["sensors"]
        ]
    }


def attack_serial(n: int, *, text: bool, seed: int = 0) -> Result:
    """Damage the bytes of a serial board, in pieces of any size; all readings stay plausible."""
    result = Result(f"serial, {'text' if text else 'binary'}: pieces of bytes")
    dice = random.Random(seed)
    decoder = AnySkinDecoder(5)

    def check(data: bytes) -> bool:
        found = decoder.feed(data).samples
        result.n_wrong += sum(not (np.abs(one) <= 1e6).all() for one in found)
        return bool(found)

    for k, data in enumerate(_pieces(n, dice, text=text)):
        if k % 10_000 == 0:
            decoder.reset()
        result.timed(lambda d=data: check(d))
    return result


def _pieces(n: int, dice: random.Random, *, text: bool) -> Iterator[bytes]:
    for _ in range(n):
        values = np.array([[20.0, *(dice.uniform(-2000, 2000) for _ in "xyz")] for _ in range(5)])
        packet = values.astype("<f4").tobytes() + b"\r\n"
        if text:
            numbers = np.roll(values, -1, axis=1).ravel()
            packet = b"\t".join(f"{v:.2f}".encode() for v in numbers) + b"\r\n"
        broken = damaged(packet, dice) if dice.random() < 0.5 else packet
        yield broken[: dice.randrange(len(broken) + 1)] if dice.random() < 0.2 else broken


Clock = Callable[[float], tuple[float, float] | None]
CLOCKS: dict[str, Clock] = {
    "1.5 times fast": lambda t: (EPOCH + 1.5 * t, t),
    "half as fast": lambda t: (EPOCH + 0.5 * t, t),
    "steadily backwards": lambda t: (EPOCH - t, t),
    "stands still": lambda t: (EPOCH, t),
    "jumps each packet": lambda t: (EPOCH + 60 * (round(150 * t) % 2), t),
    "a third of the rate after 2 s": lambda t: None if t > 2 and round(150 * t) % 3 else (t, t),
}
"""Stamp and arrival of a packet that is due at a time [s]; None drops it."""


def attack_clocks() -> list[Result]:
    """Count STABLE in the estimates of a held grasp, a second after a clock goes wrong."""
    grasp = synthetic_recording("grasp", 1, ("thumb", "index", "middle"))
    versions = ("1.7", "1.8")
    return [_attack_clock(*pair, one, grasp) for one in versions for pair in CLOCKS.items()]


class Decoded(Source):
    """Device whose packets are decoded by hand."""

    is_device = True

    def __init__(self, decoder: XelaDecoder) -> None:
        self.sensors = decoder.sensors

    def open(self) -> None:
        """Open nothing."""

    def read(self, timeout: float) -> None:
        """Read nothing."""

    def close(self) -> None:
        """Close nothing."""


def _attack_clock(name: str, clock: Clock, version: str, recording: Recording) -> Result:
    result = Result(f"clock, XELA {version}: {name}")
    sensors = {name: module.sensor for name, module in recording.modules.items()}
    encoder = XelaEncoder(sensors, version=version)
    modules, decoder = list(recording.modules.values()), XelaDecoder()
    detector: StreamDetector | None = None
    for k in range(modules[0].n_samples):
        t = k / 150
        pair = clock(t)
        if pair is None:
            continue
        samples = {m: one.readings[k] for m, one in recording.modules.items()}
        packet = encoder.packet(samples, pair[0], pair[0])
        if detector is None:
            decoder.identify(packet)
            names = dict(zip(decoder.sensors, ("thumb", "index", "middle"), strict=True))
            decoder = XelaDecoder({int(n.removeprefix("finger")): m for n, m in names.items()})
            decoder.identify(packet)
            detector = StreamDetector(Model.load("builtin:twin"), Decoded(decoder))
        for arrival in decoder.decode(packet, 50.0 + pair[1]):
            for one in detector.update(arrival).estimates:
                result.n_tried += 1
                stable = one.estimate.state is ContactState.STABLE
                result.n_wrong += stable and t > 3.0
                result.n_refused += one.estimate.state is ContactState.UNKNOWN
    return result
