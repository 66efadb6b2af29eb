import numpy as np
import pytest

from holdfast.classifiers.linear import smooth
from holdfast.metrics.slip_thresholds import SLIP_THRESHOLDS
from holdfast.metrics.slip_truth import CREEPING, NOT_HELD, SLIDING, STILL, Slip, SlipTruth
from holdfast.model import Head
from holdfast.training.head_fits import SLIP_SMOOTHING
from holdfast_lab.study.evaluation.scores import probability_of
from holdfast_lab.study.evaluation.slip_scores import (
    SlipRecording,
    SlipScores,
    gather_sliding_samples,
    log_odds_of,
    slip_recordings,
    smoothed,
    still_ranks,
)
from holdfast_lab.study.methods import HAND, METHODS
from holdfast_lab.study.plan import scan_corpus
from study.example_recordings import SLIPS, recording_with_truth, save_all

RATE = 150.0


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    made = [recording_with_truth(f"grasp-{seed}", seed) for seed in range(2)]
    return scan_corpus("main", save_all(tmp_path_factory.mktemp("slips") / "main", made))


@pytest.fixture(scope="module")
def recordings(corpus):
    return slip_recordings(METHODS["difference"], corpus)


def inside(times, spans):
    return np.any([(times >= a - 1e-9) & (times < b - 1e-9) for a, b in spans], axis=0)


def test_the_truth_is_that_of_each_finger(recordings):
    truth = recordings[0].truth
    times = recordings[0].features.times["thumb"]
    np.testing.assert_array_equal(truth["thumb"].codes == SLIDING, inside(times, SLIPS))
    assert not (truth["index"].codes == SLIDING).any()
    assert [len(truth[name].slips) for name in ("thumb", "index")] == [len(SLIPS), 0]
    held = inside(times, [(2.3, 9.5)])
    np.testing.assert_array_equal(truth["index"].codes == STILL, held)
    assert truth["index"].quiet[held & inside(times, [(3.0, 5.0)])].all()
    assert not truth["index"].quiet[inside(times, [(5.4, 6.4)])].any()


def test_slips_in_the_history_of_a_compared_method_are_left_out(corpus):
    """A stretch begins after the tare of 0.5 s."""
    (recording, _) = slip_recordings(METHODS["difference"], corpus, warm_up=5.3)
    times = recording.features.times["thumb"]
    known = recording.truth["thumb"].codes != NOT_HELD
    assert not known[times < 5.79].any() and known[(times > 5.81) & (times < 9)].all()
    (slip,) = recording.truth["thumb"].slips
    assert slip.onset == pytest.approx(SLIPS[1][0])


def test_a_hand_slides_if_one_of_its_fingers_slides(recordings):
    codes = recordings[0].codes(HAND)
    times = recordings[0].features.times["thumb"]
    np.testing.assert_array_equal(codes == SLIDING, inside(times, SLIPS))
    assert ((codes == NOT_HELD) == ~inside(times, [(2.3, 9.5)])).all()


def test_all_sliding_samples_train_and_still_ones_are_thinned(recordings):
    training = gather_sliding_samples(recordings, max_samples=200)
    thumb = training.samples["thumb"]
    n_sliding = sum(int((r.truth["thumb"].codes == SLIDING).sum()) for r in recordings)
    assert (~thumb.positive).sum() == n_sliding
    assert 100 < thumb.positive.sum() <= 200
    assert training.samples["index"].one_class


def test_a_finger_without_known_slips_does_not_train(recordings):
    without = [SlipRecording(r.features, {"thumb": r.truth["thumb"]}) for r in recordings]
    assert list(gather_sliding_samples(without, 200).samples) == ["thumb"]


def test_scores_are_smoothed_as_by_the_rule_of_a_model():
    times = np.arange(200) / RATE
    values = np.random.default_rng(0).normal(0, 3, 200)
    values[50:60] = np.nan
    gain, state = Head.gain(_Smoothing, RATE), np.nan
    expected = []
    for value in values:
        state = np.nan if np.isnan(value) else smooth(state, value, gain)
        expected.append(state)
    np.testing.assert_allclose(smoothed(times, values), expected, atol=1e-12)


class _Smoothing:
    smoothing = SLIP_SMOOTHING


class TestRanks:
    ranks = np.sort(np.random.default_rng(1).normal(0, 1, 1000))

    def test_a_higher_score_is_never_lower(self):
        scores = np.linspace(-5, 5, 500)
        assert (np.diff(log_odds_of(scores, self.ranks)) >= 0).all()

    def test_the_thresholds_reach_from_every_still_sample_to_none(self):
        probability = probability_of(log_odds_of(self.ranks, self.ranks))
        assert (probability >= SLIP_THRESHOLDS[0]).all()
        assert not (probability >= SLIP_THRESHOLDS[-1]).any()
        above = probability_of(log_odds_of(self.ranks[-1:] + 0.1, self.ranks))
        assert above >= SLIP_THRESHOLDS[-1]

    def test_the_scale_of_the_scores_does_not_matter(self):
        scores = np.linspace(-3, 3, 100)
        np.testing.assert_allclose(
            log_odds_of(scores, self.ranks), log_odds_of(10 * scores + 3, 10 * self.ranks + 3)
        )

    def test_no_estimate_stays_without(self):
        assert np.isnan(log_odds_of(np.array([np.nan]), self.ranks)).all()


def test_a_perfect_score_finds_every_slip_without_a_false_alarm():
    times = np.arange(3000) / RATE
    codes = np.full(3000, STILL, dtype=np.int8)
    codes[1500:1600], codes[1600:1620] = SLIDING, CREEPING
    truth = SlipTruth(codes, codes == STILL, (Slip(10.0, 1600 / RATE, distance=2e-3),), "truth")
    noise = np.random.default_rng(2).normal(0, 1, 3000)
    scores = SlipScores(times, np.where(codes == SLIDING, 100.0, noise), truth)
    without_contact = SlipScores(times, np.full(3000, -np.inf), truth)
    ranks = still_ranks([{"thumb": scores, "index": without_contact}])
    assert len(ranks) == (codes == STILL).sum()
    highest = scores.curve(ranks)[-1]
    assert highest.delays.tolist() == pytest.approx([0.0])
    assert highest.false_held == 0
    assert without_contact.curve(ranks)[0].delays.tolist() == [np.inf]
