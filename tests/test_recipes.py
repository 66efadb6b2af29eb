"""The recipes of docs/recipes.md, followed in a temporary copy: only the files that they name."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import holdfast
from holdfast.contact import ContactState
from holdfast.io import load_recording, save_recording
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording

PACKAGE = Path(holdfast.__file__).parent
ROOT = Path(__file__).parents[1]
RECIPES = ROOT / "docs" / "recipes.md"


VERB = ("-c", "import sys; from holdfast.cli import main; sys.exit(main())")


class Copy:
    """A copy of the package that a recipe changes.

    Args:
        folder: for the copy.
        title: of the recipe.
    """

    def __init__(self, folder, title):
        ignored = shutil.ignore_patterns("static", "page")
        for package in (PACKAGE, *ROOT.glob("packages/*/holdfast_*")):
            shutil.copytree(package, folder / package.name, ignore=ignored)
        section = RECIPES.read_text("utf-8").split(f"## {title}\n")[1].split("\n## ")[0]
        prefixes = r"(?:src/|packages/[\w-]+/)?"
        named = re.findall(rf"`{prefixes}(holdfast\w*/[\w/<>.]+)`", section)
        self.folder, self._named = folder, set(named)

    def add(self, name, kind, text):
        """Write a new file, which the recipe calls after its kind: `<kind>.py`."""
        self._check(str(Path(name).with_name(f"<{kind}>.py")))
        assert not (self.folder / name).exists()
        (self.folder / name).write_text(text)

    def change(self, name, *changes):
        """Replace texts of a file; each occurs once."""
        self._check(name)
        text = (self.folder / name).read_text()
        for before, after in changes:
            assert text.count(before) == 1, f"{before!r} in {name}"
            text = text.replace(before, after)
        (self.folder / name).write_text(text)

    def build(self):
        """Build the C kernel of the copy, as `uv run` does after a change of it."""
        root = self.folder / "clone"
        root.mkdir()
        for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
            shutil.copy(ROOT / name, root)
        (root / "src").mkdir()
        (root / "src" / "holdfast").symlink_to(self.folder / "holdfast")
        command = (sys.executable, "-c", "import setup; setup.build_editable('.')")
        ended = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
        assert ended.returncode == 0, ended.stderr

    def run(self, *arguments):
        """Run Python with the copy, and return its output."""
        environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        command = [sys.executable, *map(str, arguments)]
        ended = subprocess.run(
            command, capture_output=True, text=True, env=environment, check=False, timeout=1500
        )
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def _check(self, name):
        assert name in self._named, f"the recipe does not name {name}, but {self._named}"


@pytest.fixture
def copy_of(tmp_path):
    return lambda title: Copy(tmp_path, title)


def labelled_recordings(folder):
    """Two recordings whose first half is stable."""
    folder.mkdir()
    for seed in (0, 1):
        recording = synthetic_recording(f"grasp-{seed}", seed=seed)
        start, end = recording.start, recording.end
        middle = (start + end) / 2
        labels = [
            Label(start, middle, ContactState.STABLE),
            Label(middle, end, ContactState.UNSTABLE),
        ]
        labelled = recording.with_labels(dict.fromkeys(recording.modules, labels))
        save_recording(labelled, folder / f"grasp-{seed}.mcap")
    return folder


PAD = """def _pad() -> Sensor:
    return flat_sensor("pad", 2, 3, 0.004)


"""


def test_add_a_sensor(copy_of):
    copy = copy_of("Add a sensor")
    copy.change(
        "holdfast/sensors/built_in.py",
        ("SENSORS_BY_MAKER: ", PAD + "SENSORS_BY_MAKER: "),
        ('    "AnySkin":', '    "Pads": {"pad": _pad},\n    "AnySkin":'),
    )  # fmt: skip
    shown = json.loads(copy.run(*VERB, "sensors", "pad", "--json"))
    assert "pad" in json.dumps(shown)


LAW = '''
"""A law that wants twice the force from the start."""

from holdfast.contact import Cause
from holdfast_grip.command import GripReason
from holdfast_grip.laws.base import Law


class Double(Law):
    """Law that doubles every force."""

    def start(self, touches, thumb):
        """Do nothing."""

    def targets(self, touches, time, dt):
        """Return twice the force for each finger."""
        return [(2.0, GripReason.NONE) for touch in touches]
'''


def test_add_a_grip_law(copy_of):
    copy = copy_of("Add a grip law")
    copy.add("holdfast_grip/laws/double.py", "name", LAW)
    copy.change(
        "holdfast_grip/laws/__init__.py",
        ("from holdfast_grip.laws.friction_margin", "from holdfast_grip.laws.double import Double\n"
         "from holdfast_grip.laws.friction_margin"),
        ('    "fixed": Fixed,\n', '    "fixed": Fixed,\n    "double": Double,\n'),
    )  # fmt: skip
    program = (
        "from holdfast_grip.laws import law_named, Touch\n"
        "print(law_named('double').targets([Touch('thumb')], 0.0, 0.01)[0][0])"
    )
    assert copy.run("-c", program) == "2.0\n"


HISTORY = "    const hf_real *const newest = hf_history(f, 0);\n"
SHEAR = """    if (kind == HOLDFAST_SHEAR) { /* |F_tip - (F_tip . z) z| of the newest sample */
        return hf_sqrt(newest[1] * newest[1] + newest[2] * newest[2]);
    }
