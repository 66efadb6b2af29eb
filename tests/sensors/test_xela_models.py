import re

import numpy as np
import pytest

from holdfast.sensors import hand, sensor
from holdfast.sensors.xela_models import module_sensors, split, whole_hand


@pytest.mark.parametrize("model", ["XR23AHRCPP", "xr23ahlcpp"])
def test_a_whole_hand_has_all_its_modules(model):
    allegro = hand("allegro-uskin")
    sensors = module_sensors(model, 368)
    assert sensors == {name: module.sensor for name, module in allegro.modules.items()}
    assert whole_hand(model).name == "allegro-uskin"
    flat = np.arange(368 * 3).reshape(368, 3)
    parts = split(model, flat)
    for name, module in allegro.modules.items():
        np.testing.assert_array_equal(parts[name], flat[module.flat_indices])


@pytest.mark.parametrize(
    ("model", "n_taxels", "name"),
    [
        ("uSCuAH", 30, "uskin-curved"),
        ("USPA44", 16, "uskin-4x4"),
        ("XR1946", 24, "uskin-4x6"),
        ("never heard of", 24, "uskin-4x6"),
        ("", 30, "uskin-curved"),
    ],
)
def test_separate_sensors(model, n_taxels, name):
    assert module_sensors(model, n_taxels) == {"": sensor(name)}
    flat = np.zeros((n_taxels, 3))
    assert split(model, flat)[""] is flat
    assert whole_hand(model) is None


def test_a_patch_without_a_drawing_is_flat():
    (patch,) = module_sensors("uSPa35", 15).values()
    assert (patch.name, patch.n_taxels) == ("uspa35", 15)
    assert (patch.rotations == np.eye(3)).all()
    assert len(np.unique(patch.positions, axis=0)) == 15


@pytest.mark.parametrize(
    ("model", "n_taxels", "text"),
    [
        ("uSPa44", 24, "24 taxels given, 16 expected (uSPa44: uskin-4x4)"),
        ("XR23AHRCPP", 30, "30 taxels given, 368 expected (XR23AHRCPP: allegro-uskin)"),
        ("uSPa44", 0, "uSPa44 with 0 taxels given; at least 1 expected"),
    ],
)
def test_another_number_of_taxels_is_told(model, n_taxels, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        module_sensors(model, n_taxels)
