"""Formats of other tools for `holdfast export`, and the view of `holdfast serve --rerun`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from holdfast.errors import HoldfastError, is_installed, require_extras

if TYPE_CHECKING:
    from holdfast.io import Dataset
    from holdfast.live.stream_detector import StreamDetector
    from holdfast_interop.rerun.publisher import RerunPublisher


@dataclass(frozen=True)
class LeRobotOptions:
    """Options of LeRobot data sets."""

    fps: Annotated[
        int | None,
        typer.Option(help="Frames per second of a LeRobot data set.", show_default="30"),
    ] = None


@dataclass(frozen=True)
class RerunOptions:
    """Options of files for Rerun."""

    model: Annotated[
        str | None,
        typer.Option(help="Model whose estimates are shown: a file or builtin:NAME."),
    ] = None


@dataclass(frozen=True)
class LiveOptions:
    """Options of the live view."""

    rerun: Annotated[
        bool, typer.Option("--rerun", help="Also send to the Rerun viewer on this machine.")
    ] = False


class LeRobot:
    """LeRobot data sets (v3.0)."""

    OPTIONS = LeRobotOptions()

    @staticmethod
    def export(
        recordings: "Dataset",
        out: Path,
        options: LeRobotOptions,
        *,
        force: bool,
        progress: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        """Write a data set, and return what it has."""
        require_extras("parquet")
        from holdfast_interop.lerobot import exporter as lerobot

        rate = lerobot.DEFAULT_FPS if options.fps is None else options.fps
        totals = lerobot.export(recordings, out, fps=rate, force=force, progress=progress)
        return {**totals, "fps": rate}


class Rerun:
    """Files for Rerun, and its live view: states, forces, taxels with arrows, and events."""

    OPTIONS = RerunOptions()

    @staticmethod
    def export(
        recordings: "Dataset",
        out: Path,
        options: RerunOptions,
        *,
        force: bool,
        progress: Any,  # noqa: ANN401
    ) -> dict[str, Any]:
        """Write the files, and return how many."""
        require_rerun()
        from holdfast.detection import Model
        from holdfast_interop.rerun import exporter

        model = None if options.model is None else Model.load(options.model)
        return exporter.export(recordings, out, model=model, force=force, progress=progress)


class LiveRerun:
    """The live view of Rerun."""

    OPTIONS = LiveOptions()

    @staticmethod
    def publisher(stream: "StreamDetector", options: LiveOptions) -> "RerunPublisher":
        """Return the publisher of a stream; it is not open yet."""
        require_rerun()
        from holdfast_interop.rerun.publisher import RerunPublisher

        return RerunPublisher(stream)


def require_rerun() -> None:
    """Check that Rerun is installed.

    Raises:
        HoldfastError: it is not; it is in no default, as it needs 700 MB.
    """
    if not is_installed("rerun"):
        raise HoldfastError(
            "this needs the package rerun, which is not installed: pip install 'rerun-sdk>=0.41'"
        )
