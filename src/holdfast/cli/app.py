"""Run a verb of the command line, and report its failure in one line.

A verb is a function in the file of its name (`tune.py`: `tune`; `import_.py`: `import_`), or in
`verb.py` of the folder of its name, if it has more files. It is imported only when it is used. To
add a verb, write the file and add a line to `VERBS`; the commands of a verb are in `SUB_VERBS`.
"""

import inspect
import keyword
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, get_args

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from holdfast.cli.extensions import PluginOptions
from holdfast.cli.options import RARE
from holdfast.cli.terminal.console import break_silence, print_error, print_line, print_message
from holdfast.errors import (
    DISTRIBUTION,
    PACKAGE_PARTS,
    HoldfastError,
    RecordingError,
    missing_extra,
    missing_part,
)
from holdfast.plugins import PluginGroup
from holdfast.removed import removal

VERB_GROUPS = {
    "Your hand and your recordings": {
        "detect": "Detect the contact state of every finger at every sample.",
        "serve": "Show the estimates of a source on a web page, and publish them.",
        "record": "Record a source; a crash loses at most the last half second.",
        "play": "Send a recording or the twin as a XELA server or an ORCA Touch hand does.",
        "import": "Import recordings from other formats.",
        "info": "Show the content of a recording, a folder of them, or a model.",
        "label": "Label recordings on a page or by a rule.",
        "teach": "Teach a model the slips of your own hand.",
        "train": "Train a model from labelled recordings.",
        "evaluate": "Evaluate a model on labelled recordings.",
        "tune": "Choose the threshold for a wanted rate of false alarms.",
        "calibrate": "Fit a model to a hand by two minutes of handling, without labels.",
    },
    "More": {
        "demo": "Detect on real and simulated recordings; train; replay live.",
        "simulate": "Simulate recordings of grasps with the physical twin.",
        "hold": "Control the grip force of a hand by the estimates of a source.",
        "export": "Export a model as C, or recordings to other tools.",
        "datasets": "List public recordings, download them and import them.",
        "sensors": "List the known sensors and hands, or show one of them.",
        "doctor": "Check the installation and the sources, or the modules of one.",
    },
    "Laboratory": {
        "trial": "Compare laws of grip force on the twin, all on the same trials.",
        "study": "Repeat the experiments of the paper, and run further ones.",
    },
}
"""Verbs in the order of the help, with the first line of their docstrings. Those that are plug-ins
of the packages beside the core are listed as well; verbs of other plug-ins follow them."""
VERBS = {name: summary for verbs in VERB_GROUPS.values() for name, summary in verbs.items()}
"""Verbs with the first line of their docstrings."""
SUB_VERBS = {
    "label auto": "Write the labels that a rule proposes.",
    "label export": "Export labels as CSV.",
    "label import": "Import labels from CSV or other label files.",
    "label markers": "Print stickers by which a camera sees slips.",
}
"""Commands of verbs, with the first line of their docstrings; for `label auto`,
`cli/label/auto.py` has the function `auto`."""

HELP = """Detect whether the contact of each fingertip of a robot hand is stable, slipping or
disturbed, from its tactile sensors, at every sample.

Start with: holdfast demo. It needs no hand and takes half a minute."""
EPILOG = (
    "Each verb has its own help with an example: holdfast VERB --help. With a hand: holdfast "
    "doctor finds it, and holdfast serve builtin:any xela://auto shows it. The tutorials and all "
    "pages: docs/ of the repository."
)
SETTINGS_FILE, SETTINGS_VARIABLE = "holdfast.toml", "HOLDFAST_CONFIG"
SETTINGS_VERBS = ("detect", "serve", "record", "calibrate")
"""Verbs that read this file in 0.3.0; verbs of other packages with a source did so too."""
COMPLETE_VARIABLE = "_HOLDFAST_COMPLETE"
"""Is set by the completion script of a shell."""

OWN_VERBS = tuple(
    verb
    for verb in VERBS
    if all(verb not in parts.get("verbs", ()) for parts in PACKAGE_PARTS.values())
)
"""Verbs of the core; the others of `VERBS` are plug-ins."""
SHOWS_ALL = "holdfast.shows_all"
"""Key of click's `Context.meta`: the help shows the rare options as well."""
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

_UsageError = typer.BadParameter.__mro__[2]
"""Base class of usage errors, from click or from the copy of click within typer."""

