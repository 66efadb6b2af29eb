"""Small files that cost much memory or time: each is read in a process with limits of its own.

A file is of some kilobytes, or a sparse one of 10 TB. It must be refused with one line and the
exit code 2, or be read, within `MAX_MEMORY` and `MAX_SECONDS`.
"""

import bz2
import os
import resource
import sqlite3
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import zstandard

from attack import imports
from attack.result import CpuResult
from holdfast.io.importers.csv_columns import Columns  # noqa: F401 (imported before the fork)

MAX_MEMORY = 3 << 30
"""Address space of the process that reads a file [bytes]."""
MAX_RESIDENT = 3 << 29
"""Memory that the process may use, with that of the program and of copies [bytes]."""
MAX_SECONDS = 30
"""Time of the processor that a file may take, 20 times what was measured [s]."""
HUGE = 10 * 10**12
"""Length of a sparse file [bytes]."""
CHUNK = 200 << 20
"""Number of bytes that a chunk becomes when it is unpacked."""
MAGIC = b"\x89MCAP0\r\n"
KIND = imports.KIND

Make = Callable[[Path], Path]
_ZSTD = zstandard.ZstdCompressor(level=3)


def attack_expansions(names: list[str] | None = None) -> Iterator[CpuResult]:
    """Read each file in a process of its own; those without their package are left out."""
    for name, (make, verb) in FILES.items():
        if names is None or name in names:
            with TemporaryDirectory() as folder:
                try:
                    path = make(Path(folder))
                except ImportError:
                    continue
                yield _attack(name, path, verb, Path(folder))


def _attack(name: str, path: Path, verb: str, folder: Path) -> CpuResult:
    words = [verb, str(path)]
    if verb.startswith("import"):
        words = ["import", str(path), str(folder / "out"), *verb.split()[1:]]
    code, text, memory, seconds = _limited(words, folder / "printed")
    result = CpuResult(f"expansion: {name}", n_tried=1, worst=seconds, limit=MAX_SECONDS)
    result.n_accepted, result.n_refused = int(code == 0), int(code == 2)
    is_one_line = text.startswith("holdfast: ") and text.count("\n") == 1
    result.n_foreign = int(code not in (0, 2) or (code == 2 and not is_one_line))
    result.n_wrong = int(memory > MAX_RESIDENT or "does not fit into memory" in text)
    result.n_slow = int(seconds > MAX_SECONDS)
    result.note = f"{memory / 1e6:.0f} MB; exit code {code}: {' '.join(text.split())[-200:]}"
    return result


def _limited(words: list[str], printed: Path) -> tuple[int, str, int, float]:
    """Run a command in a process with limits.

    Returns:
        Its exit code, its errors, its memory [bytes] and its time of the processor [s].
    """
    child = os.fork()
    if child == 0:
        _run(words, printed)
    _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    text = printed.read_text(errors="replace") if printed.exists() else ""
    return code, text, 1024 * usage.ru_maxrss, usage.ru_utime + usage.ru_stime


def _run(words: list[str], printed: Path) -> None:
    from holdfast.cli import main

    code = 70
    with suppress(BaseException):
        file = os.open(printed, os.O_CREAT | os.O_WRONLY)
        os.dup2(file, 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS + 5, MAX_SECONDS + 10))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        code = main(words)
        sys.stderr.flush()
    os._exit(code)


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(text: bytes) -> bytes:
    return struct.pack("<I", len(text)) + text


def _chunk(data: bytes) -> bytes:
    packed = _ZSTD.compress(data)
    head = struct.pack("<QQQI", 0, 0, len(data), zlib.crc32(data))
    return _record(0x06, head + _text(b"zstd") + struct.pack("<Q", len(packed)) + packed)


def _schema(number: int, name: bytes, text: bytes, encoding: bytes = b"ros2msg") -> bytes:
    return _record(0x03, struct.pack("<H", number) + _text(name) + _text(encoding) + _text(text))


def _channel(number: int, topic: bytes) -> bytes:
    return _record(0x04, struct.pack("<HH", number, 1) + _text(topic) + _text(b"cdr") + _text(b""))


