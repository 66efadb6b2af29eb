"""How a stream begins: with an open hand, or in contact, so that its first samples are load."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from holdfast.features.tare import Tare
from holdfast.recordings import BASELINES, STARTS_LOADED
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array


@dataclass(frozen=True)
class Start:
    """How the samples of a recording or a source begin.

    Attributes:
        loaded: whether the first samples are load, and not an open hand.
        baselines: (n_taxels, 3) readings without contact by finger, where they are known [unit of
            the readings].

    Example:
        >>> Start.of({"starts_loaded": True}, {}).loaded, Start.of({}, {}).loaded
        (True, False)
    """

    loaded: bool = False
    baselines: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def of(cls, metadata: Mapping[str, Any], sensors: Mapping[str, Sensor]) -> Self:
        """Return the start that the metadata of a recording or a source declare.

        Args:
            metadata: `starts_loaded`, and `baselines` by finger.
            sensors: sensor of each finger.

        Raises:
            ValueError: the baselines are no finite numbers of the sensors' shapes.
        """
        if metadata.get(STARTS_LOADED) is not True:
            return cls()
        return cls(loaded=True, baselines=declared_baselines(metadata, sensors))

    def used_tare(self, tare: Tare, sensors: Mapping[str, Sensor]) -> Tare:
        """Return the tare of a model, or what takes its place if the first samples are load.

        It is none where the zero of every finger is known: it is declared, or the readings are in
        newtons. Counts have an offset that the readings do not show; they are counted from the
        first sample. A tare that does not rest on the first samples stays.

        Args:
            tare: of the model.
            sensors: sensor of each finger.
        """
        if not self.loaded or tare.kind in ("none", "interval"):
            return tare
        known = all(name in self.baselines or s.unit == "N" for name, s in sensors.items())
        return Tare("none" if known else "first")


OPEN_HAND = Start()
"""Start of a stream whose first samples are without contact."""


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
    for finger in [finger for finger in sensors if finger in stated]:
        try:
            baseline = np.array(stated[finger], dtype=np.float64)
        except (TypeError, ValueError):
            baseline = np.empty(0)  # words, or rows of different lengths: refused by its shape
        n_taxels = sensors[finger].n_taxels
        if baseline.shape != (n_taxels, 3) or not np.isfinite(baseline).all():
            raise ValueError(
                f"metadata: {BASELINES} of {finger}: {n_taxels} taxels of 3 finite numbers "
                f"expected, an array of shape {baseline.shape} given"
            )
        baselines[finger] = baseline
    return baselines
