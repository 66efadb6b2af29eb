import numpy as np
import pytest

from holdfast.errors import OutputError
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.simulation import Grasp
from holdfast_lab.trial.course import FALL_TIME, LEAD_TIME, TrialCourse, follow
from holdfast_lab.trial.film import FILM_GAP, FILM_WIDTH, HEIGHT, captions, film
from holdfast_lab.trial.run import run_trial
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


def test_following_a_trial_changes_nothing(instants):
    result = run_trial(CAN, "fixed", "builtin:noise-floor")
    assert result.dropped == instants[-1].is_lost


def test_the_lines_below_a_picture(instants):
    texts = [text for text, _ in captions("fixed", instants[0])]
    assert texts[0].startswith("fixed: ")
    assert texts[1].startswith("force ") and " N, least " in texts[1]
    assert texts[2] == "0.5 s before the load"
    assert captions("fixed", instants[-1])[0][0] == "fixed: object lost"


def test_a_film_has_both_sides(tmp_path):
    from PIL import Image

    try:
        data = film(CAN, ("fixed", "fixed"), "builtin:noise-floor")
    except OutputError as missing:
        pytest.skip(str(missing))
    path = tmp_path / "film.webp"
    path.write_bytes(data)
    with Image.open(path) as opened:
        assert opened.size[0] == 2 * FILM_WIDTH + FILM_GAP and opened.size[1] > HEIGHT
        assert opened.n_frames > 10
        picture = np.asarray(opened.convert("RGB")).astype(int)
    left, right = picture[:HEIGHT, :FILM_WIDTH], picture[:HEIGHT, FILM_WIDTH + FILM_GAP :]
    assert left.std() > 10  # not empty
    assert np.abs(left - right).mean() < 5  # the same law on both sides
    assert len(data) < 2_000_000
