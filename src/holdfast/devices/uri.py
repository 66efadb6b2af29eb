"""Sources by name: the path of a recording, or a URI, also of a plug-in."""

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, urlsplit

from holdfast.errors import MissingExtra, install_command, missing_part, require_extras
from holdfast.plugins import PluginGroup
from holdfast.sensors import Sensor
from holdfast.sensors.files import find_sensor

if TYPE_CHECKING:
    from holdfast.devices.sources.base import Source

SCHEMES = {
    "xela": "XELA's server: xela://HOST:PORT or xela://auto, ?values=counts|calibrated",
    "twin": "the twin: twin:?object=can&seed=1&case=2&profile=reference",
    "serial": "a serial sensor: serial:///dev/ttyACM0?sensor=anyskin",
    "orca": "an ORCA Touch hand: orca:///dev/ttyUSB0?baud=921600",
}
"""URI schemes of the sources, with a description and an example of each."""
DEVICE_SCHEMES = ("xela", "serial", "orca")
"""Those of devices: the module `holdfast.devices.sources.<scheme>` has a function `source(address)`
that makes a source."""
VALUES = ("counts", "calibrated")
"""Readings to take from a packet: uint16 counts, or newtons if the device sends them."""

_SCHEME = re.compile(r"(?P<scheme>[a-z][a-z0-9+]+):")


@dataclass(frozen=True)
class Address:
    """Parts of the URI of a source.

    Attributes:
        text: the whole URI.
        host: host and port, as given: "127.0.0.1:5000".
        path: part after the host.
        parameters: values by name.
    """

    text: str
    host: str
    path: str
    parameters: Mapping[str, str]

    def only(self, *names: str) -> None:
        """Check that all parameters are known.

        Raises:
            ValueError: a parameter is not among `names`.
        """
        if unknown := sorted(set(self.parameters) - set(names)):
            raise ValueError(
                f"{self.text}: unknown parameter {', '.join(unknown)}; there are {', '.join(names)}"
            )

    def names(self) -> dict[int, str]:
        """Return the names of modules by their number, from `fingers=1:thumb,2:index`.

        Raises:
            ValueError: the parameter has another form, or a number or a name occurs twice.
        """
        text = self.parameters.get("fingers", "")
        names: dict[int, str] = {}
        for part in filter(None, text.split(",")):
            number, _, name = part.partition(":")
            if not (number.strip().isdecimal() and name.strip()):
                raise ValueError(f"{self.text}: fingers=1:thumb,2:index expected, {text!r} given")
            if int(number) in names or name.strip() in names.values():
                raise ValueError(f"{self.text}: a name for each finger expected, {text!r} given")
            names[int(number)] = name.strip()
        return names

    def calibrated(self) -> bool:
        """Return whether readings are taken in newtons: `values=calibrated`, not `counts`.

        Raises:
            ValueError: `values` is neither.
        """
        return self.choice("values", *VALUES) == "calibrated"

    def choice(self, name: str, *choices: str) -> str:
        """Return a parameter that has one of some values, by default the first.

        Raises:
            ValueError: it has another.
        """
        value = self.parameters.get(name, choices[0])
        if value not in choices:
            expected = " or ".join(choices)
            raise ValueError(f"{self.text}: {name}={expected} expected, {value!r} given")
        return value

    def integer(self, name: str, default: int, least: int = 0) -> int:
        """Return a parameter that is a whole number.

        Raises:
            ValueError: it is not, or is below `least`.
        """
        text = self.parameters.get(name, str(default))
        if not (text.isascii() and text.isdecimal() and int(text) >= least):
            expected = f"{name}={default}, a whole number of at least {least}"
            raise ValueError(f"{self.text}: {expected}, expected, {text!r} given")
        return int(text)

    def sensor(self) -> Sensor | None:
        """Return the sensor of `sensor=FILE.json` or `sensor=NAME`; None without the parameter.

        Raises:
            ValueError: there is no such file or sensor, or the file is not valid.
        """
        text = self.parameters.get("sensor")
        if text is None:
            return None
        try:
            return find_sensor(text)
        except OSError as cause:
            raise ValueError(f"{self.text}: cannot read {text}: {cause.strerror}") from cause
        except ValueError as cause:
            raise ValueError(f"{self.text}: {cause}") from cause


