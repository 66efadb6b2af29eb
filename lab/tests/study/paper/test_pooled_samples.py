from dataclasses import replace

import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN
from holdfast.detection import fingertip_force, haar_features
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.paper.pooled_samples import COLUMNS, pool_samples
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import save_all, save_synthetic


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return scan_corpus("main", save_synthetic(tmp_path_factory.mktemp("pools") / "main", range(3)))


def test_features_and_classes_are_those_of_each_recording(corpus):
    pool = pool_samples(corpus, corpus.rate, "index", 8, seed=0)
    for place, recording in enumerate(corpus.load()):
        module = recording.modules["index"]
        force = fingertip_force(module.readings, module.sensor, 0.5, module.times)
        features = haar_features(force, 8)
        known = np.isfinite(features[:, 0]) & (module.label_states != UNKNOWN)
        mine = pool.samples.groups == place
        assert np.array_equal(pool.samples.features[mine, :6], features[known])
        assert np.array_equal(pool.samples.positive[mine], module.label_states[known] == STABLE)


def test_energy_is_the_sum_of_squared_details_of_the_normal_force(corpus):
    pool = pool_samples(corpus, corpus.rate, "index", 4, seed=0)
    x = pool.samples.features[pool.samples.groups == 0, COLUMNS.index("F_x")]
    k = 700
    details = (x[k - 3] - x[k - 2]) ** 2 / 2 + (x[k - 1] - x[k]) ** 2 / 2
    assert pool.select(["energy"]).features[k, 0] == pytest.approx(details)


def test_parts_do_not_depend_on_the_window_or_the_finger(corpus):
    one = pool_samples(corpus, corpus.rate, "index", 4, seed=3)
    two = pool_samples(corpus, corpus.rate, "thumb", 14, seed=3)
    for place in range(3):
        mine, other = (pool.parts[pool.samples.groups == place] for pool in (one, two))
        assert np.array_equal(mine[10:], other)  # a window of 14 begins ten samples later


def test_parts_are_drawn_by_the_seed(corpus):
    first, again, other = (pool_samples(corpus, corpus.rate, "index", 4, seed=s) for s in (0, 0, 1))
    assert np.array_equal(first.parts, again.parts)
    assert not np.array_equal(first.parts, other.parts)
    share = np.bincount(first.parts, minlength=25) / len(first.parts)
    assert share == pytest.approx(np.full(25, 0.04), abs=0.015)


def test_a_recording_without_the_finger_has_no_samples(tmp_path):
    fingers = (["thumb", "index"], ["thumb"], ["thumb", "index"])
    recordings = [synthetic_recording(f"r{k}", k, names) for k, names in enumerate(fingers)]
    corpus = scan_corpus("main", save_all(tmp_path / "data", recordings))
    assert set(pool_samples(corpus, corpus.rate, "index", 14, seed=0).samples.groups) == {0, 2}
    assert len(pool_samples(corpus, corpus.rate, "ring", 14, seed=0).samples.positive) == 0


def test_objects_are_those_of_the_metadata(tmp_path):
    recordings = [synthetic_recording(f"r{k}", k, ["index"]) for k in range(2)]
    recordings.append(replace(synthetic_recording("r2", 2, ["index"]), metadata={}))
    corpus = scan_corpus("main", save_all(tmp_path / "data", recordings))
    pool = pool_samples(corpus, corpus.rate, "index", 14, seed=0)
    assert pool.objects == ("object 0", "object 1", None)
