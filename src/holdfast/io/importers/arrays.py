"""The format `arrays`: arrays of numbers in files of NumPy, MATLAB, HDF5, Parquet and JSON.

Nothing is unpickled, and nothing outside of the file is read.
"""

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.errors import RecordingError, require_extras
from holdfast.io.importers.columns import Columns
from holdfast.io.importers.reading import ForeignFile, recordings_of
from holdfast.io.importers.stored import StoredArray, StoredArrays, arrays_of_records, in_memory
from holdfast.io.importers.table import csv_files, natural_order
from holdfast.recordings import Recording
from holdfast.sensors import Sensor

TAKES_SENSORS = True
"""Whether `read` has the sensors, the columns and the report of `generic_csv.read`."""
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
TEXT_SUFFIXES = (".txt", ".log", "")
HEAD_SIZE = 4096
"""Size of the start of a text in which the first line of JSON must be [bytes]."""

_NOT_STORED = "is no array stored in this file; links to other places and files are refused"
_JSON_LINE = re.compile(rb'^(?:\xef\xbb\xbf)?\{\s*"', re.MULTILINE)


def can_read(path: Path) -> bool:
    """Return whether `path` is a file with arrays, or a folder with one."""
    return any(map(_has_arrays, _files(path)))


def parts(path: Path) -> list[Path]:
    """Return the file, or the files with arrays of a folder.

    Raises:
        RecordingError: there is none.
    """
    if not (files := _files(path)):
        raise RecordingError(
            f"no file with arrays in {path}; {', '.join(sorted(_READERS))} expected"
        )
    return files


def read(
    path: Path,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | None = None,
    report: Callable[[str], None] = lambda _: None,
    *,
    accept: bool = False,
) -> Iterator[Recording]:
    """Yield the recordings in a file with arrays; see `recordings_of`.

    Raises:
        RecordingError: it cannot be read, or has no such array.
    """
    if not path.stat().st_size:
        raise RecordingError(f"{path} is empty; arrays of numbers expected")
    try:
        arrays = _READERS.get(path.suffix.lower(), arrays_of_json)(path)
    except ValueError as cause:
        if "allow_pickle" in str(cause):  # NumPy stores objects as pickles
            refuse_pickle(path)
        raise
    yield from recordings_of(
        ForeignFile(path, arrays), sensors or {}, columns, report, accept=accept
    )


def _files(path: Path) -> list[Path]:
    """Return the file, or the files with arrays in a folder that has no CSV files."""
    if path.is_file():
        return [path]
    files = path.glob("*") if not csv_files(path) else ()
    return sorted(
        (file for file in files if file.is_file() and _has_arrays(file)), key=natural_order
    )


def _has_arrays(file: Path) -> bool:
    """Return whether a file has arrays, by its suffix; other text has lines that are JSON."""
    if file.suffix.lower() in _READERS:
        return True
    if file.suffix.lower() not in TEXT_SUFFIXES:
        return False
    with file.open("rb") as content:
        return _JSON_LINE.search(content.read(HEAD_SIZE)) is not None


def arrays_of_npy(path: Path) -> StoredArrays:
    """Return the array of a file of NumPy, or the arrays of its fields."""
    values = np.load(path, allow_pickle=False)
    fields = values.dtype.names
    return _flat({name: values[name] for name in fields} if fields else {path.stem: values})


def arrays_of_npz(path: Path) -> StoredArrays:
    """Return the arrays of an archive of NumPy."""
    with np.load(path, allow_pickle=False) as content:
        return _flat(dict(content))


def arrays_of_matlab(path: Path) -> StoredArrays:
    """Return the arrays of a file of MATLAB; from version 7.3 on it is HDF5."""
    with path.open("rb") as file:
        head = file.read(128)
    if head.startswith(b"MATLAB 7.3") or head.startswith(HDF5_MAGIC):
        return arrays_of_hdf5(path, is_transposed=head.startswith(b"MATLAB 7.3"))
    require_extras("label")  # scipy
    from scipy.io import loadmat

    content = loadmat(path, simplify_cells=True)
    return _flat({name: values for name, values in content.items() if not name.startswith("__")})


