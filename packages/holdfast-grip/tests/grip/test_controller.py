import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grip.build import FINGERS, NORMAL, RATE, finger, hand, holding, run, scales
from holdfast.contact import Cause, ContactEstimate, ContactState, HandEstimate, Reason
from holdfast.sensors import flat_sensor, sensor
from holdfast_grip import LAWS, GripController, GripReason, Limits, LoopState
from holdfast_grip.laws import Fixed
from holdfast_grip.laws.stability import START_SCALE, START_TIME
from holdfast_grip.span import STILL_TIME

SLIPPING = {name: {"probability": 0.05, "state": ContactState.UNSTABLE} for name in FINGERS}
NO_SLIP = {name: {"slip_probability": 0.01} for name in FINGERS}
GONE = {name: {"state": ContactState.NO_CONTACT, "normal": 0.0} for name in FINGERS}
RISING = {GripReason.UNSTABLE, GripReason.SLIP, GripReason.LOAD, GripReason.MARGIN}

numbers = st.one_of(st.floats(-2.0, 2.0), st.floats(allow_nan=True, allow_infinity=True))
estimates = st.builds(
    ContactEstimate,
    st.floats(-1.0, 3.0) | st.just(math.nan),
    st.sampled_from(ContactState),
    st.sampled_from(Reason),
    numbers,
    numbers,
    st.tuples(*[st.floats(-5e3, 5e3) | numbers] * 3),
)
steps = st.lists(
    st.tuples(
        st.floats(0.0, 0.02) | numbers,
        st.dictionaries(st.sampled_from(FINGERS), estimates, max_size=4),
    ),
    max_size=30,
)


class TestSteadyStart:
    """A grip that the model calls unstable begins when nothing slides and the forces stay."""

    def state_after(self, seconds, *, slip=0.01, cause=None, growth=0.0, rule=True):
        controller = GripController(Limits())
        for k in range(round(seconds * RATE)):
            now = k / RATE
            fingers = {
                name: msgspec.structs.replace(
                    finger(name, now, ContactState.UNSTABLE, probability=0.1,
                           normal=NORMAL[name] * math.exp(growth * now)),
                    slip_probability=slip if rule else None,
                    cause=cause,
                )
                for name in FINGERS
            }  # fmt: skip
            controller.update(HandEstimate(now, ContactState.UNSTABLE, fingers), now)
        return controller.state

    def test_it_begins_after_a_while(self):
        assert self.state_after(STILL_TIME - 0.02) is LoopState.IDLE
        assert self.state_after(STILL_TIME + 0.02) is not LoopState.IDLE

    def test_forces_that_change_a_slide_and_a_model_without_slips_begin_nothing(self):
        assert self.state_after(1.5, growth=1.0) is LoopState.IDLE
        assert self.state_after(1.5, slip=0.9, cause=Cause.SLIP) is LoopState.IDLE
        assert self.state_after(1.5, rule=False) is LoopState.IDLE


class TestAnyInput:
    @settings(max_examples=60)
    @given(
        steps,
        st.sampled_from(sorted(LAWS)),
        st.sampled_from(["hold", "open"]),
        st.sampled_from([{}, NO_SLIP]),
    )
    def test_no_command_is_beyond_the_limits(self, inputs, law, on_fault, rule):
        limits = Limits(min_scale=0.8, max_scale=1.7, rise=5.0, fall=2.0, on_fault=on_fault)
        controller, time = holding(law, changes=rule, **msgspec.structs.asdict(limits))
        before = dict.fromkeys(FINGERS, 1.0)
        newest, saved = time, 0.0
        for dt, changes in inputs:
            fingers = {name: finger(name, time, **rule.get(name, {})) for name in FINGERS} | changes
            command = controller.update(HandEstimate(time, ContactState.STABLE, fingers), time + dt)
            step = min(max(dt, 0.0), limits.stale_after) if math.isfinite(dt) else 0.0
            allowed = saved + step
            for name, one in command.fingers.items():
                assert limits.min_scale <= one.scale <= limits.max_scale
                assert one.scale - before[name] <= limits.rise * allowed + 1e-9
                assert before[name] - one.scale <= limits.fall * allowed + 1e-9
                assert one.scale <= before[name] or one.reason in RISING
            before = scales(command)
            # An estimate that is not new changes nothing, and its time counts with the next one.
            newest, saved = time, allowed if time == newest else 0.0
            time += step

    @settings(max_examples=40)
    @given(st.lists(st.floats(0.0, 1.0), min_size=5, max_size=40), st.sampled_from(sorted(LAWS)))
    def test_every_rise_is_logged(self, probabilities, law):
        controller, time = holding(law, rise=3.0)
        before = dict.fromkeys(FINGERS, 1.0)
        rising = dict.fromkeys(FINGERS, GripReason.NONE)
        for probability in probabilities:
            time += 1 / RATE
            index = {"probability": probability, "tangential": 600.0 * (1.5 - probability)}
            command = controller.update(hand(time, index=index), time)
            logged = {(e.finger, e.reason) for e in controller.events() if e.finger}
            for name, one in command.fingers.items():
                if one.scale > before[name] and rising[name] is not one.reason:
                    assert (name, one.reason) in logged
                rising[name] = one.reason
            before = scales(command)


