"""Import of recordings in other formats; each format has a module, which is loaded by name.

Formats of plug-ins have such a module too, in another package. A module has `can_read(path)`,
`parts(path)`, `read(path)`, and perhaps `HINT`, a text for the person who imports, and `EXTRA`, the
extra of holdfast that it needs. A child process reads the recordings, see `foreign.py`.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from holdfast.errors import RecordingError, missing_part, require_extras
from holdfast.files import check_regular, is_lfs_pointer, refusal_of_lfs_pointer
from holdfast.io.foreign import read_foreign, read_foreign_poses
from holdfast.io.importers.columns import Columns
from holdfast.io.importers.table import SLIPPED, csv_files, name_prefixes
from holdfast.io.safe_reading import recording_errors
from holdfast.plugins import PluginGroup
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

FORMATS = {
    "xela-log": "CSV of a whole hand: a time column and 368 x 3 columns in flat taxel order",
    "csv": "the generic CSV of docs/importing.md, and CSV of any other logger",
    "arrays": "arrays of numbers in .npy, .npz, .mat, HDF5, Parquet or lines of JSON",
}
"""Formats that can be imported, with a description; they are detected in this order, those of
plug-ins after the first."""
BAG_SUFFIXES = (".bag", ".db3", ".mcap")
ZARR_MARKS = (".zgroup", ".zarray", "zarr.json")
IN_CONTACT = "the object is held from the first sample on (metadata: starts_loaded)"
IF_IN_CONTACT = (
    "if the hand already holds the object at the first sample, use `holdfast detect --in-contact`, "
    "and so in other verbs"
)
IF_Z_FALLS = f"{IF_IN_CONTACT}; if z falls when a taxel is pressed, give --axes 1,-2,-3"
HINTS = {"xela-log": IF_IN_CONTACT, "csv": IF_Z_FALLS, "arrays": IF_Z_FALLS}
"""Advice about the recordings of a format, for the person who imports them. Options are those of
`import`, unless another verb is named."""


def import_recordings(
    path: str | Path,
    format: str | None = None,  # noqa: A002 (as on the command line)
    *,
    labels: bool = True,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | str | None = None,
    report: Callable[[str], None] = lambda _: None,
    limited: bool = True,
    accept: bool = False,
) -> Iterator[Recording]:
    """Import the recordings in a file or folder of another format, one at a time.

    Args:
        path: path of the file or folder.
        format: one of `FORMATS`; by default it is detected from the content.
        labels: keep the labels in the data.
        sensors: sensor by module, or of `"*"` for all modules, of a CSV file of any logger; by
            array of another file, or by topic of a bag.
        columns: layout of such a file, as `Columns` or as the text of `--columns`. With `sensors`
            or `columns` the format is one of those that take them (`takes_sensors`).
        report: receives a text about what was read.
        limited: refuse a file that takes more than 1 GiB of memory, or 120 s of the processor for
            one recording, to read; False for large files of your own.
        accept: take the layout that is proposed for a file that does not say it.

    Yields:
        Recordings; each is read when the iterator reaches it.

    Raises:
        RecordingError: `path` does not exist, no format fits, or the data contradict the
            format. A `ProposalError` has the options that say a layout.
        MissingExtra: the format needs a package that is not installed.
        ValueError: there is no format of this name, `columns` is not valid, or `sensors` or
            `columns` are given for a format that does not take them.
    """
    path, layout = Path(path), Columns.parse(columns) if isinstance(columns, str) else columns
    name = _format_of(path, format, sensors, layout)
    with recording_errors(path):
        source = importer(name)
        if extra := extra_of(name):
            require_extras(extra)
        # The generic CSV itself gives names to the recordings of a folder.
        parts = {path: ""} if name == "csv" else name_prefixes(source.parts(path))

    # Not a generator itself: a wrong path is refused by the call, not by the first recording.
    def recordings() -> Iterator[Recording]:
        with recording_errors(path):
            for part, prefix in parts.items():
                if not part.is_dir():
                    check_regular(part)
                reader = read_foreign(
                    part, name, sensors, layout, report, limited=limited, accept=accept
                )
                for read in reader:
                    recording = replace(read, name=f"{prefix}{read.name}") if prefix else read
                    if labels:
                        yield recording
                        continue
                    modules = {key: replace(m, labels=()) for key, m in recording.modules.items()}
                    # The label of a whole recording is a field of its metadata.
                    facts = {
                        key: value for key, value in recording.metadata.items() if key != SLIPPED
                    }
                    yield replace(recording, modules=modules, metadata=facts)

    return recordings()


def import_parts(
    path: str | Path,
    format: str | None = None,  # noqa: A002 (as on the command line)
    *,
    sensors: Mapping[str, Sensor] | None = None,
    columns: Columns | str | None = None,
) -> tuple[str, list[Path]]:
    """Return the format of a file or folder, and its parts, which can be imported one by one.

    Args:
        path: as in `import_recordings`.
        format: as in `import_recordings`.
        sensors: as in `import_recordings`.
        columns: as in `import_recordings`.

    Returns:
        The format, and the files (or folders, or bags) of the recordings, in order.

    Raises:
        RecordingError: `path` does not exist, no format fits, or the folder has no such file.
        ValueError: as `import_recordings`.
    """
    path, layout = Path(path), Columns.parse(columns) if isinstance(columns, str) else columns
    name = _format_of(path, format, sensors, layout)
    with recording_errors(path):
        source = importer(name)
        more = (layout, sensors) if name == "csv" else ()
        parts: list[Path] = source.parts(path, *more)
    return name, parts


def read_poses(path: Path, bodies: Mapping[str, str]) -> dict[str, Array]:
    """Read the poses of bodies from a file or folder, in a child process.

    Args:
        path: path of the file or folder.
        bodies: name in the file of each body.

    Returns:
        For each body (n, 8): time [s], position [m], quaternion w x y z.

    Raises:
        RecordingError: no format fits, its importer has no poses, or a body is missing.
    """
    name = _format_of(path, None, None, None)
    if not hasattr(importer(name), "poses"):
        raise RecordingError(f"{path} is of the format {name}, from which no poses can be read")
    return read_foreign_poses(path, name, bodies)


def _format_of(
    path: Path, name: str | None, sensors: Mapping[str, Sensor] | None, columns: Columns | None
) -> str:
    """Return the format of a path, and check that the arguments fit together.

    Raises:
        RecordingError: the path does not exist, or no format fits.
        ValueError: there is no format of this name, or sensors or columns are given for another
            format than `csv`.
    """
    if name is not None and name not in FORMATS and name not in IMPORTER_PLUGINS.names():
        raise missing_part("importers", name, f"the format {name}") or ValueError(
            f"unknown format {name!r}; there are {', '.join(FORMATS)}{IMPORTER_PLUGINS.text()}"
        )
    if name is not None and name not in FORMATS:
        importer(name)
    if name is not None and (sensors or columns) and not takes_sensors(name):
        raise ValueError(f"--sensor and --columns belong to the format csv; {name!r} given")
    if not path.exists():
        raise RecordingError(f"{path} does not exist; a file or folder to import expected")
    _refuse_missing(path)
    with recording_errors(path):
        if not path.is_dir():
            check_regular(path)
        files = [path] if path.is_file() else sorted(path.iterdir())
        if not files:
            raise RecordingError(f"{path} is empty; a file or folder to import expected")
        for file in files:
            if is_lfs_pointer(file):  # the clone was made without the data
                raise RecordingError(refusal_of_lfs_pointer(file))
        if name is not None or not (sensors or columns):
            return name or _detected_format(path)
        # Of the formats that take sensors: CSV unless another is certain.
        if path.suffix.lower() == ".csv" or (path.is_dir() and csv_files(path)):
            return "csv"
        loaded = {plugin: IMPORTER_PLUGINS.load(plugin) for plugin in IMPORTER_PLUGINS.names()}
        loaded["arrays"] = importer("arrays")
        for other, source in loaded.items():
            if source is not None and takes_sensors(other) and source.can_read(path):
                return other
        return "csv"


def _refuse_missing(path: Path) -> None:
    """Refuse a file whose format needs a package that is not installed, or another program.

    Raises:
        HoldfastError: it is such a file.
    """
    name = "rosbag" if path.suffix in BAG_SUFFIXES or (path / "metadata.yaml").is_file() else ""
    name = "lerobot" if (path / "meta" / "info.json").is_file() else name
    missing = missing_part("importers", name, f"the format {name}")
    if missing and name not in IMPORTER_PLUGINS.names():
        raise missing
    if any((path / mark).is_file() for mark in ZARR_MARKS):
        values = f"zarr.open({str(path)!r})['data/tactile'][:]"
        raise RecordingError(
            f"{path} is a zarr folder, which is not read: write its arrays in Python, as "
            f"numpy.savez({path.stem + '.npz'!r}, tactile={values}, time=...), then import that"
        )


def takes_sensors(name: str) -> bool:
    """Return whether the importer of a format takes sensors, columns and a report."""
    return name == "csv" or getattr(importer(name), "TAKES_SENSORS", False)


def import_hint(name: str) -> str | None:
    """Return the hint of a format, from `HINTS` or from its plug-in; None without one."""
    hint: str | None = HINTS.get(name) or getattr(importer(name), "HINT", None)
    return hint


def extra_of(name: str) -> str | None:
    """Return the extra that a format needs; None without one."""
    extra: str | None = getattr(importer(name), "EXTRA", None)
    return extra


def importer(name: str) -> ModuleType:
    """Return the module of a format.

    Raises:
        ValueError: the plug-in of the format cannot be used.
    """
    if name not in FORMATS:
        plugin = IMPORTER_PLUGINS.load(name)
        if plugin is None:
            raise ValueError(f"the plug-in of {name} cannot be used; holdfast doctor says why")
        return plugin
    module = "generic_csv" if name == "csv" else name.replace("-", "_")
    return import_module(f"holdfast.io.importers.{module}")


def _detected_format(path: Path) -> str:
    """Return the format of a path: one of holdfast, of a plug-in, CSV, in this order."""
    first, *others = FORMATS
    for name in [first, *IMPORTER_PLUGINS.names(), *others]:
        source = importer(name) if name in FORMATS else IMPORTER_PLUGINS.load(name)
        if source is not None and source.can_read(path):
            return name
    if importer("csv").can_guess(path):
        return "csv"
    names = f"{', '.join(FORMATS)}{IMPORTER_PLUGINS.text()}"
    raise RecordingError(
        f"{path} is of no supported format; there are {names} "
        "(--format); for a table or arrays of any other logger give --sensor"
    )


def _plugin_importer(name: str, loaded: Any) -> ModuleType:  # noqa: ANN401
    """Return the module of a plug-in, with the functions that every importer has."""
    missing = [part for part in ("can_read", "parts", "read") if not hasattr(loaded, part)]
    if not isinstance(loaded, ModuleType) or missing:
        raise TypeError(
            f"a module with can_read, parts and read expected for {name}, {loaded!r} given"
        )
    return loaded


IMPORTER_PLUGINS = PluginGroup("importers", FORMATS, _plugin_importer)
"""Formats of other packages."""
