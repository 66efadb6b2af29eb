import numpy as np
import pytest
from msgspec.structs import replace

from holdfast.contact import Phase
from holdfast.twin.impacts import Impact
from holdfast.twin.loads import Load, LoadKind
from holdfast.twin.operator import Disturbance
from holdfast.twin.profile import profile
from holdfast.twin.protocol import (
    CLOSED_GAP,
    CLOSING_TIMEOUT,
    EASED,
    FIRMER,
    GRIP_CONFIRM_TIME,
    HAND_OVER_TIME,
    LOST_DISTANCE,
    OPEN_GAP,
    SETTLE_TIME,
    Plan,
    Protocol,
)

PERIOD = 1 / 150
BEFORE, AFTER, HOLD, SPEED = 0.5, 0.4, 2.0, 0.02
SHORT = replace(profile("reference"), hold=HOLD)
GRIPS = np.array([3.6, 2.0, 2.0, 2.0])
PUSH = Disturbance(1.0, 0.5, "down", 0, np.zeros(9))
TOUCHED = 0.001  # depth at which the pads of this hand touch [m]


class Table:
    """A protocol on a table where loads go with depths, 4 N/mm; the slip is given."""

    def __init__(self, disturbances=(), grips=GRIPS, before=BEFORE):
        self.protocol = Protocol(Plan(SHORT, grips, SPEED, before, AFTER, disturbances), PERIOD)
        self.item = np.zeros(18)
        self.item[3:12] = np.eye(3).ravel()
        self.times, self.commands = [], []

    def run(self, loads=lambda time, depths: 4000 * (TOUCHED - depths), slip=0.0, limit=40.0):
        depths = np.full(4, OPEN_GAP)
        for k in range(round(limit / PERIOD)):
            time = k * PERIOD
            if self.protocol.is_over(time):
                break
            forces = np.maximum(0.0, loads(time, depths))
            command = self.protocol.command(time, forces, slip, self.item)
            depths = command.depths.copy()
            self.times.append(time)
            self.commands.append(command._replace(depths=depths))
        return self

    def phases(self):
        """Each phase with when it begins, in order."""
        phases = [command.phase for command in self.commands]
        return [
            (phase, time)
            for phase, before, time in zip(phases, [None, *phases], self.times, strict=False)
            if phase != before
        ]

    def column(self, name):
        return np.array([getattr(command, name) for command in self.commands])


def test_phases_come_in_their_order():
    table = Table().run()
    phases = dict(table.phases())
    assert [phase for phase, _ in table.phases()][:-1] == [
        Phase.FREE, Phase.CLOSING, Phase.LOCKED, Phase.RELEASED
    ]  # fmt: skip
    assert table.phases()[-1][0] == Phase.FREE
    assert table.phases()[1][1] == pytest.approx(BEFORE, abs=PERIOD)
    assert phases[Phase.LOCKED] == pytest.approx(table.protocol.locked_at + PERIOD)
    held = phases[Phase.RELEASED] - table.protocol.locked_at
    assert held == pytest.approx(HOLD + HAND_OVER_TIME, abs=2 * PERIOD)
    assert table.times[-1] - phases[Phase.RELEASED] == pytest.approx(AFTER, abs=2 * PERIOD)
    assert not table.protocol.failed
    assert table.protocol.lost_at is None


def test_each_finger_stops_at_its_grip_and_all_settle_before_the_lock():
    table = Table().run()
    depths = table.column("depths")
    expected = TOUCHED - GRIPS / 4000
    locked = table.times.index(table.protocol.locked_at)
    np.testing.assert_allclose(depths[locked], expected, atol=2 * SPEED * PERIOD)
    still = (np.abs(np.diff(depths, axis=0)) == 0).all(axis=1)
    settled = int((SETTLE_TIME + GRIP_CONFIRM_TIME) / PERIOD)
    assert still[locked - settled : locked].all()
    assert not still[locked - settled - 3 : locked - settled].all()


def test_a_finger_over_its_grip_waits_and_has_stopped_once_that_lasts():
    over = 1.0 + 2 * GRIP_CONFIRM_TIME

    def loads(time, depths):
        return np.full(4, 5.0 if 1.0 <= time < over else 0.0)

    table = Table().run(loads)
    times, depths = np.array(table.times), table.column("depths")
    halted = depths[(times >= 1.0) & (times < BEFORE + CLOSING_TIMEOUT)]
    assert (halted == halted[0]).all()
    assert (halted > CLOSED_GAP).all()


def test_the_operator_lets_go_and_takes_back_in_ramps():
    table = Table().run()
    times, hold = np.array(table.times), table.column("hold")
    locked = table.protocol.locked_at
    held_for = times - locked
    released = locked + HOLD + HAND_OVER_TIME
    assert (hold[held_for <= 0] == 1.0).all()
    going = (held_for > 0) & (held_for < HAND_OVER_TIME)
    np.testing.assert_allclose(hold[going], 1 - held_for[going] / HAND_OVER_TIME)
    assert (hold[(held_for > HAND_OVER_TIME + PERIOD) & (held_for < HOLD - PERIOD)] == 0.0).all()
    coming = (held_for > HOLD + PERIOD) & (times < released - PERIOD)
    assert (np.diff(hold[coming]) > 0).all()
    np.testing.assert_allclose(np.diff(hold[coming]), PERIOD / HAND_OVER_TIME, rtol=1e-6)
    assert (hold[times > released + PERIOD] == 1.0).all()
    assert ((hold >= 0) & (hold <= 1)).all()


