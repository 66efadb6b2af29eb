import pytest

from holdfast_lab.study.evaluation.common_samples import longest_warm_up, warm_up


@pytest.mark.parametrize(
    ("method", "samples"),
    [("friction", 0), ("difference", 1), ("logreg", 13), ("sigma_cut", 13), ("spectrum", 29)],
)
def test_the_history_of_a_method_in_samples(method, samples):
    assert warm_up(method, 150.0) == pytest.approx(samples / 150)


def test_the_network_needs_a_second():
    assert warm_up("tcn", 100.0) == pytest.approx(0.99)


def test_the_longest_history_counts():
    assert longest_warm_up(("friction", "logreg", "difference"), 100.0) == pytest.approx(0.13)
    assert longest_warm_up((), 100.0) == 0.0
