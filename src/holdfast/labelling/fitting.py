"""Labels cut to the time of their finger, which is not that of the whole recording."""

from collections.abc import Sequence
from dataclasses import replace

from holdfast.labelling.store import EDGE, Labels
from holdfast.recordings import Label, Recording, Tactile


def fitted(recording: Recording, labels: Labels) -> dict[str, tuple[Label, ...]]:
    """The labels, each cut to the samples of its own finger.

    Fingers begin and end at different times, and a page has one time for all. What lies outside
    the recording is left as it is, and `store.checked` refuses it. A label ends up to a sample
    period after the last sample that it holds.

    Args:
        recording: that they label.
        labels: by finger.
    """
    end = recording.end + max(module.period for module in recording.modules.values())
    return {
        finger: tuple(_cut(own, recording.modules.get(finger), recording.start, end))
        for finger, own in labels.items()
    }


def _cut(labels: Sequence[Label], module: Tactile | None, start: float, end: float) -> list[Label]:
    """Those within [start, end] cut to the module's time; the others as they are."""
    if module is None or not module.n_samples:
        return list(labels)
    first, last = float(module.times[0]), float(module.times[-1])
    cut = []
    for each in labels:
        if start - EDGE <= each.start and each.end <= end + EDGE:
            begins, ends = max(each.start, first), min(each.end, last + module.period)
            cut += [replace(each, start=begins, end=ends)] if begins < ends else []
        else:
            cut.append(each)
    return cut