class TestStart:
    def test_the_grip_begins_when_the_hand_has_been_stable_for_a_while(self):
        controller = GripController(Limits())
        times = [k / RATE for k in range(90)]
        states = [controller.update(hand(time), time).state for time in times]
        assert times[states.index(LoopState.HOLD)] == pytest.approx(STILL_TIME, abs=1.5 / RATE)
        assert controller.loaded_fingers == FINGERS

    @pytest.mark.parametrize("state", [s for s in ContactState if s != "STABLE"])
    def test_it_does_not_begin_otherwise(self, state):
        controller = GripController(Limits())
        fingers = {name: {"state": state} for name in FINGERS}
        for k in range(100):
            estimate = hand(k / RATE, state, **fingers)
            assert controller.update(estimate, k / RATE).state is LoopState.IDLE

    def test_a_finger_without_an_estimate_blocks_it(self):
        controller = GripController(Limits())
        unknown = {"index": {"state": ContactState.UNKNOWN}}
        for k in range(170):
            controller.update(hand(k / RATE, ContactState.UNSTABLE, **unknown), k / RATE)
        assert controller.state is LoopState.IDLE

    def test_a_new_grip_presses_more_within_the_limits_until_the_object_rests(self):
        """Only with a slip rule, by which it may begin before a person lets go."""
        controller, time = holding(changes=NO_SLIP, rise=2.0)
        commands, time = run(controller, time, START_TIME, **NO_SLIP)
        pressed = [scales(command)["index"] for command in commands]
        assert max(np.diff([1.0, *pressed])) <= 2.0 / RATE + 1e-9
        assert pressed[-1] == START_SCALE
        assert commands[0].fingers["index"].reason is GripReason.MARGIN
        commands, _ = run(controller, time, 3.0, **NO_SLIP)
        assert scales(commands[-1])["index"] == pytest.approx(1.0)

    def test_reset_returns_to_idle(self):
        controller, time = holding()
        controller.update(hand(time), math.nan)
        controller.reset()
        assert controller.state is LoopState.IDLE
        assert controller.loaded_fingers == ()
        assert controller.events() == []


class TestReaction:
    def test_an_unstable_finger_raises_all_forces_by_one_factor(self):
        """A common factor keeps the balance of forces and moments."""
        controller, time = holding()
        commands, _ = run(controller, time, 0.12, index=SLIPPING["index"])
        assert LoopState.REACT in {command.state for command in commands}
        got = scales(commands[-1])
        assert set(got.values()) == {got["index"]} and got["index"] > 1.2
        first = next(command for command in commands if command.state is LoopState.REACT)
        assert first.fingers["thumb"].reason is GripReason.UNSTABLE

    def test_the_force_falls_again_slowly_after_the_cooldown(self):
        controller, time = holding(cooldown=0.5, fall=0.3)
        _, time = run(controller, time, 0.1, **SLIPPING)
        raised = scales(controller.update(hand(time + 1 / RATE), time + 1 / RATE))["index"]
        commands, time = run(controller, time + 1 / RATE, 0.4)
        assert scales(commands[-1])["index"] == raised
        commands, time = run(controller, time, 1.0)
        assert commands[-1].state is LoopState.RELAX
        assert raised - 0.3001 <= scales(commands[-1])["index"] < raised - 0.2

    def test_the_debounced_state_does_not_matter(self):
        """The state of a display is held; the probability of the sample counts."""
        raw, time = holding()
        held = {"state": ContactState.UNSTABLE}
        commands, _ = run(raw, time, 0.2, **dict.fromkeys(FINGERS, held))
        assert {one.scale for one in commands[-1].fingers.values()} == {1.0}
        commands, _ = run(raw, time + 0.2, 0.15, index={"probability": 0.0})
        assert scales(commands[-1])["index"] > 1.0


