"""What the modes of `holdfast label` have in common."""

import getpass
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holdfast.labelling.rules.poses import Poses
    from holdfast.labelling.server.store import Labels
    from holdfast.recordings import Label, Recording

STATES = ("stable", "unstable", "no_contact")
MOST_DOUBTFUL = 20
"""Doubtful stretches that are shown to a person; JSON has all."""


@dataclass(frozen=True)
class Asking:
    """What a rule is given.

    Attributes:
        tare: how the baseline is found.
        poses: path of a CSV file of poses, or of a bag, for `tracking`.
        tracks: topics or frames of a bag, as BODY=NAME.
        parameters: others, as NAME=VALUE.
    """

    tare: str = "0.5"
    poses: Path | None = None
    tracks: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()

    @cached_property
    def tracking(self) -> "Poses | None":
        """The poses that are given; None where none are.

        Raises:
            ValueError: tracks without a bag, or a bag without the object's.
            RecordingError: the file cannot be read.
            MissingExtra: it is a bag, and rosbags is not installed.
        """
        from holdfast.labelling.rules.poses import OBJECT, poses_from_bag, poses_from_csv

        if self.poses is None or self.poses.suffix == ".csv":
            if self.tracks:
                raise ValueError("--track names topics or frames of a bag: give --poses BAG")
            return None if self.poses is None else poses_from_csv(self.poses)
        names = dict(_pair(text, "--track BODY=NAME") for text in self.tracks)
        if OBJECT not in names:
            raise ValueError(
                f"{self.poses} is no .csv, so taken for a bag: --track {OBJECT}=NAME expected, "
                "a topic or frame"
            )
        return poses_from_bag(self.poses, names.pop(OBJECT), names)

    def arguments(self, rule: str) -> dict[str, Any]:
        """The arguments of a rule.

        Raises:
            ValueError: a parameter is not NAME=VALUE, or poses are given to a rule without.
        """
        given: dict[str, Any] = {"tare": self.tare, **dict(map(_parameter, self.parameters))}
        if self.tracking is not None:
            if rule != "tracking":
                raise ValueError(f"--poses are for the rule tracking; rule {rule!r} given")
            given["tracking"] = self.tracking
        return given

    def propose(self, rule: str, recording: "Recording") -> dict[str, tuple["Label", ...]]:
        """What a rule proposes for a recording.

        Raises:
            RecordingError: the recording has not what the rule rests on.
            ValueError: an unknown rule or parameter.
        """
        from holdfast.labelling.rules import propose

        return propose(rule, recording, **self.arguments(rule))


@dataclass(frozen=True)
class Serving:
    """Where a page is served, and to whom."""

    host: str
    port: int
    token: str | None
    browser: bool
    as_json: bool


def recordings_at(paths: Sequence[Path]) -> list[Path]:
    """The files of recordings at these paths, each once; a folder gives all that lie in it.

    Raises:
        RecordingError: there is no such file or folder, or no recording in it.
    """
    from holdfast.errors import RecordingError
    from holdfast.io import load_dataset
    from holdfast.io.recording_files import SUFFIXES

    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found.extend(load_dataset(path).paths)
        elif not path.exists():
            raise RecordingError(f"{path} does not exist; a recording or a folder expected")
        elif path.suffix not in SUFFIXES:
            raise RecordingError(
                f"{path} is no recording: {' or '.join(SUFFIXES)} expected "
                "(`holdfast import` brings other formats in)"
            )
        else:
            found.append(path)
    return list(dict.fromkeys(found))


def check_rule(rule: str) -> None:
    """Does nothing where there is such a rule.

    Raises:
        ValueError: there is none.
    """
    from holdfast.labelling.rules import RULES

    if rule not in RULES:
        raise ValueError(f"unknown rule {rule!r}; there are {', '.join(RULES)}")


def login_name() -> str:
    """Who sits at this machine, as far as it knows."""
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # nobody is logged in, as in a container
        return ""


def now() -> str:
    """The time, as ISO 8601 text."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def seconds_of(labels: "Labels") -> dict[str, float]:
    """How long each state lasts, over all fingers [s]."""
    total = dict.fromkeys(STATES, 0.0)
    for own in labels.values():
        for label in own:
            total[label.state.value.lower()] += label.end - label.start
    return {state: round(value, 6) for state, value in total.items()}


def doubtful_of(labels: "Labels") -> list[dict[str, Any]]:
    """The labels of little confidence, the most doubtful first, as plain JSON values."""
    from holdfast.labelling.review.spans import doubtful

    return [
        {
            "finger": finger,
            "start": label.start,
            "end": label.end,
            "state": label.state.value.lower(),
            "confidence": label.confidence,
            "evidence": label.evidence,
        }
        for finger, label in doubtful(labels)
    ]


def labels_json(labels: "Labels") -> Mapping[str, Any]:
    """Labels by finger as plain JSON values."""
    from msgspec import to_builtins

    from holdfast.labelling.server.api import labels_data

    found: Mapping[str, Any] = to_builtins(labels_data(labels))
    return found


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
