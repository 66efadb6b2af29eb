"""Recordings as Parquet, for analysis: one wide table that opens in pandas.

Row groups are spans of time of at most a minute; within one, row i holds the i-th sample of
every module, and a module with fewer samples has nulls below its last. `docs/formats.md` is
the full description.
"""

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from holdfast.errors import RecordingError
from holdfast.files import whole_file
from holdfast.io.header import Header, decode, encode, header_of
from holdfast.io.seal import BLANK, KEY, check_seal, read_footer, seal
from holdfast.io.series import (
    Samples,
    Series,
    n_components,
    recording_from,
    samples_of,
    series_of,
)
from holdfast.io.spans import spans
from holdfast.recordings import Recording
from holdfast.sensors.types import Array

HEADER_KEY = "holdfast.header"
MAGIC = b"PAR1"
GROUP_SECONDS = 60.0
GROUP_ROWS = 1 << 16


def save(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Writes a recording, sealed.

    Raises:
        OutputError: as `whole_file`.
        RecordingError: it holds what Parquet cannot.
    """
    header = header_of(recording, path.stem)
    text = encode(header)
    every = series_of(header)
    schema = _schema(every)
    samples = samples_of(recording)
    with whole_file(path, force=force) as part:
        with pq.ParquetWriter(
            str(part),
            schema,
            compression="zstd",
            use_dictionary=False,
            column_encoding=_encodings(schema),
            write_page_checksum=True,
        ) as writer:
            for span in spans(_track_times(every, samples), GROUP_SECONDS, GROUP_ROWS):
                writer.write_batch(_batch(every, samples, span, schema), row_group_size=1 << 30)
            writer.add_key_value_metadata({HEADER_KEY: text, KEY: BLANK})
        seal(part)


def load(path: Path) -> Recording:
    """The recording in a file.

    Raises:
        RecordingError: it is cut, damaged or no recording.
    """
    header, file = _open(path)
    n_rows = file.metadata.num_rows
    filled = {s.topic: _Filled(s, n_rows, path) for s in series_of(header)}
    for samples in _groups(header, file, path):
        for topic, (times, values) in samples.items():
            filled[topic].append(times, values)
    recording = recording_from(
        header, {topic: fill.whole() for topic, fill in filled.items()}, path
    )
    if recording.digest != header.digest:
        raise RecordingError(f"{path} is damaged: its samples do not match their digest")
    return recording


def chunks(path: Path) -> tuple[Header, Iterator[Samples], bool]:
    """The header, the samples of one row group after the other, and that the file is whole.

    Raises:
        RecordingError: as `load`.
    """
    header, file = _open(path)
    return header, _groups(header, file, path), True


def is_foreign(path: Path) -> bool:
    """Whether it is sound Parquet that holds something else than a recording."""
    _, footer = read_footer(path)
    return footer.endswith(MAGIC) and not any(key.encode() in footer for key in (HEADER_KEY, KEY))


def _open(path: Path) -> tuple[Header, pq.ParquetFile]:
    _check_ends(path)
    try:
        check_seal(path)
    except RecordingError:
        if is_foreign(path):
            raise RecordingError(
                f"{path} is a Parquet file but no recording of holdfast: import it instead"
            ) from None
        raise
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as cause:
        raise RecordingError(f"{path} is damaged: {_line(cause)}") from cause
    return decode((file.metadata.metadata or {}).get(HEADER_KEY.encode(), b""), path), file


def _check_ends(path: Path) -> None:
    size = path.stat().st_size
    if size == 0:
        raise RecordingError(f"{path} is empty (0 bytes); a Parquet recording expected")
    with path.open("rb") as file:
        head = file.read(len(MAGIC))
        file.seek(max(0, size - len(MAGIC)))
        tail = file.read()
    if head != MAGIC:
        raise RecordingError(f"{path} is no Parquet file, or its first bytes are damaged")
    if tail != MAGIC or size < 3 * len(MAGIC):
        raise RecordingError(
            f"{path} is cut or damaged: {size} bytes without the end of a Parquet file, "
            "from which nothing can be recovered"
        )


def _schema(every: list[Series]) -> pa.Schema:
    fields = []
    for series in every:
        if series.track != "truth":
            fields.append((f"{series.column}.time", pa.float64()))
        fields += [(name, _arrow_type(series.number)) for name in _columns(series)]
    names = [name for name, _ in fields]
    if twice := sorted({name for name in names if names.count(name) > 1} if _double(names) else ()):
        raise RecordingError(f"two arrays of the recording would share the column {twice[0]!r}")
    return pa.schema(fields)


def _double(names: list[str]) -> bool:
    return len(set(names)) < len(names)


def _arrow_type(number: str | None) -> pa.DataType:
    return pa.string() if number == "str" else pa.from_numpy_dtype(np.dtype(number))


def _encodings(schema: pa.Schema) -> dict[str, str]:
    split = {f.name for f in schema if pa.types.is_integer(f.type) or pa.types.is_floating(f.type)}
    return {f.name: "BYTE_STREAM_SPLIT" if f.name in split else "PLAIN" for f in schema}


def _columns(series: Series) -> list[str]:
    """The column of each component of a value, in order."""
    if series.track != "truth":
        n_taxels = series.shape[0]
        width = max(2, len(str(n_taxels)))
        taxels = [f"t{taxel + 1:0{width}d}" for taxel in range(n_taxels)]
        return [f"{series.column}.{taxel}.{axis}" for taxel, axis in product(taxels, "xyz")]
    places = product(*(range(size) for size in series.shape))
    return [".".join([series.column, *map(str, place)]) for place in places]


def _track_times(every: list[Series], samples: Samples) -> dict[str, Array]:
    return {_track_key(series): samples[series.topic][0] for series in every}


def _track_key(series: Series) -> str:
    return "/truth/time" if series.track == "truth" else series.topic


def _batch(
    every: list[Series], samples: Samples, span: Mapping[str, slice], schema: pa.Schema
) -> pa.RecordBatch:
    n_rows = max(cut.stop - cut.start for cut in span.values())
    columns: list[pa.Array] = []
    for series in every:
        cut = span[_track_key(series)]
        times, values = samples[series.topic]
        if series.track != "truth":
            columns.append(_padded(times[cut], n_rows))
        flat = values[cut].reshape(cut.stop - cut.start, n_components(series))
        columns += [_padded(column, n_rows) for column in np.ascontiguousarray(flat.T)]
    return pa.RecordBatch.from_arrays(columns, schema=schema)


def _padded(values: npt.NDArray[Any], n_rows: int) -> pa.Array:
    array = pa.array(values, type=pa.string() if values.dtype.kind == "U" else None)
    missing = n_rows - len(array)
    return pa.concat_arrays([array, pa.nulls(missing, array.type)]) if missing else array


def _groups(header: Header, file: pq.ParquetFile, path: Path) -> Iterator[Samples]:
    every = series_of(header)
    if file.schema_arrow.names != _schema(every).names:
        raise RecordingError(f"{path}: its columns are not those that its header names")
    for group in range(file.num_row_groups):
        try:
            table = file.read_row_group(group)
            yield _samples(every, table)
        except (pa.ArrowException, OSError, ValueError) as cause:
            raise RecordingError(
                f"{path} is damaged in row group {group}: {_line(cause)}"
            ) from cause


def _samples(every: list[Series], table: pa.Table) -> Samples:
    columns = iter(table.columns)
    samples: dict[str, tuple[Array, npt.NDArray[Any]]] = {}
    times: Array = np.empty(0)
    for series in every:
        if series.track != "truth":
            times = _numbers(next(columns), None)
        elif series.topic == "/truth/time":
            times = _numbers(next(columns), None)
            samples[series.topic] = (times, times)
            continue
        values = [_numbers(next(columns), len(times)) for _ in range(n_components(series))]
        dtype: Any = object if series.number == "str" else series.number
        flat = np.empty((len(times), len(values)), dtype)
        for place, column in enumerate(values):
            flat[:, place] = column
        samples[series.topic] = (times, flat.reshape(len(times), *series.shape))
    return samples


def _numbers(column: pa.ChunkedArray, n: int | None) -> npt.NDArray[Any]:
    """The values above the nulls that pad a column; a null among them is an error."""
    n = len(column) - column.null_count if n is None else n
    values = column.slice(0, n)
    if values.null_count or len(values) != n:
        raise ValueError("a column has another number of values than its times")
    array: npt.NDArray[Any] = values.to_numpy()
    return array


class _Filled:
    """An array of known length that fills piece by piece."""

    def __init__(self, series: Series, n_rows: int, path: Path) -> None:
        self._n = series.n or 0
        if self._n > n_rows:
            raise RecordingError(f"{path}: {series.column} names {self._n} samples of {n_rows}")
        dtype: Any = object if series.number == "str" else series.number
        self._text = series.number == "str"
        self._times = np.empty(self._n)
        self._values = np.empty((self._n, *series.shape), dtype)
        self._end = 0
        self._path = path

    def append(self, times: Array, values: npt.NDArray[Any]) -> None:
        end = self._end + len(times)
        if end > self._n:
            raise RecordingError(f"{self._path}: more samples than its header names")
        self._times[self._end : end] = times
        self._values[self._end : end] = values
        self._end = end

    def whole(self) -> tuple[Array, npt.NDArray[Any]]:
        if self._end != self._n:
            raise RecordingError(f"{self._path}: {self._end} samples, its header names {self._n}")
        return self._times, self._values.astype(str) if self._text else self._values


def _line(cause: BaseException) -> str:
    return " ".join(str(cause).split())[:200]
