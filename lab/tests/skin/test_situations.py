from itertools import islice

import numpy as np
import pytest
from scipy.stats import ks_2samp

from holdfast.io import save_recording
from holdfast.metrics.slip_truth import SLIDING, slip_truth
from holdfast_lab.randomized.simulation import RandomHold, simulate_random
from holdfast_lab.skin.situations import (
    MAX_SAMPLES_SHOWN,
    SITUATIONS,
    distribution_distance,
    real_sets,
    twin_grasps,
    twin_holds,
    values_of,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("hands")
    for number in (0, 1):
        recording = simulate_random(RandomHold(number))
        save_recording(recording, place / f"{recording.name}.parquet")
    return place


@pytest.mark.slow
def test_situations_of_the_twin_follow_its_truth(folder):
    holds = list(twin_holds(folder))
    assert len(holds) == 2
    for marked in holds:
        for name, masks in marked.masks.items():
            times = marked.recording.modules[name].times
            codes = slip_truth(marked.recording, name, times).codes
            assert set(masks) == set(SITUATIONS)
            assert sum(mask.astype(int) for mask in masks.values()).max() <= 1
            np.testing.assert_array_equal(masks["slip"], codes == SLIDING)
            for still in ("quiet", "moving", "pushed"):
                assert not (masks[still] & (codes == SLIDING)).any()


@pytest.mark.slow
def test_a_hold_has_no_open_hand_and_a_grasp_begins_with_it(folder):
    for marked in twin_holds(folder):
        codes = [
            slip_truth(marked.recording, name, module.times).codes
            for name, module in marked.recording.modules.items()
        ]
        assert np.mean(np.concatenate(codes) < 0) < 0.2
    assert all("starts_loaded" not in marked.recording.metadata for marked in twin_grasps(folder))
    assert len(list(twin_holds(folder, 1))) == 1


@pytest.mark.slow
def test_values_of_a_finger_are_few_and_of_all_features(folder):
    (marked,) = twin_holds(folder, 1)
    fingers = list(values_of(marked))
    assert {finger.situation for finger in fingers} <= set(SITUATIONS)
    for finger in fingers:
        assert len({len(values) for values in finger.values.values()}) == 1
        assert len(finger.values["any relative(residual[0.067 s])"]) <= MAX_SAMPLES_SHOWN
        assert len(finger.values) == 92


def test_the_distance_is_that_of_scipy_and_has_no_scale():
    generator = np.random.default_rng(0)
    a, b = generator.normal(size=300), np.round(generator.normal(0.5, 2.0, size=200), 1)
    assert distribution_distance(a, b) == pytest.approx(ks_2samp(a, b).statistic)
    assert distribution_distance(np.exp(a), np.exp(b)) == distribution_distance(a, b)
    assert distribution_distance(a, a) == 0.0
    assert distribution_distance(a, a + 100.0) == 1.0
    assert np.isnan(distribution_distance(a, a[:0]))


def test_real_sets_have_the_situations_that_their_labels_allow(data_folder):
    expected = {
        "boxes": {"quiet", "moving", "slip"},
        "tugs": {"quiet", "pushed", "slip"},
        "GTac": {"moving"},
        "GTac V2": {"quiet"},
    }
    for name, marked in real_sets(data_folder).items():
        first = list(islice(marked, 3))
        situations = {
            situation
            for part in first
            for masks in part.masks.values()
            for situation, mask in masks.items()
        }
        assert situations <= expected[name]
        for part in first:
            for finger, masks in part.masks.items():
                n_samples = part.recording.modules[finger].n_samples
                assert all(mask.shape == (n_samples,) for mask in masks.values())
