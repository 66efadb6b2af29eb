"""Course of the guided protocol of `holdfast teach`, without I/O, clock or thread.

Each grasp is one recording: open hand, grasp, what the step asks for, release. The machine gets
what the stream detector gives. It says what a person does now, when a recording runs, which markers
it gets, and whether the grasp passed the check of its step. Its time is that of the samples.
"""

import math
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple

import msgspec
import numpy as np

from holdfast.contact import MERGE_GAP, MIN_HOLDING_FINGERS, ContactState, HandEstimate
from holdfast.errors import SourceError
from holdfast.live.health import HealthCheck, ModuleHealth, findings_of, module_health
from holdfast.live.stream_detector import TOUCHING, StreamUpdate
from holdfast.live.teaching.steps import STEPS, Check, Step
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array

MARKER = "teach: "
"""Begin of the markers of the protocol."""
SETTLED_SECONDS = 0.5
"""Time for which the hand must be open, or hold, before the protocol goes on [s]."""
CREEP_SHARE = 0.2
"""Share of the grip force below which a released elastomer may still keep a load: it creeps back
over seconds, and the detector reports contact meanwhile."""
CREEP_SECONDS = 3.0
"""Time with at most such a load after which the hand counts as open [s]."""
TARE_SECONDS = 1.5
"""Time with an open hand at the beginning of a recording [s]: a tare takes 0.5 s."""
LOST_SECONDS = 1.0
"""Time without contact after which the object counts as lost [s]."""
MAX_STAGE_SECONDS = 60.0
"""Time for which an open hand, or a grasp, is awaited [s]."""
MIN_HELD_SHARE = 0.6
"""Share of the time of a step for which the object must be held."""
MIN_CARRIED_CHANGE, CHANGE_SECONDS = 0.05, 0.5
"""Change of a finger's force within half a second [s] that an arm which carries exceeds at times,
as a share of the force; a hand that rests stays below half of it."""
MIN_SLIDES = 2
"""Number of slides that a grasp must have in which the object is to slide."""
LONGEST_ESTIMATE_STEP = 0.1
"""A longer step between two estimates is a gap, and counts for nothing [s]."""


class Stage(StrEnum):
    """Stage of a grasp; a recording runs from TARE to RELEASE."""

    OPEN = "open"
    TARE = "tare"
    GRASP = "grasp"
    ACT = "act"
    RELEASE = "release"
    CHECK = "check"
    DECIDE = "decide"
    OVER = "over"


RECORDED_STAGES = (Stage.TARE, Stage.GRASP, Stage.ACT, Stage.RELEASE)
"""Stages in which a recording runs."""

STAGE_WORDS = {
    Stage.OPEN: ("OPEN THE HAND", "Nothing may touch it."),
    Stage.TARE: ("KEEP IT OPEN", "The zero of the sensors is taken."),
    Stage.GRASP: ("GRASP THE OBJECT", ""),
    Stage.RELEASE: ("OPEN THE HAND", "Put the object down first."),
    Stage.CHECK: ("ONE MOMENT", "The recording is checked."),
    Stage.DECIDE: ("GOOD", ""),
}
"""Instruction of each stage, and its explanation; in ACT they are those of the step."""


class GraspResult(msgspec.Struct, frozen=True):
    """Result of a grasp.

    Attributes:
        name: of the step.
        number: of the grasp within the step, from 1.
        seconds: time of the recording [s].
        kept: whether it teaches.
        recording: name of the recording; empty for a grasp that was skipped.
        text: result of the check.
        n_slides: number of pulls or pushes that slid, as the camera saw it.
    """

    name: str
    number: int
    seconds: float
    kept: bool
    recording: str = ""
    text: str = ""
    n_slides: int = 0

    @property
    def is_done(self) -> bool:
        """Whether the protocol does not repeat the grasp."""
        return self.kept or not self.recording


class View(NamedTuple):
    """Content of the screen.

    Attributes:
        title: which step and grasp.
        words: what to do, in a few words.
        hint: how.
        left: time left [s]; None without an end.
        share: share of the time that is over.
        message: result of the check, or what is missing.
        decides: whether a person decides now what becomes of the grasp.
    """

    title: str
    words: str
    hint: str
    left: float | None = None
    share: float = 0.0
    message: str = ""
    decides: bool = False


