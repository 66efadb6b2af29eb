from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.recordings import Label
from holdfast.study.comparison import jobs, real_recordings
from holdfast.study.methods import METHODS
from holdfast.study.plan import StudyPlan, scan_corpus
from holdfast.study.report.table_layouts import to_html
from holdfast.synthetic import synthetic_recording
from study.example_recordings import save_all

DISTURBED = [
    Label(3.0, 5.3, ContactState.STABLE),
    Label(5.3, 6.5, ContactState.UNSTABLE),
    Label(6.5, 8.0, ContactState.STABLE),
]
CALM = [Label(3.0, 8.0, ContactState.STABLE)]


def run(plan):
    results = {}
    for task in real_recordings.tasks(plan):
        data = msgspec.msgpack.encode(task.function(*task.arguments))
        results[task.name] = msgspec.msgpack.decode(data, type=task.result)
    return real_recordings.tables(plan, results)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    """Recordings that begin while the object is held; two of four have no disturbance."""
    recordings = []
    for seed in range(4):
        recording = held_part(synthetic_recording(f"pick-{seed}", seed, ("finger1", "finger2")))
        recording = recording.with_labels(dict.fromkeys(recording.modules, DISTURBED))
        if seed > 1:
            recording = recording.with_labels(dict.fromkeys(recording.modules, CALM))
        recordings.append(recording)
    folder = save_all(tmp_path_factory.mktemp("real") / "real", recordings)
    return scan_corpus("real", folder, tare="first")


def held_part(recording):
    """Return the recording from 3 s to 8 s, around the disturbance, without metadata."""
    modules = {}
    for name, module in recording.modules.items():
        rows = slice(450, 1200)
        modules[name] = replace(
            module, times=module.times[rows], readings=np.array(module.readings[rows]), labels=()
        )
    return replace(recording, modules=modules, metadata={})


def test_each_recording_is_evaluated_by_a_fit_to_the_others(corpus, monkeypatch):
    names = ("logreg", "zhang", "jl_global_logreg")
    monkeypatch.setattr(jobs, "METHODS", {name: METHODS[name] for name in names})
    plan = StudyPlan({"main": corpus}, real=corpus)
    (job,) = (
        task.arguments[0] for task in real_recordings.tasks(plan) if task.name == "real/logreg"
    )
    assert job.effort.folds == 4
    (table,) = run(plan)
    assert table.name == "real"
    assert to_html(table)
    found = {(row.keys["recording"], row.keys["finger"]) for row in table.rows}
    fingers = ("finger1", "finger2", "hand")
    assert found == {(f"pick-{k}", finger) for k in (0, 1) for finger in fingers}
    for name in ("stable samples", "other samples"):
        n = {}
        for row in table.rows:
            if row.keys["figure"] == name and row.keys["finger"] != "hand":
                n.setdefault((row.keys["recording"], row.keys["finger"]), set()).add(row.ours)
        assert n and all(len(each) == 1 for each in n.values())
    assert {row.ours > 0 for row in table.rows if row.keys["figure"] == "without estimate [%]"} == {
        True
    }
    areas = [row.ours for row in table.rows if row.keys["figure"] == "AUC contact"]
    assert all(0 <= area <= 1 for area in areas)
    sigma = [r for r in table.rows if r.keys["method"] == METHODS["zhang"].title]
    assert all(row.ours > 0.8 for row in sigma if row.keys["figure"] == "AUC")


def test_without_real_recordings_there_is_nothing_to_do(corpus):
    plan = StudyPlan({"main": corpus})
    assert (
        real_recordings.tasks(plan),
        real_recordings.tables(plan, {}),
        real_recordings.figures(plan, {}),
    ) == ([], [], [])
