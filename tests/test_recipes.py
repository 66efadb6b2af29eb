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

    def run(self, *arguments, exit_code=0):
        """Run Python with the copy, and return its output, or its errors if it is to fail."""
        environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        command = [sys.executable, *map(str, arguments)]
        ended = subprocess.run(
            command, capture_output=True, text=True, env=environment, check=False, timeout=1500
        )
        assert ended.returncode == exit_code, ended.stderr
        return ended.stderr if exit_code else ended.stdout

    def _check(self, name):
        assert name in self._named, f"the recipe does not name {name}, but {self._named}"


@pytest.fixture
def copy_of(tmp_path):
    return lambda title: Copy(tmp_path, title)


MIDDLE = '''
"""Cut of one feature in the middle between the means of the classes."""

from dataclasses import dataclass, field

from holdfast.classifiers.fitting import Fitted, check_classes, sigmoid, standardise
from holdfast.classifiers.linear import Linear


@dataclass(frozen=True)
class Middle:
    """The direction is that of the difference of the means."""

    name: str = "middle"
    reference: dict = field(default_factory=dict)

    def suggest(self, trial):
        """Return no parameters."""
        return {}

    def fit(self, samples, parameters, seed):
        """Fit the means."""
        check_classes(samples)
        mean, scale, rows = standardise(samples.features)
        high, low = rows[samples.positive].mean(axis=0), rows[~samples.positive].mean(axis=0)
        slope, offset = sigmoid(rows @ (high - low), samples.positive)
        return Fitted(Linear.of(mean, scale, high - low, 0.0, slope=slope, offset=offset))
'''


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


def test_add_a_classifier(copy_of, tmp_path):
    copy = copy_of("Add a classifier")
    copy.add("holdfast/classifiers/middle.py", "name", MIDDLE)
    copy.change(
        "holdfast/classifiers/__init__.py",
        ("from holdfast.classifiers.svm", "from holdfast.classifiers.middle import Middle\n"
         "from holdfast.classifiers.svm"),
        ('"svm": LinearSVM()}', '"svm": LinearSVM(), "middle": Middle()}'),
    )  # fmt: skip
    data, model = labelled_recordings(tmp_path / "data"), tmp_path / "model.json"
    copy.run(
        *VERB, "train", data, "-o", model, "--classifier", "middle", "--trials", "0",
        "--shared", "--jobs", "1",
    )  # fmt: skip
    written = json.loads(model.read_text())["fingers"]["*"]["heads"][0]
    assert written["rule"]["type"] == "linear"
    program = (
        "import sys; from holdfast import Model, detect, load_recording\n"
        "print(len(detect(Model.load(sys.argv[1]), load_recording(sys.argv[2])).times))"
    )
    assert int(copy.run("-c", program, model, data / "grasp-0.mcap")) > 100


PAD = """def _pad() -> Sensor:
    return flat_sensor("pad", 2, 3, 0.004)


"""


def test_add_a_sensor(copy_of):
    copy = copy_of("Add a sensor")
    copy.change(
        "holdfast/sensors/built_in.py",
        ('    "anyskin": anyskin,\n', '    "anyskin": anyskin,\n    "pad": _pad,\n'),
        ("SENSORS = {", PAD + "SENSORS = {"),
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

    def wishes(self, touches, time, dt):
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
        "print(law_named('double').wishes([Touch('thumb')], 0.0, 0.01)[0][0])"
    )
    assert copy.run("-c", program) == "2.0\n"


C_FEATURES = (
    "    const hf_real *const newest = hf_history(f, 0);\n",
    """    if (kind == HOLDFAST_SHEAR) { /* |F_tip - (F_tip . z) z| of the newest sample */
        return hf_sqrt(newest[1] * newest[1] + newest[2] * newest[2]);
    }
    if (kind == HOLDFAST_RANGE) { /* max F_a - min F_a over the window */
        hf_real least = newest[0], most = newest[0];
        for (size_t back = 1; back < window; ++back) {
            least = hf_min(least, hf_history(f, back)[0]);
            most = hf_max(most, hf_history(f, back)[0]);
        }
        return most - least;
    }
""",
)

