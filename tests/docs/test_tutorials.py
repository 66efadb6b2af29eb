import re

import pytest
from msgspec.structs import replace

from holdfast.io import load_recording, save_recording
from holdfast.synthetic import synthetic_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile

from . import blocks

DOCS = blocks.ROOT / "docs"
SHORT = replace(profile("reference"), idle=(0.7, 0.8), hold=6.0)


def save_grasps(folder, fingers=("thumb", "index")):
    folder.mkdir()
    for seed in range(3):
        recording = synthetic_recording(f"grasp{seed}", seed, fingers)
        save_recording(recording, folder / f"grasp{seed}.parquet")


def test_your_hand(folder, hand):
    save_grasps(folder / "grasps", ("thumb",))
    host = hand.removeprefix("xela://").partition("?")[0]
    n_run = blocks.run_page(
        DOCS / "tutorials" / "your-hand.md",
        {
            "xela://auto": f"xela://{host}",
            "holdfast serve": "holdfast serve --port 0",
            "holdfast play": "holdfast play --port 0",
            "holdfast label grasps": "holdfast label --port 0 grasps",
        },
    )
    assert n_run == 5
    assert (folder / "my-hand.json").exists()
    assert (folder / "grasps" / "grasp0.labels.json").exists()


def test_from_python(folder, monkeypatch, capsys):
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    assert blocks.run_page(DOCS / "tutorials" / "from-python.md") == 9
    out = capsys.readouterr().out
    assert "STABLE" in out
    assert "{'window': " in out


def test_from_pandas(folder, capsys):
    from matplotlib import pyplot as plt

    plt.switch_backend("agg")
    assert blocks.run_page(DOCS / "tutorials" / "from-pandas.md") == 4
    plt.close("all")
    assert (folder / "states.png").exists()
    assert re.search(r"^finger1 +1\.103$", capsys.readouterr().out, re.M)


def test_your_own_sensor(folder, capsys):
    assert blocks.run_page(DOCS / "tutorials" / "own-sensor.md") == 5
    out = capsys.readouterr().out  # its lines are compared with those of the page
    (pushed,) = re.findall(r"^ +([\d.]+) +finger1 +UNSTABLE +STABLE$", out, re.M)[:1]
    assert 5.0 <= float(pushed) <= 5.2
    assert re.findall(r"^- (.*):", out, re.M) == ["no labels"]  # of all findings


def test_from_ros2(folder):
    pytest.importorskip("cyclonedds")
    replace = {"--ros2": "--ros2 --port 0"}
    assert blocks.run_page(DOCS / "tutorials" / "from-ros2.md", replace) == 1


def test_from_the_registry_to_a_decision(folder, public_box, capsys):
    """The three commands of docs/datasets.md."""
    assert blocks.run_page(DOCS / "datasets.md", public_box) == 1
    out = capsys.readouterr().out
    assert re.search(r"^data_sample_2022-02-22-08-10-01 +1.34 +1.75 +1.68$", out, re.M)
    assert re.search(r"^ +1.103  hand +UNSTABLE +STABLE$", out, re.M)


def test_exports(folder, public_box):
    """The commands of docs/export.md; what comes back is what was exported."""
    assert blocks.run_page(DOCS / "export.md", public_box) == 4
    for path in (folder / "box").glob("*.parquet"):
        got, want = load_recording(folder / "back" / path.name), load_recording(path)
        assert got.digest == want.digest
        assert (folder / "view" / f"{path.stem}.mcap").is_file()
        assert (folder / "tables" / f"{path.stem}.csv").is_file()
    assert len(list((folder / "back").glob("*.parquet"))) == 5


def test_how_to(folder):
    save_grasps(folder / "recordings")
    assert blocks.run_page(DOCS / "how-to.md") == 3
    assert (folder / "part.parquet").exists()


PAGES = [
    *DOCS.rglob("*.md"),
    blocks.ROOT / "README.md",
    blocks.ROOT / "CONTRIBUTING.md",
    blocks.ROOT / "CHANGELOG.md",
    blocks.ROOT / "examples" / "README.md",
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(blocks.ROOT)))
def test_the_links_exist(page):
    for target, anchor in blocks.links_of(page):
        path = (page.parent / target).resolve() if target else page
        assert path.exists(), target
        if anchor and path.suffix == ".md":
            assert anchor in blocks.anchors_of(path), f"{target}#{anchor}"


FIRST_DAY = DOCS / "tutorials" / "your-hand.md"
LIMITS = {
    "doctor": ("--seconds 2", None),
    "serve": ("--port 0 --no-browser", "Ctrl-C stops it"),
    "calibrate": ("--seconds 12 --speed 0 --force", None),
    "detect": ("", "Ctrl-C stops"),
    "teach": ("2> log < <(printf 'next\\nquit\\n') || grep 'recordings go to' log", None),
}
"""What keeps the line of each verb short, and the text at which one that goes on is interrupted."""


def hand_lines():
    """The lines of the five steps that have the address of a hand, with `twin:` in its place."""
    for block in blocks.blocks_of(FIRST_DAY):
        if block.section[:1].isdigit():
            for line in blocks.lines_of(block.text):
                if "xela://auto" in line:
                    yield re.sub(r'"?xela://auto\S*', "twin:", line)


@pytest.mark.parametrize("line", list(hand_lines()), ids=lambda line: line.split()[1])
def test_a_line_for_a_hand_runs_with_the_twin(folder, line):
    """Without the model that `calibrate` would have written, `builtin:any` is detected with."""
    end, until = LIMITS[line.split()[1]]
    line = f"{line.replace('detect mine.json', 'detect builtin:any')} {end}"
    blocks.run_line(line, blocks.Block(FIRST_DAY.name, 0, "sh", line, "", ""), until=until)
