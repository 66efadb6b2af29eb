import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.labelling.fitting import fitted
from holdfast.labelling.store import checked
from holdfast.recordings import Label, Recording, Tactile
from holdfast.sensors import sensor


def uneven():
    """Two fingers at 100 Hz: the thumb from 0 to 1 s, the index from 0.2 to 0.8 s."""
    tip = sensor("uskin-4x4")
    times = np.arange(101) / 100
    thumb = Tactile(tip, times, np.zeros((len(times), 16, 3)))
    return Recording("uneven", {"thumb": thumb, "index": thumb.slice(20, 81)})


@pytest.mark.parametrize(
    ("given", "thumb", "index"),
    [
        ((0.0, 1.01), (0.0, 1.01), (0.2, 0.81)),  # all of the recording, its last sample too
        ((0.0, 0.5), (0.0, 0.5), (0.2, 0.5)),
        ((0.5, 1.0), (0.5, 1.0), (0.5, 0.81)),
        ((0.3, 0.4), (0.3, 0.4), (0.3, 0.4)),
        ((0.0, 0.2), (0.0, 0.2), None),
        ((0.9, 1.0), (0.9, 1.0), None),
    ],
)
def test_labels_are_cut_to_the_samples_of_their_finger(given, thumb, index):
    recording = uneven()
    label = Label(*given, ContactState.STABLE, confidence=0.5)
    found = fitted(recording, {"thumb": [label], "index": [label]})
    spans = {name: [(each.start, each.end) for each in own] for name, own in found.items()}
    expected = {"thumb": thumb, "index": index}
    assert spans == {name: [pytest.approx(own)] if own else [] for name, own in expected.items()}
    assert {each.confidence for own in found.values() for each in own} == {0.5}
    checked(recording, found)


@pytest.mark.parametrize("given", [(-0.1, 0.5), (0.5, 1.1)])
def test_labels_outside_the_recording_are_not_cut_but_refused(given):
    label = Label(*given, ContactState.STABLE)
    found = fitted(uneven(), {"index": [label]})
    assert found == {"index": (label,)}
    with pytest.raises(ValueError, match=r"^index: label .* lies outside the recording"):
        checked(uneven(), found)