def arrays_of_hdf5(path: Path, *, is_transposed: bool = False) -> dict[str, StoredArray]:
    """Return the arrays of numbers in an HDF5 file, and the numbers in attributes, by path.

    Only what is inside of the file itself is read: HDF5 can also store the names of other files
    (external links, external storage, virtual arrays), and would read any file of the user.

    Args:
        path: path of the file.
        is_transposed: whether axes are in reverse order, as MATLAB writes them.
    """
    require_extras("hdf5")
    import h5py

    file = h5py.File(path, "r")  # open until the process has read what it needs
    arrays: dict[str, StoredArray] = {}
    waiting: list[tuple[str, Any]] = [("", file["/"])]
    while waiting:
        name, group = waiting.pop()
        for key, value in group.attrs.items():
            if np.ndim(value) == 0 and np.asarray(value).dtype.kind in "iuf":
                arrays[f"{name}/{key}"] = in_memory(np.asarray(value))
        if isinstance(group, h5py.Dataset):
            arrays |= _of_dataset(path, name, group, is_transposed=is_transposed)
            continue
        for key in group:
            inside = f"{name}/{key}".lstrip("/")
            if not isinstance(group.get(key, getlink=True), h5py.HardLink):
                arrays[inside] = _refused(f"{path}: {inside} {_NOT_STORED}")
            elif not key.startswith("#"):  # what MATLAB refers to
                waiting.append((inside, group[key]))
    return arrays


def _refused(text: str) -> StoredArray:
    """Return an array that cannot be read."""

    def refuse() -> npt.NDArray[Any]:
        raise RecordingError(text)

    return StoredArray((), "O", refuse)


def _of_dataset(
    path: Path,
    name: str,
    dataset: Any,  # noqa: ANN401 (h5py.Dataset)
    *,
    is_transposed: bool,
) -> dict[str, StoredArray]:
    """Return the arrays of a dataset: one, or one for each field; none if it holds no numbers."""
    import h5py

    shape = tuple(reversed(dataset.shape or ())) if is_transposed else dataset.shape

    def values(field: str | None) -> npt.NDArray[Any]:
        if dataset.is_virtual or dataset.external:
            raise RecordingError(f"{path}: {name} {_NOT_STORED}")
        array = np.asarray(dataset[() if field is None else field])
        if array.dtype.kind == "O":
            array = np.array([text.decode(errors="replace") for text in array.ravel()])
        return array.transpose() if is_transposed else array

    if dataset.dtype.names:
        return {
            f"{name}/{field}": StoredArray(
                shape + dataset.dtype[field].shape, dataset.dtype[field].base.kind,
                lambda field=field: values(field),  # type: ignore[misc]
            )
            for field in dataset.dtype.names
        }  # fmt: skip
    is_text = h5py.check_string_dtype(dataset.dtype) is not None and len(shape or ()) == 1
    if shape is None or not (is_text or dataset.dtype.kind in "biuf"):
        return {}
    kind = "U" if is_text else dataset.dtype.kind
    return {name: StoredArray(shape, kind, lambda: values(None))}


def arrays_of_parquet(path: Path) -> StoredArrays:
    """Return all columns of a Parquet file that `arrays_of_columns` reads."""
    require_extras("parquet")
    import pyarrow.parquet as pq

    file = pq.ParquetFile(path)
    return arrays_of_columns(path, file, file.schema_arrow.names)


