import os

import pytest

from holdfast.parallel import each


def power(base, exponent):
    if exponent < 0:
        raise ValueError("negative")
    return base**exponent, os.getpid()


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_results_come_in_the_order_of_the_arguments(n_jobs):
    arguments = [(base, base % 3) for base in range(20)]
    assert [n for n, _ in each(power, iter(arguments), n_jobs)] == [b**e for b, e in arguments]


def test_one_at_a_time_happens_here_and_when_it_is_asked_for():
    taken = []

    def arguments():
        for base in range(3):
            taken.append(base)
            yield base, 1

    results = each(power, arguments())
    assert taken == []
    assert next(results) == (0, os.getpid())
    assert taken == [0]


def test_two_at_a_time_happen_elsewhere():
    assert os.getpid() not in {pid for _, pid in each(power, [(1, 1)] * 4, n_jobs=2)}


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_nothing_to_do(n_jobs):
    assert list(each(power, [], n_jobs)) == []


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_failure_comes_through(n_jobs):
    with pytest.raises(ValueError, match="negative"):
        list(each(power, [(1, 1), (1, -1)], n_jobs))
