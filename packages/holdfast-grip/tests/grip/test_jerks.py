import numpy as np
import pytest

from grip.build import RATE, hand, holding
from holdfast_grip import GripReason
from holdfast_grip.jerks import JERK_RATIO, MIN_SPREAD_REPORTS, JerkMonitor
from holdfast_grip.laws.stability import JERK_TIME

N_JOINTS = 16
DOUBTFUL = {"probability": 0.0}
NAMES = ("thumb", "index", "middle", "ring")


def angles(n, seed=0, noise=1e-4):
    return 0.5 + noise * np.random.default_rng(seed).standard_normal((n, N_JOINTS))


def jerked(reports):
    monitor, found = JerkMonitor(), []
    for report in reports:
        monitor.update(report)
        found.append(monitor.jerked)
    return np.flatnonzero(found).tolist()


class TestMonitor:
    def test_noise_is_no_jerk(self):
        assert jerked(angles(3000)) == []

    def test_a_joint_that_jumps_is_found_in_that_report(self):
        reports = angles(300)
        reports[200:203, 5] += 0.01
        assert jerked(reports)[0] == 200

    def test_the_unit_of_the_angles_makes_no_difference(self):
        reports = angles(300)
        reports[200:, 5] += 0.01
        assert jerked(reports) == jerked(57.3 * reports) != []

    def test_a_smooth_motion_is_no_jerk(self):
        reports = angles(450)
        reports += 0.3 * np.sin(np.linspace(0, 6, len(reports)))[:, None]
        assert jerked(reports) == []

    def test_the_ratio_decides(self):
        reports = angles(400)
        changes = np.diff(reports, 2, axis=0)
        spread = float(np.sqrt(np.mean(changes**2)))
        weak, strong = reports.copy(), reports.copy()
        weak[300:, 0] += 0.6 * JERK_RATIO * spread
        strong[300:, 0] += 1.6 * JERK_RATIO * spread
        assert jerked(weak) == [] and 300 in jerked(strong)

    def test_jerks_do_not_hide_the_next_one(self):
        reports = angles(1000)
        for k in range(200, 1000, 100):
            reports[k : k + 2, 3] += 0.02
        assert set(range(200, 1000, 100)) <= set(jerked(reports))

    def test_it_waits_until_the_spread_is_known(self):
        reports = angles(MIN_SPREAD_REPORTS)
        reports[10:, 0] += 1.0
        assert jerked(reports) == []

    @pytest.mark.parametrize("wrong", [np.full(N_JOINTS, np.nan), np.zeros(3)])
    def test_other_joints_or_no_number_begin_anew(self, wrong):
        reports = list(angles(300))
        reports[200] = wrong
        reports[201:] = [report + 0.1 for report in reports[201:]]
        assert jerked(reports) == []

    def test_angles_that_never_change_are_no_jerk(self):
        still = np.full((100, N_JOINTS), 0.3)
        still[60:] += 1.0
        assert jerked(still) == []


class TestLaw:
    """The law of holdfast after a jerk of the hand."""

    def rises(self, seconds, *, jerk, tangential=900.0, early=0.0):
        """Times from the beginning of a doubt to each rise of the command."""
        controller, time = holding()
        for report in angles(200):
            controller.observe(report)
        first, began, n_early = [], None, round(early * RATE)
        changes = {
            name: DOUBTFUL | ({"tangential": tangential} if name == "thumb" else {})
            for name in NAMES
        }
        for k in range(round(1.5 * RATE)):
            time += 1 / RATE
            is_doubtful = 100 <= k < 100 + round(seconds * RATE)
            if k == 100:
                began = time
            report = angles(1, seed=k + 1)[0]
            if jerk and k == 100 + n_early:
                report[4] += 0.05
            controller.observe(report)
            command = controller.update(hand(time, **(changes if is_doubtful else {})), time)
            if any(one.reason is GripReason.UNSTABLE for one in command.fingers.values()):
                first.append(time - began)
        return first

    def test_a_short_doubt_begins_a_rise_without_a_jerk_only(self):
        assert self.rises(0.2, jerk=False)[0] < 0.03
        assert self.rises(0.2, jerk=True) == []

    def test_a_doubt_that_lasts_is_answered_late(self):
        late = self.rises(1.0, jerk=True)
        assert JERK_TIME <= late[0] < JERK_TIME + 0.05

    def test_a_missing_load_is_answered_at_once(self):
        assert self.rises(0.2, jerk=True, tangential=0.0)[0] < 0.15

    def test_a_jerk_in_a_doubt_explains_nothing(self):
        assert self.rises(0.2, jerk=True, early=0.04)[0] < 0.03


def test_a_jerk_before_the_grip_is_forgotten():
    controller, time = holding()
    controller.reset()
    for report in [*angles(100), np.ones(N_JOINTS)]:
        controller.observe(report)
    while controller.state == "IDLE":
        time += 1 / RATE
        controller.update(hand(time), time)
    time += 1 / RATE
    controller.update(hand(time), time)
    assert not any(touch.jerked for touch in controller._touches)


def test_a_jerk_counts_for_one_sample():
    controller, time = holding()
    for report in [*angles(100), np.ones(N_JOINTS)]:
        controller.observe(report)
    seen = []
    for _ in range(2):
        time += 1 / RATE
        controller.update(hand(time), time)
        seen.append({touch.jerked for touch in controller._touches})
    assert seen == [{True}, {False}]
