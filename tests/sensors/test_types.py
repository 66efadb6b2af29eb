import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from holdfast.sensors import Hand, HandModule, Sensor, built_in_sensors, hand, sensor


def two_taxels(**fields):
    plain = {
        "name": "pair",
        "positions": [[0, 0, 0], [0.01, 0, 0]],
        "rotations": [np.eye(3), np.eye(3)],
        "normal": [0, 0, 2],
        "rate": 100.0,
    }
    return Sensor(**(plain | fields))


def written(folder, **fields):
    plain = two_taxels().to_dict() | fields
    path = folder / "pair.json"
    path.write_text(json.dumps({key: value for key, value in plain.items() if value != "absent"}))
    return path


def one_module(indices):
    pair = two_taxels()
    return HandModule(pair, indices, "tip", pair.positions, pair.rotations, [[0, 0], [0, 1]])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": ""}, "a sensor needs"),
        ({"positions": [[0, 0]]}, "positions of pair"),
        ({"positions": [[0, 0, 0], [0]]}, "positions of pair"),
        ({"positions": "here"}, "positions of pair"),
        ({"positions": [[0, 0, 0], [0, 0, np.nan]]}, "positions of pair"),
        ({"rotations": [np.eye(3)]}, "rotations of pair"),
        ({"rotations": [np.eye(3), 1.01 * np.eye(3)]}, "pair: the rotation"),
        ({"rotations": [np.eye(3), np.diag([1, 1, -1])]}, "pair: the rotation"),
        ({"normal": [0, 0, 0]}, "pair: at least"),
        ({"positions": np.zeros((0, 3)), "rotations": np.zeros((0, 3, 3))}, "pair: at least"),
        ({"rate": 0}, "pair: a rate"),
        ({"rate": float("inf")}, "pair: a rate"),
        ({"unit": "V"}, "pair: unit 'count'"),
        ({"magnetic": 1}, "pair: magnetic true"),
        ({"range": (1, 0)}, "range of pair"),
        ({"range": (1, 2, 3)}, "range of pair"),
        ({"step": 0.0}, "pair: a step above 0, .* expected, 0.0 given"),
        ({"step": -0.1}, "pair: a step above 0"),
        ({"step": float("nan")}, "pair: a step above 0"),
        ({"step": float("inf")}, "pair: a step above 0"),
        ({"step": True}, "pair: a step above 0"),
        ({"step": "0.1"}, "pair: a step above 0"),
        ({"step": 2.0, "range": (0, 1)}, "within the range of 0 to 1, expected, 2"),
        ({"rests_at_zero": 1}, "pair: rests_at_zero true or false expected, 1 given"),
        (
            {"rests_at_zero": True, "range": (1, 9)},
            "a range with zero expected, 1 to 9 given",
        ),
    ],
)
def test_invalid_fields(fields, message):
    with pytest.raises(ValueError, match=message):
        two_taxels(**fields)


def test_arrays_are_read_only_and_its_own():
    positions = np.zeros((2, 3))
    one = two_taxels(positions=positions)
    positions[0] = 1
    assert one.positions.max() == 0
    for array in (one.positions, one.rotations, one.normal):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_normal_has_length_one():
    assert two_taxels().normal.tolist() == [0, 0, 1]


def test_equal_by_content():
    assert two_taxels() == two_taxels()
    assert hash(two_taxels()) == hash(two_taxels())
    assert two_taxels() != two_taxels(rate=50.0)
    assert two_taxels() != "pair"


@pytest.mark.parametrize("name", built_in_sensors())
def test_reading_a_written_sensor_gives_the_same(name, tmp_path):
    path = tmp_path / "sensor.json"
    path.write_text(json.dumps(sensor(name).to_dict()))
    assert Sensor.from_json(path) == sensor(name)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_copies_are_equal_and_read_only(copied):
    one = copied(sensor("uskin-curved"))
    assert one == sensor("uskin-curved")
    assert not one.positions.flags.writeable
    other = copied(hand("allegro-uskin"))
    assert other.n_taxels == 368
    assert not other.modules["thumb"].flat_indices.flags.writeable


