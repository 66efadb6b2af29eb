from holdfast_grip import GripReason, Limits
from holdfast_grip.laws import Stability, Touch
from holdfast_lab.trial.reference_rows import V5Reflex, limits_of, row_named


def touches(normal):
    made = [Touch("thumb"), Touch("index")]
    for touch in made:
        touch.known, touch.normal, touch.start_normal = True, normal, 2.0
    return made


class TestV5Reflex:
    def test_a_sum_over_the_level_doubles_the_force_of_all_fingers(self):
        law = V5Reflex(1.1)
        law.start(touches(2.0), 0)
        assert law.targets(touches(2.1), 0.0, 0.01) == [(1.0, GripReason.NONE)] * 2
        assert law.targets(touches(2.3), 0.1, 0.01) == [(2.0, GripReason.MARGIN)] * 2

    def test_it_does_not_return_before_the_next_grip(self):
        law = V5Reflex(1.1)
        law.start(touches(2.0), 0)
        law.targets(touches(2.3), 0.0, 0.01)
        assert law.targets(touches(1.0), 0.1, 0.01) == [(2.0, GripReason.MARGIN)] * 2
        law.start(touches(2.0), 0)
        assert law.targets(touches(2.0), 0.2, 0.01) == [(1.0, GripReason.NONE)] * 2


def test_rows_of_the_widest_limits_have_the_same_law():
    limits = limits_of("holdfast-widest")
    assert limits.min_scale < Limits().min_scale and limits.max_scale > Limits().max_scale
    assert isinstance(row_named("holdfast-widest"), Stability)
