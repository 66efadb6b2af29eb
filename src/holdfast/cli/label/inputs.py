"""Inputs of the modes of `holdfast label`: recordings, options of rules, options of the page."""

import getpass
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holdfast.labelling.rules.poses import Poses
    from holdfast.recordings import Label, Recording


@dataclass(frozen=True)
class RuleOptions:
    """Options of a rule.

    Attributes:
        tare: tare of the recordings; by default the one that fits the start of each.
        poses: path of a CSV file of poses, or of a bag, for the rule `tracking`.
        tracks: topics or frames of a bag, as BODY=NAME.
        parameters: other parameters, as NAME=VALUE.
    """

    tare: str | None = None
    poses: Path | None = None
    tracks: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()

    @cached_property
    def tracking(self) -> "Poses | None":
        """Return the poses of the file; None without a file.

        Raises:
            ValueError: tracks are given without a bag, or a bag without the track of the object.
            RecordingError: the file cannot be read.
            MissingExtra: the file is a bag, and rosbags is not installed.
        """
        from holdfast.labelling.rules.poses import OBJECT, poses_from_bag, poses_from_csv

        if self.poses is None or self.poses.suffix == ".csv":
            if self.tracks:
                raise ValueError("--track names topics or frames of a bag: give --poses BAG")
            return None if self.poses is None else poses_from_csv(self.poses)
        names = dict(_pair(text, "--track BODY=NAME") for text in self.tracks)
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
        arguments: dict[str, Any] = {"tare": self.tare, **dict(map(_parameter, self.parameters))}
        if self.tracking is not None:
            if rule != "tracking":
                raise ValueError(f"--poses are for the rule tracking; rule {rule!r} given")
            arguments["tracking"] = self.tracking
        return arguments

    def propose(self, rule: str, recording: "Recording") -> dict[str, tuple["Label", ...]]:
        """Return the labels that a rule proposes for a recording.

        Raises:
            RecordingError: the recording lacks the data that the rule needs.
            ValueError: an unknown rule or parameter.
        """
        from holdfast.labelling.rules import propose

        return propose(rule, recording, **self.arguments(rule))


@dataclass(frozen=True)
class PageOptions:
    """Options of the labelling page.

    Attributes:
        host: address to listen on.
        port: port to listen on; 0 selects a free one.
        token: secret that clients must send; None without one.
        browser: open the page in a browser.
        as_json: print the address as JSON.
    """

    host: str
    port: int
    token: str | None
    browser: bool
    as_json: bool


def recordings_at(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings at these paths, without duplicates; of a folder all recordings.

    Raises:
        RecordingError: a path does not exist or is no recording, or a folder has none.
    """
    from holdfast.errors import RecordingError
    from holdfast.io import load_dataset
    from holdfast.io.recording_files import SUFFIXES

    files: list[Path] = []
    for path in paths:
        if path.is_dir():
            files.extend(load_dataset(path).paths)
        elif not path.exists():
            raise RecordingError(f"{path} does not exist; a recording or a folder expected")
        elif path.suffix not in SUFFIXES:
            raise RecordingError(
                f"{path} is not a recording: {' or '.join(SUFFIXES)} expected "
                "(`holdfast import` reads other formats)"
            )
        else:
            files.append(path)
    return list(dict.fromkeys(files))


def check_rule(rule: str) -> None:
    """Check that a rule exists.

    Raises:
        ValueError: the rule is unknown.
    """
    from holdfast.labelling.rules import RULES

    if rule not in RULES:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")


def login_name() -> str:
    """Return the name of the user; empty if it is not known."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # there is no login, as in a container
        return ""


def current_time() -> str:
    """Return the time in ISO 8601 format."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def _parameter(text: str) -> tuple[str, Any]:
    name, value = _pair(text, "--set NAME=VALUE")
    try:
        return name, float(value)
    except ValueError:
        return name, value


def _pair(text: str, expected: str) -> tuple[str, str]:
    name, sign, value = (part.strip() for part in text.partition("="))
    if not (sign and name and value):
        raise ValueError(f"{expected} expected, {text!r} given")
    return name, value
