"""The grip controller: from the estimates of a hand to a command. No I/O and no clock."""

import math
from collections import defaultdict, deque
from collections.abc import Mapping

from holdfast.contact import ContactEstimate, ContactState, Fault, HandEstimate, Reason
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast_grip.command import FingerCommand, GripCommand, GripEvent, GripReason, LoopState
from holdfast_grip.laws import Law, Touch, law_named
from holdfast_grip.laws.base import Three
from holdfast_grip.limits import Limits
from holdfast_grip.repeats import RepeatMonitor
from holdfast_grip.span import GripStart, JointWay

MAX_EVENTS = 1000
"""Number of events that a controller keeps until `events` is called; the oldest are dropped."""
OVERLOAD = 1.5
"""Multiple of `Limits.max_force` at which a measured force is a fault."""
DETECTOR_RATE = 150.0
"""Rate of the samples, if no sensor is given [Hz]."""
IMPLAUSIBLE = frozenset(
    {Fault.INVALID, Fault.REPEATED, Fault.EQUAL_TAXELS, Fault.COPIED, Fault.REZEROED}
)
"""Faults of readings that no skin gives: a grip does not go on with the other taxels alone."""
KEEP = FingerCommand(1.0)
Fingers = Mapping[str, ContactEstimate]

_NONE, _UNKNOWN = GripReason.NONE, ContactState.UNKNOWN
_HOLD, _REACT, _RELAX = LoopState.HOLD, LoopState.REACT, LoopState.RELAX


