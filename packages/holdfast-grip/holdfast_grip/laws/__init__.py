"""Laws of grip force, one file each, behind one interface."""

from collections.abc import Callable

from holdfast_grip.laws.base import ForceTarget, Law, Touch
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
    "holdfast": Stability,
}
"""Laws by name, with the best of the settings that were tried (docs/study/grip.md)."""

__all__ = ["LAWS", "ForceTarget", "Law", "Touch", "law_named"]


def law_named(name: str) -> Law:
    """Return a new law, one of `LAWS`.

    Raises:
        ValueError: there is no law of that name; the message lists the names.
    """
    if name not in LAWS:
        raise ValueError(f"unknown law {name!r}; there are {', '.join(LAWS)}")
    return LAWS[name]()
