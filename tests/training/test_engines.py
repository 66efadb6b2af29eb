"""The same results from every engine, and in bounded memory."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from holdfast.io import load_dataset, save_recording
from holdfast.parallel import Engine
from holdfast.training import Setting, evaluate, train, trainer
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.splits import split_data
from holdfast.training.training_samples import SamplesPlan, gather_samples

from .build import tiny_recording

pytestmark = pytest.mark.slow

QUICK = Setting(trials=0)


@pytest.fixture(scope="module")
def cluster():
    """An engine on a cluster of two threads of this process."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp://", host="127.0.0.1",
        dashboard_address="127.0.0.1:0", silence_logs=50,
    ) as running:  # fmt: skip
        yield Engine.parse(f"dask:{running.scheduler_address}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Seven recordings on disk; one of them has no labels."""
    folder = tmp_path_factory.mktemp("recordings")
    for seed in range(7):
        recording = tiny_recording(seed, n=200 + 20 * seed)
        given = recording.with_labels({}) if seed == 4 else recording
        save_recording(given, folder / f"{recording.name}.parquet")
    return folder


def contents(model, folder):
    """Return the bytes of the file of a model."""
    path = folder / "model.json"
    model.save(path, force=True)
    return path.read_bytes()


def assert_same(one, other):
    assert one.keys() == other.keys()
    for finger, own in one.items():
        found = other[finger]
        for name in ("units", "recordings", "times", "at_rest"):
            np.testing.assert_array_equal(getattr(own, name), getattr(found, name))
        for mine, theirs in zip(own.samples, found.samples, strict=True):
            np.testing.assert_array_equal(mine, theirs)
        assert own.n_usable == found.n_usable


@pytest.mark.parametrize("max_samples", [200_000, 100, 7])
def test_samples_do_not_depend_on_the_engine(folder, cluster, max_samples):
    recordings = load_dataset(folder)
    setting = replace(QUICK, max_samples=max_samples)
    scan = scan_dataset(recordings)
    plan = SamplesPlan(scan, setting, split_data(scan.recordings, "recording", 0))
    alone = gather_samples(recordings, plan).stable
    assert_same(alone, gather_samples(recordings, plan, cluster).stable)
    kept = {len(own.units) for own in alone.values()}
    assert all(n <= max_samples for n in kept)
    used = np.unique(alone["thumb"].recordings)
    assert len(used) == (6 if max_samples > 7 else len(used)) and 4 not in used


@pytest.mark.parametrize("split", ["recording", "random"])
def test_a_cluster_gives_the_same_model_and_metrics(folder, cluster, split, tmp_path):
    setting = Setting(split=split, max_samples=500)
    warned, warned_there = [], []
    alone = train(load_dataset(folder), setting, warn=warned.append)
    there = train(load_dataset(folder), setting, warn=warned_there.append, engine=cluster)
    assert contents(there.model, tmp_path) == contents(alone.model, tmp_path)
    assert (there.cross_validation, there.tares) == (alone.cross_validation, alone.tares)
    assert warned_there == warned
    assert evaluate(there.model, load_dataset(folder), engine=cluster) == evaluate(
        alone.model, load_dataset(folder)
    )


def test_the_model_records_how_many_samples_it_is_fitted_to(grasps, tmp_path):
    warned = []
    thinned = train(grasps, replace(QUICK, max_samples=1000), warn=warned.append).model
    used, n = thinned.training.samples["thumb"]
    assert 500 < used <= 1000 < n < 2400
    assert f"thumb: fitted to {used} of {n} labelled samples, one of 3 (--max-samples)" in warned[0]
    whole = train(grasps, QUICK).model
    assert whole.training.samples is msgspec.UNSET
    assert b'"samples"' not in contents(whole, tmp_path)


class TestManyRecordings:
    """More recordings than models that the cross-validation fits."""

    def test_no_model_is_fitted_to_what_it_is_evaluated_on(self, grasps, monkeypatch):
        held = []
        fit = trainer.fit_model
        monkeypatch.setattr(trainer, "MAX_FITS", 5)
        monkeypatch.setattr(
            trainer, "fit_model", lambda *given: (held.append(given[3]), fit(*given))[1]
        )
        warned = []
        found = train([*grasps, tiny_recording(9)], QUICK, warn=warned.append).cross_validation
        assert held == [{0, 5}, {1, 6}, {2}, {3}, {4}]
        assert warned[-1] == "7 recordings are held out in 5 groups, not alone"
        assert [each.name for each in found.recordings] == [
            *(f"grasp-{k}" for k in range(6)), "grasp-9",
        ]  # fmt: skip
        assert all(each.fingers["thumb"].n for each in found.recordings)