CHECK_FEATURES = """
import sys
from dataclasses import replace
import numpy as np
from holdfast import Detector, Model, detect, fingertip_force, load_recording
from holdfast.features.stream import extract

model, recording = Model.load(sys.argv[1]), load_recording(sys.argv[2])
model.save(sys.argv[3])
assert Model.load(sys.argv[3]).digest == model.digest
names = [str(spec) for spec in model.finger("thumb").features]
assert names == ["F_a", "shear", "range[14]"], names

# The values of the kernel are those of NumPy, of a skin from which no field of the earth is taken.
plan = model.plan(model.fingers_of({n: m.sensor for n, m in recording.modules.items()}), 150.0)
sensors = {n: replace(sensor, magnetic=False) for n, sensor in plan.sensors.items()}
plan = replace(plan, sensors=sensors)
features = extract(plan, recording)
for finger, module in recording.modules.items():
    force = fingertip_force(module.readings, module.sensor, model.tare, module.times)
    amplitude = np.linalg.norm(force, axis=1)
    windows = np.lib.stride_tricks.sliding_window_view(amplitude, 14)
    shear, extent = np.hypot(force[13:, 0], force[13:, 1]), np.ptp(windows, axis=1)
    rows = features[finger].features[13:]
    known = np.isfinite(rows).all(axis=1)
    assert known.sum() > 100
    np.testing.assert_allclose(rows[known, 1], shear[known], atol=1e-9)
    np.testing.assert_allclose(rows[known, 2], extent[known], atol=1e-9)

# A detector that is fed sample by sample gives the same bits as the whole recording.
batch, detector = detect(model, recording), Detector(model, rate=recording.rate)
for k, time in enumerate(recording.modules["thumb"].times):
    live = detector.update({n: m.readings[k] for n, m in recording.modules.items()}, time)
    for finger, trace in batch.fingers.items():
        assert repr(live.fingers[finger]) == repr(trace.estimate(k)), (finger, k)
print(np.isfinite(batch.fingers["thumb"].stable_probability).sum())
"""


def test_add_a_feature(copy_of, tmp_path):
    copy = copy_of("Add a feature")
    copy.change(
        "holdfast/features/specs.py",
        ('        # The change of F_tip, and its',
         '        FeatureKind("shear", "force", "sample"),\n'
         '        FeatureKind("range", "force", "window"),\n'
         '        # The change of F_tip, and its'),
    )  # fmt: skip
    copy.change(
        "holdfast/kernel/kernel.h",
        ("HOLDFAST_FIRST_RELATIVE = 8,",
         "HOLDFAST_SHEAR = 8, HOLDFAST_RANGE = 9, HOLDFAST_FIRST_RELATIVE = 10,"),
    )  # fmt: skip
    copy.change("holdfast/kernel/stream.c", (C_FEATURES[0], "".join(C_FEATURES)))
    copy.change(
        "holdfast/kernel/tables.c",
        ("feature->kind >= HOLDFAST_M && !has_lag;",
         "feature->kind >= HOLDFAST_M && feature->kind != HOLDFAST_SHEAR && !has_lag;"),
    )  # fmt: skip
    copy.build()
    data, model = labelled_recordings(tmp_path / "data"), tmp_path / "model.json"
    copy.run(
        *VERB, "train", data, "-o", model, "--features", "F_a,shear,range", "--trials", "0",
        "--jobs", "1",
    )  # fmt: skip
    recording, again = data / "grasp-0.mcap", tmp_path / "again.json"
    assert int(copy.run("-c", CHECK_FEATURES, model, recording, again)) > 100
    assert again.read_bytes() == model.read_bytes()


IMPORTER = '''
"""Import of taps: a line of JSON for each sample, with its time and the taxels of a fingertip."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from holdfast.errors import RecordingError
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
    try:
        rows = [json.loads(line) for line in read_input(path, 1 << 20).splitlines()]
        times = np.array([row["t"] for row in rows], dtype=np.float64)
        readings = np.array([row["taxels"] for row in rows])
        yield Recording(path.stem, {"index": Tactile(sensor("uskin-4x4"), times, readings)})
    except (KeyError, TypeError, ValueError) as cause:
        raise RecordingError(f"{path} is no file of taps: {cause}") from cause
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
    file.write_text('{"t": 1}')
    broken = copy.run(*VERB, "import", file, out, "--format", "finger-taps", exit_code=2)
    assert broken == f"holdfast: {file} is no file of taps: 'taxels'\n"


def test_a_file_that_the_recipe_does_not_name_is_noticed(copy_of):
    copy = copy_of("Add a grip law")
    with pytest.raises(AssertionError, match=r"does not name holdfast_grip/controller"):
        copy.change("holdfast_grip/controller.py")