# Failures of the input, of files or of memory; any other is an error of holdfast.
_EXPECTED_ERRORS = (HoldfastError, ValueError, TypeError, OSError, MemoryError)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a verb, and return the exit code of the process.

    Args:
        arguments: words after `holdfast`; by default the arguments of the process.

    Returns:
        0 after success, 2 after bad input, 130 after an interrupt, 1 after an internal error.
    """
    if arguments is None:  # this process is ours
        # Processes that joblib starts would import from the working folder first.
        os.environ.setdefault("PYTHONSAFEPATH", "1")
        # joblib replaces a process whose memory grew, and loses no result.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs were given")
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    try:
        # Imports alone take seconds on a slow disk, before a verb can print anything.
        with break_silence(f"{words[0]}: working ..."):
            code = _run(words)
        sys.stdout.flush()  # a closed pipe fails here, inside the `try`
    except BrokenPipeError:
        # The reader has closed the pipe, as `| head` does, which is no error. Python flushes
        # stdout once more at its end, and would report the pipe then.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    # Also SystemExit and KeyboardInterrupt: `_report` has the exit code of each.
    except BaseException as failure:
        return _report(failure, words)
    return code


def _run(words: list[str]) -> int:
    if COMPLETE_VARIABLE in os.environ:
        # The script of the shell has set the typed words in the environment.
        typed = [os.environ.get(name, "") for name in ("COMP_WORDS", "_TYPER_COMPLETE_ARGS")]
        command = get_command(_app(" ".join(typed).split()))
        command.main([], prog_name="holdfast", complete_var=COMPLETE_VARIABLE)
        return 0
    command = get_command(_app(words))
    try:
        with command.make_context("holdfast", words) as context:
            command.invoke(context)
    except typer.Exit as done:
        return done.exit_code
    return 0


def _app(words: list[str]) -> typer.Typer:
    """Create the app with all verbs; import only those among `words`."""
    app = typer.Typer(
        cls=_GroupedVerbs,
        help=HELP,
        epilog=EPILOG,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_root)
    others = {
        name: "A verb of a plug-in."
        # Without a report: a plug-in whose name is taken must not print a line at every verb.
        for name in VERB_PLUGINS.names(report=False)
        if name not in VERBS
    }
    for name, summary in {**VERBS, **others}.items():
        if name in words:
            _add(app, name)
        else:
            # The help needs the name and one line; importing all verbs would make it slow.
            app.command(name, help=summary)(_placeholder)
    for name in SUB_VERBS:
        # A subset: the line that a shell completes begins with `holdfast`.
        if set(name.split()) <= set(words):
            _add(app, name, hidden=True)
    return app


def _add(app: typer.Typer, name: str, *, hidden: bool = False) -> None:
    """Import a verb, and add it with its options and `--help-all`."""
    verb = load_verb(name)
    spread = spread_groups(verb)

    def run(*, help_all: HelpAllOption = False, **values: Any) -> None:  # noqa: ANN401
        spread(**values)

    options_of_run, shared = (inspect.signature(x).parameters for x in (run, spread))
    options = [*shared.values(), options_of_run["help_all"]]
    # Typer reads the options from the signature and the annotations.
    run.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    run.__annotations__ = {option.name: option.annotation for option in options}
    # `\b` keeps click from wrapping the lines of the example.
    text = (inspect.getdoc(verb) or "").replace("\nExample", "\n\b\nExample")
    app.command(name, cls=_Verb, help=text, hidden=hidden)(run)


class _Verb(TyperCommand):
    """A verb whose help lists its commands, and the options that most users need."""

    def format_options(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 (of click)
        """Write a section of commands, then the options; rare ones only for `--help-all`."""
        prefix = f"{self.name} "
        commands = {name: text for name, text in SUB_VERBS.items() if name.startswith(prefix)}
        if commands:
            with formatter.section("Commands"):
                formatter.write_dl([(n.removeprefix(prefix), t) for n, t in commands.items()])
        options = inspect.signature(self.callback or _placeholder, eval_str=True).parameters
        rare = {
            name
            for name, option in options.items()
            if RARE in getattr(option.annotation, "__metadata__", ())
        }
        hidden = () if ctx.meta.get(SHOWS_ALL) else rare or {"help_all"}
        for option in self.params:
            option.hidden = option.name in hidden  # type: ignore[attr-defined]
        super().format_options(ctx, formatter)


def _show_all(context: typer.Context, value: bool) -> None:
    if value:
        context.meta[SHOWS_ALL] = True
        typer.echo(context.get_help())
        raise typer.Exit


# Eager: typer calls it before it reports that an argument is missing.
HelpAllOption = Annotated[
    bool,
    typer.Option(
        "--help-all", help="Show all options and exit.", callback=_show_all, is_eager=True
    ),
]


class _GroupedVerbs(TyperGroup):
    """Verbs that the help lists by group."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 (of click)
        """Take a verb and its command as one name."""
        name = " ".join(args[:2])
        if name not in SUB_VERBS:
            # A path may have the name of a command that was removed.
            is_path = Path(*args[1:2]).exists()
            for removed in (args[0],) if is_path else (name, args[0]):
                if text := removal("verbs", removed, f"the verb {removed}"):
                    raise HoldfastError(text)
        return super().resolve_command(ctx, [name, *args[2:]] if name in SUB_VERBS else args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ANN401 (of click)
        """Write a section for each group, and one for verbs of plug-ins."""
        others = {name: "" for name in self.commands if name not in {**VERBS, **SUB_VERBS}}
        width = max(map(len, (*VERBS, *others)))
        # 6 as in click: three times the spacing of its columns.
        limit = formatter.width - 6 - width
        for title, verbs in {**VERB_GROUPS, "Plug-ins": others}.items():
            rows = [
                # All sections have columns of equal width.
                (name.ljust(width), self.commands[name].get_short_help_str(limit))
                for name in verbs
            ]
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)


