import numpy as np
import pytest

from holdfast.sensors import built_in_hands, built_in_sensors, hand, sensor
from holdfast.sensors.built_in import SENSORS_BY_MAKER

N_TAXELS = {
    "uskin-curved": 30,
    "uskin-4x4": 16,
    "uskin-4x6": 24,
    "gtac": 15,
    "anyskin": 5,
    "papillarray": 9,
    "force-button": 1,
    "orca-finger": 87,
    "orca-thumb": 51,
    "orca-pinky": 51,
    "paxini-120": 120,
    "xhand": 120,
}
NEWTONS = ("papillarray", "force-button", "orca-finger", "orca-thumb", "orca-pinky")
FINGERTIPS = ("thumb", "index", "middle", "ring")


def nearest(positions):
    """Distance of each taxel to its nearest neighbour [m]."""
    distances = np.linalg.norm(positions[:, None] - positions, axis=2)
    np.fill_diagonal(distances, np.inf)
    return distances.min(axis=1)


def test_built_in_sensors():
    assert {name: sensor(name).n_taxels for name in built_in_sensors()} == N_TAXELS
    assert [name for own in SENSORS_BY_MAKER.values() for name in own] == list(N_TAXELS)


@pytest.mark.parametrize("name", N_TAXELS)
def test_every_sensor(name):
    one = sensor(name)
    assert one.name == name
    assert one.positions.shape == (one.n_taxels, 3)
    assert one.rotations.shape == (one.n_taxels, 3, 3)
    assert np.linalg.norm(one.normal) == pytest.approx(1, abs=1e-15)
    assert one.unit == ("N" if name in NEWTONS else "count")
    assert nearest(one.positions).min() > 1e-3


@pytest.mark.parametrize("name", N_TAXELS)
def test_rotations_are_exact(name):
    turns = sensor(name).rotations
    np.testing.assert_allclose(
        turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (len(turns), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-12)


def test_unknown_names():
    with pytest.raises(ValueError, match="'uskin'"):
        sensor("uskin")
    with pytest.raises(ValueError, match="'shadow'"):
        hand("shadow")


@pytest.mark.parametrize(
    ("name", "first"),
    [
        ("orca-finger", [0.004036, 0.028082, 0.003726]),
        ("orca-thumb", [-0.009988, -0.001000, 0.000837]),
        ("orca-pinky", [-0.007314, -0.001800, 0.000400]),
    ],
)
def test_orca_touch_as_its_driver_has_it(name, first):
    one = sensor(name)
    np.testing.assert_array_equal(one.positions[0], first)
    assert (one.step, one.rests_at_zero) == (0.1, True)
    np.testing.assert_allclose(one.range, [0.1 * -128, 0.1 * 255])  # int8 and uint8 counts


class TestCurvedFingertip:
    """Facts from the data sheet and the drawings."""

    def test_spacing_and_size(self):
        one = sensor("uskin-curved")
        assert nearest(one.positions).min() == pytest.approx(5.98e-3, abs=1e-5)
        low, high = one.positions.min(axis=0), one.positions.max(axis=0)
        np.testing.assert_allclose(low, [12.54e-3, -14.3e-3, 3.8e-3], atol=1e-9)
        np.testing.assert_allclose(high, [25.74e-3, 14.3e-3, 33.8e-3], atol=1e-9)

    def test_taxels_1_to_15_mirror_16_to_30(self):
        """Group by group: wall, shoulder, crown."""
        one = sensor("uskin-curved")
        mirror = np.array([1.0, -1.0, 1.0])
        order = [*range(25, 30), *range(21, 25), *range(15, 21)]
        np.testing.assert_allclose(one.positions[:15] * mirror, one.positions[order], atol=1e-9)
        normals = one.rotations[:, :, 2]
        np.testing.assert_allclose(normals[:15] * mirror, normals[order], atol=1e-6)

    def test_normals_point_outwards(self):
        one = sensor("uskin-curved")
        axis = np.array([12.54e-3, 0, 0])
        outwards = one.positions - axis
        assert (np.einsum("ij,ij->i", one.rotations[:, :, 2], outwards) > 0).all()

    def test_the_pad_is_pressed_along_x(self):
        """Equal pressure on every taxel adds up to a force along the normal and the tip."""
        one = sensor("uskin-curved")
        force = one.rotations[:, :, 2].sum(axis=0)
        assert one.normal.tolist() == [1, 0, 0]
        assert force[0] > 0
        assert force[1] == pytest.approx(0, abs=1e-5)


def test_flat_patches_go_line_by_line_from_the_top_left():
    x, y, z = (1e3 * sensor("uskin-4x6").positions).T
    np.testing.assert_allclose(x[:6], np.arange(-2.5, 3) * 7.24)
    np.testing.assert_allclose(y[::6], np.arange(1.5, -2, -1) * 7.17)
    assert (z == 0).all()


class TestAllegro:
    def test_modules(self):
        one = hand("allegro-uskin")
        assert built_in_hands() == ("allegro-uskin",)
        assert one.n_taxels == 368
        assert list(one.modules)[:4] == list(FINGERTIPS)
        assert len(one.modules) == 18
        models = [module.sensor.name for module in one.modules.values()]
        assert [models.count(name) for name in ("uskin-curved", "uskin-4x4", "uskin-4x6")] == [
            4,
            11,
            3,
        ]

    @pytest.mark.parametrize("finger", FINGERTIPS)
    def test_fingertips_have_the_shape_of_the_sensor(self, finger):
        module = hand("allegro-uskin").modules[finger]
        shift = module.positions - module.sensor.positions
        np.testing.assert_allclose(shift, np.tile(shift.mean(axis=0), (30, 1)), atol=1e-4)

    @pytest.mark.parametrize("shape", [(367, 3), (368, 2), (2, 3, 368)])
    def test_split_of_a_packet_of_another_shape(self, shape):
        with pytest.raises(ValueError, match="allegro-uskin"):
            hand("allegro-uskin").split(np.zeros(shape))