class TestFromJson:
    @pytest.mark.parametrize(
        ("fields", "named"),
        [
            ({"colour": "red"}, "colour"),
            ({"positions": "absent"}, "positions"),
            ({"positions": [[0, 0]]}, "positions of pair"),
            ({"rate": None}, "float"),
            ({"rate": "fast"}, "float"),
            ({"unit": "kg"}, "kg"),
            ({"range": [0]}, "range of pair"),
            ({"rotations": [[[1, 0, 0]] * 3] * 2}, "rotation"),
        ],
    )
    def test_invalid_fields(self, tmp_path, fields, named):
        with pytest.raises(ValueError, match=f"pair.json: .*{named}"):
            Sensor.from_json(written(tmp_path, **fields))

    @pytest.mark.parametrize("text", ["", "[]", "{", '{"rate": NaN}', "\x80"])
    def test_no_json_object(self, tmp_path, text):
        path = tmp_path / "pair.json"
        path.write_text(text, "latin-1")
        with pytest.raises(ValueError, match="JSON"):
            Sensor.from_json(path)

    def test_no_file(self, tmp_path):
        with pytest.raises(FileNotFoundError):
            Sensor.from_json(tmp_path / "none.json")

    def test_the_range_of_an_older_file_is_called_limits(self, tmp_path):
        one = Sensor.from_json(written(tmp_path, range="absent", limits=[0, 4095]))
        assert one.range == (0.0, 4095.0)

    def test_a_range_under_both_names_is_refused(self, tmp_path):
        with pytest.raises(ValueError, match="limits"):
            Sensor.from_json(written(tmp_path, range=[0, 1], limits=[0, 4095]))

    def test_gtac_rests_at_zero_by_its_name(self):
        gtac = sensor("gtac")
        assert gtac.rests_at_zero
        assert "rests_at_zero" not in gtac.to_dict()
        assert Sensor.from_dict(gtac.to_dict()) == gtac
        assert not Sensor.from_dict(gtac.to_dict() | {"rests_at_zero": False}).rests_at_zero

    def test_what_is_magnetic_is_known_by_the_name_of_a_built_in_sensor(self, tmp_path):
        plain, magnetic = (
            Sensor.from_json(written(tmp_path, magnetic=value)) for value in ("absent", True)
        )
        assert (plain.magnetic, magnetic.magnetic, plain == magnetic) == (False, True, False)
        assert Sensor.from_dict(magnetic.to_dict()) == magnetic
        fields = {"uskin-curved", "uskin-4x4", "uskin-4x6", "anyskin"}
        assert {name for name in built_in_sensors() if sensor(name).magnetic} == fields
        assert all("magnetic" not in sensor(name).to_dict() for name in built_in_sensors())

    def test_step_and_rest_are_written_only_where_they_are_known(self, tmp_path):
        assert not {"step", "rests_at_zero"} & set(two_taxels().to_dict())
        plain = Sensor.from_json(written(tmp_path))
        assert (plain.step, plain.rests_at_zero) == (None, False)
        stepped = Sensor.from_json(written(tmp_path, step=1, rests_at_zero=True))
        assert (stepped.step, stepped.rests_at_zero) == (1.0, True)
        assert Sensor.from_dict(stepped.to_dict()) == stepped

    def test_unit_and_range_may_be_left_out(self, tmp_path):
        one = Sensor.from_json(written(tmp_path, unit="absent", range="absent"))
        assert (one.unit, one.range) == ("count", None)


class TestHand:
    def test_every_flat_index_once(self):
        for indices in ([0, 0], [0, 2], [1, 2]):
            with pytest.raises(ValueError, match="odd"):
                Hand("odd", {"a": one_module(indices)})

    def test_modules_are_read_only(self):
        with pytest.raises(TypeError):
            hand("allegro-uskin").modules["thumb"] = None

    def test_a_module_fits_its_sensor(self):
        with pytest.raises(ValueError, match="pair on tip"):
            one_module([0, 1, 2])

    def test_rotations_of_modules_are_checked(self):
        with pytest.raises(ValueError, match="taxel 1"):
            replace(one_module([0, 1]), rotations=np.ones((2, 3, 3)))


def test_sensors_are_equal_but_for_the_last_digits():
    """Another C library gives other last digits of a sine."""
    curved = sensor("uskin-curved")
    nearly = replace(
        curved,
        positions=curved.positions + 1e-15,
        rotations=curved.rotations * (1 + 1e-15),
        rate=curved.rate * (1 + 1e-15),
    )
    assert nearly.to_dict() != curved.to_dict()
    assert nearly == curved
    assert hash(nearly) == hash(curved)
    assert len({curved, nearly}) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"name": "other"},
        {"unit": "N"},
        {"range": None},
        {"range": (0.0, 4095.0)},
        {"rate": 151.0},
        {"step": 1.0},
        {"rests_at_zero": True},
        {"positions": np.zeros((30, 3))},
        {"rotations": np.tile(np.eye(3), (30, 1, 1))},
        {"normal": np.array([0.0, 0.0, 1.0])},
    ],
)
def test_sensors_that_differ_are_not_equal(change):
    curved = sensor("uskin-curved")
    assert replace(curved, **change) != curved
    assert curved != "uskin-curved"


@pytest.mark.parametrize("size", [1e-308, 1e-150, 1.0, 1e150, 1e308])
def test_a_normal_of_any_length_is_normalised(size):
    one = replace(sensor("anyskin"), normal=np.array([0.0, size, 0.0]))
    assert one.normal.tolist() == [0.0, 1.0, 0.0]


def test_rotations_of_any_size_are_refused_without_a_warning():
    with pytest.raises(ValueError, match="rotations"):
        replace(sensor("anyskin"), rotations=np.full((5, 3, 3), 1e308))
