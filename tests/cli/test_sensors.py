import json
import math
import re

import pytest
from matplotlib.axes import Axes

from command_line import Verb
from holdfast.cli import main
from holdfast.plots.sensors import plot_hand, plot_sensor
from holdfast.sensors import Sensor, built_in_hands, built_in_sensors, hand, sensor

pytestmark = pytest.mark.slow

URDF = """<robot name="finger"><link name="tip"/>
<joint name="taxel_1" type="fixed"><parent link="tip"/><child link="t"/></joint></robot>"""


refusal = Verb("sensors").refusal


def shown(capsys, *words):
    assert main(["sensors", *map(str, words)]) == 0
    return capsys.readouterr().out


def test_lists_all(capsys):
    out = shown(capsys)
    for name in built_in_sensors() + built_in_hands():
        assert re.search(rf"^{name} +\d+", out, re.MULTILINE)


def test_lists_all_as_json(capsys):
    listed = json.loads(shown(capsys, "--json"))
    assert [one["name"] for one in listed["sensors"]] == list(built_in_sensors())
    assert listed["hands"][0]["n_taxels"] == 368


def test_shows_a_sensor(capsys):
    out = shown(capsys, "uskin-curved")
    assert "0 to 65535" in out
    assert len(out.splitlines()) == 6 + 1 + 1 + 30


@pytest.mark.parametrize("name", built_in_sensors())
def test_json_of_a_sensor_is_a_sensor_file(name, capsys, tmp_path):
    """The JSON can be read by `from_json`, without the number of taxels."""
    printed = json.loads(shown(capsys, name, "--json"))
    assert printed.pop("n_taxels") == sensor(name).n_taxels
    assert Sensor.from_dict(printed) == sensor(name)


def test_shows_a_hand(capsys):
    out = shown(capsys, "allegro-uskin")
    assert re.search(r"^thumb +uskin-curved +30 +thumb_link3 +0-8, 17-22,", out, re.MULTILINE)
    printed = json.loads(shown(capsys, "allegro-uskin", "--json"))
    indices = hand("allegro-uskin").modules["index"].flat_indices.tolist()
    assert printed["modules"]["index"]["flat_indices"] == indices


def test_own_sensor_from_json(capsys, tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(sensor("gtac").to_dict() | {"name": "mine"}))
    assert json.loads(shown(capsys, path, "--json"))["name"] == "mine"


def test_own_sensor_from_urdf(capsys, tmp_path):
    path = tmp_path / "finger.urdf"
    path.write_text(URDF)
    assert json.loads(shown(capsys, path, "--base", "tip", "--json"))["n_taxels"] == 1
    assert refusal(capsys, path) == (
        f"{path} needs --base LINK: the link that is the fingertip frame"
    )


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


@pytest.mark.parametrize("name", ["uskin-curved", "allegro-uskin"])
def test_plots_have_the_numbers_of_taxels(name, monkeypatch):
    texts = []
    write = Axes.text

    def seen(axes, x, y, text, **given):
        texts.append(text)
        return write(axes, x, y, text, **given)

    monkeypatch.setattr(Axes, "text", seen)
    if name in built_in_hands():
        plot_hand(hand(name))
        sizes = [module.sensor.n_taxels for module in hand(name).modules.values()]
    else:
        plot_sensor(sensor(name))
        sizes = [sensor(name).n_taxels]
    numbers = [int(text) for text in texts if text.isdecimal()]
    assert numbers == [number for size in sizes for number in range(1, size + 1)]


def test_plots_a_sensor_of_one_oblique_taxel(capsys, tmp_path):
    path = tmp_path / "one.json"
    third = 1 / math.sqrt(3)
    path.write_text(
        json.dumps(
            {
                "name": "one",
                "positions": [[0, 0, 0]],
                "rotations": [[[1, 0, 0], [0, 1, 0], [0, 0, 1]]],
                "normal": [third, third, third],
                "rate": 100,
            }
        )
    )
    shown(capsys, path, "--plot", tmp_path / "one.png")


def test_refusals(capsys, tmp_path):
    assert refusal(capsys, "uskin") == (
        "unknown sensor or hand 'uskin'; built in are uskin-curved, uskin-4x4, uskin-4x6, gtac, "
        "anyskin, papillarray, allegro-uskin; or give a .json or .urdf file"
    )
    assert refusal(capsys, "gtac", "--plot", "a.txt") == (
        "a plot ends in .pdf, .png, .svg; 'a.txt' given"
    )
    assert refusal(capsys, "--plot", "a.svg") == (
        "--plot and --base need the name of a sensor; holdfast sensors lists them"
    )
    assert (
        refusal(capsys, "gtac", "--base", "tip") == "--base belongs to a .urdf file; 'gtac' given"
    )
    missing = tmp_path / "none.json"
    assert refusal(capsys, missing) == f"{missing}: No such file or directory"


class TestTemplate:
    def test_it_is_read_back(self, capsys, tmp_path):
        words = ["--template", "2X3", "--pitch", "4.7", "--rate", "60", "--unit", "N"]
        assert main(["sensors", *words]) == 0
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) < 80
        (tmp_path / "s.json").write_text(out)
        made = Sensor.from_json(tmp_path / "s.json")
        assert (made.name, made.n_taxels, made.rate, made.unit) == ("grid-2x3", 6, 60.0, "N")
        assert made.positions[0].tolist() == [-0.0047, 0.00235, 0.0]

    @pytest.mark.parametrize(
        ("words", "text"),
        [
            (("--template", "3"), "--template: ROWSxCOLUMNS such as 3x3 expected, '3' given"),
            (("--template", "0x3"), "--template: ROWSxCOLUMNS such as 3x3 expected, '0x3' given"),
            (("--template", "3x3", "--pitch", "0"), "--pitch: a distance above 0 mm expected, 0"),
            (("--template", "3x3", "--rate", "-1"), "grid-3x3: a rate above 0 Hz expected, -1.0"),
            (("--template", "3x3", "--unit", "kg"), "--unit: count or N expected, 'kg' given"),
            (("gtac", "--template", "3x3"), "--template makes a new sensor; 'gtac' given as well"),
        ],
    )
    def test_refusals(self, capsys, words, text):
        assert main(["sensors", *words]) == 2
        assert text in capsys.readouterr().err