class TestFaults:
    @pytest.mark.parametrize("on_fault", ["hold", "open"])
    def test_silence_leads_to_the_safe_state_within_50_ms_past_due(self, on_fault):
        controller, last = holding(on_fault=on_fault)
        estimate, time = hand(last), last
        while (command := controller.update(estimate, time)).state is not LoopState.FAULT:
            time += 0.001
        assert time - (last + 1 / RATE) <= 0.05 + 0.0011
        assert command.reason is GripReason.STALE
        assert command.release is (on_fault == "open")
        assert {one.scale for one in command.fingers.values()} == {1.0}

    @settings(max_examples=30)
    @given(
        st.sampled_from(FINGERS),
        st.sampled_from(sorted(LAWS)),
        st.sampled_from([Reason.FAULT, Reason.GAP, Reason.WARM_UP]),
    )
    def test_a_fault_of_any_loaded_finger_leads_there_within_50_ms(self, name, law, reason):
        controller, start = holding(law)
        bad = {name: {"state": ContactState.UNKNOWN, "reason": reason}}
        commands, _ = run(controller, start, 0.06, **bad)
        found = [command.state is LoopState.FAULT for command in commands]
        assert found.index(True) / RATE <= 0.05

    @pytest.mark.parametrize(
        ("change", "reason"),
        [
            ({"force": (math.nan, 0.0, 0.0)}, GripReason.NOT_FINITE),
            ({"force": (math.inf, 0.0, 0.0)}, GripReason.NOT_FINITE),
            ({"probability": math.nan}, GripReason.NOT_FINITE),
            ({"normal": 9001.0}, GripReason.OVERLOAD),
        ],
    )
    def test_a_bad_number_leads_there_at_once(self, change, reason):
        controller, time = holding(max_force=6.0)
        command = controller.update(hand(time + 0.01, index=change), time + 0.01)
        assert (command.state, command.reason) == (LoopState.FAULT, reason)

    def test_a_lost_object_is_a_fault_that_stays(self):
        controller, time = holding()
        commands, time = run(controller, time, 0.05, **GONE)
        assert (commands[-1].state, commands[-1].reason) == (LoopState.FAULT, GripReason.LOST)
        commands, _ = run(controller, time, 2.0)
        assert commands[-1].state is LoopState.FAULT

    def test_hold_recovers_after_valid_data_and_open_does_not(self):
        for on_fault, after in (("hold", LoopState.HOLD), ("open", LoopState.FAULT)):
            controller, time = holding(on_fault=on_fault, recovery=0.5)
            controller.update(hand(time), time + 0.2)
            commands, _ = run(controller, time + 0.2, 0.45)
            assert commands[-1].state is LoopState.FAULT
            commands, _ = run(controller, time + 0.65, 0.2)
            assert commands[-1].state is after

    @pytest.mark.parametrize(
        ("moved", "state", "reason"),
        [
            (-0.2, LoopState.IDLE, GripReason.RELEASED),  # the hand let go
            (0.2, LoopState.FAULT, GripReason.LOST),  # the fingers close on nothing
            (-0.01, LoopState.FAULT, GripReason.LOST),
            (None, LoopState.FAULT, GripReason.LOST),  # a hand that reports no joints
        ],
    )
    def test_a_hand_that_opens_has_let_go(self, moved, state, reason):
        controller, closed = GripController(Limits(), newtons_per_unit=1e-3), np.full(4, 0.5)
        if moved is not None:
            controller.observe(np.zeros(4))
            controller.observe(closed)
        _, time = run(controller, 0.0, 0.5)
        assert controller.state is LoopState.HOLD
        controller.events()
        if moved is not None:
            controller.observe(closed + moved)
        _, time = run(controller, time, 0.5, **GONE)
        event = next(e for e in controller.events() if e.reason in (reason, GripReason.LOST))
        assert (event.state, event.reason, controller.state) == (state, reason, state)
        assert (controller.loaded_fingers == ()) is (state is LoopState.IDLE)
        if state is LoopState.IDLE:  # it waits for the next grip
            controller.observe(closed)
            run(controller, time, 0.5)
            assert controller.state is LoopState.HOLD


class TestSilence:
    @pytest.mark.parametrize("law", sorted(LAWS))
    def test_no_force_changes_without_a_new_estimate(self, law):
        controller, time = holding(law)
        time += 1 / RATE
        estimate = hand(time, **SLIPPING)
        first = controller.update(estimate, time)
        for k in range(1, 200):
            command = controller.update(estimate, time + k / 1000)
            assert scales(command) == scales(first)
        assert command.reason is GripReason.STALE


def lively(k, noise, **changes):
    """An estimate whose forces change from sample to sample, as those of a noisy sensor do."""
    changes = {name: {"normal": NORMAL[name] + noise(k), **changes} for name in FINGERS}
    return hand(k / RATE, **changes)


def noisy(k):
    return k * 37 % 11