class GuidedProtocol:
    """State machine of the protocol.

    Args:
        sensors: of the modules that the detector uses.
        done: results of an earlier run, which are not repeated.
        steps: the protocol.

    Attributes:
        stage: of the present grasp.
        step: the present one.
        number: of the present grasp within its step, from 1.
        results: of all grasps that are over, oldest first.
        passed: whether the grasp was what the step asks for; known in DECIDE.
        message: result of its check.
        stopped: True after the key that quits.
        n_begun: number of grasps that were begun.
    """

    def __init__(
        self,
        sensors: Mapping[str, Sensor],
        done: Sequence[GraspResult] = (),
        steps: Sequence[Step] = STEPS,
    ) -> None:
        self.results = list(done)
        self.stopped = self.passed = False
        self.message, self.n_begun = "", 0
        self._sensors, self._steps = sensors, steps
        over = {(result.name, result.number) for result in done if result.is_done}
        grasps = [(step, k) for step in steps for k in range(1, step.n_grasps + 1)]
        # Those that are left, the next one last.
        self._left = [grasp for grasp in reversed(grasps) if (grasp[0].name, grasp[1]) not in over]
        self._now = self._began = math.nan  # of the newest estimate, and of the stage
        self._since = math.nan  # since when what the stage waits for lasts
        self._touching: tuple[str, ...] = ()
        self._grips: dict[str, float] = {}  # mean force of each finger when it held last
        self._recording, self._seconds, self._n_slides = "", 0.0, 0
        self.step, self.number = grasps[-1]
        self.stage = Stage.OVER
        self._begin()

    @property
    def recording(self) -> bool:
        """Whether a recording runs."""
        return self.stage in RECORDED_STAGES

    @property
    def n_grasps(self) -> int:
        """Number of grasps of the whole protocol."""
        return sum(step.n_grasps for step in self._steps)

    def put(self, update: StreamUpdate) -> list[str]:
        """Process an update of the detector, and return the markers of the recording.

        Raises:
            SourceError: the hand does not open, or grasps nothing, for a minute.
        """
        is_checked = self.stage is Stage.ACT and self.step.check is Check.HEALTH
        if is_checked and update.arrival is not None:
            for name in self._samples.keys() & update.arrival.samples.keys():
                readings = np.array(update.arrival.samples[name], dtype=np.float64)
                self._samples[name].append((update.arrival.time, readings))
        markers = [self._advance(estimate) for estimate, _ in update.estimates]
        return [marker for marker in markers if marker]

    def press(self, key: str) -> list[str]:
        """Process a key, or the line of a robot, and return the markers of the recording.

        While a grasp is checked, only `quit` has an effect.

        Args:
            key: `next`, `repeat`, `skip` (the whole step) or `quit`.
        """
        if key == "quit":
            if self._recording:  # one that has passed is not recorded again
                self._keep(self.passed)
            self.stopped, self.stage = True, Stage.OVER
        elif self.stage in (Stage.CHECK, Stage.OVER):
            return []
        elif key == "skip":
            skipped = self.step
            if self._recording:
                self._keep(False)
            while self._left and self._left[-1][0] == skipped:
                _, number = self._left.pop()
                self.results.append(GraspResult(skipped.name, number, 0.0, False))
            self._begin()
        elif key == "repeat":
            if self._recording:
                self._keep(False)
            self._begin()
        elif key == "next" and self.stage is Stage.DECIDE:
            self._keep(True)
            self._left.pop()
            self._begin()
        elif key == "next" and self.stage in (Stage.GRASP, Stage.ACT):
            return [self._enter(Stage.ACT if self.stage is Stage.GRASP else Stage.RELEASE)]
        return []

    def checked(
        self, recording: str, seconds: float, n_slides: int | None = None, note: str = ""
    ) -> None:
        """Accept or refuse the grasp whose recording is complete.

        Args:
            recording: its name.
            seconds: its time [s].
            n_slides: number of pulls or pushes that slid; None if no camera saw them.
            note: why it is not known.
        """
        self._recording, self._seconds, self._n_slides = recording, seconds, n_slides or 0
        self.passed, self.message = self._check_grasp(n_slides, note)
        self.stage = Stage.DECIDE

    def view(self) -> View:
        """Return what a person sees now."""
        step, stage = self.step, self.stage
        title = f"step {self._steps.index(step) + 1} of {len(self._steps)}: {step.name}"
        if step.n_grasps > 1:
            title += f", grasp {self.number} of {step.n_grasps}"
        words, hint = STAGE_WORDS.get(stage, (step.words, step.hint))
        message, left, share = self.message if stage is Stage.DECIDE else "", None, 0.0
        elapsed = 0.0 if math.isnan(self._now - self._began) else self._now - self._began
        if stage is Stage.TARE:
            share = min(elapsed / TARE_SECONDS, 1.0)
        elif stage is Stage.GRASP:
            hint = f"Then: {step.words.lower()}."
        elif stage is Stage.ACT:
            left = max(step.seconds - elapsed, 0.0)
            share = 1 - left / step.seconds
            if self._n_felt and step.n_actions:
                message = f"{self._n_felt} felt"
        elif stage in (Stage.OPEN, Stage.RELEASE) and self._touching:
            message = f"in contact: {', '.join(self._touching)}"
        elif stage is Stage.DECIDE and not self.passed:
            words = "NOT YET"
        return View(title, words, hint, left, share, message, stage is Stage.DECIDE)

    def _begin(self) -> None:
        """Begin the next grasp, or the same one again."""
        self.stage = Stage.OPEN if self._left else Stage.OVER
        self.n_begun += 1
        if self._left:
            self.step, self.number = self._left[-1]
        self._began, self._since, self._recording = self._now, math.nan, ""
        self._samples: dict[str, list[tuple[float, Array]]] = {n: [] for n in self._sensors}
        # Of what happens in ACT: time of holding [s]; number of movements, and when the last one
        # ended; forces.
        self._held = 0.0
        self._n_felt, self._moved_at = 0, -math.inf
        self._forces: list[dict[str, tuple[float, float, float]]] = []

    def _keep(self, kept: bool) -> None:
        self.results.append(GraspResult(
            self.step.name, self.number, self._seconds, kept, self._recording, self.message,
            self._n_slides,
        ))  # fmt: skip
        self._recording = ""

    def _enter(self, stage: Stage) -> str:
        """Enter a stage, and return the marker of a step that begins or ends."""
        was, self.stage = self.stage, stage
        if was is Stage.ACT:
            for name in self._sensors:
                sizes = [math.hypot(*forces[name]) for forces in self._forces if name in forces]
                if sizes:
                    self._grips[name] = math.fsum(sizes) / len(sizes)
        self._began, self._since = self._now, math.nan
        if Stage.ACT not in (was, stage):
            return ""
        return f"{MARKER}{self.step.name} {'begins' if stage is Stage.ACT else 'ends'}"

    def _lasts(self, condition: bool, seconds: float) -> bool:
        """Return whether a condition of this stage has lasted for some time [s]."""
        if not condition:
            self._since = math.nan
        elif math.isnan(self._since):
            self._since = self._now
        return self._now - self._since >= seconds

    def _advance(self, estimate: HandEstimate) -> str:
        before, self._now = self._now, estimate.time
        if math.isnan(self._began):
            self._began = self._now
        states = {name: finger.state for name, finger in estimate.fingers.items()}
        touching = [name for name, state in states.items() if state in TOUCHING]
        creeps = {
            name
            for name in touching
            if math.hypot(*estimate.fingers[name].force) < CREEP_SHARE * self._grips.get(name, 0.0)
        }
        self._touching = tuple(name for name in touching if name not in creeps)
        # A finger without an estimate does not keep the protocol from going on, all of them do.
        is_open = not self._touching and bool(creeps or ContactState.NO_CONTACT in states.values())
        elapsed, is_health = self._now - self._began, self.step.check is Check.HEALTH
        n_holding = min(MIN_HOLDING_FINGERS, len(states))
        match self.stage:
            case Stage.OPEN | Stage.RELEASE:
                if self._lasts(is_open, CREEP_SECONDS if creeps else SETTLED_SECONDS):
                    return self._enter(Stage.TARE if self.stage is Stage.OPEN else Stage.CHECK)
                self._check_patience(elapsed, "the hand has not opened")
            case Stage.TARE if self._touching:
                return self._enter(Stage.OPEN)
            case Stage.TARE if elapsed >= TARE_SECONDS:
                return self._enter(Stage.ACT if is_health else Stage.GRASP)
            case Stage.GRASP:
                if self._lasts(len(self._touching) >= n_holding, SETTLED_SECONDS):
                    return self._enter(Stage.ACT)
                self._check_patience(elapsed, "nothing was grasped")
            case Stage.ACT:
                self._measure(estimate, self._now - before)
                is_lost = self._lasts(not (self._touching or is_health), LOST_SECONDS)
                if elapsed >= self.step.seconds or is_lost:
                    return self._enter(Stage.CHECK if is_health else Stage.RELEASE)
        return ""

    def _check_patience(self, elapsed: float, what: str) -> None:
        if elapsed <= MAX_STAGE_SECONDS:
            return
        touching = ", ".join(self._touching) or "no finger"
        raise SourceError(
            f"{what} for {MAX_STAGE_SECONDS:g} s in step {self.step.name} ({touching} in contact)"
        )

    def _measure(self, estimate: HandEstimate, since_last: float) -> None:
        if not self._touching or not since_last <= LONGEST_ESTIMATE_STEP:
            return
        touched = {name: estimate.fingers[name] for name in self._touching}
        self._held += since_last
        self._forces.append({name: finger.force for name, finger in touched.items()})
        if any(finger.state is ContactState.UNSTABLE for finger in touched.values()):
            self._n_felt += self._now - self._moved_at > MERGE_GAP
            self._moved_at = self._now

    def _largest_change(self) -> float:
        """Return how much a finger's force changes within half a second at times, as a share."""
        n = max(round(CHANGE_SECONDS * len(self._forces) / self._held), 1)
        changes = [0.0]
        for name in self._sensors:
            force = np.array([forces[name] for forces in self._forces if name in forces])
            if len(force) > n:
                change = np.linalg.norm(force[n:] - force[:-n], axis=1)
                usual = max(float(np.linalg.norm(force, axis=1).mean()), 1e-9)
                changes.append(float(np.percentile(change, 95)) / usual)
        return max(changes)

    def _check_grasp(self, n_slides: int | None, note: str) -> tuple[bool, str]:
        """Return whether the grasp was what the step asks for, and the result in one line."""
        step = self.step
        if step.check is Check.HEALTH:
            return self._check_health()
        if self._held < MIN_HELD_SHARE * step.seconds:
            return False, f"held for {self._held:.0f} s only, {step.seconds:.0f} s expected"
        good, bad = f"held for {self._held:.0f} s", ""
        match step.check:
            case Check.CARRIED:
                change = self._largest_change()
                good += f", the force changed by {100 * change:.0f} %"
                if change < MIN_CARRIED_CHANGE:
                    bad = f"the force changed by {100 * change:.0f} % only: carry it faster"
            case Check.FELT:
                good = f"{self._n_felt} movements felt"
                good += f"; {n_slides} slid, and teach as slips" if n_slides else ""
                if self._n_felt < step.n_actions / 2:
                    bad = f"{self._n_felt} of {step.n_actions} felt: {step.name} a little harder"
            case _:
                good = f"{n_slides} slides seen"
                if n_slides is None:
                    bad = note or "no camera saw whether it slid"
                elif n_slides < MIN_SLIDES:
                    seen = "one slide seen" if n_slides else "no slide seen"
                    bad = f"{seen}: {step.name} a little farther"
        return not bad, bad or good

    def _check_health(self) -> tuple[bool, str]:
        modules: dict[str, ModuleHealth] = {}
        try:
            for name, samples in self._samples.items():
                times, readings = np.array([t for t, _ in samples]), [x for _, x in samples]
                stacked = np.array(readings).reshape(-1, self._sensors[name].n_taxels, 3)
                modules[name] = module_health(name, self._sensors[name], times, stacked)
        except SourceError as failure:
            return False, str(failure)
        kinds = {
            f"{x.sensor} ({self._sensors[name].n_taxels} taxels, {x.rate:.0f} Hz)": ""
            for name, x in modules.items()
        }
        n = len(modules)
        text = f"is this your hand: {n} module{'s' * (n > 1)}, {', '.join(kinds)}?"
        findings = findings_of(HealthCheck("", 0, modules))
        # Dead taxels are left out by every model: they are named, and the protocol goes on.
        return True, " ".join([text, "; ".join(findings)]).rstrip()
