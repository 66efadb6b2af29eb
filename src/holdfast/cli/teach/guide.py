"""Shell of the guided protocol of `holdfast teach`: source, recordings, camera and keys."""

import re
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from pathlib import Path
from threading import Thread

from holdfast.cli.teach.screen import SAFETY, TeachScreen
from holdfast.cli.terminal.control import MarkerKeys, StopRequest
from holdfast.detection import Model
from holdfast.devices.sources import Source
from holdfast.devices.sources.twin import AskedTwin
from holdfast.devices.uri import is_uri, open_source, parse
from holdfast.errors import HoldfastError, SourceError, TrainingError
from holdfast.labelling.taught_grasps import Slide, label_grasp, throw_away, write_pictures
from holdfast.live.camera import CameraRecorder
from holdfast.live.recorder import Recorder
from holdfast.live.recorder_setup import create_recorder
from holdfast.live.stream_detector import StreamDetector
from holdfast.live.teaching.folder import TeachingFolder
from holdfast.live.teaching.protocol import TARE_SECONDS, GuidedProtocol, Stage
from holdfast.live.teaching.steps import Check, Step

MAX_UNATTENDED_ATTEMPTS = 2
"""Attempts of a grasp without a person, after which the protocol goes on all the same."""
TWIN_EXTRA_SECONDS = 4.0
"""Time for which the twin holds, or is open, longer than a step takes [s]."""
MAX_TWIN_GRASPS = 60
"""Grasps of the twin, with those that fail, after which the protocol ends."""
WAITING_STAGES = (Stage.CHECK, Stage.DECIDE, Stage.OVER)
"""Stages in which no sample is awaited."""
KEY_PAUSE = 0.05
"""Pause between two looks at the keys [s]."""
THROW_AWAY = re.compile(r"throw away (\d+)")

Checked = tuple[list[Slide] | None, str]
"""Slides of a grasp, or None; and why there are none."""


def confirm_safety(camera: str, stop: StopRequest, keys: MarkerKeys, screen: TeachScreen) -> bool:
    """Ask what a person must have seen to before a hand holds anything; whether it is so.

    Args:
        camera: what a camera measures, or what cannot be promised without one.
        stop: of the signals.
        keys: of the terminal or a pipe.
        screen: that shows the questions.
    """
    screen.print(*SAFETY, *camera.splitlines(), "Enter: all of this holds   q: quit")
    while not (stop.requested or keys.stop_pressed):
        answers = keys.poll()
        if "next" in answers:
            return True
        if "quit" in answers or keys.ended:
            return False
        time.sleep(KEY_PAUSE)
    return False


def open_taught(source: str, speed: float) -> Source:
    """Return the source; the twin performs each step of the protocol."""
    if is_uri(source) and parse(source)[0] == "twin":
        return AskedTwin(parse(source)[1], speed=speed)
    return open_source(source, speed=speed)


