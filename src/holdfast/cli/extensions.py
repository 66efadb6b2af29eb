"""Plug-ins of verbs: formats of `export`, publishers of `serve`, and simulators.

Such a plug-in is an object with `OPTIONS`, an instance of a frozen dataclass: its fields are the
options that the verb gets, with their defaults, and the plug-in is used if one of them differs.
docs/plugins.md has what each kind does besides.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any, ClassVar

from holdfast.errors import is_installed
from holdfast.plugins import Plugin, PluginGroup
from holdfast.removed import REMOVED, removal


class PluginOptions:
    """Options of all plug-ins of a kind; as the type of a parameter of a verb, its options.

    Attributes:
        group: the plug-ins.
    """

    group: ClassVar[PluginGroup[Any]]

    def __init__(self, values: Mapping[str, object]) -> None:
        self._values = values  # options of each plug-in, by its name

    @classmethod
    def plugins(cls) -> dict[str, Any]:
        """Return the plug-ins by name; the code of all is imported."""
        return cls.group.load_all()

    def chosen(self) -> "list[tuple[str, Any, Any]]":
        """Return name, plug-in and options of those whose options are given."""
        return [
            (name, plugin, self._values[name])
            for name, plugin in self.plugins().items()
            if name in self._values and self._values[name] != plugin.OPTIONS
        ]

    def of(self, name: str) -> Any:  # noqa: ANN401 (a dataclass of the plug-in)
        """Return the options of a plug-in."""
        return self._values[name]


def flags_of(options: object) -> list[str]:
    """Return the names of the options of a plug-in as words of the command line."""
    return [f"--{field.name.replace('_', '-')}" for field in fields(options)]  # type: ignore[arg-type]


def _extension(function: str) -> Any:  # noqa: ANN401 (the function that converts a plug-in)
    def convert(name: str, loaded: Any) -> Any:  # noqa: ANN401
        """Return a plug-in that adds options to a verb."""
        options = getattr(loaded, "OPTIONS", None)
        is_lacking = not callable(getattr(loaded, function, None))
        if not is_dataclass(options) or isinstance(options, type) or is_lacking:
            raise TypeError(
                f"OPTIONS, a dataclass with its defaults, and {function} expected for {name}, "
                f"{loaded!r} given"
            )
        return loaded

    return convert


EXPORTER_PLUGINS = PluginGroup("exporters", ("csv",), _extension("export"))
"""Formats of `holdfast export RECORDINGS`."""
PUBLISHER_PLUGINS = PluginGroup("publishers", (), _extension("publisher"))
"""Publishers of `holdfast serve` beside the page."""
SIMULATOR_PLUGINS = PluginGroup("simulators", (), _extension("simulate"))
"""Simulators of `holdfast simulate` beside the grasps of an Allegro hand."""


class ExporterOptions(PluginOptions):
    """Options of the formats of recordings."""

    group = EXPORTER_PLUGINS


class PublisherOptions(PluginOptions):
    """Options of publishers."""

    group = PUBLISHER_PLUGINS


class SimulatorOptions(PluginOptions):
    """Options of simulators."""

    group = SIMULATOR_PLUGINS


PLUGIN_GROUPS = {
    "verbs": ("holdfast.cli.app", "VERB_PLUGINS"),
    "sources": ("holdfast.devices.uri", "SOURCE_PLUGINS"),
    "importers": ("holdfast.io.importers", "IMPORTER_PLUGINS"),
    "exporters": ("holdfast.cli.extensions", "EXPORTER_PLUGINS"),
    "publishers": ("holdfast.cli.extensions", "PUBLISHER_PLUGINS"),
    "simulators": ("holdfast.cli.extensions", "SIMULATOR_PLUGINS"),
    "hands": ("holdfast_grip.hands", "HAND_PLUGINS"),
}
"""Module and name of each group of plug-ins, by kind. Hands need holdfast-grip."""


def plugin_states() -> list[Plugin]:
    """Return the plug-ins of other packages, and why some of them are skipped.

    Each is imported, except plug-ins of a kind that was removed.
    """
    groups: list[PluginGroup[Any]] = [
        getattr(import_module(module), name)
        for module, name in PLUGIN_GROUPS.values()
        if is_installed(module.partition(".")[0])
    ]
    states = [plugin for group in groups for plugin in group.states(group.error)]
    for kind in REMOVED["plugins"]:
        reason = removal("plugins", kind, f"the kind {kind} of plug-ins")
        removed: PluginGroup[Any] = PluginGroup(kind, (), lambda _, loaded: loaded)
        states += removed.states(dict.fromkeys(removed.names(report=False), reason).__getitem__)
    return states
