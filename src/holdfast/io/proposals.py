"""Proposal of `holdfast import`: the options that state the layout of a file."""

import re
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
import numpy as np

from holdfast.errors import RecordingError

MAX_FOUND = 14
"""Maximum number of lines about what was found."""
MAX_SHORT = 1e6
"""Numbers above, such as times of a clock, are shown with all digits."""
MAX_WIDTH = 100
"""Maximum length of a line [characters]."""


class LayoutChoice(msgspec.Struct, frozen=True):
    """A choice that a layout makes.

    Attributes:
        what: field of the layout.
        value: what it is, in words of the options.
        reason: what speaks for it.
        is_said: whether the file or the user says it; others need the consent of the user.
    """

    what: str
    value: str
    reason: str
    is_said: bool = False


class Proposal(msgspec.Struct, frozen=True):
    """Options that import a file.

    Attributes:
        path: of the file.
        found: lines about its columns or arrays.
        choices: of the layout.
        sensors: option, path of an array or module, and the key of the sensor as it was given, or
            the name of one that was not.
        columns: text of `--columns`.
        axes: text of `--axes`.
        unit: text of `--unit`.
        findings: what is wrong without these options; `accept` does not take them.
    """

    path: str
    found: list[str]
    choices: list[LayoutChoice]
    sensors: list[tuple[str, str, str]]
    columns: str = ""
    axes: str = ""
    unit: str = ""
    findings: list[str] = []

    def options(self, names: Mapping[str, str]) -> list[str]:
        """Return the words of a command line.

        Args:
            names: text of each sensor that was given, by its key.
        """
        words = []
        for option, path, key in self.sensors:
            name = names.get(key, key)
            words += [option, f"{path}={name}" if path else name]
        words += ["--columns", self.columns] if self.columns else []
        words += [f"--axes={self.axes}"] if self.axes else []
        return words + (["--unit", self.unit] if self.unit else [])

    def text(self, commands: Sequence[Sequence[str]]) -> str:
        """Return the text of the proposal.

        Args:
            commands: words of the commands that import with its options.
        """
        width = max(len(choice.what) for choice in self.choices)
        left = min(max(len(choice.value) for choice in self.choices), 40)
        is_said = all(choice.is_said for choice in self.choices)
        problem = "cannot be imported so" if is_said else "does not say its layout"
        accept = "" if self.findings else "; --accept takes it as it is"
        lines = [
            f"{self.path} {problem}; it has",
            *(f"  {line}" for line in self.found),
            *textwrap.wrap("; ".join(self.findings), MAX_WIDTH, subsequent_indent="  "),
            "what it may be, and what speaks for it:",
            *(f"  {c.what:<{width}}  {c.value:<{left}}  {c.reason}" for c in self.choices),
            f"paste this if it is right (docs/importing.md has the options{accept}):",
        ]
        is_long = [len(line) > MAX_WIDTH for line in lines]
        lines = [
            f"{line[:97]}..." if long else line for line, long in zip(lines, is_long, strict=True)
        ]
        return "\n".join([*lines, *(f"  {line}" for line in _wrapped(commands))])


class ProposalError(RecordingError):
    """A file does not say its layout: the text has the options that say it.

    Args:
        proposal: the options.

    Attributes:
        inputs: paths that the caller gave in place of recordings.
    """

    def __init__(self, proposal: Proposal) -> None:
        super().__init__(proposal)
        self.proposal = proposal
        self.inputs: tuple[str, ...] = ()

    def __str__(self) -> str:
        words = ["holdfast", "import", self.proposal.path, "OUT", *self.proposal.options({})]
        return self.proposal.text([words])


def _wrapped(commands: Sequence[Sequence[str]]) -> list[str]:
    """Return commands as lines, which a shell joins to one."""
    lines = [""]
    for number, words in enumerate(commands):
        quoted: list[str] = []
        for before, word in zip(("", *words), words, strict=False):
            is_value = before.startswith("--") and "=" not in before and not word.startswith("--")
            # An option and its value stay in one line.
            text = f"{quoted.pop()} {shlex.quote(word)}" if is_value else shlex.quote(word)
            quoted.append(text)
        if number:
            quoted[0] = f"&& {quoted[0]}"
        for word in quoted:
            if lines[-1] and len(lines[-1]) + len(word) > MAX_WIDTH - 6:
                lines[-1] += " \\"
                lines.append(f"  {word}")
            else:
                lines[-1] += f" {word}" if lines[-1] else word
    return lines


def found_lines(arrays: Mapping[str, Any]) -> list[str]:
    """Return lines about arrays: names, shapes, first values and ranges; alike names are one.

    Args:
        arrays: `StoredArray` by name.
    """
    alike: dict[tuple[str, tuple[int, ...]], list[str]] = {}
    for name, array in arrays.items():
        kind = re.sub(r"\d+|(?<![a-z])[xyz](?![a-z])", "#", name, flags=re.IGNORECASE)
        alike.setdefault((kind, array.shape), []).append(name)
    lines = []
    for (_, shape), names in alike.items():
        title = names[0] if len(names) == 1 else f"{names[0]} ... {names[-1]} ({len(names)})"
        size = "" if len(shape) == 1 else f"  {shape}"
        lines.append(f"{title[-60:]}{size}  {_values_text([arrays[name] for name in names])}")
    more = len(lines) - MAX_FOUND
    return lines if more <= 0 else [*lines[:MAX_FOUND], f"and {more} more"]


def _values_text(arrays: Sequence[Any]) -> str:
    """Return the first values of arrays of one kind, and their range."""
    try:
        parts = [np.ravel(array.read()) for array in arrays]
    except RecordingError:  # a cell is no number, or a link is refused
        return ""
    if parts[0].dtype.kind not in "biuf":
        return ", ".join(map(str, parts[0][:2]))
    finite = np.concatenate([part[np.isfinite(part)] for part in parts])
    ends = (finite.min(), finite.max()) if len(finite) else (np.nan, np.nan)
    # Times of a clock are shown with all digits.
    texts = [f"{v:.{6 if abs(v) < MAX_SHORT else 13}g}" for v in (*parts[0][:3].tolist(), *ends)]
    return f"{', '.join(texts[:-2])}, ...; {' to '.join(texts[-2:])}"
