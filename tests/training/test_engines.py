"""Numbers of samples and of models that a training fits are bounded."""

from dataclasses import replace

import msgspec
import pytest

from holdfast.training import Setting, train, trainer

from .build import tiny_recording

pytestmark = pytest.mark.slow

QUICK = Setting(trials=0)


def test_the_model_records_how_many_samples_it_is_fitted_to(grasps):
    warned = []
    thinned = train(grasps, replace(QUICK, max_samples=1000), warn=warned.append).model
    used, n = thinned.training.samples["thumb"]
    assert 500 < used <= 1000 < n < 2400
    assert f"thumb: fitted to {used} of {n} labelled samples, one of 3 (--max-samples)" in warned[0]
    whole = train(grasps, QUICK).model
    assert whole.training.samples is msgspec.UNSET


class TestManyRecordings:
    """More recordings than models that the cross-validation fits."""

    def test_no_model_is_fitted_to_what_it_is_evaluated_on(self, grasps, monkeypatch):
        held = []
        fit = trainer.fit_model
        monkeypatch.setattr(trainer, "MAX_FITS", 5)
        monkeypatch.setattr(
            trainer, "fit_model", lambda *given: (held.append(given[3]), fit(*given))[1]
        )
        warned = []
        found = train([*grasps, tiny_recording(9)], QUICK, warn=warned.append).cross_validation
        assert held == [{0, 5}, {1, 6}, {2}, {3}, {4}]
        assert warned[-1] == "7 recordings are held out in 5 groups, not alone"
        assert [each.name for each in found.recordings] == [
            *(f"grasp-{k}" for k in range(6)), "grasp-9",
        ]  # fmt: skip
        assert all(each.fingers["thumb"].n for each in found.recordings)
