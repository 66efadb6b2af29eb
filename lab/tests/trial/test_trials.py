from dataclasses import replace

import pytest

from holdfast_lab.trial.trials import draw_trial


def draw_trials(n, **options):
    return [draw_trial(number, **options) for number in range(n)]


def test_the_same_seed_draws_the_same_trials():
    assert draw_trials(10, seed=3) == draw_trials(10, seed=3)
    assert draw_trials(10, seed=3)[:5] == draw_trials(5, seed=3)
    assert draw_trials(10, seed=3) != draw_trials(10, seed=4)


def test_plants_share_objects_grips_and_loads():
    mild, hard = draw_trials(60, seed=3), draw_trials(60, seed=3, plant="hard")
    assert {trial.latency for trial in mild} == {0}
    assert {trial.latency for trial in hard} == {2, 3, 4, 5}
    for one, other in zip(mild, hard, strict=True):
        assert (one.load, one.speed, one.n_fingers) == (other.load, other.speed, other.n_fingers)
        assert replace(other.grasp, plant="mild") == one.grasp


def test_60_trials_have_every_object_with_every_kind_and_both_grips():
    trials = draw_trials(60)
    assert len({(one.grasp.object, one.load.kind) for one in trials}) == 12 * 5
    assert {one.n_fingers for one in trials} == {3, 4}
    assert all(one.n_fingers == 4 for one in trials if one.grasp.item.shape == "sphere")
    assert sum(one.unseen for one in trials) == 30


def test_impacts_come_before_the_load_which_is_the_same():
    for plain, struck in zip(
        draw_trials(5, seed=3), (draw_trial(k, 3, n_impacts=3) for k in range(5)), strict=True
    ):
        assert struck.load._replace(start=plain.load.start) == plain.load
        assert struck.load.start == pytest.approx(plain.load.start + 3.0)
        impacts = struck.impacts()
        assert len(impacts) == 3 and not plain.impacts()
        assert all(plain.load.start < impact.start < struck.load.start for impact in impacts)
        assert len(struck.plan().impacts) == 3
