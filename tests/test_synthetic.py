import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.detection import fingertip_force, haar_features
from holdfast.synthetic import SYNTHETIC_RATE, synthetic_recording


def state_rows(module, state):
    return module.label_states == state.code


def test_the_same_seed_gives_the_same_bytes():
    assert synthetic_recording("a", 3).digest == synthetic_recording("b", 3).digest
    assert synthetic_recording("a", 3).digest != synthetic_recording("a", 4).digest


def test_fingers_have_their_names_and_differ():
    recording = synthetic_recording("a", 0, ("ring", "thumb"))
    assert list(recording.modules) == ["ring", "thumb"]
    ring, thumb = recording.modules.values()
    assert (ring.readings != thumb.readings).any()
    assert ring.labels == thumb.labels
    assert recording.metadata["object"] == "object 0"


def test_it_is_what_a_curved_uskin_gives():
    module = synthetic_recording("a", 0).modules["thumb"]
    assert module.sensor.name == "uskin-curved"
    assert module.readings.dtype == np.uint16
    assert module.rate == pytest.approx(SYNTHETIC_RATE)
    assert module.label_states.all()  # every sample has a label
    assert {label.state for label in module.labels} == set(ContactState) - {ContactState.UNKNOWN}


@pytest.mark.parametrize("seed", range(3))
def test_labels_agree_with_the_force(seed):
    """Free is noise, held is pressed along the normal, shaken is not held."""
    module = synthetic_recording("a", seed).modules["index"]
    force = fingertip_force(module.readings, module.sensor, times=module.times)
    features = haar_features(force, 14)
    amplitude, sigma = features[:, 0], features[:, 5]
    free = state_rows(module, ContactState.NO_CONTACT) & np.isfinite(sigma)
    held = state_rows(module, ContactState.STABLE)
    disturbed = slice(*np.searchsorted(module.times, [5.5, 6.4]))
    assert amplitude[free].max() < 100 < np.median(amplitude[held])
    assert np.median(sigma[held]) < 6 < np.median(sigma[disturbed])
    pressed = force[held].mean(axis=0)
    assert pressed[0] > 2 * np.abs(pressed[1:]).max()
