"""The speed at which a source is played, where it is one that is played."""

import math


def check_speed(source: str, speed: float) -> None:
    """Refuses a speed that no source has, or that is not that of this one.

    Raises:
        ValueError: it is negative or not finite, or a device is given another than its own.
    """
    from holdfast.sources.uri import is_uri

    if not (math.isfinite(speed) and speed >= 0):
        raise ValueError(f"--speed: at least 0 expected, {speed:g} given")
    if speed != 1 and is_uri(source) and not source.startswith("twin:"):
        raise ValueError(f"--speed is for recordings and the twin; {source} has its own")