class GripController:
    """Controller of the grip force of one hand, estimate by estimate.

    The grip begins when the hand has been still for 0.4 s (`GripStart`). Forces and scales refer to
    this moment, and the fingers in contact are the loaded fingers. The controller reads the raw
    probability of every sample, not the debounced state. UNKNOWN never lowers a force, and no force
    changes without a new sample. No input raises an exception or gives a command outside the
    limits.

    Args:
        limits: limits of the commands.
        law: name of a law, one of `LAWS`, or a law.
        sensors: sensor of each finger, for its normal, rate and unit; without it, the normal is
            x and the unit is that of counts.
        newtons_per_unit: calibration, one factor or one for each axis of the fingertip frame;
            None if the readings are in N, or for laws that need none.
        thumb: finger opposite to all others, which balances them; None if there is none.
        reports_slips: whether the model ever reports a slip (`Model.reports_slips`); the law goes
            by instability alone if it does not.

    Raises:
        ValueError: there is no such law, it needs newtons and the readings are counts without a
            calibration, or there is a calibration and readings are in newtons.

    Example:
        >>> from holdfast.contact import ContactEstimate
        >>> controller = GripController(Limits(max_scale=2.0))
        >>> finger = ContactEstimate(0.0, ContactState.NO_CONTACT, Reason.NONE, 0.1, 0.0, (0, 0, 0))
        >>> hand = HandEstimate(0.0, ContactState.NO_CONTACT, {"thumb": finger})
        >>> controller.update(hand, 0.0).state
        <LoopState.IDLE: 'IDLE'>
    """

    def __init__(
        self,
        limits: Limits,
        law: str | Law = "holdfast",
        *,
        sensors: Mapping[str, Sensor] | None = None,
        newtons_per_unit: float | tuple[float, float, float] | None = None,
        thumb: str | None = "thumb",
        reports_slips: bool = True,
    ) -> None:
        self.limits = limits
        self._reports_slips = reports_slips
        self.law = law_named(law) if isinstance(law, str) else law
        sensors = sensors or {}
        # A law that needs newtons must not take counts for them, nor newtons be scaled twice.
        measured = [name for name, sensor in sensors.items() if sensor.unit == "N"]
        in_newtons = bool(sensors) and len(measured) == len(sensors)
        if self.law.needs_newtons and not in_newtons and newtons_per_unit is None:
            raise ValueError(
                f"the law {type(self.law).__name__} needs forces in N and the readings are counts: "
                "give newtons_per_unit, the calibration of the sensor"
            )
        if measured and newtons_per_unit is not None:
            raise ValueError(
                f"newtons_per_unit: readings in counts expected, those of {', '.join(measured)} "
                "are in N already: leave the calibration out"
            )
        to_newtons = 1.0 if newtons_per_unit is None else newtons_per_unit
        self._factors: Three = (
            to_newtons if isinstance(to_newtons, tuple) else (to_newtons, to_newtons, to_newtons)
        )
        if not all(math.isfinite(factor) and factor > 0 for factor in self._factors):
            raise ValueError(
                f"newtons_per_unit: numbers above 0 expected, {newtons_per_unit} given"
            )
        self._normals: dict[str, Three] = {}
        for name, sensor in sensors.items():
            x, y, z = sensor.normal.tolist()
            self._normals[name] = (x, y, z)
        rates = [sensor.rate for sensor in sensors.values()]
        # The slowest sensor decides: its sample is late only after its period.
        self._max_age = 1 / min(rates, default=DETECTOR_RATE) + limits.stale_after
        self._thumb = thumb
        ceiling = math.inf if limits.max_force is None else limits.max_force
        self._ceiling = OVERLOAD * ceiling
        self._start = GripStart(self._new_touch)
        self._monitors: defaultdict[str, RepeatMonitor] = defaultdict(RepeatMonitor)
        self.reset()

    def reset(self) -> None:
        """Return to IDLE: forget the grip and its faults."""
        self.state = LoopState.IDLE
        # Fingers of the grip, set by `_begin`; empty without a grip.
        self._touches: list[Touch] = []
        self._joints = JointWay()
        # When each finger, and last the whole grip, became bad; infinite while good.
        self._bad_since: list[float] = []
        # Highest scale of each finger, from its force when the grip began.
        self._highest: list[float] = []
        self._commands: dict[str, FingerCommand] = {}
        # A latched fault ends by `reset` only.
        self._latched = False
        # UNKNOWN never lowers a force: forces fall only while this is True.
        self._all_known = False
        # Those of `_monitors` in the grip; `reset` keeps the noise that these have measured.
        self._repeats: list[RepeatMonitor] = []
        # Times of the last update that counted and of its estimate; NaN before the first.
        self._time = self._estimated_at = math.nan
        self._start.reset()
        self._valid_since = math.nan
        self._raised_at = -math.inf
        # The present fault, and that of `report`, which the next update takes.
        self._fault = self._reported = GripReason.NONE
        self._events: deque[GripEvent] = deque(maxlen=MAX_EVENTS)

    @property
    def loaded_fingers(self) -> tuple[str, ...]:
        """Fingers of the grip; none while IDLE."""
        return tuple(touch.finger for touch in self._touches)

    def events(self) -> list[GripEvent]:
        """Return states and rises since the last call, at most `MAX_EVENTS`, oldest first."""
        events = list(self._events)
        self._events.clear()
        return events

    def report(self, fault: GripReason) -> None:
        """Report a fault outside the estimates, as that of a silent hand, to the next update."""
        self._reported = fault

    def observe(self, angles: Array) -> None:
        """Process the joint angles that the hand's driver reports, before the next `update`.

        A grip whose joints opened when the object was let go ended as planned: the loop waits for
        the next one. Without this call no release is known, and nothing else changes.

        Args:
            angles: (n_joints,) measured angle of each joint, in any order that stays [rad].
        """
        self._joints.add(angles)

    def update(self, estimate: HandEstimate, time: float) -> GripCommand:
        """Process an estimate, or the passing of time if the estimate is the last one again.

        Args:
            estimate: the newest estimate of the hand.
            time: time now, on the clock of the source [s]; it exceeds the time of the estimate
                where samples are late.

        Returns:
            The command. Its scales change only in the states REACT and RELAX, and only with a new
            estimate: otherwise it is the last command again, with the time of that one.

        Raises:
            ValueError: the law breaks its contract, as with a scale of NaN; no estimate raises it.
        """
        is_new = estimate.time != self._estimated_at
        # Each finger is made when it is read, so each is read once.
        fingers = dict(estimate.fingers.items())
        if is_new:  # the last estimate, given again, is no repeated reading
            self._estimated_at = estimate.time
            for name, finger in fingers.items():
                self._monitors[name].update(finger)
        fault, self._reported = self._reported, _NONE
        dt = time - self._time
        if self.state is LoopState.IDLE:
            return self._idle(HandEstimate(estimate.time, estimate.state, fingers), time)
        problem = self._problem(fingers, time, dt)
        if problem is GripReason.LOST and not self._latched and self._joints.have_opened:
            events = self._events
            self.reset()
            self._events = events
            self._change(LoopState.IDLE, time, GripReason.RELEASED)
            return self._idle(HandEstimate(estimate.time, estimate.state, fingers), time)
        # After a jump of the clock no age and no duration is right, so it comes first.
        if problem is not GripReason.CLOCK:
            problem = fault or problem
        if problem is not _NONE or self._fault is not _NONE:
            return self._in_fault(problem, time)
        # No force changes without a new sample, and a repeated reading is none.
        if not is_new or any(monitor.repeating for monitor in self._repeats):
            return GripCommand(self._time, self.state, self._commands.copy())
        self._time = time
        # After a pause, a scale moves no further than in the longest pause without a fault.
        return self._control(time, min(dt, self.limits.stale_after))

    def _idle(self, estimate: HandEstimate, time: float) -> GripCommand:
        """Wait for a grip; begin it when the hand has been stable for long enough."""
        commands = {name: self._commands.get(name, KEEP) for name in estimate.fingers}
        self._commands = commands
        if touches := self._start.update(estimate, time):
            self._begin(touches, time)
        return GripCommand(time, self.state, dict(commands))

    def _new_touch(self, name: str) -> Touch:
        normal = self._normals.get(name, (1.0, 0.0, 0.0))
        return Touch(name, normal, self._factors, reports_slips=self._reports_slips)

    def _begin(self, touches: list[Touch], time: float) -> None:
        self._touches, self._time = touches, time
        self._joints.grip()
        for touch in touches:
            touch.start()
        self._highest = [self.limits.highest_scale(touch.start_normal) for touch in touches]
        self._bad_since = [math.inf] * (len(touches) + 1)  # of each finger, and of the grip
        self._repeats = [self._monitors[touch.finger] for touch in touches]
        names = self.loaded_fingers
        opposed = self._thumb in names and len(names) > 1
        self.law.start(touches, names.index(str(self._thumb)) if opposed else -1)
        self._change(LoopState.HOLD, time)

    def _problem(self, fingers: Fingers, time: float, dt: float) -> GripReason:
        """Read the loaded fingers; return why this update is a fault, NONE if it is not."""
        if not 0.0 <= dt < math.inf:
            return GripReason.CLOCK
        due = time - self._max_age
        touching, is_known, problem = False, True, _NONE
        for k, touch in enumerate(self._touches):
            finger = fingers.get(touch.finger)
            # First whether the numbers are new and known, then their values. `not >=`: NaN is late.
            if finger is None or not finger.time >= due:
                problem = GripReason.STALE
            elif finger.state is _UNKNOWN or not IMPLAUSIBLE.isdisjoint(finger.faults):
                touch.known = is_known = False
                if self._lasts(k, time):
                    is_gap = finger.reason is Reason.GAP  # samples are missing, no sensor is faulty
                    problem = GripReason.STALE if is_gap else GripReason.FINGER_FAULT
            elif not touch.read(finger):
                problem = GripReason.NOT_FINITE
            elif touch.normal > self._ceiling:
                problem = GripReason.OVERLOAD
            elif self._repeats[k].frozen:
                problem = GripReason.FROZEN
            else:
                self._bad_since[k] = math.inf
            if problem is not _NONE:
                return problem
            touching = touching or touch.touching
        self._all_known = is_known
        if touching:
            self._bad_since[-1] = math.inf
            return _NONE
        # A contact may be missed for a moment; an object that is lost stays lost.
        return GripReason.LOST if self._lasts(-1, time) else _NONE

    def _lasts(self, k: int, time: float) -> bool:
        """Return whether what is bad now has been bad for `fault_after`."""
        self._bad_since[k] = min(self._bad_since[k], time)
        return time - self._bad_since[k] >= self.limits.fault_after

    def _in_fault(self, problem: GripReason, time: float) -> GripCommand:
        """Hold or open; recover after enough valid data, where that is allowed."""
        if problem is not GripReason.CLOCK:
            self._time = time
        if problem is not GripReason.NONE:
            self._valid_since = math.nan
            # Only a loss lasts until a reset, and replaces the reason of what would end by itself.
            lasting = problem is GripReason.LOST
            # The first fault stays the reason, unless one that lasts follows it.
            if self._fault is GripReason.NONE or (lasting and self._fault is not problem):
                self._fault = problem
                self._change(LoopState.FAULT, time, problem)
            self._latched |= self.limits.on_fault == "open" or lasting
        # The first valid sample, or a clock that went back: count again from here.
        elif not self._valid_since <= time:
            self._valid_since = time
        if not self._latched and time - self._valid_since >= self.limits.recovery:
            self._fault = GripReason.NONE
            self._change(LoopState.HOLD, time)
        released = self._fault is not GripReason.NONE and self.limits.on_fault == "open"
        # Keep every scale; nothing rises or falls in a fault.
        self._commands = {
            name: FingerCommand(command.scale) for name, command in self._commands.items()
        }
        return GripCommand(time, self.state, dict(self._commands), released, self._fault)

    def _control(self, time: float, dt: float) -> GripCommand:
        """Apply the law within the limits."""
        limits, commands, highest = self.limits, self._commands, self._highest
        targets = self.law.targets(self._touches, time, dt)
        if len(targets) != len(self._touches):
            raise ValueError(_broken_law(self.law, len(self._touches), f"{len(targets)} targets"))
        # A rise shakes the contacts, and an UNKNOWN finger may slip: nothing falls then.
        may_fall = self._all_known and time - self._raised_at >= limits.cooldown
        rising = falling = False
        for k, touch in enumerate(self._touches):
            scale = touch.scale
            target, reason = targets[k]
            if math.isnan(target):
                raise ValueError(_broken_law(self.law, len(self._touches), "a scale of nan"))
            target = min(max(target, limits.min_scale), highest[k])
            if target > scale and reason is not _NONE:
                self._set(touch, min(target, scale + limits.rise * dt), reason, time)
                rising = True
            elif target < scale and may_fall:
                self._set(touch, max(target, scale - limits.fall * dt), GripReason.RELAX, time)
                falling = True
            elif commands[touch.finger].reason is not _NONE:
                commands[touch.finger] = FingerCommand(scale)
        if rising:
            self._raised_at = time
        state = _REACT if rising else _RELAX if falling else _HOLD
        if state is not self.state:
            self._change(state, time)
        return GripCommand(time, state, commands.copy())

    def _set(self, touch: Touch, scale: float, reason: GripReason, time: float) -> None:
        """Set a scale, and log the beginning of a rise."""
        before = self._commands[touch.finger]
        if scale > touch.scale and before.reason is not reason:
            event = GripEvent(time, LoopState.REACT, touch.finger, touch.scale, reason)
            self._events.append(event)
        touch.scale = scale
        self._commands[touch.finger] = FingerCommand(scale, reason)

    def _change(self, state: LoopState, time: float, reason: GripReason = GripReason.NONE) -> None:
        self.state = state
        self._events.append(GripEvent(time, state, "", math.nan, reason))


def _broken_law(law: Law, n: int, returned: str) -> str:
    """Return a message about what a law returned."""
    return (
        f"law {type(law).__name__}: the contract of laws expects a scale and a reason for each of "
        f"{n} fingers, {returned} given"
    )
