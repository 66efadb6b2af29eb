import json

import msgspec
import pytest

from command_line import Verb
from holdfast import cluster, twin_recordings
from holdfast.contact import ContactState
from holdfast.recordings import Label
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


def test_own_recordings(capsys, data, tmp_path):
    out = tmp_path / "out"
    code, printed, err = run(capsys, data, "--out", out, "--quick", "--jobs", 1)
    assert code == 0, err
    assert printed.startswith("The paper's Table I: confusion [%] (in parentheses: the paper)\n")
    assert printed.endswith(f"{out / 'report.md'}: all 7 tables and the figures\n")
    assert "making tables and figures\n" in err
    assert {path.name for path in out.iterdir()} == {
        "report.md", "study.json", "tables", "figures", "work",
    }  # fmt: skip
    summary = json.loads((out / "study.json").read_text())
    assert summary["left_out"] == []
    assert summary["data"]["real"] == summary["data"]["main"]
    assert "already holds a study" in refusal(capsys, data, "--out", out, "--quick")
    code, printed, _ = run(capsys, data, "--out", out, "--quick", "--force", "--json")
    assert code == 0, err
    assert json.loads(printed) == json.loads((out / "study.json").read_text())


def test_the_twin_simulates_the_recordings_first(capsys, monkeypatch, tmp_path):
    brief = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=1.5)
    monkeypatch.setattr(simulation, "profile", lambda name: brief)
    monkeypatch.setattr(corpora, "QUICK_CORPORA", {"main": corpora.TwinCorpus(repeats=1)})
    known = twin_recordings.plan_grasps
    monkeypatch.setattr(
        twin_recordings, "plan_grasps", lambda _, *rest, **more: known("can", *rest, **more)
    )
    out = tmp_path / "out"
    words = ("--twin", "--quick", "--jobs", 1, "--out", out, "--json")
    code, printed, err = run(capsys, *words)
    assert code == 0, err
    assert "recordings of the twin, 1 of 1: main\n" in err
    names = {path.stem for path in (out / "data/quick/main").iterdir()}
    assert {"can-case1-1", "can-case2-1"} <= names
    assert json.loads(printed)["data"]["main"]["recordings"] == len(names)
    assert "These recordings are simulated" in (out / "report.md").read_text()
    assert refusal_after(capsys, *words, "--force", "--seed", 3).endswith(
        "can-case1-1.parquet has profile reference, seed 0, server False; profile "
        "reference, seed 3, server False given: choose another OUT, or delete its data"
    )


def refusal_after(capsys, *words):
    """Return the last line; the lines before report the progress."""
    code, printed, err = run(capsys, *words)
    assert (code, printed) == (2, "")
    return err.splitlines()[-1].removeprefix("holdfast: ")


class TestBadInput:
    def test_recordings_or_twin(self, capsys, data, tmp_path):
        message = "a folder of recordings or --twin expected, {} given"
        assert refusal(capsys, "--out", tmp_path / "out") == message.format("neither")
        assert refusal(capsys, data, "--twin") == message.format("both")
        assert "there is no folder" in refusal(capsys, tmp_path / "no", "--out", tmp_path / "out")

    def test_numbers(self, capsys, data):
        both = refusal(capsys, data, "--quick", "--full")
        assert both == "--quick or --full expected, both given"
        assert refusal(capsys, data, "--seed", -1) == "a seed of at least 0 expected, -1 given"
        assert refusal(capsys, data, "--jobs", 0) == "jobs other than 0 expected, 0 given"
        assert "tare" in refusal(capsys, data, "--tare", "often")

    def test_labels(self, capsys, tmp_path):
        one = synthetic_recording("a", 0)
        two = synthetic_recording("b", 1)
        cases = {
            "none": ([one.with_labels({}), two.with_labels({})], "has labels to train from"),
            "class": ([stable(one), stable(two)], "a finger with both is needed"),
            "single": ([one], "one recording with labels given (a); at least two are needed"),
        }
        for name, (recordings, message) in cases.items():
            folder = save_all(tmp_path / name, recordings)
            assert message in refusal(capsys, folder, "--out", tmp_path / "out")
        assert not (tmp_path / "out").exists()

    def test_engine(self, capsys, data, tmp_path, monkeypatch):
        out = ("--out", tmp_path / "out")
        assert refusal(capsys, data, *out, "--engine", "spark") == (
            "unknown engine 'spark'; there are loky and dask:ADDRESS"
        )
        pytest.importorskip("distributed")
        monkeypatch.setattr(cluster, "SCHEDULER_TIMEOUT", 0.3)
        err = refusal(capsys, data, *out, "--engine", "dask:tcp://127.0.0.1:9")
        assert err.startswith("no Dask scheduler answers at tcp://127.0.0.1:9: start one with")
        assert not (tmp_path / "out").exists()


def stable(recording):
    labels = {
        finger: [Label(module.times[0], module.times[-1], ContactState.STABLE)]
        for finger, module in recording.modules.items()
    }
    return recording.with_labels(labels)
