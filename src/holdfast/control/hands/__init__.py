"""Hands that take commands, by URI."""

from holdfast.control.hands.base import Claim, Hand

SCHEMES = ("twin", "log", "call")
"""Schemes of the URIs of hands."""

__all__ = ["SCHEMES", "Claim", "Hand", "open_hand"]


def open_hand(uri: str) -> Hand:
    """Return the hand of a URI; entering it connects.

    Args:
        uri: `log:PATH` or `call:MODULE:FUNCTION`. `twin:` is a hand and a source at once, see
            `holdfast.control.live_twin`.

    Raises:
        ValueError: the URI names no hand.
    """
    scheme, _, rest = uri.partition(":")
    if scheme == "log" and rest:
        from holdfast.control.hands.log_file import LogFile

        return LogFile(uri, rest)
    if scheme == "call" and rest:
        from holdfast.control.hands.scalar import ScalarGripper

        return ScalarGripper.from_path(rest, uri)
    raise ValueError(f"{uri!r} is no hand; there are twin:, log:PATH and call:MODULE:FUNCTION")
