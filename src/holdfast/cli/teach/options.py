"""Options of the guided protocol of `holdfast teach`, and the protocol with them."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from holdfast.cli.options import CameraOption, awaited, check_speed
from holdfast.cli.teach.screen import TEACH_KEYS, TeachScreen
from holdfast.cli.terminal.console import message_if_slow, print_message
from holdfast.cli.terminal.control import MarkerKeys, handle_stop_signals
from holdfast.errors import HoldfastError, TrainingError, require_extras

if TYPE_CHECKING:
    from holdfast.detection import Model
    from holdfast.live.teaching.folder import TeachingFolder

WITH_CAMERA = (
    "The camera measures the slips of fingers whose stickers it sees, from 0.3 mm\n"
    "on. Smaller slips, and those of the other fingers, are not promised."
)
WITHOUT_CAMERA = (
    "Without --camera no slip is measured: this ends with a calibration, and the\n"
    "slips stay those that the model finds on a hand it was not trained on."
)
"""Evidence on which the figures rest."""


@dataclass(frozen=True)
class GuideOptions:
    """Group of options: how the guided protocol runs."""

    camera: CameraOption = None
    folder: Annotated[
        Path | None,
        typer.Option("--to", help="Folder for the grasps.", show_default="NEW-grasps"),
    ] = None
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the protocol of this folder.")
    ] = False
    unattended: Annotated[
        bool, typer.Option("--unattended", help="With twin: only: no keys, faster than real time.")
    ] = False

    def check(self, source: str, data: Path | None, speed: float) -> None:
        """Check that the options fit each other.

        Raises:
            ValueError: they do not.
            MissingExtra: a camera needs a package that is not installed.
        """
        if bool(source) == (data is not None):
            inputs = f"{source} and --from {data}" if source else "neither"
            raise ValueError(f"a SOURCE, or recordings with --from, expected; {inputs} given")
        if data is not None:
            if self != WITHOUT_PROTOCOL:
                raise ValueError("--camera, --to, --resume and --unattended need a SOURCE")
            return
        check_speed(source, speed)
        if is_twin(source):
            require_extras("twin", "parquet", "label", "video")
        elif self.unattended:
            raise ValueError(
                "--unattended is for twin:; a robot sends the lines next, repeat, skip or quit "
                "on stdin"
            )
        require_extras("label", *(("video",) if self.camera else ()))

    def run(self, source: str, model: "Model", out: Path, speed: float) -> "TeachingFolder":
        """Lead through the protocol, and return the folder of its grasps.

        Raises:
            TrainingError: it was stopped.
            SourceError: no hand answers, the source ended, or the hand did not open.
            OutputError: the folder has something else, or a recording cannot be written.
        """
        from holdfast.cli.teach.guide import Guide, confirm_safety, open_taught
        from holdfast.live.camera import CameraRecorder
        from holdfast.live.teaching.folder import TeachingFolder
        from holdfast.live.teaching.protocol import GuidedProtocol, Stage
        from holdfast.live.teaching.steps import STEPS

        path = self.folder or out.with_name(f"{out.stem}-grasps")
        is_filmed = bool(self.camera) or is_twin(source)
        # Without a camera, what slides teaches nothing.
        steps = STEPS if is_filmed else tuple(step for step in STEPS if not step.in_view)
        folder = TeachingFolder(path, resume=self.resume)
        if GuidedProtocol({}, folder.results, steps).stage is Stage.OVER:
            return folder  # only the fit was stopped
        camera = self.camera
        if camera and is_twin(source):
            print_message(f"twin: has a camera of its own, used in place of --camera {camera}")
            camera = None
        elif camera:  # a wrong one is reported before somebody stands at the robot
            CameraRecorder(camera, path / "camera.mp4").close()
        with handle_stop_signals() as stop, ExitStack() as stack:
            keys = stack.enter_context(MarkerKeys(TEACH_KEYS))
            screen = TeachScreen(is_read=not self.unattended)
            stop.graceful = True
            promise = WITH_CAMERA if is_filmed else WITHOUT_CAMERA
            if not (self.unattended or confirm_safety(promise, stop, keys, screen)):
                raise TrainingError("not confirmed: nothing was recorded")
            stop.graceful = False  # Ctrl-C ends the wait for the source
            with (
                message_if_slow(awaited(source)),
                open_taught(source, 0.0 if self.unattended else speed) as opened,
            ):
                stop.graceful = True
                print_message(f"{opened.name}: recordings go to {path}")
                guide = Guide(
                    opened, model, folder, steps, camera=camera, unattended=self.unattended
                )
                guide.run(stop, keys, screen)
        return folder


WITHOUT_PROTOCOL = GuideOptions()
"""Options of `--from`, which records nothing."""


def is_twin(source: str) -> bool:
    """Return whether a source is the twin."""
    return source.startswith("twin:")


def calibrated(model: "Model", folder: "TeachingFolder") -> "tuple[Model, bool]":
    """Return the model with the own handling of what was carried; whether it has it.

    A model that cannot be calibrated, or is not better for it, stays as it is.
    """
    from holdfast.io import load_recording
    from holdfast.training.calibration import calibrate_with_report

    names = [x.recording for x in folder.kept if x.name == "carry"]
    recordings = [load_recording(folder.path / f"{name}.mcap", labels=False) for name in names]
    try:
        result = calibrate_with_report(model, recordings)
        result.check()
    except HoldfastError as refusal:
        print_message(f"not calibrated: {refusal}")
        return model, False
    # Nothing is pushed while it is carried: a threshold of slips from that would alarm too often.
    silent = result.model.changed(
        lambda part: part.without_thresholds("slip").without_thresholds("slip_changes")
    )
    return silent, True
