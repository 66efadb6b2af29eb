"""Source of XELA's server: `xela://HOST:PORT` or `xela://auto`."""

import socket
from contextlib import suppress

from holdfast.devices.sources.base import Source
from holdfast.devices.uri import Address, parse

PROBE_TIMEOUT = 0.3
"""Time in which a server must accept a connection [s]."""


def source(address: Address) -> Source:
    """Return the source of a URI; entering it connects.

    `xela://HOST:PORT`, by default `xela://127.0.0.1:5000`; `xela://auto` tries this machine's
    own addresses. Parameters: `values=counts` or `values=calibrated`; `fingers=1:thumb,2:index`
    names the server's sensors; `sensor=FILE.json` (or a built-in name) is the layout of sensors
    whose model is not known.

    Raises:
        ValueError: the address or a parameter is not valid.
    """
    from holdfast.devices.sources.xela.addresses import server_addresses
    from holdfast.devices.sources.xela.client import XelaSource

    address.only("values", "fingers", "sensor")
    return XelaSource(
        address.text,
        server_addresses(address),
        address.names(),
        calibrated=address.calibrated(),
        sensor=address.sensor(),
    )


def state() -> str:
    """Return whether a server listens at this machine's own addresses."""
    from holdfast.devices.sources.xela.addresses import server_addresses

    addresses = server_addresses(parse("xela://auto")[1])
    for address in addresses:
        with suppress(OSError), socket.create_connection(address, PROBE_TIMEOUT):
            return f"a server listens at {address}"
    return f"no server listens at {' or '.join(map(str, addresses))}"
