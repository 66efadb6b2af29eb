import re

import numpy as np
import pytest

from holdfast.sensors import hand, sensor
from holdfast.sensors.xela_models import flat_grid, is_known, module_sensors, split, whole_hand


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
        ("", 16, "uskin-4x4"),
        ("", 24, "uskin-4x6"),
        ("", 30, "uskin-curved"),
    ],
)
def test_separate_sensors(model, n_taxels, name):
    assert module_sensors(model, n_taxels) == {"": sensor(name)}
    flat = np.zeros((n_taxels, 3))
    assert split(model, flat)[""] is flat
    assert whole_hand(model) is None


@pytest.mark.parametrize(
    ("model", "n_taxels", "name"),
    [("uSPa35", 15, "uspa35"), ("uSPr-DSF", 30, "uspr-dsf"), ("", 15, "unknown")],
)
def test_an_unknown_model_is_a_flat_grid_of_its_name(model, n_taxels, name):
    assert module_sensors(model, n_taxels) == {"": flat_grid(name, n_taxels)}
    assert not is_known(model)


@pytest.mark.parametrize(
    ("n", "n_rows", "n_columns"), [(1, 1, 1), (15, 3, 5), (16, 4, 4), (7, 1, 7)]
)
def test_flat_grids_are_complete(n, n_rows, n_columns):
    flat = flat_grid("x", n)
    assert (flat.name, flat.n_taxels, flat.range) == ("x", n, (0.0, 65535.0))
    assert len(np.unique(flat.positions, axis=0)) == n
    positions = flat.positions
    assert (len(set(positions[:, 1])), len(set(positions[:, 0]))) == (n_rows, n_columns)
    assert (flat.rotations == np.eye(3)).all()


@pytest.mark.parametrize("model", ["uSPa44", "XR1946", "xr23ahlcpp"])
def test_known_models(model):
    assert is_known(model)


@pytest.mark.parametrize(
    ("model", "n_taxels", "text"),
    [
        ("uSPa44", 24, "24 taxels"),
        ("XR23AHRCPP", 30, "30 taxels"),
        ("uSPa44", 0, "uSPa44 with"),
    ],
)
def test_another_number_of_taxels_than_the_model(model, n_taxels, text):
    with pytest.raises(ValueError, match=re.escape(text)):
        module_sensors(model, n_taxels)
