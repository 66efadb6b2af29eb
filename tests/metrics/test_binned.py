import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from holdfast.metrics import Decisions, FingerDecisions, summarise, summary
from holdfast.metrics.samples import (
    N_BINS,
    BinnedSamples,
    SampleTotal,
    bins_of,
    metrics_of_samples,
    score_samples,
)


def scored(n, seed=0, spread=2.0):
    """Labels of all states, states of a threshold, and scores that go with them."""
    generator = np.random.default_rng(seed)
    labels = generator.integers(1, 4, n).astype(np.int8)
    scores = 1 / (1 + np.exp(-generator.normal(labels - 2.0, spread)))
    return labels, np.where(scores >= 0.5, 3, 2).astype(np.int8), scores


def recordings(n, n_samples=60):
    times = np.arange(n_samples) * 0.1
    for k in range(n):
        finger = FingerDecisions(times, *scored(n_samples, k))
        yield Decisions.of(f"r{k}", {"thumb": finger, "index": finger}, n_model_fingers=2)


@given(st.lists(st.floats(0, 1), min_size=2))
def test_bins_keep_the_order(scores):
    ordered = np.sort(scores)
    bins = bins_of(ordered)
    assert (np.diff(bins) >= 0).all()
    assert 0 <= bins.min() <= bins.max() < N_BINS


def test_the_area_is_that_of_the_scores_within_the_share_of_ties():
    samples = score_samples(*scored(20_000))
    binned = BinnedSamples.of(samples)
    exact, approximate = metrics_of_samples(samples), metrics_of_samples(binned)
    stable, unstable, _ = binned.counts
    ties = (stable * unstable).sum() / (stable.sum() * unstable.sum())
    assert ties < 0.01
    assert abs(approximate.auc_contact - exact.auc_contact) <= ties / 2
    assert approximate.auc == pytest.approx(exact.auc, abs=1e-5)
    assert (approximate.confusion, approximate.brier) == (exact.confusion, exact.brier)


def test_scores_that_differ_by_more_than_a_bin_are_exact():
    scores = np.array([1e-12, 1e-6, 0.2, 0.5, 0.8, 1 - 1e-6, 1 - 1e-12])
    samples = score_samples([2, 3, 2, 3, 2, 3, 3], [3] * 7, scores)
    assert BinnedSamples.of(samples).ordered_pairs() == samples.ordered_pairs()


def test_a_total_is_the_same_in_any_parts():
    parts = [score_samples(*scored(50, seed)) for seed in range(6)]
    early, late = SampleTotal(), SampleTotal()
    early.bin()
    for part in parts:
        early.add(part)
        late.add(part)
    late.bin()
    assert (early.samples.counts == late.samples.counts).all()
    assert (early.samples.confusion == late.samples.confusion).all()
    assert early.samples.n_undecided == late.samples.n_undecided
    assert early.samples.squared_error == pytest.approx(late.samples.squared_error, rel=1e-12)


class TestSummary:
    """The metrics of many samples and recordings, with the limits set low."""

    def test_above_the_limit_only_areas_and_their_intervals_change(self, monkeypatch):
        exact = summarise(recordings(9))
        monkeypatch.setattr(summary, "MAX_EXACT_SCORES", 300)
        binned = summarise(recordings(9))
        assert (exact.score_bins, binned.score_bins) == (None, N_BINS)
        assert binned.recordings == exact.recordings
        assert binned.events == exact.events
        assert binned.pooled.confusion == exact.pooled.confusion
        assert binned.pooled.auc == pytest.approx(exact.pooled.auc, abs=2e-3)
        assert binned.fingers["index"].auc == pytest.approx(exact.fingers["index"].auc, abs=2e-3)
        assert binned.intervals.accuracy == exact.intervals.accuracy
        assert binned.intervals.hand == exact.intervals.hand
        assert binned.intervals.auc == pytest.approx(exact.intervals.auc, abs=5e-3)

    @pytest.mark.slow
    def test_many_recordings_are_drawn_in_groups(self, monkeypatch):
        alone = summarise(recordings(40))
        monkeypatch.setattr(summary, "MAX_GROUPS", 20)
        grouped = summarise(recordings(40))
        assert (alone.intervals.n_groups, grouped.intervals.n_groups) == (None, 20)
        assert grouped.intervals.n_recordings == 40
        assert grouped.pooled == alone.pooled
        width = np.diff(alone.intervals.accuracy)[0]
        np.testing.assert_allclose(
            grouped.intervals.accuracy, alone.intervals.accuracy, atol=0.5 * width
        )
