import numpy as np
import pytest

from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.simulation import Grasp
from holdfast_lab.trial.course import FALL_TIME, LEAD_TIME, TrialCourse, follow
from holdfast_lab.trial.trials import Trial

pytestmark = pytest.mark.slow

CAN = Trial(0, Grasp("can", 1, 1, seed=0), 4, Load(LoadKind.WEIGHT, 1.0, 0.0, 0.4), 0.03)


@pytest.fixture(scope="module")
def instants():
    return list(follow(CAN, "fixed", "builtin:noise-floor"))


def test_a_course_goes_on_a_little_after_the_loss(instants):
    course = TrialCourse.of(instants)
    assert course.times[0] == pytest.approx(-LEAD_TIME, abs=0.01)
    assert course.times[-1] == pytest.approx(course.lost_at + FALL_TIME, abs=0.02)
    assert np.all(np.diff(course.times) > 0)
    assert course.least[-1] > course.least[0] > 0
    assert max(course.slip_speed) > 0.01
