import ast
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from holdfast_lab.source_digest import PACKAGES, _closure

import holdfast
from holdfast.errors import ModelError
from holdfast.model import Model
from holdfast_grip import laws
from holdfast_lab.trial import plan as trial_plan
from holdfast_lab.trial.plan import SIMULATION, TrialPlan, run_numbered

PACKAGE = Path(holdfast.__file__).parent


def trial_modules(law):
    """Return the names of the modules on which a trial with a law depends."""
    own = type(laws.LAWS[law]()).__module__
    others = {type(factory()).__module__ for factory in laws.LAWS.values()} - {own}
    return set(_closure((*SIMULATION, own), (*others, laws.__name__)))


def version(law):
    return TrialPlan((law,), 1).trial_task(0, law).version


@pytest.fixture
def fresh():
    """Versions are computed again, before and after the test."""
    trial_plan.law_version.cache_clear()
    yield
    trial_plan.law_version.cache_clear()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"laws": ("magic",)}, r"^unknown law 'magic'; there are fixed, "),
        ({"laws": ("fixed", "fixed")}, r"^the law 'fixed' is given twice$"),
        ({"n": 0}, r"^at least 1 trial expected, 0 given$"),
        ({"seed": -1}, r"^a seed of at least 0 expected, -1 given$"),
        ({"plant": "soft"}, r"^unknown plant 'soft'; there are mild, hard$"),
    ],
)
def test_a_plan_refuses_what_cannot_be_run(given, message):
    with pytest.raises(ValueError, match=message):
        TrialPlan(**given)


def test_a_model_without_a_finger_is_refused(tmp_path):
    model = Model.load("builtin:noise-floor")
    one = model.fingers["*"]
    lacking = msgspec.structs.replace(model, fingers={"thumb": one, "index": one, "middle": one})
    lacking.save(tmp_path / "three.json")
    message = r"the trials need thumb, index, middle, ring; the model has no ring, only thumb"
    with pytest.raises(ModelError, match=message):
        TrialPlan(model=str(tmp_path / "three.json"))


def test_a_model_with_a_tare_of_a_recording_is_refused(tmp_path):
    model = msgspec.structs.replace(Model.load("builtin:noise-floor"), tare="0:1")
    model.save(tmp_path / "interval.json")
    with pytest.raises(ModelError, match="where samples come one by one"):
        TrialPlan(model=str(tmp_path / "interval.json"))


def test_a_worker_with_another_model_is_refused():
    with pytest.raises(ModelError, match=r"builtin:any has another content here: copy it to every"):
        run_numbered(0, 0, "fixed", "builtin:any", "another")


def test_a_result_is_stored_for_its_plant():
    tasks = {}
    for plant in ("mild", "hard"):
        plan = TrialPlan(("fixed",), 1, plant=plant)
        film = plan.film_task(0, ("fixed", "holdfast"))
        tasks[plant] = [plan.trial_task(0, "fixed"), plan.course_task(0, "fixed"), film]
    for mild, hard in zip(tasks["mild"], tasks["hard"], strict=True):
        assert mild.arguments != hard.arguments
        assert mild.version == hard.version


class TestVersion:
    def test_it_depends_on_the_constants_of_the_law(self, fresh, monkeypatch):
        before = {law: version(law) for law in ("pr2", "holdfast")}
        trial_plan.law_version.cache_clear()
        monkeypatch.setitem(laws.LAWS, "holdfast", lambda: laws.Stability(fall=0.6))
        assert version("holdfast") != before["holdfast"]
        assert version("pr2") == before["pr2"]

    def test_it_does_not_depend_on_files_of_other_laws(self):
        modules = trial_modules("pr2")
        assert {"holdfast_grip.laws.pr2", "holdfast_grip.laws.base"} <= modules
        assert not {"holdfast_grip.laws", "holdfast_grip.laws.stability"} & modules

    def test_it_depends_on_all_that_a_trial_imports(self):
        code = "import sys, holdfast_lab.trial.run; print(*sys.modules)"
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        loaded = {name for name in done.stdout.split() if name.split(".")[0] in PACKAGES}
        other_laws = {name for name in loaded if name.startswith("holdfast_grip.laws")}
        # their C files count beside the packages
        compiled = {"holdfast.kernel._extension", "holdfast.twin.steps"}
        assert loaded - other_laws - compiled <= trial_modules("holdfast")

    def test_it_does_not_depend_on_what_shows_the_results(self):
        parts = {name.split(".")[1] for name in trial_modules("pr2") if "." in name}
        assert not parts & {"cli", "devices", "io", "labelling", "live", "plots", "report", "web"}
        assert "holdfast_lab.trial.course" not in trial_modules("pr2")

    def test_no_law_imports_another(self):
        modules = {type(law()).__module__ for law in laws.LAWS.values()}
        for module in modules:
            path = Path(sys.modules[module].__file__)
            imported = {
                node.module
                for node in ast.walk(ast.parse(path.read_text("utf-8")))
                if isinstance(node, ast.ImportFrom)
            }
            assert not imported & (modules - {module})
