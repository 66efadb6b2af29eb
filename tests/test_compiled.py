import numpy as np
import pytest

from holdfast import compiled


def total(values):
    found = 0.0
    for value in values:
        found += value
    return found


@pytest.mark.parametrize("known", [True, False])
def test_steps_do_not_need_the_option_that_is_not_public(monkeypatch, known):
    assert compiled.COUNTS_ARE_OPTIONAL  # of the numba that is locked
    monkeypatch.setattr(compiled, "COUNTS_ARE_OPTIONAL", known)
    step = compiled.compiled_step(total)
    assert step(np.arange(5.0)) == 10.0
    assert step.targetoptions.get("_nrt") == (False if known else None)
