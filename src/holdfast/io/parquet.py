"""Parquet files of recordings: one wide table that opens in pandas.

A row group is a span of time, of at most 16 MB in memory. Row i of a row group has the i-th sample
of every module in that span. A module with fewer samples has nulls in the rows after its last
sample. `docs/formats.md` is the full description.

A checksum over all bytes is stored in the footer of the file, so that any flipped bit is found.
"""

import hashlib
from collections import Counter
from collections.abc import Iterator
from itertools import islice, product
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast.errors import RecordingError
from holdfast.files import whole_file
from holdfast.io.arrow_arrays import arrow_column, arrow_type, component_rows
from holdfast.io.header import Header, decode_header, encode_header, header_of
from holdfast.io.safe_reading import check_size, one_line
from holdfast.io.timed_arrays import (
    TRUTH_TIME,
    ArraySpec,
    TimedArray,
    TimedArrays,
    array_specs,
    arrays_of,
    recording_from,
    time_spans,
)
from holdfast.recordings import Recording
from holdfast.sensors import taxel_numbers
from holdfast.sensors.types import Array

HEADER_KEY = "holdfast.header"
CHECKSUM_KEY = "holdfast.seal"
"""Keys of the header and of the checksum in the metadata of the file."""
BLANK_CHECKSUM = "0" * 64
"""Text in place of the checksum while the checksum is computed; it has the same length."""
PARQUET_MAGIC = b"PAR1"
FOOTER_END_SIZE = 8
"""A Parquet file ends with the length of its footer (4 bytes) and the magic (4 bytes)."""
MAX_FOOTER_SIZE = 1 << 30
"""Number of bytes that are searched for the checksum; a day of a whole hand has 0.3 GB."""
GROUP_SIZE = 1 << 24
"""Maximum size of a row group in memory [bytes], if a row is not larger."""
GROUP_ROWS = 1 << 16
"""Maximum number of rows in a row group."""
BLOCK_SIZE = 1 << 20
"""Number of bytes that are read at a time."""


