from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import ContactState
from holdfast.recordings import Label
from holdfast.synthetic import synthetic_recording
from holdfast_lab.report.table_layouts import to_markdown
from holdfast_lab.study.comparison import jobs, real_recordings
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import StudyPlan, scan_corpus
from study.example_recordings import results_of, save_all

pytestmark = pytest.mark.slow

DISTURBED = [
    Label(3.0, 5.3, ContactState.STABLE),
    Label(5.3, 6.5, ContactState.UNSTABLE),
    Label(6.5, 8.0, ContactState.STABLE),
]
CALM = [Label(3.0, 8.0, ContactState.STABLE)]


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


@pytest.fixture(scope="module")
def made(corpus):
    """The tables of a few methods, by name."""
    with pytest.MonkeyPatch.context() as patch:
        names = ("logreg", "zhang", "jl_global_logreg")
        patch.setattr(jobs, "METHODS", {name: METHODS[name] for name in names})
        plan = StudyPlan({"main": corpus}, real=corpus)
        tables = real_recordings.tables(plan, results_of(real_recordings.tasks(plan)))
        return {table.name: table for table in tables}


def test_the_tables(made):
    assert list(made) == ["real", "real_recordings", "real_fingers", "real_pairs"]
    assert all(to_markdown(table) for table in made.values())


def test_a_shaken_hold_is_ranked_below_a_calm_one(made):
    energy = METHODS["zhang"].title
    areas = [row.ours for row in made["real_fingers"].rows
             if row.keys["method"] == energy and row.keys["figure"] == "AUC"]  # fmt: skip
    assert len(areas) == 4 and all(area > 0.8 for area in areas)