def _mcap(path: Path, chunks: Iterator[bytes], profile: bytes, library: bytes) -> Path:
    """Write an MCAP file with a valid end and without a summary."""
    with path.open("wb") as file:
        file.write(MAGIC + _record(0x01, _text(profile) + _text(library)))
        for chunk in chunks:
            file.write(chunk)
        file.flush()
        crc = zlib.crc32(path.read_bytes())
        file.write(_record(0x0F, struct.pack("<I", crc)))
        start = file.tell()
        footer = struct.pack("<BQQQ", 0x02, 20, start, 0)
        file.write(footer + struct.pack("<I", zlib.crc32(footer)) + MAGIC)
    return path


def _recording(folder: Path, chunks: Iterator[bytes]) -> Path:
    from holdfast.io.mcap_writer import LIBRARY

    return _mcap(folder / "a.mcap", chunks, b"", LIBRARY.encode())


def _bag(folder: Path, chunks: Iterator[bytes]) -> Path:
    return _mcap(folder / "a.mcap", chunks, b"ros2", b"attack")


def _schemas(folder: Path) -> Path:
    """Make a recording with a long name in each of many schemas."""
    return _recording(folder, (_chunk(_schema(k, bytes(CHUNK), b"")) for k in range(8)))


def _empty_records(folder: Path) -> Path:
    """Make a recording with 23 million records without content."""
    return _recording(folder, iter([_chunk(bytes(CHUNK))]))


