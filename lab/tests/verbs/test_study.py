import json

import msgspec
import pytest

from command_line import Verb
from holdfast import simulated_grasps
from holdfast.synthetic import synthetic_recording
from holdfast.twin import simulation
from holdfast.twin.profile import profile
from holdfast_lab.study import corpora
from holdfast_lab.study import run as study_run
from holdfast_lab.study.paper import paper_tables
from study.example_recordings import save_all

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def nowhere(monkeypatch, tmp_path):
    """No real recordings, and few tasks."""
    monkeypatch.setenv("HOLDFAST_DATA", str(tmp_path / "nothing"))
    few = {name: study_run.PARTS[name] for name in ("paper", "experiments")}
    monkeypatch.setattr(study_run, "PARTS", few)
    monkeypatch.setattr(paper_tables, "QUICK_WINDOWS", (14,))
    monkeypatch.setattr(paper_tables, "ABLATION_WINDOWS", (14,))


@pytest.fixture
def data(tmp_path):
    return save_all(tmp_path / "data", [synthetic_recording(f"grasp-{k}", k) for k in range(3)])


VERB = Verb("study")
run, refusal = VERB.run, VERB.refusal


def test_the_twin_simulates_the_recordings_first(capsys, monkeypatch, tmp_path):
    brief = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=1.5)
    monkeypatch.setattr(simulation, "profile", lambda name: brief)
    monkeypatch.setattr(corpora, "QUICK_CORPORA", {"main": corpora.TwinCorpus(repeats=1)})
    known = simulated_grasps.plan_grasps
    monkeypatch.setattr(
        simulated_grasps, "plan_grasps", lambda _, *rest, **more: known("can", *rest, **more)
    )
    out = tmp_path / "out"
    words = ("--twin", "--quick", "--jobs", 1, "--out", out, "--json")
    code, printed, err = run(capsys, *words)
    assert code == 0, err
    names = {path.stem for path in (out / "data/quick/main").iterdir()}
    assert {"can-case1-1", "can-case2-1"} <= names
    assert json.loads(printed)["data"]["main"]["recordings"] == len(names)
    code, printed, err = run(capsys, *words, "--force", "--seed", 3)
    assert (code, printed) == (2, "")
    assert "seed 0" in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "--twin expected, neither given"),
        (("data", "--twin"), "--twin expected, both given"),
        (("none",), "none"),
        (("data", "--quick", "--full"), "--quick or --full"),
        (("data", "--seed", -1), "-1 given"),
        (("data", "--jobs", 0), "0 given"),
        (("data", "--tare", "often"), "tare"),
        (("data", "--engine", "spark"), "'spark'"),
    ],
)
def test_bad_input(capsys, data, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    assert message in refusal(capsys, *words, "--out", "out")
    assert not (tmp_path / "out").exists()
