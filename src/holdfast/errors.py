"""What can go wrong, one family for each thing that a caller would do about it.

    HoldfastError
    ├── RecordingError   a recording or dataset cannot be read, or contradicts itself
    ├── ModelError       a model file is refused, or does not fit the data it is given
    ├── TrainingError    the data cannot train or test a classifier (one class, one group)
    ├── StreamError      samples came that a detector cannot take
    ├── SourceError      a source cannot be reached, says nothing, or is another than expected
    ├── EngineError      the processes or the cluster that do the work fail, not the work
    ├── OutputError      an output exists already or cannot be written
    └── MissingExtra     a part needs a package that is not installed

Wrong arguments are ``ValueError`` or ``TypeError``, as everywhere in Python. Every message
says what was given, what was expected and what exists. The command line prints it as one
line and exits with 2.
"""


class HoldfastError(Exception):
    """Any failure that holdfast foresees; its text is one line for a person."""


class RecordingError(HoldfastError):
    """A recording cannot be read, is damaged, or contradicts itself: use another file."""


class ModelError(HoldfastError):
    """A model is refused, or does not fit the data: use another model or sensor."""


class TrainingError(HoldfastError):
    """The data cannot train or test a classifier: bring more or other recordings."""


class StreamError(HoldfastError):
    """Samples came that a detector cannot take: mend the source, then reset."""


class SourceError(HoldfastError):
    """A source cannot be reached, says nothing or not what is expected: mend it, try again."""


class EngineError(HoldfastError):
    """The processes or the cluster that do the work fail: mend them, then start again."""


class OutputError(HoldfastError):
    """An output exists already or cannot be written: nothing was left half-written."""


class MissingExtra(HoldfastError):  # noqa: N818 (it names what to install, not what broke)
    """A part needs an optional package: install the extra that the text names."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(package, extra)

    def __str__(self) -> str:
        package, extra = self.args
        return (
            f"this needs the package {package}, which is not installed: "
            f'pip install "holdfast[{extra}]"'
        )


def listen_error(host: str, port: int, cause: Exception) -> OutputError:
    """Return the error of a server whose address is in use or cannot be bound."""
    text = getattr(cause, "strerror", None) or str(cause)
    reason = "it is in use" if "in use" in text else text
    return OutputError(f"cannot listen at {host}:{port} ({reason}); --port 0 finds a free port")