class TestFrozenReadings:
    """Forces that repeat exactly: the fault of a noisy sensor, the rest of a quiet one."""

    def held(self, noise, n_free=400, **limits):
        """A controller that holds, with forces that changed by a noise; the next sample."""
        controller = GripController(Limits(**limits), newtons_per_unit=1e-3)
        for k in range(n_free):
            estimate = lively(k, noise, state=ContactState.NO_CONTACT)
            controller.update(
                HandEstimate(k / RATE, ContactState.NO_CONTACT, estimate.fingers), k / RATE
            )
        k = n_free
        while controller.state is LoopState.IDLE:
            controller.update(lively(k, noise), k / RATE)
            k += 1
        return controller, k

    @pytest.mark.parametrize("on_fault", ["hold", "open"])
    def test_a_noisy_sensor_that_repeats_itself_is_a_fault_within_100_ms(self, on_fault):
        controller, k = self.held(noisy, on_fault=on_fault)
        last = controller.update(lively(k, lambda k: 3.5), k / RATE)
        assert last.state is LoopState.HOLD
        for n in range(1, round(0.1 * RATE) + 1):
            command = controller.update(lively(k + n, lambda k: 3.5), (k + n) / RATE)
        assert (command.state, command.reason) == (LoopState.FAULT, GripReason.FROZEN)
        assert command.release is (on_fault == "open")

    @pytest.mark.parametrize(
        ("noise", "rest"),
        [
            (lambda k: 0.0, lambda k: 0.0),
            (lambda k: k // 30 % 2, lambda k: 0.0),
            (lambda k: k % 40 == 0, lambda k: 0.0),
            (lambda k: k // 8, lambda k: 0.0),
            (lambda k: k // 2 * 37 % 11, lambda k: k // 2 * 37 % 11),
        ],
        ids=["none", "slow flicker", "rare counts", "drift", "each sample twice"],
    )
    def test_a_quiet_sensor_may_rest(self, noise, rest):
        """Integers that repeat because nothing moves are no fault."""
        controller, k = self.held(noise)
        for n in range(300):
            command = controller.update(lively(k + n, rest), (k + n) / RATE)
            assert command.state is not LoopState.FAULT


def test_a_fault_that_was_reported_holds_for_one_update():
    controller, time = holding(recovery=0.0)
    controller.report(GripReason.HAND)
    first = controller.update(hand(time + 0.01), time + 0.01)
    assert (first.state, first.reason) == (LoopState.FAULT, GripReason.HAND)
    assert controller.update(hand(time + 0.02), time + 0.02).state is LoopState.HOLD


class TestUnits:
    def test_a_calibration_of_readings_in_newtons_is_refused(self):
        sensors = {"thumb": sensor("uskin-curved"), "pad": flat_sensor("pad", 1, 2, 1e-3, unit="N")}
        with pytest.raises(ValueError, match="pad"):
            GripController(Limits(), sensors=sensors, newtons_per_unit=1e-3)
        GripController(Limits(), sensors=sensors)

    @pytest.mark.parametrize("law", ["pr2", "friction-margin"])
    def test_a_law_that_needs_newtons_refuses_counts(self, law):
        with pytest.raises(ValueError, match="counts"):
            GripController(Limits(), law, sensors={"index": sensor("uskin-curved")})
        GripController(Limits(), law, sensors={"index": sensor("papillarray")})
        GripController(Limits(), law, newtons_per_unit=7e-4)

    @pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, (1.0, 1.0, 0.0)])
    def test_a_calibration_is_above_0(self, factor):
        with pytest.raises(ValueError, match="newtons_per_unit"):
            GripController(Limits(), newtons_per_unit=factor)

    def test_the_law_of_holdfast_needs_no_unit(self):
        """Forces a thousand times as large give the same scales."""
        (one, time), large = holding(), GripController(Limits(), newtons_per_unit=1.0)
        start = 0.0
        while large.state is LoopState.IDLE:
            large.update(hand(start), start)
            start += 1 / RATE
        for k in range(1, 60):
            estimate = hand(time + k / RATE, index={"probability": 0.2, "instability": 0.0})
            first, second = (c.update(estimate, time + k / RATE) for c in (one, large))
            assert scales(first) == pytest.approx(scales(second))

    def test_an_unknown_law_is_refused(self):
        with pytest.raises(ValueError, match="'magic'"):
            GripController(Limits(), "magic")


class BrokenLaw(Fixed):
    """Law that returns the given targets."""

    def __init__(self, targets):
        self._given = targets

    def targets(self, touches, time, dt):
        return self._given


@pytest.mark.parametrize(
    ("targets", "given_text"),
    [
        ([(1.0, GripReason.NONE)], "1 targets given"),
        ([(math.nan, GripReason.SLIP)] * len(FINGERS), "a scale of nan given"),
    ],
)
def test_a_law_that_breaks_its_contract_is_named_with_it(targets, given_text):
    controller, time = holding(BrokenLaw(targets))
    with pytest.raises(ValueError, match=f"BrokenLaw.*{given_text}"):
        run(controller, time, 0.1)
