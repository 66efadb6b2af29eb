"""Exceptions of the package: one class for each different reaction of a caller.

    HoldfastError
    ├── RecordingError   a recording or dataset cannot be read, or contradicts itself
    ├── ModelError       a model file is invalid, or does not fit the data
    ├── TrainingError    the data cannot train or test a classifier (one class, one group)
    ├── StreamError      a detector cannot process the samples
    ├── SourceError      a source cannot be reached, sends nothing, or is not the expected one
    ├── HandError        a hand cannot be commanded: it does not answer, or has another controller
    ├── EngineError      the processes or the cluster that make parallel calls fail
    ├── OutputError      an output exists already or cannot be written
    └── MissingExtra     an optional package is not installed

Wrong arguments raise ``ValueError`` or ``TypeError``, as everywhere in Python. Every message
says what was given, what was expected and what exists. The command line prints it as one
line and exits with 2.
"""


class HoldfastError(Exception):
    """Base class of all exceptions of holdfast; the text is one line."""


class RecordingError(HoldfastError):
    """A recording cannot be read, is damaged, or is inconsistent: use another file."""


class ModelError(HoldfastError):
    """A model is invalid, or does not fit the data: use another model or sensor."""


class TrainingError(HoldfastError):
    """The data cannot train or test a classifier: use more or other recordings."""


class StreamError(HoldfastError):
    """A detector cannot process the samples: repair the source, then reset the detector."""


class SourceError(HoldfastError):
    """A source cannot be reached, or sends nothing or other data: repair it, then try again."""


class HandError(HoldfastError):
    """A hand cannot be commanded: see that it is left in a safe state, then repair it."""


class EngineError(HoldfastError):
    """The processes or the cluster of parallel calls fail: repair them, then start again."""


class OutputError(HoldfastError):
    """An output exists already or cannot be written; no incomplete file is left."""


class MissingExtra(HoldfastError):  # noqa: N818 (it names what to install, not what broke)
    """An optional package is not installed: install the extra that the text names."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(package, extra)

    def __str__(self) -> str:
        package, extra = self.args
        return f"this needs the package {package}, which is not installed: {install_command(extra)}"


def install_command(extra: str) -> str:
    """Return the command that adds an extra to this installation.

    From a clone it installs the clone, and from a wheel the wheel, not a package of that name.
    """
    import json
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        found = distribution("holdfast")
    except PackageNotFoundError:
        return f'pip install "holdfast[{extra}]"'
    with_uv = (found.read_text("INSTALLER") or "").strip() == "uv"
    origin = json.loads(found.read_text("direct_url.json") or "{}")
    if origin.get("dir_info", {}).get("editable"):
        folder = origin["url"].removeprefix("file://")
        pip = f'pip install -e "{folder}[{extra}]"'
        return f"uv sync --inexact --extra {extra}" if with_uv else pip
    package = f"holdfast[{extra}] @ {origin['url']}" if origin else f"holdfast[{extra}]"
    return f'{"uv " * with_uv}pip install "{package}"'


def listen_error(host: str, port: int, cause: Exception) -> OutputError:
    """Return the error of a server whose address is in use or cannot be bound."""
    text = getattr(cause, "strerror", None) or str(cause)
    reason = "it is in use" if "in use" in text else text
    return OutputError(f"cannot listen at {host}:{port} ({reason}); --port 0 finds a free port")
