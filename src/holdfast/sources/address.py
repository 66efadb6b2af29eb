"""The parts of a URI, and what the parameters that several sources share say."""

from collections.abc import Mapping
from dataclasses import dataclass

from holdfast.sensors import Sensor, built_in_sensors, sensor

VALUES = ("counts", "calibrated")
"""What can be taken from a packet: uint16 counts, or newtons where the device has them."""


@dataclass(frozen=True)
class Address:
    """The parts of a URI.

    Attributes:
        text: the whole of it.
        host: and the port, as given: "127.0.0.1:5000".
        path: after the host.
        parameters: by name.
    """

    text: str
    host: str
    path: str
    parameters: Mapping[str, str]

    def only(self, *known: str) -> None:
        """Refuses parameters that are not known.

        Raises:
            ValueError: there is one.
        """
        if unknown := sorted(set(self.parameters) - set(known)):
            raise ValueError(
                f"{self.text}: unknown parameter {', '.join(unknown)}; there are {', '.join(known)}"
            )

    def names(self) -> dict[int, str]:
        """What `fingers=1:thumb,2:index` calls the modules that the device numbers.

        Raises:
            ValueError: it is not of that form, or names one twice.
        """
        given = self.parameters.get("fingers", "")
        names: dict[int, str] = {}
        for part in filter(None, given.split(",")):
            number, _, name = part.partition(":")
            if not (number.strip().isdecimal() and name.strip()):
                raise ValueError(f"{self.text}: fingers=1:thumb,2:index expected, {given!r} given")
            if int(number) in names or name.strip() in names.values():
                raise ValueError(f"{self.text}: a name for each finger expected, {given!r} given")
            names[int(number)] = name.strip()
        return names

    def calibrated(self) -> bool:
        """Whether `values=calibrated` asks for newtons, instead of `values=counts`.

        Raises:
            ValueError: it is neither.
        """
        values = self.parameters.get("values", VALUES[0])
        if values not in VALUES:
            raise ValueError(
                f"{self.text}: values={' or '.join(VALUES)} expected, {values!r} given"
            )
        return values == "calibrated"

    def sensor(self) -> Sensor | None:
        """What `sensor=FILE.json`, or the name of one that is built in, gives; None if neither.

        Raises:
            ValueError: there is no such sensor.
        """
        given = self.parameters.get("sensor")
        if given is None:
            return None
        if not given.endswith(".json") and given not in built_in_sensors():
            raise ValueError(
                f"{self.text}: sensor=FILE.json or one of {', '.join(built_in_sensors())} "
                f"expected, {given!r} given"
            )
        try:
            return Sensor.from_json(given) if given.endswith(".json") else sensor(given)
        except OSError as cause:
            raise ValueError(f"{self.text}: cannot read {given}: {cause.strerror}") from cause
        except ValueError as cause:
            raise ValueError(f"{self.text}: {cause}") from cause
