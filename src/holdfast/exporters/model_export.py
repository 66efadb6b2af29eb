"""Export of a model to a C99 header, which other programs use."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from holdfast.detection import ANY_FINGER, Model
from holdfast.detection.c_header import CHeader, header_of
from holdfast.detection.plan import Start
from holdfast.errors import ModelError, missing_part
from holdfast.files import refuse_overwrite, write_whole
from holdfast.recordings import Recording
from holdfast.sensors import Sensor, sensor

HEADER_SUFFIX = ".h"


class ExportedModel(NamedTuple):
    """Facts about the file that was written.

    Attributes:
        path: of the file.
        fingers: their names, in the order of the readings.
        size: of the file [bytes].
        header: the header.
    """

    path: Path
    fingers: tuple[str, ...]
    size: int
    header: CHeader


def export(
    model: Model,
    path: str | Path,
    like: Recording | None = None,
    *,
    fingers: Mapping[str, Sensor] | None = None,
    single: bool = False,
    in_contact: bool | None = None,
    force: bool = False,
) -> ExportedModel:
    """Write a model as a C99 header (`.h`).

    The header has tare, features, faults and decision rule: it gives what `Detector` gives.

    Args:
        model: the model.
        path: of the output.
        like: recording with the fingers, sensors and rate of the hand.
        fingers: sensor of each finger instead of a recording; by default those that the model
            names.
        single: numbers of the header are of single precision; times stay double.
        in_contact: the first samples are load; None if the metadata of the recording say it.
        force: replace an existing file.

    Raises:
        ModelError: a part of the model cannot be exported, or the fingers do not fit.
        OutputError: the file exists and `force` is not given, or it cannot be written.
        HoldfastError: holdfast 0.3.0 had the format of the suffix.
        ValueError: the suffix is another one.
    """
    target = Path(path)
    refuse_overwrite(target, force=force)
    if target.suffix != HEADER_SUFFIX:
        name = target.suffix[1:]
        raise missing_part("exporters", name, f"the format {name}") or ValueError(
            f"{target}: a model is exported as {HEADER_SUFFIX} (C99)"
        )
    if like is None:
        sensors = named_fingers(model) if fingers is None else dict(fingers)
        rate, start = next(iter(model.fingers_of(sensors).values())).rate, Start(in_contact is True)
    else:
        sensors, rate = _fingers_like(model, like), like.rate
        start = Start.of(like.with_start(loaded=in_contact).metadata, sensors)
    header = header_of(model, sensors, rate, single=single, start=start)
    data = header.text.encode()
    write_whole(target, data, force=force)
    return ExportedModel(target, tuple(model.fingers_of(sensors)), len(data), header)


def named_fingers(model: Model) -> dict[str, Sensor]:
    """Return the fingers that a model names, with their sensors.

    Raises:
        ModelError: the model is for any finger or sensor.
    """
    if ANY_FINGER in model.fingers or any(f.sensor is None for f in model.fingers.values()):
        raise ModelError(
            "the model is for any finger: a recording of the hand (--like), or its sensor and its "
            "fingers (--sensor NAME --fingers N), are expected"
        )
    return {name: model.sensors[str(part.sensor)] for name, part in model.fingers.items()}


def fingers_of_sensor(name: str, fingers: str) -> dict[str, Sensor]:
    """Return fingers of one sensor: so many, or with names.

    Args:
        name: of the sensor.
        fingers: a number, or names with commas between them.

    Raises:
        ValueError: the sensor is unknown, or the fingers are neither of these.

    Example:
        >>> list(fingers_of_sensor("uskin-curved", "2"))
        ['finger1', 'finger2']
    """
    used = sensor(name)
    names: Sequence[str] = [word.strip() for word in fingers.split(",")]
    if fingers.strip().isdecimal() and int(fingers) > 0:
        names = [f"finger{n + 1}" for n in range(int(fingers))]
    if not all(names) or len(set(names)) < len(names) or names == ["0"]:
        raise ValueError(
            f"fingers: a number from 1 on or different names with commas expected; {fingers!r} "
            "given"
        )
    return dict.fromkeys(names, used)


def _fingers_like(model: Model, like: Recording) -> dict[str, Sensor]:
    """Return the fingers of the model on the hand of a recording, which must have all of them."""
    sensors = model.fingers_of({name: m.sensor for name, m in like.modules.items()})
    missing = [name for name in sensors if name not in like.modules]
    if missing:
        raise ModelError(
            f"recording {like.name!r} has {', '.join(like.modules)}; the model is for "
            f"{', '.join(sensors)}: a recording with all of them expected"
        )
    if not model.rate_fits(like.rate):
        raise ModelError(
            f"recording {like.name!r} has {like.rate:.4g} Hz, the model expects {model.rate:.4g} "
            "Hz: a header does not resample; a recording at the rate of the model expected"
        )
    return sensors