def _header(folder: Path) -> Path:
    """Make a recording whose header is a list of empty lists."""
    from holdfast.io.mcap_messages import TEXT_TYPE, encode_text
    from holdfast.io.mcap_writer import HEADER_TOPIC

    text = '{"metadata":{"a":[' + "[]," * (CHUNK // 3) + "[]]}}"
    message = struct.pack("<HIQQ", 1, 0, 0, 0) + encode_text(0.0, text)
    records = _schema(1, TEXT_TYPE.encode(), b"") + _channel(1, HEADER_TOPIC.encode())
    return _recording(folder, iter([_chunk(records + _record(0x05, message))]))


def _sparse(name: str, head: bytes = b"") -> Make:
    """Return a function that makes a sparse file with these first bytes."""

    def make(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(head)
        os.truncate(path, HUGE)
        return path

    return make


def _bag_records(folder: Path) -> Path:
    return _bag(folder, iter([_chunk(bytes(CHUNK))]))


def _bag_messages(folder: Path) -> Path:
    """Make a bag with large messages of one time, which must be sorted."""
    records = _schema(1, KIND.encode(), imports._definition().encode()) + _channel(1, b"/x")
    message = _record(0x05, struct.pack("<HIQQ", 1, 0, 0, 0) + bytes(4 << 20))
    chunk = _chunk(message * (CHUNK >> 22))
    return _bag(folder, iter([_chunk(records), *([chunk] * 40)]))


def _bag_topics(folder: Path) -> Path:
    """Make a bag with a long definition and many topics that use it."""
    text = "\n".join(f"float64 field_{k}" for k in range(3000)).encode()
    topics = b"".join(_channel(k, b"/t%d" % k) for k in range(60_000))
    return _bag(folder, iter([_chunk(_schema(1, b"p/A", text) + topics)]))


def _database(folder: Path, *statements: str) -> Path:
    path = folder / "a.db3"
    base = sqlite3.connect(path)
    base.executescript(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, "
        "serialization_format TEXT, offered_qos_profiles TEXT);"
        f"INSERT INTO topics VALUES (1, '/x', '{KIND}', 'cdr', '');"
    )
    for statement in statements:
        base.executescript(statement)
    base.commit()
    base.close()
    return path


_FILL = (
    "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < 1000) "
    "INSERT INTO {0} SELECT k, 1, k FROM n;"
)


def _generated(folder: Path) -> Path:
    return _database(
        folder,
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB AS (zeroblob(500000000)));",
        _FILL.format("messages"),
    )


def _view(folder: Path) -> Path:
    """Make a bag whose messages are a table with a name in other letters, and a view."""
    path = _database(
        folder,
        "CREATE TABLE rows(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER);",
        _FILL.format("rows"),
        "CREATE TABLE messages(id, topic_id, timestamp, data);",
        "CREATE VIEW v AS SELECT * FROM rows a, rows b, rows c, rows d;",
    )
    base = sqlite3.connect(path)
    base.execute("PRAGMA writable_schema = ON")
    base.execute("DELETE FROM sqlite_master WHERE name = 'messages'")
    base.execute(
        "UPDATE sqlite_master SET type = 'view', name = 'messages', tbl_name = 'messages', "
        "sql = 'CREATE VIEW messages AS SELECT a.id, 1 topic_id, a.timestamp, zeroblob(500000000) "
        "data FROM rows a, rows b, rows c, rows d' WHERE name = 'v'"
    )
    base.commit()
    base.close()
    return path


def _shared_pages(folder: Path) -> Path:
    """Make a bag whose messages are a tree of pages that all point to the same page."""
    path = _database(
        folder,
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB);",
        "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n WHERE k < 3000) "
        "INSERT INTO messages SELECT k, 1, k, zeroblob(300) FROM n;",
    )
    base = sqlite3.connect(path)
    (root,) = base.execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    base.close()
    data, size = bytearray(path.read_bytes()), 4096
    first = (root - 1) * size
    if data[first] != 5:
        raise ValueError("the messages do not have several pages")
    n_cells = int.from_bytes(data[first + 3 : first + 5], "big")
    places = [
        first + int.from_bytes(data[first + 12 + 2 * k : first + 14 + 2 * k], "big")
        for k in range(n_cells)
    ]
    leaf = data[places[0] : places[0] + 4]
    n_pages = len(data) // size
    for level in range(6):  # copies of the root, each of which points to the next
        page = bytearray(data[first : first + size])
        target = leaf if level == 5 else (n_pages + level + 2).to_bytes(4, "big")
        page[8:12] = target
        for place in places:
            page[place - first : place - first + 4] = target
        data += page
    for place in [first + 8, *places]:
        data[place : place + 4] = (n_pages + 1).to_bytes(4, "big")
    data[28:32] = (len(data) // size).to_bytes(4, "big")
    path.write_bytes(data)
    return path


def _packed_messages(folder: Path) -> Path:
    """Make a bag with messages that are packed one by one."""
    return _folder(folder, "message", zstandard.compress(bytes(1 << 30)))


def _packed_file(folder: Path) -> Path:
    """Make a bag whose file is packed."""
    path = _folder(folder, "file", b"")
    (file,) = path.glob("*.db3")
    packed = file.with_suffix(".db3.zstd")
    with packed.open("wb") as target, _ZSTD.stream_writer(target) as stream:
        stream.write(file.read_bytes())
        for _ in range(40):
            stream.write(bytes(CHUNK))
    file.unlink()
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text(text.replace(file.name, packed.name))
    return path


def _yaml(folder: Path) -> Path:
    """Make a bag whose metadata repeat their parts."""
    path = _folder(folder, "message", b"")
    names = "abcdefghi"
    lines = ["a: &a {x: 1}"]
    for before, name in pairwise(names):
        lines.append(f"{name}: &{name} {{<<: [{', '.join([f'*{before}'] * 10)}]}}")
    text = (path / "metadata.yaml").read_text()
    (path / "metadata.yaml").write_text("\n".join(lines) + "\n" + text)
    return path


def _folder(folder: Path, mode: str, data: bytes) -> Path:
    """Make a bag in a folder with one message."""
    path = imports._db3(folder).parent
    (file,) = path.glob("*.db3")
    base = sqlite3.connect(file)
    base.execute("UPDATE messages SET data = ?", (data,))
    base.commit()
    base.close()
    text = (path / "metadata.yaml").read_text()
    lines = [line for line in text.splitlines() if "compression" not in line]
    lines += ["  compression_format: zstd", f"  compression_mode: {mode}"]
    (path / "metadata.yaml").write_text("\n".join(lines) + "\n")
    return path


def _ros1_record(data: bytes, **fields: bytes) -> bytes:
    head = b"".join(_text(name.encode() + b"=" + value) for name, value in fields.items())
    return _text(head) + _text(data)


def _number(value: int) -> bytes:
    return struct.pack("<I", value)


def _ros1(
    folder: Path, chunks: list[bytes], kind: bytes, entries: list[int], n_infos: int = 1
) -> Path:
    """Make a bag of ROS 1.

    Args:
        folder: for the file.
        chunks: packed bytes of each chunk.
        kind: compression of the chunks.
        entries: place of each message in a chunk; its number is its time [s], and its chunk is
            given by its number.
        n_infos: how often the index names each chunk.
    """
    names = {"topic": b"/x", "conn": _number(0)}
    text = imports._definition().encode()
    inner = {"topic": b"/x", "type": KIND.encode(), "md5sum": b"0", "message_definition": text}
    head = b"".join(_text(name.encode() + b"=" + value) for name, value in inner.items())
    connection = _ros1_record(head, op=b"\x07", **names)
    body, infos = bytearray(b"#ROSBAG V2.0\n" + bytes(4096 + 8)), bytearray()
    for k, chunk in enumerate(chunks):
        own = [(time, place) for time, place in enumerate(entries) if time % len(chunks) == k]
        index = b"".join(struct.pack("<III", time, 0, place) for time, place in own)
        info = {"ver": _number(1), "chunk_pos": struct.pack("<Q", len(body))}
        info |= {"start_time": bytes(8), "end_time": bytes(8), "count": _number(1)}
        infos += _ros1_record(_number(0) + _number(len(own)), op=b"\x06", **info) * n_infos
        body += _ros1_record(chunk, op=b"\x05", compression=kind, size=_number(CHUNK))
        body += _ros1_record(
            index, op=b"\x04", ver=_number(1), conn=_number(0), count=_number(len(own))
        )
    fields = {"index_pos": struct.pack("<Q", len(body)), "conn_count": _number(1)}
    first = _ros1_record(b"", op=b"\x03", chunk_count=_number(n_infos * len(chunks)), **fields)
    pad = 4096 + 8 - len(first)
    first = first[:-4] + _number(pad) + bytes(pad)
    body[13 : 13 + 4096 + 8] = first
    path = folder / "a.bag"
    path.write_bytes(bytes(body) + connection + infos)
    return path


def _ros1_message() -> bytes:
    message = imports._messages()[0][4:]
    return _ros1_record(message, op=b"\x02", conn=_number(0), time=bytes(8))


def _ros1_bz2(folder: Path) -> Path:
    packed = bz2.BZ2Compressor(9)
    parts = [packed.compress(bytes(CHUNK)) for _ in range(8)]
    return _ros1(folder, [b"".join(parts) + packed.flush()], b"bz2", [0])


def _ros1_lz4(folder: Path) -> Path:
    import lz4.frame

    return _ros1(folder, [lz4.frame.compress(bytes(8 * CHUNK))], b"lz4", [0])


def _ros1_turns(folder: Path) -> Path:
    """Make a bag whose messages are in two chunks by turns."""
    chunk = bz2.compress(_ros1_message() + bytes(CHUNK // 4))
    return _ros1(folder, [chunk, chunk], b"bz2", [0] * 2000)


def _ros1_connections(folder: Path) -> Path:
    """Make a bag whose messages all begin with the same million records."""
    chunk = bz2.compress(_ros1_record(b"", op=b"\x07") * 1_000_000 + _ros1_message())
    return _ros1(folder, [chunk], b"bz2", [0] * 2000)


def _ros1_index(folder: Path) -> Path:
    """Make a bag whose index names a chunk with many messages many times."""
    return _ros1(folder, [b""], b"none", [0] * 50_000, 10_000)


def _csv(header: str, rows: str, name: str = "a.csv") -> Make:
    """Return a function that makes a CSV file."""

    def make(folder: Path) -> Path:
        path = folder / name
        path.write_text(f"{header}\n{rows}")
        return path

    return make


def _tensor_packed(folder: Path) -> Path:
    """Make a tensor of 2 GB of zeros that is packed to 2 MB."""
    path = folder / "seq_1.pt"
    archive = zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED)
    with archive, archive.open("seq_1/data/0", "w") as member:
        for _ in range(10):
            member.write(bytes(CHUNK))
    return path


def _tensor_size(folder: Path) -> Path:
    """Make a tensor of which the archive says that it has 4 GB."""
    path = folder / "seq_1.pt"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("seq_1/data/0", bytes(1200))
    data = path.read_bytes()
    size = struct.pack("<II", 1200, 1200)
    path.write_bytes(data.replace(size, struct.pack("<II", 0xFFFFFFF0, 0xFFFFFFF0)))
    return path


def _tensor_members(folder: Path) -> Path:
    """Make an archive of 60,000 members that are all the tensor."""
    path = folder / "seq_1.pt"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data/0", bytes(1200))
    data = path.read_bytes()
    first = data.index(b"PK\x01\x02")
    entry, end = data[first : data.index(b"PK\x05\x06")], bytearray(data[-22:])
    n_members = 60_000
    end[8:12] = struct.pack("<HH", n_members, n_members)
    end[12:16] = struct.pack("<I", n_members * len(entry))
    path.write_bytes(data[:first] + entry * n_members + end)
    return path


def _hdf5_depth(folder: Path) -> Path:
    """Make an HDF5 file with 3,000 groups inside each other."""
    import h5py

    path = folder / "a.h5"
    with h5py.File(path, "w") as file:
        group = file
        for _ in range(3000):
            group = group.create_group("g")
        group["tactile_data_raw"] = [1.0]
    return path


def _hdf5_links(folder: Path) -> Path:
    """Make an HDF5 file with 200 groups that share large arrays."""
    import h5py

    path, n = folder / "a.h5", 200_000
    with h5py.File(path, "w") as file:
        options = {"chunks": True, "compression": "gzip", "compression_opts": 1}
        raw = file.create_dataset("raw", (18, 3, n), "f8", fillvalue=1.0, chunks=True)
        times = file.create_dataset("times", data=range(n), **options)
        for k in range(200):
            group = file.create_group(f"p/can/Pose1/Exp{k}")
            group["tactile_data_raw"], group["tactile_timestamps"] = raw, times
    return path


def _hdf5_empty(folder: Path) -> Path:
    """Make an HDF5 file with 200 groups whose large arrays have no stored values."""
    import h5py

    path, n = folder / "a.h5", 200_000
    with h5py.File(path, "w") as file:
        for k in range(200):
            group = file.create_group(f"p/can/Pose1/Exp{k}")
            group.create_dataset("tactile_data_raw", (18, 3, n), "f8", chunks=True)
            group.create_dataset("tactile_timestamps", (n,), "f8", chunks=True)
    return path


def _hdf5_chunk(folder: Path) -> Path:
    """Make an HDF5 file with a chunk that is packed and much larger than it should be."""
    import h5py

    path, n = folder / "a.h5", 100
    packer = zlib.compressobj(1)
    packed = b"".join(packer.compress(bytes(CHUNK)) for _ in range(20)) + packer.flush()
    with h5py.File(path, "w") as file:
        group = file.create_group("p/can/Pose1/Exp1")
        group["tactile_timestamps"] = range(n)
        raw = group.create_dataset(
            "tactile_data_raw", (18, 3, n), "f8", chunks=(18, 3, n), compression="gzip"
        )
        raw.id.write_direct_chunk((0, 0, 0), packed)
    return path


def _hdf5_filters(folder: Path) -> Path:
    """Make an HDF5 file with a chunk that is packed twice."""
    import h5py

    path, n = folder / "a.h5", 100
    packer = zlib.compressobj(9)
    packed = zlib.compress(
        b"".join(packer.compress(bytes(CHUNK)) for _ in range(20)) + packer.flush(), 9
    )
    with h5py.File(path, "w") as file:
        group = file.create_group("p/can/Pose1/Exp1")
        group["tactile_timestamps"] = range(n)
        layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        layout.set_chunk((18, 3, n))
        layout.set_deflate(9)
        layout.set_deflate(9)
        space = h5py.h5s.create_simple((18, 3, n))
        raw = h5py.h5d.create(
            group.id, b"tactile_data_raw", h5py.h5t.NATIVE_DOUBLE, space, dcpl=layout
        )
        raw.write_direct_chunk((0, 0, 0), packed)
    return path


def _head(profile: bytes, library: bytes) -> bytes:
    return MAGIC + _record(0x01, _text(profile) + _text(library))


_WIDE = ",".join(f"f{k // 3}_{'xyz'[k % 3]}{k}" for k in range(20_000))

FILES: dict[str, tuple[Make, str]] = {
    "recording, schemas": (_schemas, "info"),
    "recording, records without content": (_empty_records, "info"),
    "recording, header of lists": (_header, "info"),
    "recording, sparse .mcap": (_sparse("a.mcap", _head(b"", b"holdfast")), "info"),
    "recording, sparse .parquet": (_sparse("a.parquet", b"PAR1"), "info"),
    "bag, .mcap, records without content": (_bag_records, "import"),
    "bag, .mcap, messages of one time": (_bag_messages, "import"),
    "bag, .mcap, topics of one definition": (_bag_topics, "import"),
    "bag, .mcap, sparse": (_sparse("a.mcap", _head(b"ros2", b"attack")), "import"),
    "bag, .db3, sparse": (_sparse("a.db3", b"SQLite format 3\x00"), "import"),
    "bag, .db3, generated column": (_generated, "import"),
    "bag, .db3, view": (_view, "import"),
    "bag, .db3, shared pages": (_shared_pages, "import"),
    "bag, folder, packed messages": (_packed_messages, "import"),
    "bag, folder, packed file": (_packed_file, "import"),
    "bag, folder, metadata that repeat": (_yaml, "import"),
    "bag, .bag, sparse": (_sparse("a.bag", b"#ROSBAG V2.0\n"), "import"),
    "bag, .bag, bz2": (_ros1_bz2, "import"),
    "bag, .bag, lz4": (_ros1_lz4, "import"),
    "bag, .bag, two chunks by turns": (_ros1_turns, "import"),
    "bag, .bag, records before each message": (_ros1_connections, "import"),
    "bag, .bag, index that repeats": (_ros1_index, "import"),
    "csv, sparse": (_sparse("a.csv", b"time,t01_x,t01_y,t01_z\n0,1,2,3\n"), "import"),
    "csv, sparse, without a header": (_sparse("a.csv"), "import --format csv"),
    "csv, sparse, gtac": (_sparse("a.csv", b",0,1,2,3\n"), "import --format gtac"),
    "csv, sparse, xela-log": (_sparse("a.csv", b"time,b\n"), "import --format xela-log"),
    "csv, columns to guess from": (_csv(f"time,{_WIDE}", "1"), "import"),
    "csv, a name to guess from": (_csv(f"time,{'x1' * 20_000}", "1,2"), "import"),
    "csv, two million columns": (_csv("," * 2_000_000, "," * 2_000_000), "import --format gtac"),
    "csv, two million rows that are wrong": (
        _csv("time,t01_x,t01_y,t01_z", "\n" * 2_000_000 + "a,b,c,d"), "import"
    ),
    "csv, semicolons, a million columns": (_csv(";" * 1_000_000, ";" * 1_000_000), "import"),
    "tensor, sparse": (_sparse("seq_1.pt", b"PK\x03\x04"), "import"),
    "tensor, packed": (_tensor_packed, "import"),
    "tensor, a size that is too large": (_tensor_size, "import"),
    "tensor, one member many times": (_tensor_members, "import"),
    "HDF5, sparse": (_sparse("a.h5", b"\x89HDF\r\n\x1a\n"), "import"),
    "HDF5, groups in groups": (_hdf5_depth, "import"),
    "HDF5, links to one array": (_hdf5_links, "import"),
    "HDF5, arrays without values": (_hdf5_empty, "import"),
    "HDF5, a chunk that is too large": (_hdf5_chunk, "import"),
    "HDF5, a chunk that is packed twice": (_hdf5_filters, "import"),
}  # fmt: skip
"""Function that makes each file, and the command that reads it."""
