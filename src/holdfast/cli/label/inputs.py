"""Inputs of `holdfast label` and its commands: recordings, and options that they share."""

import getpass
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.cli.options import (
    RARE,
    FittingTareOption,
    ForceOption,
    FpsOption,
)
from holdfast.errors import require_extras

if TYPE_CHECKING:
    from holdfast.labelling.rules.poses import Poses
    from holdfast.recordings import Label, Recording


PathsArgument = Annotated[list[Path], typer.Argument(help="Recordings, or folders of them.")]
AuthorOption = Annotated[
    str | None,
    typer.Option("--author", help="Author of the labels.", show_default="login name, or rule:RULE"),
]
PosesOption = Annotated[
    Path | None,
    typer.Option("--poses", help="Poses for the rule tracking: a CSV file or a ROS bag."),
]
TracksOption = Annotated[
    list[str] | None,
    typer.Option(
        "--track",
        metavar="BODY=NAME",
        help="Topic or frame of a body in the bag, or number of its sticker; BODY is object or "
        "a finger.",
    ),
]


@dataclass(frozen=True)
class RuleOptions:
    """Group of options: how a rule labels."""

    tare: FittingTareOption = None
    poses: PosesOption = None
    tracks: TracksOption = None
    parameters: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Parameter of the rule; may be repeated."),
        RARE,
    ] = None
    video: Annotated[
        Path | None,
        typer.Option(
            help="Video of stickers for the rule tracking.",
            show_default="NAME.mp4 beside the recording",
        ),
    ] = None
    fps: FpsOption = None
    motion: Annotated[
        Path | None,
        typer.Option(
            help="Motion of the object for the rule tracking, measured by another instrument: a "
            "CSV file of positions or quaternions."
        ),
        RARE,
    ] = None
    column: Annotated[
        str | None,
        typer.Option(help="Column of --motion that counts: of an encoder or a stage, in metres."),
        RARE,
    ] = None

    @cached_property
    def tracking(self) -> "Poses | None":
        """Return the poses of the file; None without a file.

        Raises:
            ValueError: tracks are given without a bag, or a bag without the track of the object.
            RecordingError: the file cannot be read.
        """
        from holdfast.labelling.rules.poses import OBJECT, poses_from_bag, poses_from_csv

        if self.poses is None or self.poses.suffix == ".csv":
            if self.tracks and (self.poses is not None or self.video is None):
                raise ValueError(
                    "--track names topics or frames of a bag: give --poses BAG (or stickers of a "
                    "video: `holdfast label auto tracking` has --video FILE)"
                )
            return None if self.poses is None else poses_from_csv(self.poses)
        names = dict(_pair(text, "--track BODY=NAME") for text in self.tracks or ())
        # Slip is motion of a finger against the object: without the object there is none.
        if OBJECT not in names:
            raise ValueError(
                f"{self.poses} is not a .csv file, so it is read as a bag: --track {OBJECT}=NAME "
                "expected, a topic or frame"
            )
        return poses_from_bag(self.poses, names.pop(OBJECT), names)

    def arguments(self, rule: str) -> dict[str, Any]:
        """Return the arguments of a rule.

        Raises:
            ValueError: a parameter is not NAME=VALUE, or the rule does not use poses.
        """
        arguments: dict[str, Any] = {
            "tare": self.tare,
        }
        for text in self.parameters or ():
            name, value = _pair(text, "--set NAME=VALUE")
            arguments[name] = value
            with suppress(ValueError):  # a word, as of a choice
                arguments[name] = float(value)
        if self.tracking is not None:
            if rule != "tracking":
                raise ValueError(f"--poses are for the rule tracking; rule {rule!r} given")
            if self.video is not None:
                raise ValueError("--poses and --video given; only one of them expected")
            arguments["tracking"] = self.tracking
        if self.video is not None:
            if rule != "tracking":
                raise ValueError(f"--video is for the rule tracking; rule {rule!r} given")
            arguments["video"] = self.video
        if self.motion is not None:
            if rule != "tracking" or self.video or self.poses:
                raise ValueError("--motion is for the rule tracking, without --poses and --video")
            arguments["motion"] = self.motion
            arguments["column"] = self.column
        elif self.column is not None:
            raise ValueError("--column is one of --motion FILE.csv, which is missing")
        return arguments

    def propose(
        self, rule: str, recording: "Recording", path: Path | None = None
    ) -> dict[str, tuple["Label", ...]]:
        """Return the labels that a rule proposes for a recording.

        Args:
            rule: name of the rule.
            recording: the recording.
            path: of the recording. The rule tracking reads the video beside it, if there is one.

        Raises:
            RecordingError: the recording lacks the data that the rule needs.
            ValueError: an unknown rule or parameter.
        """
        from holdfast.labelling.rules import propose

        arguments = self.arguments(rule)
        beside = None if path is None else path.with_suffix(".mp4")
        # A default: the video of the option, which `arguments` has, is not replaced.
        file = self.poses or self.motion
        if rule == "tracking" and not file and beside is not None and beside.exists():
            arguments.setdefault("video", beside)
        if "video" in arguments:
            require_extras("video")
            pairs = [_pair(text, "--track BODY=NUMBER") for text in self.tracks or ()]
            if wrong := [name for _, name in pairs if not name.isdecimal()]:
                raise ValueError(f"--track BODY=NUMBER expected with a video, {wrong[0]!r} given")
            arguments["bodies"] = {body: int(number) for body, number in pairs} or None
            arguments["fps"] = self.fps
        elif self.fps is not None:
            raise ValueError("--fps is for a video: give --video FILE")
        return propose(rule, recording, **arguments)


@dataclass(frozen=True)
class SaveOptions:
    """Group of options: how labels of a rule or of other programs are saved."""

    dry_run: Annotated[bool, typer.Option("--dry-run", help="Write no labels; only show them.")] = (
        False
    )
    force: ForceOption = False


def login_name() -> str:
    """Return the name of the user; empty if it is not known."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # there is no login, as in a container
        return ""


def current_time() -> str:
    """Return the time in ISO 8601 format."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def _pair(text: str, expected: str) -> tuple[str, str]:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (sign and name and value):
        raise ValueError(f"{expected} expected, {text!r} given")
    return name, value
