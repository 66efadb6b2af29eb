import json
import re

import pytest

from holdfast.cli import main
from holdfast.sensors import (
    Sensor,
    built_in_hands,
    built_in_sensors,
    sensor,
)

pytestmark = pytest.mark.slow

URDF = """<robot name="finger"><link name="tip"/>
<joint name="taxel_1" type="fixed"><parent link="tip"/><child link="t"/></joint></robot>"""


def shown(capsys, *words):
    assert main(["sensors", *map(str, words)]) == 0
    return capsys.readouterr().out


def test_lists_all(capsys):
    out = shown(capsys)
    for name in built_in_sensors() + built_in_hands():
        assert re.search(rf"^{name} +\d+", out, re.MULTILINE)
    listed = json.loads(shown(capsys, "--json"))
    assert [one["name"] for one in listed["sensors"]] == list(built_in_sensors())
    assert listed["hands"][0]["n_taxels"] == 368


def test_the_taxels_of_a_sensor_are_counted_from_1(capsys):
    rows = shown(capsys, "uskin-curved").splitlines()[-30:]
    assert [int(row.split()[0]) for row in rows] == list(range(1, 31))


@pytest.mark.parametrize("name", built_in_sensors())
def test_json_of_a_sensor_is_a_sensor_file(name, capsys, tmp_path):
    """The JSON can be read by `from_json`, without the number of taxels."""
    printed = json.loads(shown(capsys, name, "--json"))
    assert printed.pop("n_taxels") == sensor(name).n_taxels
    assert Sensor.from_dict(printed) == sensor(name)


def test_step_and_rest_are_shown_where_they_are_known(capsys):
    assert re.search(r"step +0\.1 N\nat rest +exactly zero\n", shown(capsys, "orca-finger"))
    assert "step" not in shown(capsys, "papillarray")


def test_own_sensors(capsys, tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(sensor("gtac").to_dict() | {"name": "mine"}))
    assert json.loads(shown(capsys, path, "--json"))["name"] == "mine"
    path = tmp_path / "finger.urdf"
    path.write_text(URDF)
    assert json.loads(shown(capsys, path, "--base", "tip", "--json"))["n_taxels"] == 1


@pytest.mark.parametrize(
    ("name", "suffix", "magic"),
    [("uskin-curved", ".png", b"\x89PNG"), ("papillarray", ".svg", b"<?xml"),
     ("allegro-uskin", ".pdf", b"%PDF")],
)  # fmt: skip
def test_plots(name, suffix, magic, capsys, tmp_path):
    plot = tmp_path / f"plot{suffix}"
    shown(capsys, name, "--plot", plot)
    assert plot.read_bytes().startswith(magic)
    assert list(tmp_path.iterdir()) == [plot]


def test_a_template_is_read_back(capsys, tmp_path):
    out = shown(capsys, "--template", "2X3", "--pitch", "4.7", "--rate", "60", "--unit", "N")
    (tmp_path / "s.json").write_text(out)
    made = Sensor.from_json(tmp_path / "s.json")
    assert (made.name, made.n_taxels, made.rate, made.unit) == ("grid-2x3", 6, 60.0, "N")
    assert made.positions[0].tolist() == [-0.0047, 0.00235, 0.0]
