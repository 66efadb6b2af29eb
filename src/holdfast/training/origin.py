"""The model that training begins from, beside the data that it is adapted to."""

from collections.abc import Collection, Iterator

from holdfast.model import Model
from holdfast.training.survey import Survey


def doubts(init: Model, found: Survey, fingers: Collection[str]) -> Iterator[str]:
    """What a user has to know before believing the figures of a model that was adapted.

    Args:
        init: the model to begin from.
        found: by the survey of the data it is adapted to.
        fingers: that get a classifier; `"*"` for one that serves all.

    Raises:
        ModelError: the model to begin from has no such finger.
    """
    parts = {finger: init.finger(finger) for finger in fingers}
    name = init.name or "the model to begin from"
    unlike: dict[tuple[str, str], list[str]] = {}
    for finger, sensor in found.sensors.items():
        known = parts.get(finger) or init.finger(finger)
        if known.sensor is not None and init.sensors[known.sensor] != sensor:
            expected, given = init.sensors[known.sensor], sensor
            pair = (f"{given.name} ({given.unit})", f"{expected.name} ({expected.unit})")
            unlike.setdefault(pair, []).append(finger)
    for (given_text, expected_text), those in unlike.items():
        yield (
            f"{', '.join(those)}: the sensor is {given_text}, {name} was trained on "
            f"{expected_text}; its features are taken as they are, what it knows may not fit"
        )
    digests = _known(init).values()
    if seen := [entry.name for entry in found.entries if entry.digest in digests]:
        some = ", ".join(seen[:3]) + (" ..." if len(seen) > 3 else "")
        yield (
            f"{name} has seen {len(seen)} of these {len(found.entries)} recordings in training "
            f"({some}): figures on them flatter"
        )


def seen_by(init: Model | None, found: Survey) -> dict[str, str]:
    """Digest of every recording that a model has seen: the data, and what it began from saw."""
    own = {entry.name: entry.digest for entry in found.entries}
    before = {} if init is None else _known(init)
    return {f"{name} (init)": digest for name, digest in before.items()} | own


def _known(init: Model) -> dict[str, str]:
    return {} if init.training is None else init.training.recordings
