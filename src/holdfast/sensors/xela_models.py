"""What XELA's servers call their sensors, and which of ours that is."""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.sensors import Hand, Sensor, hand, sensor
from holdfast.sensors.layouts import UINT16

_HANDS = {"xr23ahlcpp": "allegro-uskin", "xr23ahrcpp": "allegro-uskin"}
_SENSORS = {
    "uscuah": "uskin-curved",
    "uscualha": "uskin-curved",
    "usftah": "uskin-4x4",
    "uspa44": "uskin-4x4",
    "xr1844": "uskin-4x4",
    "xr1944": "uskin-4x4",
    "uspa46": "uskin-4x6",
    "xr1946": "uskin-4x6",
}
_BY_TAXELS = {16: "uskin-4x4", 24: "uskin-4x6", 30: "uskin-curved"}
_PITCH = 7.25e-3
"""Of the 4 x 6 patch [m]; nominal for patches of which no drawing is at hand."""


def module_sensors(model: str, n_taxels: int) -> dict[str, Sensor]:
    """Sensors of a device by module; of a device that is no hand, one that is called ''.

    A model that nobody knows is taken for the built-in sensor with as many taxels, or for a
    flat line of taxels: its fingertip force is right where its taxels point the same way.

    Args:
        model: as the server calls it, in any case.
        n_taxels: as it sends.

    Raises:
        ValueError: there are no taxels, or the model has another number of them.

    Example:
        >>> [len(module_sensors("XR23AHRCPP", 368)), module_sensors("uSPa46", 24)[""].name]
        [18, 'uskin-4x6']
    """
    if n_taxels < 1:
        raise ValueError(f"{model or 'a sensor'} with {n_taxels} taxels given; at least 1 expected")
    known = whole_hand(model)
    if known is not None:
        _check(model, n_taxels, known.n_taxels, known.name)
        return {name: module.sensor for name, module in known.modules.items()}
    if (name := _SENSORS.get(model.lower())) is not None:
        built_in = sensor(name)
        _check(model, n_taxels, built_in.n_taxels, name)
        return {"": built_in}
    if n_taxels in _BY_TAXELS:
        return {"": sensor(_BY_TAXELS[n_taxels])}
    return {"": _flat(model.lower() or "unknown", n_taxels)}


def whole_hand(model: str) -> Hand | None:
    """The hand that reports in one packet under that model's name, if it is one."""
    name = _HANDS.get(model.lower())
    return None if name is None else hand(name)


def split(model: str, flat: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
    """Readings by module of (..., n_taxels, 3) of a device; see `module_sensors`."""
    known = whole_hand(model)
    return {"": flat} if known is None else known.split(flat)


def _check(model: str, n_given: int, n_expected: int, name: str) -> None:
    if n_given != n_expected:
        raise ValueError(f"{n_given} taxels given, {n_expected} expected ({model}: {name})")


@cache
def _flat(name: str, n_taxels: int) -> Sensor:
    places = np.zeros((n_taxels, 3))
    places[:, 0] = (np.arange(n_taxels) - (n_taxels - 1) / 2) * _PITCH
    turns = np.tile(np.eye(3), (n_taxels, 1, 1))
    return Sensor(name, places, turns, np.array([0.0, 0.0, 1.0]), rate=100.0, limits=UINT16)
