import numpy as np
import pytest

from holdfast.training.classifiers import Samples, recipe
from holdfast.training.splits import inner_folds
from holdfast.training.tuning import search

pytestmark = pytest.mark.slow


def blobs(seed=0, n=240, n_groups=6):
    """Two overlapping clouds; groups are shifted against each other."""
    rng = np.random.default_rng(seed)
    groups = np.repeat(np.arange(n_groups), n // n_groups)
    stable = rng.random(n) < 0.4
    features = (
        rng.normal(size=(n, 3)) + 0.8 * stable[:, None] + rng.normal(size=(n_groups, 3))[groups]
    )
    return Samples(features, stable, groups)


class Spy:
    """A recipe that records its calls, and can stop like a killed process."""

    def __init__(self, name="logreg", stops_after=None):
        self._recipe = recipe(name)
        self.name = name
        self.reference = self._recipe.reference
        self.suggest = self._recipe.suggest
        self.asked = []
        self.fitted = []
        self.stops_after = stops_after

    def fit(self, samples, parameters, seed):
        if self.stops_after is not None and len(self.asked) == self.stops_after:
            raise KeyboardInterrupt
        self.asked.append(dict(parameters))
        self.fitted.append(samples)
        return self._recipe.fit(samples, parameters, seed)


def run(spy, *, n_trials=8, seed=0, journal=None, samples=None, objective="log_loss"):
    samples = blobs() if samples is None else samples
    folds = inner_folds(samples, 3, seed)
    return search(
        samples, folds, spy, n_trials=n_trials, seed=seed, objective=objective, journal=journal
    )


@pytest.mark.parametrize("name", ["logreg", "svm"])
def test_the_same_seed_finds_the_same_parameters(name):
    one, two = Spy(name), Spy(name)
    assert run(one) == run(two)
    assert one.asked == two.asked
    assert run(Spy(name), seed=1) is not None


def test_the_first_trial_is_the_reference_setting():
    spy = Spy()
    assert run(spy, n_trials=1) == spy.reference
    assert spy.asked == [spy.reference] * 3


def test_the_parameters_with_the_least_log_loss_are_returned():
    """Compute the loss of every trial again, from its definition."""
    spy, samples = Spy(), blobs()
    best = run(spy, samples=samples)
    tried = {repr(asked): asked for asked in spy.asked}.values()

    def loss(parameters):
        logs = []
        for held in inner_folds(samples, 3, 0):
            fit = recipe("logreg").fit(samples.take(~held), parameters, 0)
            p = fit.probability(samples.features[held])
            logs += np.log(np.where(samples.positive[held], p, 1 - p)).tolist()
        return -np.mean(logs)

    assert len(tried) == 8
    assert best == min(tried, key=loss)


def test_the_best_by_error_is_taken():
    """Computed from the definition for every parameter that was tried."""
    spy, samples = Spy("svm"), blobs()
    best = run(spy, samples=samples, objective="error")
    tried = {repr(asked): asked for asked in spy.asked}.values()

    def error(parameters):
        wrong = 0
        for held in inner_folds(samples, 3, 0):
            fit = recipe("svm").fit(samples.take(~held), parameters, 0)
            decided = fit.probability(samples.features[held]) >= fit.threshold
            wrong += (decided != samples.positive[held]).sum()
        return wrong

    assert error(best) == min(map(error, tried))


def test_no_fit_sees_the_group_that_it_is_scored_on():
    spy, samples = Spy(), blobs()
    run(spy, n_trials=2, samples=samples)
    every = set(range(6))
    left_out = [every - set(fitted.groups) for fitted in spy.fitted]
    assert [len(groups) for groups in left_out] == [2] * 6
    assert set.union(*left_out[:3]) == every


@pytest.mark.parametrize("stops_after", [0, 1, 2, 3, 4, 10, 13, 23])
def test_a_stopped_search_ends_where_it_would_have_ended(tmp_path, stops_after):
    journal = tmp_path / "search"
    whole = Spy()
    expected = run(whole)
    with pytest.raises(KeyboardInterrupt):
        run(Spy(stops_after=stops_after), journal=journal)
    rest = Spy()
    assert run(rest, journal=journal) == expected
    n_done = stops_after // 3
    assert rest.asked == whole.asked[3 * n_done :]


def test_a_finished_search_is_not_repeated(tmp_path):
    expected = run(Spy(), journal=tmp_path / "search")
    again = Spy()
    assert run(again, journal=tmp_path / "search") == expected
    assert again.asked == []
    more = Spy()
    run(more, journal=tmp_path / "search", n_trials=10)
    assert len(more.asked) == 2 * 3


@pytest.mark.parametrize(
    "other",
    [{"samples": blobs(1)}, {"seed": 1}, {"spy": Spy("svm")}, {"objective": "error"}],
    ids=["data", "seed", "svm", "objective"],
)
def test_the_journal_of_another_search_is_not_used(tmp_path, other):
    run(Spy(), journal=tmp_path / "search")
    other = {"spy": Spy()} | other
    expected = run(Spy(other["spy"].name), **{k: v for k, v in other.items() if k != "spy"})
    assert run(**other, journal=tmp_path / "search") == expected
    assert len(other["spy"].asked) >= 8 * 3
