"""Laws of grip force, one file each, behind one interface."""

from collections.abc import Callable
from typing import Any

from holdfast.plugins import PluginGroup
from holdfast_grip.laws.base import Law, Touch, Wish
from holdfast_grip.laws.costanzo import Costanzo
from holdfast_grip.laws.fixed import Fixed
from holdfast_grip.laws.friction_margin import FrictionMargin
from holdfast_grip.laws.pr2 import Pr2
from holdfast_grip.laws.stability import Stability
from holdfast_grip.laws.wong_zhu import WongZhu

LAWS: dict[str, Callable[[], Law]] = {
    "fixed": Fixed,
    "pr2": Pr2,
    "wong-zhu": WongZhu,
    "friction-margin": FrictionMargin,
    "costanzo": Costanzo,
    "holdfast": Stability,
}
"""Laws by name, with the best of the settings that were tried (docs/study/grip.md)."""

__all__ = ["LAWS", "Law", "Touch", "Wish", "law_named"]


def law_named(name: str) -> Law:
    """Return a new law, one of `LAWS` or of a plug-in.

    Raises:
        ValueError: there is no law of that name; the message lists the names.
    """
    if name in LAWS:
        return LAWS[name]()
    law = LAW_PLUGINS.load(name)
    if law is None:
        raise ValueError(f"unknown law {name!r}; there are {', '.join(LAWS)}{LAW_PLUGINS.text()}")
    return law


def _plugin_law(name: str, loaded: Any) -> Law:  # noqa: ANN401
    """Return a new law of a plug-in: of a class, or of a function without arguments."""
    law = loaded() if callable(loaded) else loaded
    if law is loaded or not isinstance(law, Law):
        raise TypeError(f"a subclass of Law expected for {name}, {loaded!r} given")
    return law


LAW_PLUGINS = PluginGroup("laws", LAWS, _plugin_law)
"""Laws of other packages."""
