import pytest

from holdfast.cli.teach.screen import TeachScreen, screen_lines
from holdfast.live.teaching.protocol import STAGE_WORDS, View
from holdfast.live.teaching.steps import STEPS

PULL = View("step 4 of 8: pull, grasp 1 of 3", "PULL UNTIL IT SLIDES", "Let it rest.", 24.2, 0.2,
            "3 felt")  # fmt: skip


@pytest.mark.parametrize(
    "words", [*(x.words for x in STEPS), *(x[0] for x in STAGE_WORDS.values())]
)
def test_all_words_fit_into_80_columns(words):
    lines = screen_lines(PULL._replace(words=words, message="a" * 200), "3 of 12 grasps")
    assert all(len(line) <= 80 for line in lines)
    assert " ".join(words.split()[-1]) in lines[3] and lines[3].endswith("24 s")
    hints = [x.hint for x in STEPS] + [x[1] for x in STAGE_WORDS.values()]
    assert all(len(hint) <= 76 for hint in hints)


def test_a_message_cannot_control_the_terminal():
    lines = screen_lines(PULL._replace(message="\x1b[2J"), "")
    assert "  \\x1b[2J" in lines


def test_without_a_terminal_each_change_is_a_line(capsys):
    with TeachScreen() as screen:
        for view in (PULL, PULL._replace(left=3.0), PULL._replace(words="GOOD", decides=True)):
            screen.show(view, "")
        screen.print("one", "two")
    with TeachScreen(is_read=False) as screen:
        screen.show(PULL, "")  # nobody reads it
        screen.print("three")
    assert capsys.readouterr().err.splitlines() == [
        "step 4 of 8: pull, grasp 1 of 3: PULL UNTIL IT SLIDES",
        "step 4 of 8: pull, grasp 1 of 3: GOOD: 3 felt",
        *("one", "two", "three"),
    ]
