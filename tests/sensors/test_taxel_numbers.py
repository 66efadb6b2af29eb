from hypothesis import given
from hypothesis import strategies as st

from holdfast.sensors import taxel_index, taxel_number, taxel_numbers


@given(st.integers(0, 1000))
def test_a_number_and_its_index(index):
    assert taxel_index(taxel_number(index)) == index
    assert taxel_numbers(range(index)) == tuple(range(1, index + 1))