"""

CHECK_FEATURES = """
import sys
from dataclasses import replace
import numpy as np
from holdfast import Model, fingertip_force, load_recording
from holdfast.detection.features import extract

model, recording = Model.load(sys.argv[1]), load_recording(sys.argv[2])
assert [str(spec) for spec in model.finger("thumb").features] == ["F_a", "shear"]

# The values of the kernel are those of NumPy, of a skin from which no field of the earth is taken.
plan = model.plan(model.fingers_of({n: m.sensor for n, m in recording.modules.items()}), 150.0)
sensors = {n: replace(sensor, magnetic=False) for n, sensor in plan.sensors.items()}
features = extract(replace(plan, sensors=sensors), recording)
for finger, module in recording.modules.items():
    force = fingertip_force(module.readings, module.sensor, model.tare, module.times)
    shear = features[finger].features[:, 1]
    known = np.isfinite(shear)
    np.testing.assert_allclose(shear[known], np.hypot(*force.T[:2])[known], atol=1e-9)
    print(known.sum())
"""


def test_add_a_feature(copy_of, tmp_path):
    copy = copy_of("Add a feature")
    copy.change(
        "holdfast/detection/specs.py",
        ('        # The change of F_tip, and its',
         '        FeatureKind("shear", "force", "sample"),\n'
         '        # The change of F_tip, and its'),
    )  # fmt: skip
    copy.change(
        "holdfast/kernel/holdfast.h",
        ("HOLDFAST_FIRST_RELATIVE = 8,", "HOLDFAST_SHEAR = 8, HOLDFAST_FIRST_RELATIVE = 9,"),
    )
    copy.change("holdfast/kernel/stream.c", (HISTORY, HISTORY + SHEAR))
    copy.change(
        "holdfast/kernel/tables.c",
        ("feature->kind >= HOLDFAST_M && !has_lag;",
         "feature->kind >= HOLDFAST_M && feature->kind != HOLDFAST_SHEAR && !has_lag;"),
    )  # fmt: skip
    copy.build()
    data, model = labelled_recordings(tmp_path / "data"), tmp_path / "model.json"
    copy.run(
        *VERB, "train", data, "-o", model, "--features", "F_a,shear", "--trials", "0", "--jobs", "1"
    )
    known = copy.run("-c", CHECK_FEATURES, model, data / "grasp-0.mcap")
    assert min(map(int, known.split())) > 100


IMPORTER = '''
"""Import of taps: a line of JSON for each sample, with its time and the taxels of a fingertip."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.files import read_input
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor


def can_read(path: Path) -> bool:
    """Return whether `path` is such a file."""
    return path.suffix == ".taps"


def parts(path: Path) -> list[Path]:
    """Return the file."""
    return [path]


def read(path: Path) -> Iterator[Recording]:
    """Read the recording of a file."""
    rows = [json.loads(line) for line in read_input(path, 1 << 20).splitlines()]
    times = np.array([row["t"] for row in rows], dtype=np.float64)
    readings = np.array([row["taxels"] for row in rows])
    yield Recording(path.stem, {"index": Tactile(sensor("uskin-4x4"), times, readings)})
'''


def test_add_a_file_format(copy_of, tmp_path):
    copy = copy_of("Add a file format to import")
    copy.add("holdfast/io/importers/finger_taps.py", "format", IMPORTER)
    copy.change(
        "holdfast/io/importers/__init__.py",
        ("FORMATS = {\n", 'FORMATS = {\n    "finger-taps": "lines of JSON",\n'),
    )
    rows = [{"t": k / 100, "taxels": [[k, 0, 1000 + k]] * 16} for k in range(50)]
    file, out = tmp_path / "tap.taps", tmp_path / "out"
    file.write_text("\n".join(map(json.dumps, rows)))
    copy.run(*VERB, "import", file, out, "--suffix", "mcap")
    module = load_recording(out / "tap.mcap").modules["index"]
    assert module.times.tolist() == [row["t"] for row in rows]
    assert module.readings.tolist() == [row["taxels"] for row in rows]