def save(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Save a recording.

    Raises:
        OutputError: as in `whole_file`.
        RecordingError: the file cannot store the recording.
    """
    header = header_of(recording, path.stem)
    text = encode_header(header)
    specs = array_specs(header)
    schema = _schema(specs)
    arrays = arrays_of(recording)
    # Neighbouring numbers share their high bytes: split by byte they take less. Arrow refuses this
    # encoding for texts and booleans.
    encodings = {
        f.name: "BYTE_STREAM_SPLIT"
        if pa.types.is_integer(f.type) or pa.types.is_floating(f.type)
        else "PLAIN"
        for f in schema
    }
    # All truth arrays have the times of one track, so they are cut at the same rows.
    tracks = {spec.topic: TRUTH_TIME if spec.track == "truth" else spec.topic for spec in specs}
    times = {track: arrays[track][0] for track in tracks.values()}
    row_size = sum(_value_size(spec) for spec in specs)
    n_group_rows = max(1, min(GROUP_ROWS, GROUP_SIZE // row_size))
    with whole_file(path, force=force) as part:
        with pq.ParquetWriter(
            str(part),
            schema,
            compression="zstd",
            use_dictionary=False,  # with dictionaries, Arrow takes no encoding of a column
            column_encoding=encodings,
            write_page_checksum=True,
        ) as writer:
            for span in time_spans(times, np.inf, n_group_rows):
                n_rows = max(cut.stop - cut.start for cut in span.values())
                columns: list[pa.Array] = []
                for spec in specs:
                    cut = span[tracks[spec.topic]]
                    sample_times, values = arrays[spec.topic]
                    if spec.track != "truth":
                        columns.append(_padded(sample_times[cut], n_rows))
                    flat = values[cut].reshape(cut.stop - cut.start, spec.n_components)
                    columns += [_padded(column, n_rows) for column in np.ascontiguousarray(flat.T)]
                # A span is one row group: Arrow must not divide it again.
                batch = pa.RecordBatch.from_arrays(columns, schema=schema)
                writer.write_batch(batch, row_group_size=1 << 30)
            # The checksum covers the footer that holds it: a blank of its length is written first.
            writer.add_key_value_metadata({HEADER_KEY: text, CHECKSUM_KEY: BLANK_CHECKSUM})
        write_checksum(part)


def load(path: Path) -> Recording:
    """Load the recording in a file.

    Raises:
        RecordingError: the file is cut, damaged or not a recording.
    """
    header, file = _open(path)
    n_rows = file.metadata.num_rows
    specs = array_specs(header)
    check_size(path, sum((spec.n or 0) * _value_size(spec) for spec in specs))
    buffers = {spec.topic: _ArrayBuffer(spec, n_rows, path) for spec in specs}
    for arrays in _groups(header, file, path):
        for topic, (times, values) in arrays.items():
            buffers[topic].append(times, values)
    complete = {topic: buffer.result() for topic, buffer in buffers.items()}
    recording = recording_from(header, complete, path)
    if recording.digest != header.digest:
        raise RecordingError(f"{path} is damaged: its samples do not match their digest")
    return recording


def read_groups(path: Path) -> tuple[Header, Iterator[TimedArrays], bool]:
    """Return the header, an iterator over the arrays of the row groups, and True: complete.

    Raises:
        RecordingError: as in `load`.
    """
    header, file = _open(path)
    return header, _groups(header, file, path), True


def is_foreign(path: Path) -> bool:
    """Return whether a file is Parquet, but not a recording."""
    _, footer = _read_footer(path)
    # Either key, so that a recording with a flipped bit in one is damaged, not foreign.
    keys = (HEADER_KEY, CHECKSUM_KEY)
    return footer.endswith(PARQUET_MAGIC) and not any(key.encode() in footer for key in keys)


def write_checksum(path: Path) -> None:
    """Replace the blank checksum in the footer by the checksum of the file."""
    offset = _checksum_offset(path)
    checksum = _checksum(path, offset)
    with path.open("r+b") as file:
        file.seek(offset)
        file.write(checksum)


def _open(path: Path) -> tuple[Header, pq.ParquetFile]:
    size = path.stat().st_size
    if size == 0:
        raise RecordingError(f"{path} is empty (0 bytes); a Parquet recording expected")
    with path.open("rb") as file:
        head = file.read(len(PARQUET_MAGIC))
        file.seek(max(0, size - len(PARQUET_MAGIC)))
        tail = file.read()
    if head != PARQUET_MAGIC:
        raise RecordingError(f"{path} is no Parquet file, or its first bytes are damaged")
    # The smallest file is the magic, a length of 4 bytes, and the magic.
    if tail != PARQUET_MAGIC or size < 3 * len(PARQUET_MAGIC):
        raise RecordingError(
            f"{path} is cut or damaged: {size} bytes without the end of a Parquet file, "
            "from which nothing can be recovered"
        )
    # The checksum comes first: Arrow may end the process for a file that is damaged.
    try:
        offset = _checksum_offset(path)
        with path.open("rb") as file:
            file.seek(offset)
            stored = file.read(len(BLANK_CHECKSUM))
        if stored != _checksum(path, offset):
            raise RecordingError(f"{path} is damaged: its content does not match its checksum")
    except RecordingError:
        if is_foreign(path):
            raise RecordingError(
                f"{path} is a Parquet file but no recording of holdfast: import it instead"
            ) from None
        raise
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as cause:
        raise RecordingError(f"{path} is damaged: {one_line(cause)}") from cause
    header = (table.metadata.metadata or {}).get(HEADER_KEY.encode(), b"")
    return decode_header(header, path), table


def _checksum_offset(path: Path) -> int:
    """Return the offset of the first character of the checksum in the file."""
    start, footer = _read_footer(path)
    # In the thrift encoding of the footer a value follows its key: field header, varint length.
    mark = CHECKSUM_KEY.encode() + b"\x18" + bytes([len(BLANK_CHECKSUM)])
    if footer.count(mark) != 1:
        raise RecordingError(f"{path} is damaged: its checksum is missing or broken")
    return start + footer.index(mark) + len(mark)


def _checksum(path: Path, offset: int) -> bytes:
    """Return the blake2b-256 of all bytes of the file, with a blank checksum at `offset`."""
    state = hashlib.blake2b(digest_size=len(BLANK_CHECKSUM) // 2)
    n_left = offset
    with path.open("rb") as file:
        while n_left and (block := file.read(min(BLOCK_SIZE, n_left))):
            state.update(block)
            n_left -= len(block)
        state.update(BLANK_CHECKSUM.encode())
        file.seek(offset + len(BLANK_CHECKSUM))
        while block := file.read(BLOCK_SIZE):
            state.update(block)
    return state.hexdigest().encode()


def _read_footer(path: Path) -> tuple[int, bytes]:
    """Return the offset of the footer in a Parquet file, and its bytes."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - FOOTER_END_SIZE))
        footer_size = int.from_bytes(file.read()[:4], "little") + FOOTER_END_SIZE
        footer_size = min(footer_size, MAX_FOOTER_SIZE)
        file.seek(max(0, size - footer_size))
        start = file.tell()
        return start, file.read()


def _schema(specs: list[ArraySpec]) -> pa.Schema:
    fields = []
    for spec in specs:
        if spec.track != "truth":
            fields.append((f"{spec.column}.time", pa.float64()))
            n_taxels = spec.shape[0]
            # Numbers of one width, so that the names of columns sort like the taxels.
            width = max(2, len(str(n_taxels)))
            taxels = [f"t{number:0{width}d}" for number in taxel_numbers(range(n_taxels))]
            components = [f"{taxel}.{axis}" for taxel, axis in product(taxels, "xyz")]
        else:
            indices = product(*(range(size) for size in spec.shape))
            components = [".".join(map(str, index)) for index in indices]
        # A value of one number has no component, and its column no end.
        names = [f"{spec.column}.{end}" if end else spec.column for end in components]
        fields += [(name, arrow_type(spec.number)) for name in names]
    counts = Counter(name for name, _ in fields)
    if repeated := sorted(name for name, n in counts.items() if n > 1):
        raise RecordingError(f"two arrays of the recording would share the column {repeated[0]!r}")
    return pa.schema(fields)


def _padded(values: npt.NDArray[Any], n_rows: int) -> pa.Array:
    array = arrow_column(values)
    missing = n_rows - len(array)
    return pa.concat_arrays([array, pa.nulls(missing, array.type)]) if missing else array


def _groups(header: Header, file: pq.ParquetFile, path: Path) -> Iterator[TimedArrays]:
    """Yield the arrays of each row group as they are in a recording, (n, ...)."""
    specs = _specs(header, file, path)
    _check_groups(file, path)
    # Not a generator: a file of other columns is refused by the call.
    return (_read_group(file, path, group, specs) for group in range(file.num_row_groups))


def _specs(header: Header, file: pq.ParquetFile, path: Path) -> list[ArraySpec]:
    specs = array_specs(header)
    if file.schema_arrow.names != _schema(specs).names:
        raise RecordingError(f"{path}: its columns are not those that its header names")
    return specs


def _check_groups(file: pq.ParquetFile, path: Path) -> None:
    """Check all row groups before the first is read: one of few bytes may claim any size.

    Raises:
        RecordingError: a row group is larger than recordings have.
    """
    groups = map(file.metadata.row_group, range(file.num_row_groups))
    if (n_rows := max((group.num_rows for group in groups), default=0)) > GROUP_ROWS:
        raise RecordingError(
            f"{path} is damaged: a row group of at most {GROUP_ROWS} rows expected, {n_rows} given"
        )


def _read_group(
    file: pq.ParquetFile, path: Path, group: int, specs: list[ArraySpec]
) -> TimedArrays:
    """Return the arrays of a row group.

    Raises:
        RecordingError: it is damaged.
    """
    try:
        table = file.read_row_group(group)
        columns = (column.combine_chunks() for column in table.columns)
        arrays: dict[str, TimedArray] = {}
        times: Array = np.empty(0)
        for spec in specs:
            # Columns have the order of the arrays; all of the truth share the times of the first.
            if spec.track != "truth" or spec.topic == TRUTH_TIME:
                column = next(columns)
                # Nulls are only after the last sample of the module in this span.
                times = _rows([column], len(column) - column.null_count)[0]
            if spec.topic == TRUTH_TIME:
                arrays[spec.topic] = (times, times)
                continue
            # The components of a sample side by side in memory.
            values = _rows(list(islice(columns, spec.n_components)), len(times), "F")
            arrays[spec.topic] = (times, values.T.reshape(len(times), *spec.shape))
    except (pa.ArrowException, OSError, ValueError) as cause:
        raise RecordingError(
            f"{path} is damaged in row group {group}: {one_line(cause)}"
        ) from cause
    pa.default_memory_pool().release_unused()  # 50 MB, which Arrow would keep
    return arrays


def _value_size(spec: ArraySpec) -> int:
    """Return the size of a value and its time in memory [bytes]."""
    n_bytes: int = 8 + spec.n_components * np.dtype(_memory_type(spec)).itemsize
    return n_bytes


def _rows(columns: list[pa.Array], n: int, order: Literal["C", "F"] = "C") -> npt.NDArray[Any]:
    """Return the first `n` values of each column, before the nulls at its end.

    Raises:
        ValueError: there are nulls among them.
    """
    batch = pa.RecordBatch.from_arrays(columns, names=[""] * len(columns))
    return component_rows(batch.slice(0, n), order)


def _memory_type(spec: ArraySpec) -> Any:  # noqa: ANN401 (a dtype)
    """Return the dtype of values while they are read: texts are objects first."""
    return object if spec.number == "str" else spec.number


class _ArrayBuffer:
    """Buffer of known length for one array, filled one row group after the other."""

    def __init__(self, spec: ArraySpec, n_rows: int, path: Path) -> None:
        self._n = spec.n or 0
        # Before the buffer is made: a header may claim any number.
        if self._n > n_rows:
            raise RecordingError(f"{path}: {spec.column} names {self._n} samples of {n_rows}")
        self._is_text = spec.number == "str"
        self._times = np.empty(self._n)
        self._values = np.empty((self._n, *spec.shape), _memory_type(spec))
        self._end = 0  # number of samples so far
        self._path = path

    def append(self, times: Array, values: npt.NDArray[Any]) -> None:
        end = self._end + len(times)
        if end > self._n:
            raise RecordingError(f"{self._path}: more samples than its header names")
        self._times[self._end : end] = times
        self._values[self._end : end] = values
        self._end = end

    def result(self) -> TimedArray:
        if self._end != self._n:
            raise RecordingError(f"{self._path}: {self._end} samples, its header names {self._n}")
        if not self._is_text:
            return self._times, self._values
        # Their lengths are known only now: as an array each takes as much as the longest.
        longest = max(map(len, self._values.flat), default=0)
        check_size(self._path, 4 * longest * self._values.size)
        return self._times, self._values.astype(str)
