import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import brier_score_loss, confusion_matrix, roc_auc_score

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.metrics import FingerDecisions, calibration_sums, sample_metrics
from holdfast.metrics.samples import metrics_of_samples, pool_samples, score_samples

sample = st.tuples(st.integers(0, 3), st.integers(0, 3), st.sampled_from([0, 0.1, 0.5, 0.7, 1]))


def columns(samples):
    labels, states, scores = (np.array([s[i] for s in samples]) for i in range(3))
    return labels, states, np.where(states == UNKNOWN, np.nan, scores.astype(float))


def test_rates_by_hand():
    labels = [STABLE] * 5 + [UNSTABLE] * 3 + [NO_CONTACT] * 2
    states = [STABLE] * 4 + [UNSTABLE] + [STABLE, UNSTABLE, NO_CONTACT] + [NO_CONTACT] * 2
    scores = [0.9, 0.8, 0.7, 0.6, 0.4, 0.65, 0.3, 0.2, 0.1, 0.1]
    metrics = sample_metrics(labels, states, scores)
    assert metrics.confusion == [[4, 1], [1, 4]]
    assert (metrics.n, metrics.accuracy) == (10, 80.0)
    assert (metrics.fdr, metrics.fpr, metrics.fnr) == (20.0, 20.0, 20.0)
    assert metrics.auc == 23 / 25
    assert metrics.auc_contact == 13 / 15


@given(st.lists(sample, min_size=2, max_size=60))
def test_scikit_learn_agrees(samples):
    labels, states, scores = columns(samples)
    metrics = sample_metrics(labels, states, scores)
    used = (labels != UNKNOWN) & (states != UNKNOWN)
    assert metrics.n == used.sum()
    truth, decided, score = labels[used] == STABLE, states[used] == STABLE, scores[used]
    if not used.any():
        assert (metrics.accuracy, metrics.auc, metrics.brier) == (None, None, None)
        return
    expected = confusion_matrix(truth, decided, labels=[False, True])
    assert metrics.confusion == expected.tolist()
    assert metrics.brier == pytest.approx(brier_score_loss(truth, score, pos_label=True))
    check_auc(metrics.auc, truth, score)
    contact = labels[used] != NO_CONTACT
    check_auc(metrics.auc_contact, truth[contact], score[contact])


def check_auc(auc, truth, score):
    if len(set(truth.tolist())) < 2:
        assert auc is None
    else:
        assert auc == pytest.approx(roc_auc_score(truth, score))


def test_unlabelled_and_undecided_samples_are_left_out():
    labels = [UNKNOWN, STABLE, UNSTABLE, STABLE]
    states = [STABLE, UNKNOWN, UNKNOWN, STABLE]
    metrics = sample_metrics(labels, states, [0.9, np.nan, np.nan, 0.9])
    assert (metrics.n, metrics.n_undecided) == (1, 2)
    assert metrics.without_estimate == pytest.approx(200 / 3)
    assert metrics.confusion == [[0, 0], [0, 1]]


def test_a_rate_without_a_denominator_is_none():
    metrics = sample_metrics([UNSTABLE], [UNSTABLE], [0.2])
    assert (metrics.fdr, metrics.fpr, metrics.fnr, metrics.auc) == (None, 0.0, None, None)
    metrics = sample_metrics([STABLE, NO_CONTACT], [STABLE, UNSTABLE], [0.8, 0.2])
    assert (metrics.auc, metrics.auc_contact) == (1.0, None)


def test_a_score_that_is_no_probability_has_an_auc_and_no_brier_score():
    metrics = sample_metrics([STABLE, UNSTABLE], [STABLE, UNSTABLE], [7.0, -np.inf])
    assert (metrics.auc, metrics.brier) == (1.0, None)


def test_a_decided_sample_has_a_probability():
    with pytest.raises(ValueError, match="stable_probability"):
        sample_metrics([STABLE, STABLE], [STABLE, STABLE], [0.9, np.nan])


def test_shapes_that_differ_are_refused():
    with pytest.raises(ValueError, match=r"states \(1,\)"):
        sample_metrics([STABLE, STABLE], [STABLE], [0.9, 0.9])


@given(st.lists(sample, min_size=1, max_size=60), st.integers(0, 60))
def test_pooled_samples_equal_all_samples(samples, cut):
    parts = [part for part in (samples[:cut], samples[cut:]) if part]
    pooled = metrics_of_samples(pool_samples([score_samples(*columns(part)) for part in parts]))
    whole = sample_metrics(*columns(samples))
    assert pooled.confusion == whole.confusion
    assert (pooled.auc, pooled.auc_contact) == (whole.auc, whole.auc_contact)
    assert pooled.n_undecided == whole.n_undecided
    assert pooled.brier == (None if whole.brier is None else pytest.approx(whole.brier))


def test_calibration_sums_by_hand():
    labels, states = [STABLE, UNSTABLE, STABLE, STABLE], [STABLE, STABLE, UNSTABLE, UNKNOWN]
    finger = FingerDecisions(np.arange(4.0), labels, states, [0.95, 0.91, 0.05, np.nan])
    table = calibration_sums([finger])
    assert table[9] == pytest.approx([1.86, 1, 2])
    assert table[0] == pytest.approx([0.05, 1, 1])
    assert table[1:9].sum() == 0
    assert (calibration_sums([finger, finger]) == 2 * table).all()