def _version(value: bool) -> None:
    if value:
        from importlib.metadata import version

        print_line(f"holdfast {version(DISTRIBUTION)}")
        raise typer.Exit


def _verb_of_plugin(name: str, loaded: Any) -> Callable[..., None]:  # noqa: ANN401
    """Return the function of a verb of another package."""
    if not inspect.isfunction(loaded):
        raise TypeError(f"a function expected for the verb {name}, {loaded!r} given")
    return loaded


VERB_PLUGINS = PluginGroup("verbs", OWN_VERBS, _verb_of_plugin)
"""Verbs of other packages."""


def load_verb(name: str) -> Callable[..., None]:
    """Import the function of a verb.

    Raises:
        HoldfastError: it is a verb of another package, which cannot be used, or is not installed.
    """
    if name not in (*OWN_VERBS, *SUB_VERBS):
        return VERB_PLUGINS.require(name, f"the verb {name}")
    # `import` is a keyword, so its module is import_.py.
    names = [f"{word}_" if keyword.iskeyword(word) else word for word in name.split()]
    module = import_module(".".join(("holdfast.cli", *names)))
    if hasattr(module, "__path__"):  # a folder, which has the verb beside its other files
        module = import_module(f"{module.__name__}.verb")
    verb: Callable[..., None] = getattr(module, names[-1])
    return verb


def spread_groups(verb: Callable[..., None]) -> Callable[..., None]:
    """Return a function with the options of a verb and of its groups, one by one.

    A group is a parameter whose type is a dataclass; the fields are its options. The default of
    the parameter, or else those of the fields, are the defaults of the options. The options of
    plug-ins are a group as well, see `PluginOptions`. An option, or a group, that is annotated
    with `RARE` is shown by `--help-all` only.

    Example:
        >>> from dataclasses import dataclass
        >>> @dataclass
        ... class Range:
        ...     start: float
        ...     end: float = 1.0
        >>> def length(name: str, part: Range) -> None:
        ...     print(name, part.end - part.start)
        >>> spread = spread_groups(length)
        >>> inspect.signature(spread)
        <Signature (*, name: str, start: float, end: float = 1.0)>
        >>> spread(name="grip", start=0.25, end=1.0)
        grip 0.75
    """
    parameters: list[inspect.Parameter] = []
    groups: dict[str, tuple[Callable[[Values], object], list[str]]] = {}
    for name, parameter in inspect.signature(verb, eval_str=True).parameters.items():
        kind = parameter.annotation
        is_rare = RARE in getattr(kind, "__metadata__", ())
        kind = get_args(kind)[0] if is_rare else kind
        if isinstance(kind, type) and (is_dataclass(kind) or issubclass(kind, PluginOptions)):
            options = _options_of(kind, parameter.default)
            groups[name] = _maker_of(kind), [option.name for option in options]
            if is_rare:
                options = [x.replace(annotation=Annotated[x.annotation, RARE]) for x in options]
            parameters += options
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))

    def run(**values: Any) -> None:  # noqa: ANN401
        # The values of a group's options become one value, that of the group.
        for name, (make, options) in groups.items():
            values[name] = make({option: values.pop(option) for option in options})
        verb(**values)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {option.name: option.annotation for option in parameters}
    return run


