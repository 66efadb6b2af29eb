"""Hands that take commands, by URI, also of a plug-in."""

from collections.abc import Callable
from typing import Any

from holdfast.errors import missing_part
from holdfast.plugins import PluginGroup
from holdfast_grip.hands.base import HandDevice
from holdfast_grip.hands.claim import Claim

HAND_SCHEMES = ("twin", "log", "call")
"""Schemes of the URIs of hands that this package has: the twin, with the source `twin:...`; a file,
for dry runs; and a function of Python."""

__all__ = ["HAND_SCHEMES", "Claim", "HandDevice", "open_hand"]


def open_hand(uri: str, *, standby: bool = False) -> HandDevice:
    """Return the hand of a URI; entering it connects.

    Args:
        uri: `log:PATH`, `call:MODULE:FUNCTION`, or that of a plug-in. `twin:` is a hand
            and a source at once, see `holdfast_grip.hands.live_twin`.
        standby: whether a watchdog opens it, beside the controller that commands the hand.

    Raises:
        ValueError: the URI names no hand, a parameter is missing or not valid, or what a plug-in
            returns is no `HandDevice`.
        MissingExtra: the hand needs a package that is not installed.
    """
    scheme, _, rest = uri.partition(":")
    if scheme == "log" and rest:
        from holdfast_grip.hands.local import LogFile

        return LogFile(uri, rest)
    if scheme == "call" and rest:
        from holdfast_grip.hands.local import ScalarGripper

        return ScalarGripper.from_path(rest, uri)
    make = HAND_PLUGINS.load(scheme)
    if make is None:
        raise missing_part("hands", scheme, f"the hand {scheme}:") or ValueError(
            f"{uri!r} is no hand; there are twin:, log:PATH, call:MODULE:FUNCTION"
            f"{HAND_PLUGINS.text()}"
        )
    hand: Any = make(uri)
    if not isinstance(hand, HandDevice):
        raise ValueError(
            f"{uri}: the plug-in {scheme} must return a subclass of HandDevice, as the contract "
            f"of hands says; {type(hand).__name__} returned"
        )
    hand.standby = standby
    return hand


def _plugin_hand(name: str, loaded: Any) -> Callable[[str], HandDevice]:  # noqa: ANN401
    """Return the function of a plug-in that makes the hand of a URI."""
    if not callable(loaded):
        raise TypeError(f"a function hand(uri) expected for {name}:, {loaded!r} given")
    make: Callable[[str], HandDevice] = loaded
    return make


HAND_PLUGINS = PluginGroup("hands", HAND_SCHEMES, _plugin_hand)
"""Hands of other packages, by the scheme of their URIs."""
