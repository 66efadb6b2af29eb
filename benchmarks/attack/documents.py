"""Attacks on documents: models, labels, sensors, tables of objects, definitions of messages."""

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

from attack.mutations import damaged, encoded, flipped, lying
from attack.recordings import make_recording
from attack.result import CpuResult
from holdfast.errors import ModelError, RecordingError
from holdfast.io import labels_from_csv, labels_to_csv, load_labels, save_labels
from holdfast.io.cdr import MessageDecoder
from holdfast.io.definitions import field_paths, parse_definition
from holdfast.model import Model
from holdfast.sensors import Sensor, sensor
from holdfast.twin.objects import BUILT_IN_OBJECTS, load_objects
from holdfast_ros.sensor_messages import SENS_STREAM

Read = Callable[[Path], object]
Refusals = tuple[type[BaseException], ...]

URDF = """<robot name="finger"><link name="tip"/>
<joint name="a"><origin xyz="0 0 0.1" rpy="0 0 1"/><parent link="palm"/><child link="tip"/></joint>
<joint name="taxel_1"><origin xyz="0 0.2 0"/><parent link="tip"/><child link="t1"/></joint>
<joint name="taxel_2"><parent link="tip"/><child link="t2"/></joint></robot>"""


def attack_document(
    name: str, data: bytes, read: Read, refusals: Refusals, n_tried: int, *, is_json: bool = True
) -> CpuResult:
    """Read a document with damaged bytes and, if it is JSON, with odd values.

    Args:
        name: what it is.
        data: a valid document.
        read: reads a file.
        refusals: documented errors.
        n_tried: number of documents.
        is_json: whether every second document gets an odd value in place of damaged bytes.
    """
    result = CpuResult(name)
    chance = Random(4)
    document = json.loads(data) if is_json else None
    with TemporaryDirectory() as folder:
        path = Path(folder) / "document"
        path.write_bytes(data)
        read(path)  # imports
        for k in range(n_tried):
            odd = is_json and k % 2
            path.write_bytes(encoded(lying(document, chance)) if odd else damaged(data, chance))
            result.timed(lambda: read(path) is not None, *refusals)
    return result


def attack_models(n_tried: int) -> CpuResult:
    """Load damaged and lying model files."""
    with TemporaryDirectory() as folder:
        Model.load("builtin:any").save(Path(folder) / "m.json")
        data = (Path(folder) / "m.json").read_bytes()
    return attack_document("model files", data, Model.load, (ModelError,), n_tried)


def attack_labels(n_tried: int) -> CpuResult:
    """Load label files that lie, and without a digest."""
    document = json.loads(_label_file())
    del document["digest"]
    return attack_document(
        "label files without a digest", encoded(document), load_labels, (RecordingError,), n_tried
    )


def attack_label_bits(n_tried: int) -> CpuResult:
    """Load label files with one flipped bit; no label may change."""
    result = CpuResult("label files: flipped bits")
    chance, data = Random(5), _label_file()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "can.labels.json"
        path.write_bytes(data)
        want = load_labels(path).modules
        found: list[object] = []

        def read() -> bool:
            found.append(load_labels(path).modules)
            return True

        for _ in range(n_tried):
            path.write_bytes(flipped(data, chance))
            found.clear()
            result.timed(read, RecordingError)
            result.n_wrong += any(one != want for one in found)
    return result


def attack_others(n_tried: int) -> list[CpuResult]:
    """Read sensors, URDF files, tables of objects and CSV files of labels."""
    labels = {name: one.labels for name, one in make_recording().modules.items()}
    refused = (ValueError, OSError)
    plain = json.dumps(sensor("anyskin").to_dict()).encode()
    table = BUILT_IN_OBJECTS.read_bytes()
    csv = labels_to_csv(labels).encode()
    return [
        attack_document("sensors, JSON", plain, Sensor.from_json, refused, n_tried),
        attack_document("sensors, URDF", URDF.encode(), _urdf, refused, n_tried, is_json=False),
        attack_document("objects, TOML", table, load_objects, refused, n_tried, is_json=False),
        attack_document(
            "labels, CSV", csv, labels_from_csv, (RecordingError,), n_tried, is_json=False
        ),
    ]


def attack_definitions(n_tried: int) -> CpuResult:
    """Parse damaged definitions of messages, and decode random bytes by those that are valid."""
    result = CpuResult("ROS definitions, and messages by them")
    chance = Random(6)
    text = SENS_STREAM.encode()

    def parse() -> bool:
        definition = parse_definition("xela_server_ros/SensStream", damaged(text, chance).decode())
        field_paths(definition)
        decode = MessageDecoder(definition, ros2=bool(chance.randrange(2)))
        with suppress(ValueError):  # most random bytes are no message
            decode(chance.randbytes(200))
        return True

    for _ in range(n_tried):
        result.timed(parse, ValueError)
    return result


def _label_file() -> bytes:
    with TemporaryDirectory() as folder:
        return save_labels(make_recording(), Path(folder) / "can.parquet", author="a").read_bytes()


def _urdf(path: Path) -> Sensor:
    return Sensor.from_urdf(path, "tip")
