"""Which verbs there are, and what becomes of their failures: one line, never a traceback.

A verb is one function in the file of its name (`train.py`: `train`; `import_.py`: `import_`),
loaded only when it is asked for. To add one, write the file and add its line to `VERBS`.
"""

import inspect
import keyword
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module

import typer
from typer.main import get_command

from holdfast.cli.terminal.console import complain
from holdfast.errors import HoldfastError

VERBS = {
    "demo": "Does the main job in one go, on data of its own.",
    "simulate": "Makes recordings of grasps by the physical twin.",
    "record": "Records a source, and loses at most half a second whatever happens.",
    "import": "Brings in other people's data, whatever its format.",
    "info": "Shows what is in a recording, or in a folder of them.",
    "label": "Labels recordings on a page, by a rule, or checks labels that are there.",
    "train": "Trains a model from labelled recordings.",
    "evaluate": "Measures a model on labelled recordings.",
    "detect": "Tells the contact state of every finger at every sample.",
    "serve": "Shows what a model says of a source on a page, and tells other programs.",
    "play": "Acts as a XELA server for a recording or the twin.",
    "study": "Repeats the paper, and asks what it did not.",
    "bench": "Measures speed, against peers and against the machine.",
    "sensors": "Shows the sensors and hands that are known.",
    "doctor": "Shows what is installed and what works.",
}
"""Every verb, in the order of the help, with the first line of its docstring."""

BAD_INPUT = 2
INTERRUPTED = 130

_UsageError = typer.BadParameter.__mro__[2]
"""The base of the errors in usage: click's class, or that of typer's own copy of click."""

_FORESEEN = (HoldfastError, ValueError, TypeError, OSError, MemoryError)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one verb and returns the exit code of the process.

    Args:
        arguments: words after `holdfast`; those of the process where not given.

    Returns:
        0 where all went well, 2 after bad input, 130 after an interrupt, 1 after a bug.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        code = _run(words)
        sys.stdout.flush()
    except BrokenPipeError:
        return _reader_left()
    except BaseException as failure:
        return _report(failure)
    return code


def _run(words: list[str]) -> int:
    command = get_command(_app(words))
    try:
        with command.make_context("holdfast", words) as context:
            command.invoke(context)
    except typer.Exit as done:
        return done.exit_code
    return 0


def _app(words: list[str]) -> typer.Typer:
    """All verbs by name; only those among `words` are loaded."""
    app = typer.Typer(
        help="Tells whether the contacts of a robot hand are stable, from its tactile sensors.",
        epilog="Start with: holdfast sensors",
        rich_markup_mode=None,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    for name, summary in VERBS.items():
        if name in words:
            verb = load_verb(name)
            app.command(name, help=_help(verb))(verb)
        else:
            app.command(name, help=summary)(_root)
    return app


def load_verb(name: str) -> Callable[..., None]:
    """The function of that verb."""
    home = f"{name}_" if keyword.iskeyword(name) else name
    verb: Callable[..., None] = getattr(import_module(f"holdfast.cli.{home}"), home)
    return verb


def _root() -> None:
    """Stands in for a verb that is not loaded."""


def _help(verb: Callable[..., None]) -> str:
    r"""The docstring, with `\b` where click must not fill the lines of an example."""
    return (inspect.getdoc(verb) or "").replace("\nExample", "\n\b\nExample")


def _reader_left() -> int:
    """Whoever read our output has had enough (`| head`): nothing to complain about."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _report(failure: BaseException) -> int:
    if os.environ.get("HOLDFAST_DEBUG"):
        traceback.print_exception(failure)
    match failure:
        case SystemExit() | GeneratorExit():
            raise failure
        case KeyboardInterrupt() | typer.Abort():
            complain("interrupted")
            return INTERRUPTED
        case _ if isinstance(failure, _UsageError):
            complain(_usage(failure))
            return BAD_INPUT
        case _ if isinstance(failure, _FORESEEN):
            complain(_text(failure))
            return BAD_INPUT
    complain(f"internal error ({type(failure).__name__}: {failure}): please report it")
    return 1


def _usage(failure: BaseException) -> str:
    text: str = failure.format_message()  # type: ignore[attr-defined]
    path = getattr(getattr(failure, "ctx", None), "command_path", "holdfast")
    return f"{text.rstrip('.')} (see {path} --help)"


def _text(failure: BaseException) -> str:
    if isinstance(failure, OSError) and failure.filename and failure.strerror:
        return f"{failure.filename}: {failure.strerror}"
    return str(failure) or type(failure).__name__
