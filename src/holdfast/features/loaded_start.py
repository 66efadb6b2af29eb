"""Streams that begin in contact: the first samples are load, and not an open hand."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from holdfast.features.tare import Tare
from holdfast.recordings import BASELINES, STARTS_LOADED
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array


def begins_in_contact(metadata: Mapping[str, Any], declared: bool | None = None) -> bool:
    """Return whether the first samples are load: as declared, else as the metadata say.

    Example:
        >>> begins_in_contact({"starts_loaded": True}), begins_in_contact({}, declared=True)
        (True, True)
    """
    if declared is not None:
        return declared
    return metadata.get(STARTS_LOADED) is True


def declared_baselines(
    metadata: Mapping[str, Any], sensors: Mapping[str, Sensor]
) -> dict[str, Array]:
    """Return the readings without contact that the metadata declare, for some of the fingers.

    Args:
        metadata: of a recording or a source.
        sensors: sensor of each finger.

    Returns:
        (n_taxels, 3) by finger [unit of the readings].

    Raises:
        ValueError: they are no finite numbers of that shape.
    """
    stated = metadata.get(BASELINES)
    if stated is None:
        return {}
    if not isinstance(stated, Mapping):
        raise ValueError(f"metadata: {BASELINES} by finger expected, {type(stated).__name__} given")
    baselines = {}
    for finger, sensor in sensors.items():
        if finger not in stated:
            continue
        try:
            baseline = np.array(stated[finger], dtype=np.float64)
        except (TypeError, ValueError):
            baseline = np.empty(0)  # words, or rows of different lengths: refused by its shape
        if baseline.shape != (sensor.n_taxels, 3) or not np.isfinite(baseline).all():
            raise ValueError(
                f"metadata: {BASELINES} of {finger}: {sensor.n_taxels} taxels of 3 finite numbers "
                f"expected, an array of shape {baseline.shape} given"
            )
        baselines[finger] = baseline
    return baselines


def loaded_tare(tare: Tare, sensors: Mapping[str, Sensor], baselines: Sequence[str]) -> Tare:
    """Return the tare of a stream that begins in contact.

    It is none where the zero of every finger is known: it is declared, or the readings are in
    newtons. Counts have an offset that the readings do not show; they are counted from the first
    sample. A tare that does not rest on the first samples stays.

    Args:
        tare: of the model.
        sensors: sensor of each finger.
        baselines: fingers with a declared baseline.
    """
    if tare.kind in ("none", "interval"):
        return tare
    known = all(name in baselines or sensor.unit == "N" for name, sensor in sensors.items())
    return Tare("none" if known else "first")
