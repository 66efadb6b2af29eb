"""Source of XELA's server: `xela://HOST:PORT` or `xela://auto`."""

from holdfast.devices.sources.base import Source
from holdfast.devices.uri import Address

PARAMETERS = ("values", "fingers", "sensor")
"""Names of the parameters of the URI."""


def source(address: Address) -> Source:
    """Return the source of a URI; entering it connects.

    `xela://HOST:PORT`, by default `xela://127.0.0.1:5000`; `xela://auto` tries this machine's
    own addresses. Parameters: `values=counts` or `values=calibrated`; `fingers=1:thumb,2:index`
    names the server's sensors; `sensor=FILE.json` (or a built-in name) is the layout of sensors
    whose model is not known.

    Raises:
        ValueError: the address or a parameter is not valid.
    """
    from holdfast.devices.sources.xela.client import XelaSource
    from holdfast.devices.sources.xela.places import places

    address.only(*PARAMETERS)
    return XelaSource(
        address.text,
        places(address),
        address.names(),
        calibrated=address.calibrated(),
        sensor=address.sensor(),
    )