def arrays_of_columns(path: Path, file: Any, names: list[str]) -> dict[str, StoredArray]:  # noqa: ANN401
    """Return columns of numbers, of texts, and of lists of numbers, in a Parquet file.

    Args:
        path: path of the file.
        file: `pyarrow.parquet.ParquetFile`.
        names: of the columns.
    """
    import pyarrow as pa

    def is_number(kind: Any) -> bool:  # noqa: ANN401 (pyarrow.DataType)
        while pa.types.is_nested(kind) and hasattr(kind, "value_type"):
            kind = kind.value_type
        return bool(pa.types.is_primitive(kind) or pa.types.is_boolean(kind))

    schema = file.schema_arrow
    wanted = [
        name
        for name in names
        if is_number(schema.field(name).type) or pa.types.is_string(schema.field(name).type)
    ]
    arrays: dict[str, StoredArray] = {}
    table = file.read(columns=wanted, use_threads=False)
    for name in wanted:
        column = table[name].combine_chunks()
        if column.null_count and hasattr(column.type, "value_type"):
            shape = next((np.shape(cell.as_py()) for cell in column if cell.is_valid), ())
            empty = np.full(shape, np.nan).tolist()
            column = pa.array([empty if cell is None else cell for cell in column.to_pylist()])
        lengths = [len(column)]
        while hasattr(column.type, "value_type"):
            n_before = len(column)
            column = column.flatten()
            if column.null_count or len(column) % max(n_before, 1):
                break
            lengths.append(len(column) // max(n_before, 1))
        else:
            values = column.to_numpy(zero_copy_only=False)
            values = values.astype(str) if values.dtype.kind == "O" else values
            arrays[name] = in_memory(values.reshape(lengths))
    return arrays


def arrays_of_json(path: Path) -> StoredArrays:
    """Return the arrays in lines of JSON, or in one document: a record, or a list of records."""
    text = path.read_text(encoding="utf-8-sig")
    try:
        document = json.loads(text)
    except json.JSONDecodeError:
        records: list[dict[str, Any]] = []
        lines = [line for line in text.splitlines() if line.startswith("{")]
        for number, line in enumerate(lines, start=1):
            try:
                records.append(json.loads(line))
            except json.JSONDecodeError as cause:
                # The last one may be cut, as a killed logger leaves it.
                if number < len(lines):
                    raise RecordingError(f"{path}: record {number} is damaged: {cause}") from cause
        return arrays_of_records(records)
    if isinstance(document, list):
        return arrays_of_records(record for record in document if isinstance(record, dict))
    return _flat(document)


def refuse_pickle(path: Path) -> StoredArrays:
    """Refuse a pickle, and name what to do instead.

    Raises:
        RecordingError: always.
    """
    raise RecordingError(
        f"{path} is a pickle, which can run code and is not read: load it in Python and save its "
        f"arrays with numpy.savez({path.stem + '.npz'!r}, **arrays), then import {path.stem}.npz"
    )


def _flat(content: Any, path: str = "") -> dict[str, StoredArray]:  # noqa: ANN401 (any content)
    """Return the arrays in records and lists, by path."""
    if isinstance(content, Mapping):
        pairs = [(str(key), item) for key, item in content.items()]
    else:
        with suppress(ValueError):  # values of several shapes, or records
            values = np.asarray(content)
            if values.dtype.kind in "biufUM":
                return {path: in_memory(values)}
        pairs = [(str(k), item) for k, item in enumerate(content)] if np.ndim(content) else []
    return {
        name: array
        for key, item in pairs
        for name, array in _flat(item, f"{path}/{key}" if path else key).items()
    }


_READERS: dict[str, Callable[[Path], StoredArrays]] = {
    ".npy": arrays_of_npy,
    ".npz": arrays_of_npz,
    ".mat": arrays_of_matlab,
    **dict.fromkeys((".h5", ".hdf5", ".hdf", ".he5"), arrays_of_hdf5),
    **dict.fromkeys((".parquet", ".pq"), arrays_of_parquet),
    **dict.fromkeys((".jsonl", ".ndjson", ".json"), arrays_of_json),
    **dict.fromkeys((".pkl", ".pickle", ".joblib"), refuse_pickle),
}
