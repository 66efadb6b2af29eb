"""Files of other loggers as input of a verb: their options, and the messages of the importer."""

import re
import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.terminal.console import print_message

if TYPE_CHECKING:
    from holdfast.io.importers.columns import Columns
    from holdfast.io.proposals import ProposalError
    from holdfast.labelling.review.findings import Finding
    from holdfast.recordings import Recording
    from holdfast.sensors import Sensor

GRID = re.compile(r"[1-9]\d*x[1-9]\d*", re.IGNORECASE)
SENSOR_OPTIONS = ("--sensor", "--array", "--topic")
LAYOUT_OPTIONS = (*SENSOR_OPTIONS, "--columns", "--axes", "--unit")
"""Options that a proposed command replaces, with their values."""
ACCEPT = "--accept"


@dataclass(frozen=True)
class CsvOptions:
    """Group of options: the sensor and the layout of the numbers in a file of another logger."""

    sensor: Annotated[
        list[str] | None,
        typer.Option(
            *SENSOR_OPTIONS,
            metavar="NAME|FILE.json|ROWSxCOLUMNS",
            help="Sensor of a table, array or topic: a name of `holdfast sensors`, a file, or a "
            "grid such as 6x4 (with --unit); MODULE=NAME, ARRAY=NAME or /TOPIC=NAME for one. May "
            "be repeated.",
        ),
    ] = None
    columns: Annotated[
        str | None,
        typer.Option(
            help="Columns, by names or numbers: time=COLUMN[:ms] or time=100Hz, taxels=FIRST..LAST,"
            " such as 2..16; module=, episode=, label=; missing=, wrap=, decimal=.",
            show_default="as the header says",
        ),
    ] = None
    axes: Annotated[
        str | None,
        typer.Option(
            help="Numbers of each taxel that are x, y and z, from 1, such as 2,3,4; a minus turns "
            "the sign (--axes=-1,2,3).",
            show_default="1,2,3",
        ),
    ] = None
    unit: Annotated[
        str | None,
        typer.Option(
            help="Unit of the readings: N, mN, g, count, uT or mT.",
            show_default="that of the header, else of the sensor",
        ),
    ] = None
    accept: Annotated[
        bool, typer.Option(ACCEPT, help="Take the layout that is proposed, as it stands.")
    ] = False

    def fits(self, source: str) -> bool:
        """Return whether a source is a file of another logger, or an option for one is given.

        Raises:
            ValueError: an option is given for a recording of holdfast, or for a live source.
        """
        from holdfast.devices.uri import is_uri
        from holdfast.io.file_formats import SUFFIXES, is_recording

        path = Path(source)
        if not (self.sensor or self.layout or self.accept):
            return not is_uri(source) and path.is_file() and not is_recording(path)
        # These files and sources name their sensors.
        if is_uri(source) or is_recording(path) or (path.suffix in SUFFIXES and not path.exists()):
            raise ValueError(
                f"--sensor and --columns are for files of other loggers; {source} given"
            )
        return True

    @property
    def layout(self) -> "Columns | None":
        """The layout that the options describe; None without one.

        Raises:
            ValueError: an option has another form.
        """
        from holdfast.io.importers.columns import Columns

        layout = Columns.parse(self.columns, self.axes, self.unit)
        return None if layout == Columns() else layout

    def sensors(self) -> "dict[str, Sensor]":
        """Return the sensors by module; the key `"*"` stands for all other modules.

        Raises:
            ValueError: a module has two sensors, or a sensor is unknown or not valid.
        """
        from holdfast.io.importers.columns import READING_UNITS
        from holdfast.sensors.files import find_sensor, grid_sensor

        sensors: dict[str, Sensor] = {}
        for key, name in sensor_texts(self.sensor or ()):
            if key in sensors:
                raise ValueError(
                    f"--sensor: two sensors given for {key if key != '*' else 'all modules'}"
                )
            if GRID.fullmatch(name) is None:
                sensors[key] = find_sensor(name)
            elif self.unit is None:
                raise ValueError(
                    f"--sensor {name} needs the unit of the readings: --unit N or count"
                )
            else:
                kept = "N" if self.unit in READING_UNITS["N"] else "count"
                sensors[key] = grid_sensor(name, unit=kept)
        return sensors

    def read(self, path: Path) -> "list[Recording]":
        """Read the recordings in a file, or in a folder of them, with the importer's messages.

        Raises:
            RecordingError: there is none, or one has another form or no sensor.
            ValueError: a module has two sensors, or a sensor or the layout are not valid.
        """
        from holdfast.io.importers import IF_Z_FALLS, import_recordings
        from holdfast.labelling.review.findings import findings_of

        imported = import_recordings(
            path, sensors=self.sensors(), columns=self.layout, report=print_message,
            accept=self.accept,
        )  # fmt: skip
        recordings = list(imported)
        report_findings((recording.name, findings_of(recording)) for recording in recordings)
        print_message(f"hint: {IF_Z_FALLS}")
        return recordings


def sensor_texts(texts: Sequence[str]) -> list[tuple[str, str]]:
    """Return module (or array, or topic) and name of the sensor of each `--sensor`."""
    parts = [text.rpartition("=") for text in texts]
    return [(module if equals else "*", name) for module, equals, name in parts]


def print_proposal(cause: "ProposalError", words: Sequence[str]) -> None:
    """Print what a file does not say, and the command that says it.

    Args:
        cause: the proposal.
        words: of the command line that was given, after `holdfast`.
    """
    kept, texts = [], []
    rest = iter(words)
    for word in rest:
        option, equals, value = word.partition("=")
        if option not in LAYOUT_OPTIONS:
            kept += [word] if word != ACCEPT else []
            continue
        value = value if equals else next(rest, "")
        texts += [value] if option in SENSOR_OPTIONS else []
    names = {
        key.replace(".", "/") if key.startswith("/") else key: name
        for key, name in sensor_texts(texts)
    }
    options = cause.proposal.options(names)
    if kept and kept[0] in ("info", "label"):  # these read recordings only
        verb = [word for word in kept if word not in cause.inputs]
        commands = [
            ["holdfast", "import", cause.inputs[0], "recordings", *options],
            ["holdfast", *verb, "recordings"],
        ]
    else:
        commands = [["holdfast", *kept, *options]]
    for line in ("holdfast: " + cause.proposal.text(commands)).split("\n"):
        print_message(line)


def refuse_foreign(paths: Sequence[Path]) -> None:
    """Propose the import of a file of another logger where recordings are expected.

    Raises:
        RecordingError: the text has the command that imports it.
    """
    from holdfast.errors import HoldfastError
    from holdfast.io.file_formats import is_recording
    from holdfast.io.importers import import_recordings
    from holdfast.io.proposals import ProposalError

    for path in paths:
        if not path.is_file() or is_recording(path):
            continue
        try:
            next(iter(import_recordings(path)))
        except ProposalError as cause:
            cause.inputs = (str(path),)
            raise
        except (HoldfastError, ValueError, StopIteration):
            continue  # the verb says what it expects
        command = shlex.join(["holdfast", "import", str(path), "recordings"])
        raise HoldfastError(f"{path} is no recording of holdfast: {command} makes one")


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
