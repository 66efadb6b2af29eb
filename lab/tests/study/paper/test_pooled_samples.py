import numpy as np
import pytest

from holdfast.contact import STABLE, UNKNOWN
from holdfast.detection import fingertip_force, haar_features
from holdfast.synthetic import synthetic_recording
from holdfast_lab.study.paper.pooled_samples import pool_samples
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import save_all, save_synthetic


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return scan_corpus("main", save_synthetic(tmp_path_factory.mktemp("pools") / "main", range(3)))


def test_features_and_classes_are_those_of_each_recording(corpus):
    pool = pool_samples(corpus, corpus.rate, "index", 8, seed=0)
    for index, recording in enumerate(corpus.load()):
        module = recording.modules["index"]
        force = fingertip_force(module.readings, module.sensor, 0.5, module.times)
        features = haar_features(force, 8)
        known = np.isfinite(features[:, 0]) & (module.label_states != UNKNOWN)
        mine = pool.samples.groups == index
        assert np.array_equal(pool.samples.features[mine, :6], features[known])
        assert np.array_equal(pool.samples.positive[mine], module.label_states[known] == STABLE)


def test_parts_do_not_depend_on_the_window_or_the_finger(corpus):
    one = pool_samples(corpus, corpus.rate, "index", 4, seed=3)
    two = pool_samples(corpus, corpus.rate, "thumb", 14, seed=3)
    for index in range(3):
        mine, other = (pool.parts[pool.samples.groups == index] for pool in (one, two))
        assert np.array_equal(mine[10:], other)  # a window of 14 begins ten samples later


def test_a_recording_without_the_finger_has_no_samples(tmp_path):
    fingers = (["thumb", "index"], ["thumb"], ["thumb", "index"])
    recordings = [synthetic_recording(f"r{k}", k, names) for k, names in enumerate(fingers)]
    corpus = scan_corpus("main", save_all(tmp_path / "data", recordings))
    assert set(pool_samples(corpus, corpus.rate, "index", 14, seed=0).samples.groups) == {0, 2}
    assert len(pool_samples(corpus, corpus.rate, "ring", 14, seed=0).samples.positive) == 0