def parse(text: str) -> tuple[str, Address]:
    """Return the scheme of a URI and its parts.

    Raises:
        ValueError: the scheme is not known, or a parameter occurs twice or has no value.
        HoldfastError: the scheme is of a package that is not installed.

    Example:
        >>> parse("twin:?object=can")[1].parameters
        {'object': 'can'}
    """
    match = _SCHEME.match(text)
    scheme = match["scheme"] if match else ""
    # Plug-ins are looked up only for other schemes: reading their names takes time.
    if scheme not in SCHEMES and scheme not in (others := SOURCE_PLUGINS.names()):
        raise missing_part("sources", scheme, f"the source {scheme}:") or ValueError(
            f"{text!r} is neither the path of a recording nor the URI of a source; there are "
            + ", ".join(f"{name}:" for name in (*SCHEMES, *others))
        )
    try:
        parts = urlsplit(text)
    except ValueError as cause:
        raise ValueError(f"{text} is no URI: {cause}") from cause
    if parts.fragment:
        raise ValueError(f"{text}: nothing after # expected, {parts.fragment!r} given")
    for part in filter(None, parts.query.split("&")):
        if "=" not in part:  # `parse_qsl` would leave it out without a word
            raise ValueError(f"{text}: name=value expected, {part!r} given")
    # Blank values stay: `sensor=` is refused by its reader, and not ignored.
    pairs = parse_qsl(parts.query, keep_blank_values=True)
    if len(dict(pairs)) < len(pairs):
        raise ValueError(f"{text}: a parameter is given twice")
    return scheme, Address(text, parts.netloc, parts.path, dict(pairs))


def is_uri(text: str) -> bool:
    """Return whether the text has the form of a URI and is not the name of a file."""
    # A file may be called `twin:can`; then it is meant.
    return bool(_SCHEME.match(text)) and not Path(text).exists()


def open_source(text: str | Path, *, speed: float = 1.0, loop: bool = False) -> "Source":
    """Return the source of a path or URI; entering it connects.

    Args:
        text: path of a recording, or URI with one of `SCHEMES`, or of a plug-in.
        speed: speed of a recording or of the twin: 1 is real time, 0 is as fast as samples
            are read. Devices ignore it.
        loop: start a recording again at its end; the twin grasps again. Devices ignore it.

    Raises:
        ValueError: the text is neither, or a parameter is not valid.
        MissingExtra: the source needs a package that is not installed.

    Example:
        >>> with open_source("twin:?object=can&seed=1", speed=0) as source:  # doctest: +SKIP
        ...     print(list(source.sensors))
        ['thumb', 'index', 'middle', 'ring']
    """
    if isinstance(text, Path) or not is_uri(text):
        from holdfast.devices.sources.replay import ReplaySource

        return ReplaySource(text, speed=speed, loop=loop)
    scheme, address = parse(text)
    if scheme == "twin":
        require_extras("twin", "parquet")
        from holdfast.devices.sources.twin import Twin

        return Twin(address, speed=speed, loop=loop)
    return _source_maker(scheme)(address)


def source_module(scheme: str) -> ModuleType | None:
    """Return the module of the sources of a scheme, None of the twin.

    It may have a function `state()`, which returns in a few words whether such a source can be
    reached.

    Raises:
        ValueError: the plug-in of the scheme cannot be used.
    """
    return None if scheme == "twin" else sys.modules.get(_source_maker(scheme).__module__)


def source_state(scheme: str) -> str:
    """Return the state of the sources of a scheme, or why its plug-in is skipped; may be empty."""
    if scheme not in SCHEMES and (error := SOURCE_PLUGINS.error(scheme)):
        return error
    try:
        return getattr(source_module(scheme), "state", str)()
    except MissingExtra as missing:
        return f"not installed: {install_command(missing.args[1])}"


def source_states() -> dict[str, str]:
    """Return in a few words whether the live sources of each scheme can be reached."""
    states = {name: source_state(name) for name in ("xela", *SOURCE_PLUGINS.names(), "serial")}
    return {name: state for name, state in states.items() if state}


def _source_maker(scheme: str) -> "Callable[[Address], Source]":
    """Return the function that makes the sources of a scheme.

    Raises:
        ValueError: the plug-in of the scheme cannot be used.
    """
    if scheme in DEVICE_SCHEMES:
        module = import_module(f"holdfast.devices.sources.{scheme}")
        make: Callable[[Address], Source] = module.source
        return make
    plugin = SOURCE_PLUGINS.load(scheme)
    if plugin is None:
        raise ValueError(f"the plug-in of {scheme}: cannot be used; holdfast doctor says why")
    return plugin


def _plugin_source(name: str, loaded: Any) -> "Callable[[Address], Source]":  # noqa: ANN401
    """Return the function of a plug-in that makes the source of an address."""
    if not callable(loaded):
        raise TypeError(f"a function source(address) expected for {name}:, {loaded!r} given")
    make: Callable[[Address], Source] = loaded
    return make


SOURCE_PLUGINS = PluginGroup("sources", SCHEMES, _plugin_source)
"""Sources of other packages, by the scheme of their URIs."""
