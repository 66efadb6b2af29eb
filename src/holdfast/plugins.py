"""Plug-ins of other packages: verbs, sources, importers, exporters, publishers, ...

A package declares them as entry points (docs/plugins.md). Its code is imported when a name is
used that holdfast itself does not have, and by `holdfast doctor`. A plug-in that fails is named
once by the logger `holdfast.plugins`, which prints on stderr by default, and is skipped. The
packages beside the core (`PACKAGE_PARTS` of `errors.py`) use nothing else.
"""

from collections.abc import Callable, Collection, Iterable
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from holdfast.errors import PACKAGE_PARTS, HoldfastError, missing_part, other_version

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")

LOGGER_NAME = "holdfast.plugins"
"""Name of the logger that reports plug-ins that are skipped."""
GROUP_PREFIX = "holdfast."
"""Begin of the names of all groups of entry points: `holdfast.sources`."""


class Plugin(NamedTuple):
    """A plug-in of an installed package.

    Attributes:
        kind: what it is: `verbs`, `sources`, ...
        name: name under which it is used.
        package: name and version of the package.
        error: why it is skipped; empty if it can be used.
    """

    kind: str
    name: str
    package: str
    error: str


class PluginGroup(Generic[T]):
    """Plug-ins of one kind.

    Args:
        kind: what they are; the group of their entry points is `holdfast.<kind>`.
        built_in: names that holdfast itself has; a plug-in cannot replace them.
        convert: function that returns the plug-in of a name and a loaded object. An error that
            it raises is the reason to skip the plug-in.
    """

    def __init__(
        self, kind: str, built_in: Collection[str], convert: Callable[[str, Any], T]
    ) -> None:
        self.kind = kind
        self._built_in, self._convert = built_in, convert
        self._reported: set[str] = set()

    def names(self, *, report: bool = True) -> tuple[str, ...]:
        """Return the names of the plug-ins, in order; no code of theirs is imported.

        Args:
            report: name those whose name is taken.
        """
        if report:
            return tuple(self._usable_points())
        return tuple(point.name for point, refusal in self._points() if not refusal)

    def text(self) -> str:
        """Return the end of a message: names of plug-ins, and names of missing packages."""
        names = self.names()
        missing = [
            f"{name} ({package})"
            for package, parts in PACKAGE_PARTS.items()
            for name in parts.get(self.kind, ())
            if name not in names
        ]
        installed = f"; of plug-ins: {', '.join(names)}" if names else ""
        return installed + (f"; not installed: {', '.join(missing)}" if missing else "")

    def load(self, name: str) -> T | None:
        """Return a plug-in; None if there is none of that name, or it is skipped."""
        point = self._usable_points().get(name)
        if point is None:
            return None
        try:
            return self._convert(name, point.load())
        except KeyboardInterrupt:
            raise
        except BaseException as cause:  # a plug-in may raise any
            self._report(point, _reason(cause))
            return None

    def require(self, name: str, what: str, names: Iterable[str] = ()) -> T:
        """Return a plug-in.

        Args:
            name: of the plug-in.
            what: what the name stands for, as in "the verb hold".
            names: all names that there are, for the message.

        Raises:
            HoldfastError: it is skipped, or its package is not installed.
            ValueError: neither holdfast nor a plug-in has the name.
        """
        refusals = [refusal for point, refusal in self._points() if point.name == name]
        if refusals and all(refusals):
            raise HoldfastError(f"{what} cannot be used: {refusals[0]}")
        if refusals:
            if (plugin := self.load(name)) is not None:
                return plugin
            raise HoldfastError(
                f"the plug-in of {what} cannot be used; the line before, and holdfast doctor, "
                "have the reason"
            )
        raise missing_part(self.kind, name, what) or ValueError(
            f"{what} is unknown; there are {', '.join(names) or 'none'}"
        )

    def load_all(self) -> dict[str, T]:
        """Return all plug-ins that are not skipped, by name."""
        loaded = {name: self.load(name) for name in self.names()}
        return {name: plugin for name, plugin in loaded.items() if plugin is not None}

    def states(self, error: Callable[[str], str]) -> list[Plugin]:
        """Return the plug-ins, each with the reason why it is skipped, if it is.

        Those of the packages beside the core are no guests: they are left out if they fit.

        Args:
            error: returns that reason for a name.
        """
        return [
            Plugin(self.kind, point.name, _package(point), refusal or error(point.name))
            for point, refusal in self._points()
            if refusal or not _is_own(point)
        ]

    def error(self, name: str) -> str:
        """Load a plug-in, and return the reason why it is skipped; empty if it can be used."""
        try:
            self._convert(name, self._usable_points()[name].load())
        except KeyboardInterrupt:
            raise
        except BaseException as cause:  # a plug-in may raise any
            return _reason(cause)
        return ""

    def _points(self) -> "list[tuple[EntryPoint, str]]":
        """Return the entry points, each with the reason why its name cannot be used, or ""."""
        from importlib.metadata import entry_points  # it takes as long as all of `--help`

        declared = entry_points(group=f"{GROUP_PREFIX}{self.kind}")
        # An earlier name of a distribution may have left metadata of the same object.
        points = list({(point.name, point.value): point for point in declared}.values())
        # Of two with one name the first counts, whatever the order of folders on the path.
        points.sort(key=lambda point: (point.name, _package(point)))
        first: dict[str, EntryPoint] = {}
        pairs: list[tuple[EntryPoint, str]] = []
        for point in points:
            owner = _package(first.setdefault(point.name, point))
            if point.name in self._built_in:
                reason = f"holdfast itself has {point.name}; another name expected"
            elif owner != _package(point):
                reason = f"{owner} has {point.name} as well; another name expected"
            else:
                package = point.dist
                reason = "" if package is None else other_version(package.name, package.version)
            pairs.append((point, reason))
        return pairs

    def _usable_points(self) -> "dict[str, EntryPoint]":
        """Return the entry points by name; report those whose name is taken."""
        usable: dict[str, EntryPoint] = {}
        for point, refusal in self._points():
            if refusal:
                self._report(point, refusal)
            else:
                usable[point.name] = point
        return usable

    def _report(self, point: "EntryPoint", reason: str) -> None:
        """Report that a plug-in is skipped, each reason once."""
        text = f"plug-in {point.name} ({self.kind} of {_package(point)}) is skipped: {reason}"
        if text not in self._reported:
            import logging  # not for `--help`

            self._reported.add(text)
            logging.getLogger(LOGGER_NAME).warning("%s", text)


def _is_own(point: "EntryPoint") -> bool:
    """Return whether the core or a package beside it has a plug-in."""
    package = point.dist
    is_beside = package is not None and package.name in PACKAGE_PARTS
    return is_beside or point.value.startswith("holdfast.")


def _package(point: "EntryPoint") -> str:
    package = point.dist
    return f"{package.name} {package.version}" if package else "an unknown package"


def _reason(cause: BaseException) -> str:
    """Return an error as one line of printable characters."""
    try:
        text = " ".join(str(cause).split())
    except Exception:  # its text is code of the plug-in too
        text = ""
    printable = "".join(character for character in text if character.isprintable())
    return f"{type(cause).__name__}: {printable}" if printable else type(cause).__name__
