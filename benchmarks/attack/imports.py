"""Attacks on the import of other formats: damaged CSV, arrays, bags of ROS and LeRobot."""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import numpy as np

from attack.mutations import cut, damaged
from attack.result import CpuResult
from holdfast.errors import RecordingError
from holdfast.io import import_recordings
from holdfast.io.cdr import MessageEncoder
from holdfast.io.definitions import parse_definition
from holdfast.io.foreign import read_stickers
from holdfast.sensors import sensor
from holdfast_ros.sensor_messages import SENS_STREAM

KIND = "xela_server_ros2/msg/SensStream"


def attack_imports(n_tried: int) -> Iterator[CpuResult]:
    """Import damaged files of each format; those without their package are left out.

    The files are read by a child process, whose time of the processor is not counted here.
    """
    for name, make in (
        ("csv", _csv), ("gtac", _gtac), ("eflesh", _eflesh), ("arq-crisp", _hdf5),
        ("rosbag", _db3), ("rosbag", _bag),
        ("lerobot", _lerobot_data), ("lerobot", _lerobot_episodes),
        ("arrays", _npz), ("arrays", _mat), ("arrays", _parquet), ("arrays", _lines),
    ):  # fmt: skip
        with TemporaryDirectory() as folder:
            try:
                original = make(Path(folder))
            except ImportError:
                continue
            data_set = Path(folder) / "set"
            whole = data_set if data_set.is_dir() else original.with_stem("damaged")
            yield _attack(name, original, whole, n_tried)


def attack_videos(n_tried: int) -> CpuResult:
    """Look for stickers in damaged copies of a film."""
    import cv2

    result, chance = CpuResult("videos, .mp4"), Random(7)
    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    sticker = np.pad(cv2.aruco.generateImageMarker(book, 0, 48), 16, constant_values=255)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        film = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (160, 120))
        for k in range(12):
            grey = np.full((120, 160), 120, np.uint8)
            grey[20:100, 20 + k : 100 + k] = sticker
            film.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
        film.release()
        data = path.read_bytes()
        for k in range(n_tried):
            path.write_bytes(damaged(data, chance) if k % 4 else cut(data, chance))
            result.timed(lambda: bool(read_stickers(path)[2]), RecordingError)
    return result


def _attack(name: str, original: Path, whole: Path, n_tried: int) -> CpuResult:
    """Import damaged copies of a file; `whole` is the copy, or the folder with the file."""
    of_folder = f" {original.parent.parent.name}" if whole.is_dir() else ""
    result = CpuResult(f"import {name}{of_folder}, {original.suffix}")
    chance, data = Random(7), original.read_bytes()
    sensors = {"*": sensor("anyskin")} if name == "arrays" else None
    undamaged = whole if whole.is_dir() else original
    if not list(import_recordings(undamaged, name, sensors=sensors)):
        raise ValueError(f"{name}: the undamaged file has no recording")
    path = original if whole.is_dir() else whole
    for k in range(n_tried):
        path.write_bytes(damaged(data, chance) if k % 4 else cut(data, chance))
        result.timed(
            lambda: bool(list(import_recordings(whole, name, sensors=sensors))), RecordingError
        )
    return result


def _csv(folder: Path) -> Path:
    names = [f"t{taxel:02d}_{axis}" for taxel in range(1, 6) for axis in "xyz"]
    rows = [f"{k / 100},{','.join(str(k + j) for j in range(15))},stable" for k in range(20)]
    path = folder / "a.csv"
    path.write_text(f"# sensor: anyskin\ntime,{','.join(names)},label\n" + "\n".join(rows))
    return path


def _gtac(folder: Path) -> Path:
    names = [f"mag_{axis}{node + 1}" for node in range(15) for axis in "xyz"]
    rows = [",".join(str(k + j) for j in range(46)) for k in range(10)]
    path = folder / "g.csv"
    path.write_text(f"{','.join(names)},milliseconds\n" + "\n".join(rows))
    return path


def _eflesh(folder: Path) -> Path:
    path = folder / "seq_1.pt"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("seq_1/data.pkl", b"torch\nFloatStorage\n.")
        archive.writestr("seq_1/byteorder", b"little")
        archive.writestr("seq_1/data/0", np.arange(240, dtype="<f4").tobytes())
    return path


def _hdf5(folder: Path) -> Path:
    import h5py

    path = folder / "a.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("planner/can/Pose1/Exp1")
        group["tactile_data_raw"] = np.arange(18.0 * 3 * 8).reshape(18, 3, 8)
        group["tactile_timestamps"] = 5.5 * np.arange(8)
        group["tactile_slips_label"] = np.array([0, 3, 4, 5, 4, 2, 0, 0])
    return path


def _skin() -> dict[str, np.ndarray]:
    return {"t": np.arange(8) / 100, "tactile": np.arange(8.0 * 15).reshape(8, 5, 3)}


def _npz(folder: Path) -> Path:
    np.savez(folder / "a.npz", **_skin())
    return folder / "a.npz"


def _mat(folder: Path) -> Path:
    from scipy.io import savemat

    savemat(folder / "a.mat", _skin())
    return folder / "a.mat"


def _parquet(folder: Path) -> Path:
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = {name: values.tolist() for name, values in _skin().items()}
    pq.write_table(pa.table(columns), folder / "a.parquet")
    return folder / "a.parquet"


def _lines(folder: Path) -> Path:
    rows = zip(*(values.tolist() for values in _skin().values()), strict=True)
    lines = [json.dumps({"t": time, "tactile": sample}) for time, sample in rows]
    (folder / "a.jsonl").write_text("\n".join(lines))
    return folder / "a.jsonl"


def _lerobot(folder: Path) -> Path:
    from attack.recordings import make_recording
    from holdfast_interop.lerobot.exporter import export

    export([make_recording()], folder / "set")
    return folder / "set"


def _lerobot_data(folder: Path) -> Path:
    return _lerobot(folder) / "data/chunk-000/file-000.parquet"


def _lerobot_episodes(folder: Path) -> Path:
    return _lerobot(folder) / "meta/episodes/chunk-000/file-000.parquet"


def _messages() -> list[bytes]:
    definition = parse_definition(KIND, _definition())
    encode = MessageEncoder(definition)
    taxel = {"x": 30000, "y": 30000, "z": 30000}
    return [
        encode({"sensors": [{
            "message": k, "time": 100.0 + k / 100, "model": "XR1944", "sensor_pos": 1,
            "taxels": [taxel] * 16, "forces": [],
        }]})
        for k in range(8)
    ]  # fmt: skip


def _definition() -> str:
    return SENS_STREAM.replace("xela_server_ros/", "xela_server_ros2/")


def _db3(folder: Path) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/x", KIND, msgdef=_definition(), rihs01=f"RIHS01_{0:064x}")
        for k, data in enumerate(_messages()):
            writer.write(topic, 10**9 + k * 10**7, data)
    return next((folder / "bag").glob("*.db3"))


def _bag(folder: Path) -> Path:
    from rosbags.rosbag1 import Writer

    path = folder / "a.bag"
    with Writer(path) as writer:
        topic = writer.add_connection(
            "/x", KIND, msgdef=_definition(), md5sum="0123456789abcdef0123456789abcdef"
        )
        for k, data in enumerate(_messages()):
            writer.write(topic, 10**9 + k * 10**7, data[4:])
    return path
