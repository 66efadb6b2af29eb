"""Bags of ROS 2 in a folder: metadata.yaml and one or more files."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path, PurePath
from tempfile import TemporaryDirectory
from typing import Any

from holdfast.errors import RecordingError
from holdfast.files import check_regular, read_input
from holdfast.io.safe_reading import ReadBudget
from holdfast_ros.bag_storage import BagConnection, BagStorage, check_number
from holdfast_ros.bag_storage.mcap import open_mcap
from holdfast_ros.bag_storage.sqlite import open_sqlite
from holdfast_ros.bag_storage.unpacking import unpack, unpack_file

METADATA = "metadata.yaml"
"""File in the folder of a ROS 2 bag."""
MAX_METADATA_SIZE = 1 << 20
"""Maximum size of that file [bytes]."""
MAX_VERSION = 9
"""Newest version of that file that is known."""

_OPENERS: dict[str, Callable[[Path, ReadBudget], AbstractContextManager[BagStorage]]] = {
    "mcap": open_mcap,
    "sqlite3": open_sqlite,
}
_ANCHOR = re.compile(r"(?:^|[\s\[\]{},:-])[&*][^\s&]")
"""Name of a part of a YAML text; a text that repeats named parts can expand without end."""


class FolderBag:
    """Reader of a bag in a folder; see `open_folder`."""

    def __init__(
        self,
        storages: Sequence[BagStorage],
        topics: Sequence[Any],
        budget: ReadBudget,
        *,
        packed: bool,
    ) -> None:
        self._storages = storages
        self._packed = packed
        self._budget = budget
        self.complete = all(storage.complete for storage in storages)
        check_number(len(topics))
        inside = [connection for storage in storages for connection in storage.connections]
        # Reversed, so that the first definition of a type is used.
        definitions = {one.kind: one.definition for one in reversed(inside) if one.definition}
        self._connections: list[BagConnection] = []
        for number, topic in enumerate(topics):
            try:
                data = topic["topic_metadata"]
                name, kind, n = str(data["name"]), str(data["type"]), int(topic["message_count"])
                encoding = data["serialization_format"]
            except (KeyError, TypeError) as cause:
                raise ValueError(f"a topic in {METADATA} is not complete: {cause}") from cause
            if encoding != "cdr":
                raise ValueError(f"messages in CDR expected, {str(encoding)[:20]!r} given")
            connection = BagConnection(number, name, kind, definitions.get(kind, ""), n)
            self._connections.append(connection)

    @property
    def connections(self) -> list[BagConnection]:
        """All connections."""
        return self._connections

    def messages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield connection, time [ns] and bytes of each message of connections, by time."""
        wanted = {(self._connections[n].topic, self._connections[n].kind): n for n in numbers}
        for storage in self._storages:
            places = {
                connection.number: wanted[connection.topic, connection.kind]
                for connection in storage.connections
                if (connection.topic, connection.kind) in wanted
            }
            if not places:
                continue
            for number, time, data in storage.messages(places):
                whole = unpack(data, "zstd", self._budget) if self._packed else data
                yield places[number], time, whole


@contextmanager
def open_folder(path: Path, budget: ReadBudget) -> Iterator[FolderBag]:
    """Open a bag in a folder for reading.

    Raises:
        RecordingError: one of its files is sparse, or expands too much.
        ValueError: the metadata or a file are cut, damaged, or of a kind that is not supported.
    """
    metadata = bag_metadata(path)
    # The name alone: a path could lead out of the folder.
    files = [path / PurePath(str(name)).name for name in metadata["relative_file_paths"]]
    # A file that is named often would be read as often, for the size of one.
    if len(set(files)) < len(files):
        raise ValueError(f"{METADATA} names a file twice")
    storage, packing = str(metadata["storage_identifier"]), metadata.get("compression_format")
    mode = str(metadata.get("compression_mode") or "none").lower()
    if mode not in ("none", "file", "message") or (mode != "none" and packing != "zstd"):
        raise ValueError(f"compression {mode[:20]!r} by {str(packing)[:20]!r} is not supported")
    if storage not in _OPENERS:
        raise ValueError(f"storage {storage[:20]!r} given, {' or '.join(_OPENERS)} expected")
    with ExitStack() as stack:
        for file in files:
            check_regular(file)
            ReadBudget(file)  # which refuses sparse files
        if mode == "file":
            folder = Path(stack.enter_context(TemporaryDirectory()))
            for k, file in enumerate(files):
                files[k] = folder / file.stem
                if files[k].exists():
                    raise RecordingError(f"{file} has the name of another file of the bag")
                unpack_file(file, files[k], budget)
        storages = [stack.enter_context(_OPENERS[storage](file, budget)) for file in files]
        topics = metadata["topics_with_message_count"]
        yield FolderBag(storages, topics, budget, packed=mode == "message")


def bag_metadata(path: Path) -> Mapping[str, Any]:
    """Return the metadata of a ROS 2 bag, of a version that is known."""
    from ruamel.yaml import YAML

    text = read_input(path / METADATA, MAX_METADATA_SIZE).decode()
    if _ANCHOR.search(text):
        raise ValueError(f"{METADATA} has parts with names (&name); plain YAML expected")
    document = YAML(typ="safe").load(text)
    try:
        metadata: Mapping[str, Any] = document["rosbag2_bagfile_information"]
        if not metadata["version"] <= MAX_VERSION:
            raise ValueError(f"version {metadata['version']} of {METADATA} is not supported")
        for key in ("relative_file_paths", "storage_identifier", "topics_with_message_count"):
            metadata[key]
    except (KeyError, TypeError) as cause:
        raise ValueError(f"{METADATA} is not that of a ROS 2 bag: {cause}") from cause
    return metadata
