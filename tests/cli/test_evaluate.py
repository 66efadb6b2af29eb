import json
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from command_line import Verb
from holdfast.detection import Model
from holdfast.io import load_dataset, load_recording, save_recording
from holdfast.training import evaluate
from holdfast.twin import simulation
from holdfast.twin.profile import profile
from holdfast.twin.simulation import Grasp, simulate

pytestmark = pytest.mark.slow


run = Verb("evaluate").run


def test_json_has_the_fields_of_the_contract_with_the_figures_of_the_library(capsys, grasps):
    code, out, err = run(capsys, grasps / "model.json", grasps / "new", "--json")
    assert (code, err) == (0, "")
    report = json.loads(out)
    assert {"fingers", "pooled", "recordings", "events", "trained_on"} <= set(report)
    assert report["trained_on"] == []
    assert [each["name"] for each in report["recordings"]] == ["grasp-2", "grasp-3"]
    metrics = evaluate(Model.load(grasps / "model.json"), load_dataset(grasps / "new"))
    assert report["pooled"]["confusion"] == metrics.pooled.confusion
    assert report["pooled"]["auc"] == metrics.pooled.auc


def test_training_recordings_are_named_even_if_renamed(capsys, grasps, tmp_path):
    seen = load_dataset(grasps / "seen")[1]
    save_recording(seen, tmp_path / "renamed.mcap")
    save_recording(load_dataset(grasps / "new")[0], tmp_path / "grasp-0.parquet")
    code, out, err = run(capsys, grasps / "model.json", tmp_path, "--json")
    assert code == 0
    assert json.loads(out)["trained_on"] == [load_dataset(tmp_path)[1].name]
    assert "was trained on 1 of these 2 recordings" in err


def test_the_tables_have_the_trivial_baseline(capsys, grasps):
    _, out, _ = run(capsys, grasps / "model.json", grasps / "new")
    _, document, _ = run(capsys, grasps / "model.json", grasps / "new", "--json")
    rows = [line.split()[2:] for line in out.splitlines() if "always STABLE " in line]
    (tn, fp), (fn, tp) = json.loads(document)["pooled"]["confusion"]
    n, n_events = tn + fp + fn + tp, json.loads(document)["events"]["hand"]["n_events"]
    share = f"{100 * (fn + tp) / n:.1f}"
    assert rows[-2][:2] == [str(n), share]
    assert rows[-1] == [str(n_events), "100.0", "100.0", "100.0", "never", "0.0", "0.0", "0.0"]


def mixed(grasps, folder, *, labels=True):
    """A folder with a recording that the model was trained on, and one that is new."""
    save_recording(load_dataset(grasps / "seen")[0], folder / "seen.parquet")
    new = load_dataset(grasps / "new")[0]
    save_recording(new if labels else new.with_labels({}), folder / "new.parquet")
    return folder


def test_no_verdict_on_training_recordings(capsys, grasps):
    _, out, _ = run(capsys, grasps / "model.json", grasps / "seen", "--json")
    assert json.loads(out)["verdict"] is None
    _, out, _ = run(capsys, grasps / "model.json", grasps / "seen")
    assert out.startswith("No verdict: ")


def test_the_verdict_is_from_unseen_recordings_only(capsys, grasps, tmp_path):
    model = grasps / "model.json"
    _, out, _ = run(capsys, model, mixed(grasps, tmp_path), "--json")
    _, alone, _ = run(capsys, model, tmp_path / "new.parquet", "--json")
    verdict = json.loads(out)["verdict"].removeprefix(json.loads(alone)["verdict"])
    assert verdict.startswith(" From 1 of 2 recordings")
    assert len(json.loads(out)["recordings"]) == 2


def test_a_plot_is_overwritten_only_by_force(capsys, grasps, tmp_path):
    plot = tmp_path / "plot.png"
    words = [grasps / "model.json", grasps / "new", "--plot", plot]
    assert run(capsys, *words)[::2] == (0, f"{plot} written\n")
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert list(tmp_path.iterdir()) == [plot]
    plot.write_text("mine")
    assert run(capsys, *words, "--force")[0] == 0
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.fixture(scope="module")
def twin_grasp(tmp_path_factory):
    """A short grasp of the twin that `builtin:twin` was not trained on."""
    short = msgspec.structs.replace(profile("reference"), idle=(0.7, 0.8), hold=4.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation, "profile", lambda _: short)
        recording = simulate(Grasp("box", 2, 1, seed=7))
    path = tmp_path_factory.mktemp("twin") / "box.parquet"
    save_recording(recording, path)
    return path


def test_a_truth_with_impacts_has_a_line_of_its_own(capsys, twin_grasp, tmp_path):
    grasp = load_recording(twin_grasp)
    truth, lock = grasp.truth, grasp.metadata["locked_at"]
    kinds = np.where(np.abs(truth.times - lock - 0.2) < 0.02, "knock", "")
    hit = replace(grasp, truth=replace(truth, hand={**truth.hand, "impact": kinds}))
    save_recording(hit, tmp_path / "hit.parquet")
    assert "Knocks, taps and bumps" in run(capsys, "builtin:twin", tmp_path / "hit.parquet")[1]
    report = json.loads(run(capsys, "builtin:twin", tmp_path / "hit.parquet", "--json")[1])
    assert report["slips"]["pooled"]["impacts"] == {"n": 4, "false_alarms_per_impact": 0.0}
