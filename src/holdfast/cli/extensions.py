"""What plug-ins add to verbs: formats of `export`, publishers of `serve`, and simulators.

Such a plug-in is an object with `OPTIONS`, an instance of a frozen dataclass: its fields are the
options that the verb gets, with their defaults, and the plug-in is used if one of them differs.
docs/plugins.md has what each kind does besides.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import partial
from importlib import import_module
from typing import Any, ClassVar

from holdfast import children
from holdfast.plugins import GROUP_PLUGINS, Plugin, PluginGroup


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
"""What `holdfast serve` also publishes to."""
SIMULATOR_PLUGINS = PluginGroup("simulators", (), _extension("simulate"))
"""What `holdfast simulate` simulates besides the grasps of an Allegro hand."""


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
    "sensors": ("sensors", "SENSOR_PLUGINS"),
    "sources": ("devices.uri", "SOURCE_PLUGINS"),
    "importers": ("io.importers", "IMPORTER_PLUGINS"),
    "labels": ("labelling.exchange.read_labels", "LABEL_PLUGINS"),
    "classifiers": ("classifiers", "CLASSIFIER_PLUGINS"),
    "verbs": ("cli.app", "VERB_PLUGINS"),
    "exporters": ("cli.extensions", "EXPORTER_PLUGINS"),
    "publishers": ("cli.extensions", "PUBLISHER_PLUGINS"),
    "simulators": ("cli.extensions", "SIMULATOR_PLUGINS"),
}
"""Module and name of each group of plug-ins, by kind; a child imports one of them. Packages may
have kinds of their own, see `GROUP_PLUGINS`."""


def plugin_states() -> list[Plugin]:
    """Return the plug-ins of other packages, and why some of them are skipped.

    Each is imported in a child process, which it may end or block.
    """
    kinds = (*PLUGIN_GROUPS, *GROUP_PLUGINS.load_all())
    error = partial(children.answer_of_child, __name__, "plugin_error")
    return [plugin for kind in kinds for plugin in _plugin_group(kind).states(error)]


def plugin_error(kind: str, name: str) -> str:
    """Return why a plug-in is skipped; empty if it can be used."""
    return _plugin_group(kind).error(name)


def _plugin_group(kind: str) -> PluginGroup[Any]:
    if kind not in PLUGIN_GROUPS:
        return GROUP_PLUGINS.require(kind, f"the kind {kind} of plug-ins")
    module, name = PLUGIN_GROUPS[kind]
    group: PluginGroup[Any] = getattr(import_module(f"holdfast.{module}"), name)
    return group
