"""Sources by what a user calls them: the path of a recording, or a URI."""

import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from urllib.parse import parse_qsl, urlsplit

from holdfast.sources.address import Address
from holdfast.sources.source import Source

SCHEMES = {
    "xela": "XELA's server: xela://HOST:PORT or xela://auto, ?values=counts|calibrated",
    "twin": "the twin: twin:?object=can&seed=1&case=2&profile=reference",
    "ros2": "a ROS 2 topic: ros2:///xServTopic",
    "ros1": "a ROS 1 topic: ros1:///xServTopic",
    "serial": "a serial sensor: serial:///dev/ttyACM0?sensor=anyskin",
}
"""Schemes of the URIs of sources, and what each is; a module of that name has its source."""

_URI = re.compile(r"(?P<scheme>[a-z][a-z0-9+]+):")


def parse(text: str) -> tuple[str, Address]:
    """The scheme of a URI, and its parts.

    Raises:
        ValueError: it is no URI of a known scheme, or a parameter is given twice or has no
            value.

    Example:
        >>> parse("twin:?object=can")[1].parameters
        {'object': 'can'}
    """
    match = _URI.match(text)
    scheme = match["scheme"] if match else ""
    if scheme not in SCHEMES:
        raise ValueError(
            f"{text!r} is neither the path of a recording nor the URI of a source; there are "
            + ", ".join(f"{name}:" for name in SCHEMES)
        )
    try:
        parts = urlsplit(text)
    except ValueError as cause:
        raise ValueError(f"{text} is no URI: {cause}") from cause
    if parts.fragment:
        raise ValueError(f"{text}: nothing after # expected, {parts.fragment!r} given")
    return scheme, Address(text, parts.netloc, parts.path, _parameters(text, parts.query))


def _parameters(text: str, query: str) -> dict[str, str]:
    for part in filter(None, query.split("&")):
        if "=" not in part:
            raise ValueError(f"{text}: name=value expected, {part!r} given")
    pairs = parse_qsl(query, keep_blank_values=True)
    if len(dict(pairs)) < len(pairs):
        raise ValueError(f"{text}: a parameter is given twice")
    return dict(pairs)


def is_uri(text: str) -> bool:
    """Whether it names no file, but looks like a URI."""
    return bool(_URI.match(text)) and not Path(text).exists()


def open_source(text: str, *, speed: float = 1.0, loop: bool = False) -> Source:
    """The source of that name; entering it connects.

    Args:
        text: the path of a recording, or a URI of one of `SCHEMES`.
        speed: of a recording and of the twin: 1 is real time, 0 as fast as it is taken.
        loop: a recording begins anew when it is over; the twin grasps again.

    Raises:
        ValueError: it is neither, or a parameter is not as expected.
        MissingExtra: it needs a package that is not installed.

    Example:
        >>> with open_source("twin:?object=can&seed=1", speed=0) as source:  # doctest: +SKIP
        ...     print(list(source.sensors))
        ['thumb', 'index', 'middle', 'ring']
    """
    if not is_uri(text):
        from holdfast.sources.replay import Replay

        return Replay(text, speed=speed, loop=loop)
    scheme, address = parse(text)
    if scheme == "twin":
        from holdfast.sources.twin import Twin

        return Twin(address, speed=speed, loop=loop)
    return _device(scheme, address)


def _device(scheme: str, address: Address) -> Source:
    make: Callable[[Address], Source] = import_module(f"holdfast.sources.{scheme}").source
    return make(address)
