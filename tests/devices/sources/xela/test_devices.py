import numpy as np
import pytest

from holdfast.devices.sources.xela.devices import xela_devices
from holdfast.errors import SourceError
from holdfast.sensors import sensor
from holdfast.sensors.xela_models import flat_grid

TIP = ("uSCuAH", 30)


def test_names():
    found = {1: TIP, 2: TIP, 5: TIP}
    names = [
        list(device.modules) for device in xela_devices(found, {2: "index", 1: "thumb"}).values()
    ]
    assert names == [["thumb"], ["index"], ["finger5"]]


@pytest.mark.parametrize("model", ["uSPa35", "uspr-dsf", "not in the table"])
def test_a_model_without_a_layout_is_flat_and_gives_a_notice(model):
    device = xela_devices({1: (model, 15)}, {})[1]
    (flat,) = device.modules.values()
    assert (flat.name, flat.n_taxels, flat.range) == (model.lower(), 15, (0.0, 65535.0))
    assert "sensor=FILE.json" in device.notices[0]


@pytest.mark.parametrize("name", ["uskin-4x4", "uskin-4x6", "uskin-curved"])
def test_without_a_model_but_with_the_taxels_of_a_built_in_sensor(name):
    device = xela_devices({1: ("", sensor(name).n_taxels)}, {})[1]
    assert device.modules == {"finger1": sensor(name)}
    assert f"{name} is assumed" in device.notices[0]


def test_a_given_sensor_is_taken_where_it_fits():
    given = flat_grid("mine", 15)
    found = {1: TIP, 2: ("uSPa35", 15)}
    made = xela_devices(found, {}, given)
    assert made[1].modules == {"finger1": sensor("uskin-curved")}
    assert made[2].modules == {"finger2": given}
    assert made[2].notices == ()
    other = flat_grid("mine", 24)  # another layout of a known model
    assert xela_devices({1: ("uSCuAH", 24)}, {}, other)[1].modules == {"finger1": other}


@pytest.mark.parametrize("found", [{1: TIP}, {1: ("XR23AHRCPP", 368)}, {1: ("odd", 3)}])
def test_calibrated_readings_are_newtons(found):
    modules = xela_devices(found, {}, calibrated=True)[1].modules
    assert {(module.unit, module.range) for module in modules.values()} == {("N", None)}


def test_two_hands_have_names_of_their_own():
    made = xela_devices({1: ("XR23AHLCPP", 368), 2: ("XR23AHRCPP", 368)}, {})
    assert [next(iter(device.modules)) for device in made.values()] == [
        "hand1/thumb",
        "hand2/thumb",
    ]
    assert made[2].split(np.zeros((368, 3))).keys() == made[2].modules.keys()


@pytest.mark.parametrize(
    ("found", "names", "given", "text"),
    [
        ({1: ("uSCuAH", 24)}, {}, None, "24 taxels given, 30 expected .*sensor=FILE.json"),
        ({3: ("XR23AHRCPP", 240)}, {}, None, "240 taxels given, 368 expected"),
        ({1: TIP}, {2: "index"}, None, "fingers= names 2"),
        ({1: ("XR23AHRCPP", 368)}, {1: "thumb"}, None, "fingers= names 1"),
        ({1: TIP}, {}, flat_grid("mine", 15), "15 taxels"),
        ({1: TIP, 2: TIP}, {1: "finger2"}, None, "finger2"),
    ],
)
def test_what_does_not_fit(found, names, given, text):
    with pytest.raises(SourceError, match=text):
        xela_devices(found, names, given)
