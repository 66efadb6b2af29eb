import math

import pytest

from holdfast_lab.study.comparison.shipped import (
    ModelCounts,
    model_rows,
)

COUNTS = ModelCounts(
    stable=(100, 90), unstable=(50, 40), events=(4, 1.0), alarms=(3, 2.0),
    delays=[-0.01, 0.1, math.inf, 0.2], speeds=[1.0, 3.0, 4.0, 30.0], over_1mm=(2, 1),
    false_slips=6, finger_minutes=4.0, hand_minutes=2.0, impacts=(10, 2),
)  # fmt: skip


def values(rows):
    return {row.keys["figure"]: row.ours for row in rows}


def test_the_figures_of_a_model_by_hand():
    found = values(model_rows({}, [COUNTS]))
    assert found["stable called STABLE [%]"] == pytest.approx(90)
    assert found["unstable or open, not STABLE [%]"] == pytest.approx(80)
    assert found["events missed at 50 ms [%]"] == pytest.approx(25)
    assert found["slips found within 0.1 s [%]"] == pytest.approx(50)
    assert found["before 1 mm [%]"] == pytest.approx(50)
    assert found["impacts with a slip alarm [%]"] == pytest.approx(20)
    assert found["false alarms of the hand, per minute"] == pytest.approx(1.5)
    assert found["false slips of a finger, per minute"] == pytest.approx(1.5)
    assert found["false slips of the hand, per minute"] == pytest.approx(3.0)