Values = dict[str, Any]
"""Values of options, by name."""


def _options_of(group: type, default: object = inspect.Parameter.empty) -> list[inspect.Parameter]:
    """Return the options of a group as parameters; options of plug-ins follow each other.

    Plug-ins of a group that have an option of the same name share it.
    """
    if issubclass(group, PluginOptions):
        shared: dict[str, inspect.Parameter] = {}
        for plugin in group.plugins().values():
            for option in _options_of(type(plugin.OPTIONS), plugin.OPTIONS):
                shared.setdefault(option.name, option)
        return list(shared.values())
    return [
        option.replace(
            kind=inspect.Parameter.KEYWORD_ONLY,
            default=option.default if default is option.empty else getattr(default, name),
        )
        for name, option in inspect.signature(group, eval_str=True).parameters.items()
    ]


def _maker_of(group: type) -> Callable[[Values], object]:
    """Return the function that makes the value of a group from the values of its options."""
    if not issubclass(group, PluginOptions):
        return lambda values: group(**values)
    kinds = {name: type(plugin.OPTIONS) for name, plugin in group.plugins().items()}
    return lambda values: group(
        {
            name: kind(**{option.name: values[option.name] for option in _options_of(kind)})
            for name, kind in kinds.items()
        }
    )


def _root(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version.", callback=_version, is_eager=True),
    ] = False,
) -> None:
    """Print that the settings of the hand are not read any more, if there are any."""
    has_settings = Path(SETTINGS_FILE).is_file() or SETTINGS_VARIABLE in os.environ
    if has_settings and _read_settings(context.invoked_subcommand or ""):
        what = f"the use of {SETTINGS_FILE} and {SETTINGS_VARIABLE}"
        print_message(removal("files", SETTINGS_FILE, what))


def _read_settings(verb: str) -> bool:
    """Return whether a verb had its defaults from the settings of the hand."""
    if verb in (*OWN_VERBS, *SUB_VERBS):
        return verb in SETTINGS_VERBS
    return "source" in inspect.signature(load_verb(verb)).parameters


def _placeholder() -> None:
    """Do nothing; in place of a verb that is not imported."""


def _report(failure: BaseException, words: Sequence[str]) -> int:
    if os.environ.get("HOLDFAST_DEBUG"):  # the traceback, before the line for users
        traceback.print_exception(failure)
    # The message then names the extra, and the command that installs it.
    if isinstance(failure, ModuleNotFoundError):
        failure = missing_extra(failure) or failure
    match failure:
        case SystemExit() | GeneratorExit():
            raise failure
        case KeyboardInterrupt() | typer.Abort():
            print_error("interrupted")
            return EXIT_INTERRUPTED
        case _ if isinstance(failure, _UsageError):
            context, option = getattr(failure, "ctx", None), getattr(failure, "option_name", "")
            verb = getattr(context, "info_name", "")
            # The option of a package that is not installed is unknown to click.
            name = f"{verb} {option}".removeprefix("holdfast ")
            missing = missing_part("options", name, f"the option {option}")
            text = failure.format_message().rstrip(".")  # type: ignore[attr-defined]
            path = getattr(context, "command_path", "holdfast")
            print_error(str(missing) if missing else f"{text} (see {path} --help)")
            return EXIT_BAD_INPUT
        case RecordingError() if hasattr(failure, "proposal"):
            from holdfast.cli.csv_options import print_proposal

            print_proposal(failure, words)  # type: ignore[arg-type]
            return EXIT_BAD_INPUT
        case _ if isinstance(failure, _EXPECTED_ERRORS):
            text = str(failure) or type(failure).__name__
            if isinstance(failure, OSError) and failure.filename and failure.strerror:
                text = f"{failure.filename}: {failure.strerror}"  # without "[Errno 2]"
            print_error(text)
            return EXIT_BAD_INPUT
    print_error(f"internal error ({type(failure).__name__}: {failure}): please report it")
    return 1