def test_a_grasp_that_never_grips_times_out():
    table = Table().run(loads=lambda time, depths: np.array([4.0, 2.5, 2.5, 0.0]))
    assert table.protocol.failed
    assert table.protocol.locked_at is None
    phases = table.column("phase")
    assert Phase.LOCKED not in phases
    assert Phase.RELEASED in phases
    assert table.times[-1] == pytest.approx(
        BEFORE + CLOSING_TIMEOUT + HAND_OVER_TIME + AFTER, abs=3 * PERIOD
    )
    assert (table.column("hold") == 1.0).all()


def test_an_object_that_moves_far_is_lost():
    table = Table()
    moved = []

    def loads(time, depths):
        locked = table.protocol.locked_at
        if locked is not None and time > locked + 1.0 and not moved:
            moved.append(time)
            table.item[2] -= 1.01 * LOST_DISTANCE
        return 4000 * (TOUCHED - depths)

    table.run(loads)
    assert table.protocol.lost_at == moved[0]
    assert table.protocol.failed
    after = [c for c, t in zip(table.commands, table.times, strict=True) if t >= moved[0]]
    assert all(c.hold == 0.0 for c in after)  # it is not caught
    assert after[0].phase == Phase.FREE
    assert all(c.disturbance == -1 for c in after)


@pytest.mark.parametrize(("slip", "phase"), [(0.0, Phase.DISTURBED), (0.01, Phase.SLIPPING)])
def test_a_disturbance_has_its_index_and_time(slip, phase):
    table = Table([PUSH]).run(slip=slip)
    times, disturbances = np.array(table.times), table.column("disturbance")
    locked = table.protocol.locked_at
    under_way = disturbances == 0
    assert times[under_way][0] - locked == pytest.approx(PUSH.start, abs=PERIOD)
    assert under_way.sum() == pytest.approx(PUSH.duration / PERIOD, abs=1)
    np.testing.assert_allclose(
        table.column("elapsed")[under_way], times[under_way] - locked - PUSH.start, atol=1e-12
    )
    assert (table.column("phase")[under_way] == phase).all()
    assert (table.column("elapsed")[~under_way] == 0.0).all()
    held = (times > locked) & (times < locked + HOLD) & ~under_way
    assert (table.column("phase")[held] == Phase.LOCKED).all()
    assert (table.column("hold")[under_way] == 0.0).all()


def test_the_operator_holds_the_object_where_it_was():
    table = Table()
    table.item[:3] = 1.0, 2.0, 3.0
    positions = []

    def loads(time, depths):
        positions.append(table.protocol.anchor[:3].copy())
        if table.protocol.locked_at is not None and len(table.protocol.anchor):
            table.item[0] = 1.01
        return 4000 * (TOUCHED - depths)

    table.run(loads)
    np.testing.assert_array_equal(positions[1], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(table.protocol.anchor[:3], [1.01, 2.0, 3.0])
    np.testing.assert_array_equal(table.protocol.anchor[3:], np.eye(3).ravel())


def eased_plan():
    push = Disturbance(2.0, 1.0, "up", 0, np.arange(1.0, 10.0))
    tap = Impact("tap", 5.0, 5.1, 0.01, 0.02, np.ones(3), np.zeros(3), 0.0, 0.0)
    turn = Load(LoadKind.TURN, 8.0, 1.0, 0.5)
    return Plan(
        profile("handling"), np.ones(4), 0.02, 1.0, 1.0, [push], impacts=[tap], loads=[turn]
    )


@pytest.mark.parametrize(
    ("onset", "glitched", "factors"),
    [
        (2.0, False, (EASED, 1, 1, 1, 1)),
        (3.3, False, (EASED, 1, 1, 1, 1)),  # just after the push
        (5.05, False, (1, EASED, 1, 1, 1)),
        (8.5, False, (1, 1, EASED, 1, 1)),
        (8.5, True, (1, 1, EASED, EASED, 1)),
        (12.0, True, (1, 1, 1, EASED, 1)),
        (12.0, False, (1, 1, 1, 1, FIRMER)),
    ],
)
def test_what_made_a_finger_slide_is_weaker_in_the_next_attempt(onset, glitched, factors):
    plan, old = eased_plan().eased(np.array([onset]), np.array([glitched])), eased_plan()
    sizes = (
        plan.disturbances[0].parameters[6] / old.disturbances[0].parameters[6],
        plan.impacts[0].size / old.impacts[0].size,
        plan.loads[0].size / old.loads[0].size,
        plan.glitch_size,
        plan.grips[0],
    )
    assert sizes == pytest.approx(factors)
    others = [k for k in range(9) if k != 6]
    assert (plan.disturbances[0].parameters[others] == np.arange(1.0, 10.0)[others]).all()
