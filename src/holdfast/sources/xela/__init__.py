"""XELA's server as a source: `xela://HOST:PORT` or `xela://auto`."""

from holdfast.sensors import Sensor, built_in_sensors, sensor
from holdfast.sources.source import Source
from holdfast.sources.uri import Address

VALUES = ("counts", "calibrated")
"""What can be taken from a packet: uint16 counts, or newtons where the server has them."""


def source(address: Address) -> Source:
    """The source at a URI; entering it connects.

    `xela://HOST:PORT`, by default `xela://127.0.0.1:5000`; `xela://auto` tries this machine's
    own addresses. Parameters: `values=counts` or `values=calibrated`, `fingers=1:thumb,2:index`
    names the server's sensors, `sensor=FILE.json` (or a built-in name) tells where the taxels
    of a sensor sit that is not known.

    Raises:
        ValueError: the address or a parameter is not of that form.
        OSError: the sensor's file cannot be read.
    """
    from holdfast.sources.xela.client import XelaSource
    from holdfast.sources.xela.places import places

    address.only("values", "fingers", "sensor")
    values = address.parameters.get("values", VALUES[0])
    if values not in VALUES:
        raise ValueError(f"{address.text}: values={' or '.join(VALUES)} expected, {values!r} given")
    return XelaSource(
        address.text,
        places(address),
        address.names(),
        calibrated=values == "calibrated",
        sensor=_sensor(address),
    )


def _sensor(address: Address) -> Sensor | None:
    given = address.parameters.get("sensor")
    if given is None:
        return None
    if given in built_in_sensors():
        return sensor(given)
    if not given.endswith(".json"):
        raise ValueError(
            f"{address.text}: sensor=FILE.json or one of {', '.join(built_in_sensors())} "
            f"expected, {given!r} given"
        )
    return Sensor.from_json(given)
