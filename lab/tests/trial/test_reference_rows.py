import pytest

from holdfast_grip import LAWS
from holdfast_lab.trial.reference_rows import REFERENCE_ROWS, row_named


@pytest.mark.parametrize("name", [*LAWS, *REFERENCE_ROWS])
def test_each_row_is_a_new_law(name):
    assert row_named(name) is not row_named(name)


def test_an_unknown_row_is_named_with_those_that_exist():
    with pytest.raises(ValueError, match=r"'magic'.*without-kick"):
        row_named("magic")