class Guide:
    """Lead through the protocol, and record every grasp into a folder.

    Args:
        source: an open source.
        model: whose contact states are used.
        folder: for the recordings.
        steps: of the protocol.
        camera: of `record --camera`; None for none, and for the twin.
        unattended: without keys: what passes is kept, what does not is repeated once.
    """

    def __init__(
        self,
        source: Source,
        model: Model,
        folder: TeachingFolder,
        steps: Sequence[Step],
        *,
        camera: str | None = None,
        unattended: bool = False,
    ) -> None:
        self._source, self._stream = source, StreamDetector(model, source)
        self._folder, self._camera, self._unattended = folder, camera, unattended
        self.protocol = GuidedProtocol(self._stream.fingers, folder.results, steps)
        self._recorder: Recorder | None = None
        self._film: CameraRecorder | None = None
        self._path = folder.path
        self._slides: list[Slide] | None = None
        self._checking: Future[Checked] | None = None
        self._seconds = 0.0
        self._n_asked = self._n_attempts = 0
        self._n_before = len(folder.results)

    def run(self, stop: StopRequest, keys: MarkerKeys, screen: TeachScreen) -> None:
        """Go through the protocol.

        Raises:
            TrainingError: it was stopped.
            SourceError: the source ended, or the hand did not open.
            OutputError: a recording cannot be written.
        """
        protocol = self.protocol
        self._folder.save(self._folder.results)  # a break in the first grasp can be resumed too
        try:
            with ExitStack() as stack:
                stack.enter_context(screen)
                stack.callback(self._close)
                while protocol.stage is not Stage.OVER:
                    self._step(screen, keys)
                    # A robot whose lines have ended decides nothing any more.
                    undecided = protocol.stage is Stage.DECIDE and not self._unattended
                    if stop.requested or keys.stop_pressed or (undecided and keys.ended):
                        self._press("quit", screen)
            if protocol.stopped:
                raise TrainingError(f"stopped in step {protocol.step.name}")
        except HoldfastError as failure:
            n, path = len(self._folder.kept), self._folder.path
            rest = f"{n} of {protocol.n_grasps} grasps are in {path}: go on with --resume"
            raise type(failure)(f"{failure}; {rest}") from failure

    def _step(self, screen: TeachScreen, keys: MarkerKeys) -> None:
        """Read the source once, and the keys."""
        protocol = self.protocol
        if isinstance(self._source, AskedTwin):
            self._ask(self._source, screen)
        update = self._stream.read()
        if update.arrival is not None:
            screen.print(*update.arrival.notices)
            if self._recorder is not None:
                self._recorder.put(update.arrival, wait=not self._source.paced)
        self._follow(protocol.put(update), screen)
        for text in keys.poll():
            self._press(text, screen)
        if self._unattended and protocol.stage is Stage.DECIDE:
            is_last = self._n_attempts + 1 >= MAX_UNATTENDED_ATTEMPTS
            goes_on = protocol.passed or is_last
            self._n_attempts = 0 if goes_on else self._n_attempts + 1
            self._press("next" if goes_on else "repeat", screen)
        if self._checking is not None and self._checking.done():
            self._show_result(self._checking.result(), screen)
        if self._recorder is not None and self._recorder.failed:
            self._recorder.close()  # it raises what failed
        if self._source.ended and protocol.stage not in WAITING_STAGES:
            raise SourceError(f"{self._source.name} ended in step {protocol.step.name}")
        progress = f"{len(self._folder.kept)} of {protocol.n_grasps} grasps"
        if protocol.stage is not Stage.OVER:
            screen.show(protocol.view(), progress)

    def _ask(self, twin: AskedTwin, screen: TeachScreen) -> None:
        """Ask the twin for the grasp that begins, or for another one if it has failed."""
        protocol, step = self.protocol, self.protocol.step
        if twin.is_idle and protocol.stage not in WAITING_STAGES and self._n_asked:
            if protocol.n_begun > MAX_TWIN_GRASPS:
                raise SourceError(f"{twin.name} does not hold its object in step {step.name}")
            self._press("repeat", screen)
        if self._n_asked != protocol.n_begun:
            self._n_asked = protocol.n_begun
            seconds = step.seconds + TWIN_EXTRA_SECONDS
            # A protocol that is resumed has other grasps than the one before.
            number = self._n_before + self._n_asked
            twin.perform(number, step.name, step.n_actions, seconds)

    def _press(self, text: str, screen: TeachScreen) -> None:
        """Process a key or line; a line that is none of them becomes a marker."""
        protocol, thrown = self.protocol, THROW_AWAY.fullmatch(text)
        if thrown and protocol.stage is Stage.DECIDE and self._slides:
            try:
                self._slides = throw_away(self._path, int(thrown[1]))
            except ValueError as refusal:
                screen.print(str(refusal))
            self._report_grasp("", screen)
        elif text in ("next", "repeat", "skip", "quit"):
            n_results = len(protocol.results)
            self._follow(protocol.press(text), screen)
            if len(protocol.results) != n_results:
                self._folder.save(protocol.results)
                for result in filter(lambda x: x.recording, protocol.results[n_results:]):
                    kept = "kept" if result.kept else "left out"
                    screen.print(f"{result.recording} {kept}: {result.text}")
        elif self._recorder is not None and not thrown:
            self._recorder.add_marker(text)

    def _follow(self, markers: Sequence[str], screen: TeachScreen) -> None:
        """Set markers, and begin or end the recording, as the protocol says."""
        protocol = self.protocol
        for marker in markers:
            if self._recorder is not None:
                self._recorder.add_marker(marker)
        if protocol.recording and self._recorder is None:
            step = protocol.step
            self._path = self._folder.new_path(step.name)
            metadata = {"teach_step": step.name, "teach_grasp": protocol.number}
            self._recorder = create_recorder(self._source, self._path, metadata)
            if self._camera is not None and step.in_view:
                self._film = CameraRecorder(self._camera, self._path.with_suffix(".mp4"))
                self._film.start(self._recorder, screen.print)
        elif self._recorder is not None and not protocol.recording:
            self._close()
            if protocol.stage is Stage.CHECK:
                self._checking = _started(lambda: self._check(self._path, protocol.step))

    def _close(self) -> None:
        """Close the recording; one that its step did not end goes aside, an empty one away."""
        recorder, self._recorder = self._recorder, None
        film, self._film = self._film, None
        if film is not None:
            film.close()
        if recorder is None:
            return
        recorder.close()
        self._seconds = recorder.status.seconds
        if self.protocol.stage is Stage.CHECK:
            return
        self._folder.leave_out(self._path)
        if self._seconds <= TARE_SECONDS:
            for file in self._folder.aside.glob(f"{self._path.stem}.*"):
                file.unlink()

    def _check(self, path: Path, step: Step) -> Checked:
        """Label a grasp, in a thread of its own: the source goes on being read."""
        if step.check is Check.HEALTH:
            return None, ""
        if isinstance(self._source, AskedTwin) and step.in_view:
            self._source.film(path.with_suffix(".mp4"))
        return label_grasp(path, step)

    def _show_result(self, checked: Checked, screen: TeachScreen) -> None:
        self._checking = None
        self._slides, note = checked
        self._report_grasp(note, screen)

    def _report_grasp(self, note: str, screen: TeachScreen) -> None:
        protocol, slides = self.protocol, self._slides
        n_slides = None if slides is None else len(slides)
        protocol.checked(self._path.stem, self._seconds, n_slides, note)
        for k, slide in enumerate(slides or ()):
            fingers = ", ".join(slide.slips)
            screen.print(f"  {k + 1}  from {slide.start:.2f} to {slide.end:.2f} s: {fingers}")
        if slides:
            kept = [x.recording for x in self._folder.kept if x.n_slides]
            write_pictures(self._folder.path, [*kept, self._path.stem])


def _started(work: Callable[[], Checked]) -> "Future[Checked]":
    """Run work in a thread that does not keep the process from ending."""
    future: Future[Checked] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except Exception as failure:
            future.set_exception(failure)

    Thread(target=run, name="holdfast-teach-check", daemon=True).start()
    return future
