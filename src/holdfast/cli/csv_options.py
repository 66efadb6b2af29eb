"""CSV files as input of a verb: the options for them, and the messages of the importer."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import RARE
from holdfast.cli.terminal.console import print_message

if TYPE_CHECKING:
    from holdfast.labelling.review.findings import Finding
    from holdfast.recordings import Recording
    from holdfast.sensors import Sensor

CSV_FORMAT = "csv"

SensorsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--sensor",
        "--array",
        "--topic",
        metavar="NAME|FILE.json",
        help="Sensor of a CSV file, array or topic: a name of `holdfast sensors` or a file; "
        "MODULE=NAME, ARRAY=NAME or /TOPIC=NAME for one. May be repeated.",
    ),
]
ColumnsOption = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="Columns of a CSV file, by names or numbers: time=COLUMN[:ms] or time=100Hz, "
        "taxels=PATTERN, as F{axis}{taxel} or 2..16; also label=, module=, episode=.",
        show_default="guessed from the header",
    ),
]


@dataclass(frozen=True)
class CsvOptions:
    """Group of options: the sensor and the columns of a CSV file that is read directly."""

    sensor: SensorsOption = None
    columns: Annotated[ColumnsOption, RARE] = None

    def fits(self, source: str) -> bool:
        """Return whether a source is read as CSV: by its suffix, or because an option is given.

        Raises:
            ValueError: an option is given for a recording of holdfast, or for a live source.
        """
        from holdfast.devices.uri import is_uri
        from holdfast.io.file_formats import SUFFIXES

        suffix = Path(source).suffix.lower()
        if not self.sensor and self.columns is None:
            return suffix == f".{CSV_FORMAT}" and not is_uri(source)
        # These files and sources name their sensors.
        if is_uri(source) or suffix in SUFFIXES:
            raise ValueError(f"--sensor and --columns are for CSV files; {source} given")
        return True

    def read(self, path: Path) -> "list[Recording]":
        """Read the recordings in a CSV file, or in a folder of them, with the importer's messages.

        Raises:
            RecordingError: there is none, or one has another form or no sensor.
            ValueError: a module has two sensors, or a sensor or the columns are not valid.
        """
        from holdfast.io.importers import import_hint, import_recordings
        from holdfast.labelling.review.findings import findings_of

        sensors = parse_sensors(self.sensor or ())
        guesses: list[str] = []  # kept back, so that a missing sensor is one line
        report = print_message if sensors else guesses.append
        name = None if sensors else CSV_FORMAT
        imported = import_recordings(
            path, name, sensors=sensors, columns=self.columns, report=report
        )
        recordings = list(imported)
        for guess in guesses:
            print_message(guess)
        report_findings((recording.name, findings_of(recording)) for recording in recordings)
        print_message(f"hint: {import_hint(CSV_FORMAT)}")
        return recordings


def parse_sensors(texts: Sequence[str]) -> "dict[str, Sensor]":
    """Return the sensors of `--sensor` by module; `"*"` is that of all others.

    Raises:
        ValueError: a module has two sensors, or a sensor is unknown or not valid.
    """
    from holdfast.sensors.files import find_sensor

    sensors: dict[str, Sensor] = {}
    for text in texts:
        module, equals, name = text.rpartition("=")
        if (key := module if equals else "*") in sensors:
            raise ValueError(f"--sensor: two sensors given for {module or 'all modules'}")
        sensors[key] = find_sensor(name)
    return sensors


def report_findings(recordings: "Iterable[tuple[str, Iterable[Finding]]]") -> None:
    """Print each kind of finding once, for the first recording that has it, by its name."""
    by_kind: dict[str, list[tuple[str, Finding]]] = {}
    for name, findings in recordings:
        for kind, finding in {finding.kind: finding for finding in findings}.items():
            by_kind.setdefault(kind, []).append((name, finding))
    # A hundred files of one logger have the same finding: one line names the first.
    for pairs in by_kind.values():
        name, finding = pairs[0]
        module = f"{finding.module}: " if finding.module else ""
        more = f" (and {len(pairs) - 1} more)" if len(pairs) > 1 else ""
        print_message(f"{name}{more}: {module}{finding.text}")
