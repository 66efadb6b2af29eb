import numpy as np
import pytest
from holdfast_lab.trial.film import (
    BELOW,
    FILM_FONT_SIZE,
    FILM_GAP,
    FILM_WIDTH,
    HEIGHT,
    STATE_WORDS,
    captions,
    film,
    load_text,
)

from holdfast.errors import OutputError
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.simulation import Grasp
from holdfast_grip import LoopState
from holdfast_lab.trial.course import FALL_TIME, LEAD_TIME, Instant, TrialCourse, follow
from holdfast_lab.trial.run import run_trial
from holdfast_lab.trial.trials import Trial, draw_trial

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
    texts = [text for text, _ in captions("fixed", instants[0], CAN.load)]
    assert texts[0].startswith("fixed: ")
    assert texts[1].startswith("force ") and " N, least " in texts[1]
    assert texts[2:] == ["load in 0.5 s", "at 0.0 s"]
    last = [text for text, _ in captions("fixed", instants[-1], CAN.load)]
    assert (last[0], last[2]) == ("fixed: object lost", "+400 g")


@pytest.mark.parametrize(
    ("load", "texts"),
    [
        (Load(LoadKind.WEIGHT, 1.0, 0.0, 0.06), ["+30 g", "+60 g"]),
        (Load(LoadKind.FRICTION, 1.0, 0.0, 0.5), ["friction x 0.75", "friction x 0.50"]),
        (Load(LoadKind.PULL, 1.0, 0.2, 2.0, (0.0, -1.0, 0.0)), ["pull 2.0 N left", "pull is over"]),
        (
            Load(LoadKind.TRANSPORT, 1.0, 0.4, 8.0, (0.0, 0.0, 1.0)),
            ["transport 8.0 m/s2", "transport is over"],
        ),
        (
            Load(LoadKind.SHAKE, 1.0, 0.4, 8.0, (-1.0, 0.0, 0.0), 2.5),
            ["shake 8.0 m/s2", "shake is over"],
        ),
    ],
)
def test_the_load_that_acts_is_in_words(load, texts):
    assert [load_text(load, time) for time in (0.1, 1.0)] == texts


def test_every_state_has_words():
    assert set(STATE_WORDS) == {state.value for state in LoopState}


def test_no_line_is_wider_than_a_phone():
    from PIL import ImageFont

    font = ImageFont.load_default(FILM_FONT_SIZE)
    assert FILM_FONT_SIZE >= 22 and FILM_WIDTH <= 360
    instant = Instant(10.25, 38.88, 38.88, 0.888, "IDLE", False, None)
    for number in range(60):
        load = draw_trial(number).load
        for time in (-0.5, 0.1, 0.25, 0.4, 9.0):
            for text, _ in captions("friction-margin", instant._replace(time=time), load):
                assert font.getlength(text) < FILM_WIDTH - 12, text
                assert text.isascii()  # the font has little else


def has_load_arrow(picture):
    """Whether a picture has some violet pixels."""
    red, green, blue = np.moveaxis(picture, -1, 0)
    return bool(((blue - green > 50) & (red - green > 30)).sum() > 20)


def test_a_film_has_both_laws(tmp_path):
    from PIL import Image

    try:
        data = film(CAN, ("fixed", "fixed"), "builtin:noise-floor")
    except OutputError as missing:
        pytest.skip(str(missing))
    path = tmp_path / "film.webp"
    path.write_bytes(data)
    with Image.open(path) as opened:
        assert opened.size == (FILM_WIDTH, 2 * (HEIGHT + BELOW) + FILM_GAP)
        assert opened.n_frames > 10
        pictures = []
        for number in range(opened.n_frames):
            opened.seek(number)
            pictures.append(np.asarray(opened.convert("RGB")).astype(int))
    picture = pictures[0]
    below = HEIGHT + BELOW + FILM_GAP
    first, second = picture[:HEIGHT], picture[below : below + HEIGHT]
    assert first.std() > 10  # not empty
    assert np.abs(first - second).mean() < 5  # the same law in both
    assert not has_load_arrow(first)
    assert any(has_load_arrow(later[:HEIGHT]) for later in pictures)
    assert len(data) < 2_000_000
