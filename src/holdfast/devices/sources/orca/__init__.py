"""Source of an ORCA Touch hand at a serial port: `orca:///dev/ttyUSB0`."""

from holdfast.devices.sources.base import Source
from holdfast.devices.uri import Address


def source(address: Address) -> Source:
    """Return the source of a URI; entering it opens the port.

    Raises:
        ValueError: a parameter is not valid.
    """
    from holdfast.devices.sources.orca.client import OrcaSource

    return OrcaSource(address)
