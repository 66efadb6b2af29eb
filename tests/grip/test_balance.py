import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from holdfast.grip.laws.stability import balanced

grasps = st.integers(2, 5).flatmap(
    lambda n: st.tuples(
        st.lists(st.floats(0.5, 3.0), min_size=n, max_size=n),
        st.lists(st.floats(0.1, 9.0), min_size=n, max_size=n),
    )
)


@settings(max_examples=40, deadline=None)
@given(grasps)
def test_the_forces_are_balanced_and_none_is_lowered(grasp):
    wanted, forces = grasp
    scales = balanced(wanted, forces, opposed=0)
    total = sum(forces[1:])
    carried = sum(s * f for s, f in zip(scales[1:], forces[1:], strict=True))
    assert carried == pytest.approx(scales[0] * total)
    assert all(s >= w - 1e-9 for s, w in zip(scales, wanted, strict=True))
    assert max(scales) <= max(wanted) + 1e-9


@settings(max_examples=40, deadline=None)
@given(grasps)
def test_no_balanced_scales_need_less_force(grasp):
    """The same by linear programming: least total force, subject to balance."""
    wanted, forces = map(np.array, grasp)
    total = forces[1:].sum()
    row = np.concatenate([[-total], forces[1:]])
    best = linprog(row * 0 + forces, A_eq=[row], b_eq=[0], bounds=[(w, None) for w in wanted])
    assert forces @ balanced(wanted, forces, 0) == pytest.approx(best.fun, rel=1e-6)


def test_without_forces_nothing_changes():
    assert balanced([1.0, 2.0], [0.0, 0.0], 0) == [1.0, 2.0]
