from dataclasses import replace

import pytest

from holdfast.cli.terminal.console import print_message
from holdfast.cli.terminal.progress import progress
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study import corpora
from holdfast_lab.study.corpora import plan_study

from .example_recordings import save_all

pytestmark = pytest.mark.slow

SHOWN = {"notify": print_message, "steps": progress}


@pytest.fixture(autouse=True)
def nowhere(monkeypatch, tmp_path):
    """No real recordings."""
    monkeypatch.setenv("HOLDFAST_DATA", str(tmp_path / "nothing"))


@pytest.fixture
def data(tmp_path):
    return save_all(tmp_path / "data", [synthetic_recording(f"grasp-{k}", k) for k in range(3)])


def test_recordings_of_the_twin_are_not_the_real_ones(data, tmp_path):
    """Without HOLDFAST_DATA there are none; own recordings of a hand are real."""
    settings = {"seed": 0, "tare": "0.5", "jobs": 1, "quick": True, **SHOWN}
    plan, left_out = plan_study(data, tmp_path / "out", **settings)
    assert (plan.real, left_out) == (plan.main, [])
    recordings = [synthetic_recording(f"grasp-{k}", k) for k in range(2)]
    twin = [replace(each, metadata={"source": "twin"}) for each in recordings]
    plan, left_out = plan_study(save_all(tmp_path / "twin", twin), tmp_path / "out", **settings)
    assert plan.real is None
    assert left_out[0].startswith("real recordings")


def test_real_recordings_are_imported(data_folder, monkeypatch, tmp_path):
    monkeypatch.setenv("HOLDFAST_DATA", str(data_folder))
    corpus, left_out = corpora.real_corpus(tmp_path / "real", print_message)
    assert (len(corpus.recordings), corpus.tare, left_out) == (5, "first", [])
    again, _ = corpora.real_corpus(tmp_path / "real", print_message)
    assert again == corpus
