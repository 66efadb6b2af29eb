"""Which labels a person should look at, and which first."""

from collections.abc import Mapping, Sequence

from holdfast.recordings import Label


def doubtful(labels: Mapping[str, Sequence[Label]], below: float = 0.8) -> list[tuple[str, Label]]:
    """The labels of little confidence, the most doubtful first.

    Of equal confidence the longer comes first: it costs more if it is wrong.

    Args:
        labels: by finger.
        below: confidence from which on a label is not doubtful.

    Raises:
        ValueError: `below` is not from 0 to 1.

    Example:
        >>> sure, unsure = (Label(0, 1, "STABLE", confidence=c) for c in (0.9, 0.4))
        >>> [(finger, label.confidence) for finger, label in doubtful({"thumb": (sure, unsure)})]
        [('thumb', 0.4)]
    """
    if not 0 <= below <= 1:
        raise ValueError(f"a confidence from 0 to 1 expected, {below} given")
    found = [
        (finger, label)
        for finger, intervals in labels.items()
        for label in intervals
        if label.confidence < below
    ]
    return sorted(found, key=_doubt)


def _doubt(found: tuple[str, Label]) -> tuple[float, float, float, str]:
    finger, label = found
    return label.confidence, label.start - label.end, label.start, finger
