import csv
from importlib import resources

import numpy as np
import pytest

from holdfast_ros.hands.joints import JointOrder
from holdfast_ros.hands.table import hand_rows
from holdfast_ros.topic_messages import JointStates

V4 = hand_rows()["v4"]
ORDER = JointOrder(V4["joints"])


def test_limits_are_those_of_the_twins_hand():
    text = resources.files("holdfast.twin.tables").joinpath("allegro_right.csv").read_text()
    rows = list(csv.DictReader(line for line in text.splitlines() if line[0] != "#"))
    order = JointOrder(hand_rows()["v5"]["joints"])
    assert [row["joint"] for row in rows] == list(order.names)
    np.testing.assert_allclose(order.values(V4["lowest"]), [float(row["lower"]) for row in rows])
    np.testing.assert_allclose(order.values(V4["highest"]), [float(row["upper"]) for row in rows])


def test_states_are_sorted_by_name():
    names = ("arm", *reversed(ORDER.names))
    values = np.arange(17.0)
    found = ORDER.sort(JointStates(names, values, 10 * values))
    np.testing.assert_array_equal(found.positions, np.arange(16, 0, -1))
    np.testing.assert_array_equal(found.efforts, 10 * found.positions)


@pytest.mark.parametrize(
    ("states", "message"),
    [
        (JointStates((), np.zeros(15), np.zeros(15)), "no joint ah_joint00"),
        (JointStates(("a", "b"), np.zeros(2), np.zeros(2)), r"there are a, b\)"),
        (JointStates(ORDER.names, np.zeros(3), np.zeros(3)), "no joint ah_joint03"),
        (JointStates((), np.full(16, np.nan), np.zeros(16)), "not finite"),
    ],
)
def test_states_of_another_hand_are_refused(states, message):
    with pytest.raises(ValueError, match=message):
        ORDER.sort(states)
