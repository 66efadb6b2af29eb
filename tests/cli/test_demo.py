import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from command_line import Verb
from holdfast import simulated_grasps
from holdfast.cli import demo as verb
from holdfast.contact import STABLE
from holdfast.demo_data import BOX_SLIPS
from holdfast.detection import Model, detect
from holdfast.io import load_dataset, load_recording
from holdfast.parallel import Engine
from holdfast.twin import simulation
from holdfast.twin.profile import profile

SHORT = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=6.0)


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Simulate one mug per case, in this process."""
    whole = simulated_grasps.simulate_grasps
    monkeypatch.setattr(verb, "DEMO_OBJECTS", "mug")
    monkeypatch.setattr(verb, "N_DEMO_REPEATS", 1)
    monkeypatch.setattr(simulation, "profile", lambda name: SHORT)
    monkeypatch.setattr(
        simulated_grasps,
        "simulate_grasps",
        lambda *given, **named: whole(*given, **{**named, "engine": Engine(1)}),
    )


run = Verb("demo").run


def test_simulates_trains_and_replays(capsys, tmp_path):
    folder = tmp_path / "demo"
    code, out, err = run(capsys, folder, "--speed", 0, "--json")
    assert code == 0
    result = json.loads(out)
    recordings = load_dataset(result["recordings"])
    assert list(recordings.names) == ["mug-case1-1", "mug-case2-1"]
    assert tuple(Model.load(result["model"]).fingers) == ("thumb", "index", "middle", "ring")
    assert result["replay"]["hand"]["n_samples"] == recordings[1].modules["thumb"].n_samples
    assert {change["finger"] for change in result["real"]["events"]} >= {"finger1", "hand"}
    assert 50 < result["accuracy"] <= 100
    assert result["shipped"]["model"] == verb.DEMO_MODEL
    assert result["shipped"]["metrics"]["events"]["hand"]["onsets"] == "truth"
    assert result["seconds"] > 0
    assert Path(result["picture"]).stat().st_size > 0
    assert err.count("/5  ") == 5
    assert all(len(line) <= 80 for line in err[err.index("5/5") :].splitlines()[1:])
    code, out, err = run(capsys, folder, "--speed", 0)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "model.json exists already" in err
    code, out, _ = run(capsys, folder, "--speed", 0, "--seed", 1, "--force")
    assert code == 0
    assert {r.metadata["seed"] for r in load_dataset(folder / "recordings")} == {1}
    # What it shows stands last, with the picture, and all of it fits a terminal.
    lines = out.rstrip("\n").splitlines()
    assert len(lines) < 24
    assert lines[-1].startswith(f"{folder}/box-slips.png: UNSTABLE {result['lead']:.2f} s before")
    assert all(len(line) <= 80 for line in lines if str(folder) not in line)
    assert f"{folder}/recordings" in out and "holdfast evaluate builtin:" in out


def test_the_lead_is_that_of_the_unstable_time_that_the_slip_is_in():
    """Against the detection of the whole recording, sample by sample."""
    recording = load_recording(BOX_SLIPS)
    (slip,) = [x for x in recording.modules["finger1"].labels if x.cause == "slip"]
    trace = detect(Model.load("builtin:any"), recording).fingers["finger1"]
    stable = trace.times[(trace.times < slip.start) & (trace.state == STABLE)]
    summary, label = verb.show_real_recording(0)
    assert label == slip
    assert 0 < verb.unstable_since(summary, slip) - stable[-1] < 2 / 60


def test_a_second_run_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("holdfast-demo", "holdfast-demo-2", "holdfast-demo-3"):
        assert verb.new_folder(force=False) == Path(name)
        Path(name).mkdir()
    assert verb.new_folder(force=True) == Path("holdfast-demo")


def test_the_objects_are_not_those_of_the_training():
    from holdfast.twin.objects import OTHER_OBJECTS, load_objects

    model = Model.load(verb.DEMO_MODEL)
    names = "mug", "carton"
    assert set(names) <= set(load_objects(OTHER_OBJECTS))
    assert not any(name in seen for name in names for seen in model.training.recordings)


def test_an_interrupt_leaves_no_process_and_no_warning(tmp_path):
    """While it replays: an interrupt could be lost while modules are imported."""
    program = "import sys; from holdfast.cli import main; sys.exit(main())"
    command = [sys.executable, "-c", program, "demo", str(tmp_path / "demo"), "--no-browser"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, start_new_session=True, **pipes) as process:
        assert any(" UNSTABLE " in line for line in process.stderr)
        os.killpg(process.pid, signal.SIGINT)
        _, rest = process.communicate(timeout=60)
    assert process.returncode == 130
    assert rest.splitlines()[-1] == "holdfast: interrupted"
    assert not re.search(r"Traceback|[Ww]arning|leaked", rest)
    with pytest.raises(ProcessLookupError):  # the group of its children is empty
        os.killpg(process.pid, 0)
