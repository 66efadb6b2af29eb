"""What a sensor of XELA's server consists of, by its model: the modules that it becomes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.errors import SourceError
from holdfast.sensors import Hand, Sensor
from holdfast.sensors.xela_models import is_known, module_sensors, whole_hand


@dataclass(frozen=True, eq=False)
class Skin:
    """A sensor of the server, and the modules that it consists of.

    Attributes:
        number: the server's.
        model: as the server calls it.
        modules: their sensors by name.
        order: (n_taxels,) where each taxel stands in the packet, module after module; None
            where it is one module, in the packet's order.
        notices: what a person should know of it.
    """

    number: int
    model: str
    modules: Mapping[str, Sensor]
    order: npt.NDArray[np.int64] | None = None
    notices: tuple[str, ...] = ()
    n_taxels: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "n_taxels", sum(s.n_taxels for s in self.modules.values()))

    def split(self, readings: npt.NDArray[Any]) -> dict[str, npt.NDArray[Any]]:
        """The readings of each module, out of those in the order of the packet."""
        if self.order is None:
            return dict.fromkeys(self.modules, readings)
        ordered = readings[self.order]
        samples, first = {}, 0
        for name, module in self.modules.items():
            samples[name] = ordered[first : first + module.n_taxels]
            first += module.n_taxels
        return samples


def skins(
    found: Mapping[int, tuple[str, int]],
    names: Mapping[int, str],
    given: Sensor | None = None,
    *,
    calibrated: bool = False,
) -> dict[int, Skin]:
    """The sensors of a server, by number.

    Args:
        found: model and number of taxels, by the server's number.
        names: what a user calls them.
        given: of the separate sensors with that number of taxels, whatever their model.
        calibrated: readings are in newtons.

    Raises:
        SourceError: a model has another number of taxels, nothing fits `names` or `given`, or
            two modules would have one name.
    """
    hands = {number: whole for number, (model, _) in found.items() if (whole := whole_hand(model))}
    made = {}
    for number, (model, n_taxels) in found.items():
        if number in hands:
            prefix = f"hand{number}/" if len(hands) > 1 else ""
            skin = _hand(number, model, n_taxels, hands[number], prefix)
        else:
            name = names.get(number, f"finger{number}")
            skin = _separate(number, name, model, n_taxels, given)
        made[number] = _in_newtons(skin) if calibrated else skin
    _check(made, names, given)
    return made


def _hand(number: int, model: str, n_taxels: int, whole: Hand, prefix: str) -> Skin:
    modules = _built_in(number, model, n_taxels)
    order = np.concatenate([whole.modules[name].flat_indices for name in modules])
    return Skin(number, model, {prefix + name: one for name, one in modules.items()}, order)


def _separate(number: int, name: str, model: str, n_taxels: int, given: Sensor | None) -> Skin:
    if given is not None and given.n_taxels == n_taxels:
        return Skin(number, model, {name: given})
    (found,) = _built_in(number, model, n_taxels).values()
    if is_known(model):
        return Skin(number, model, {name: found})
    layout = "a flat grid" if found.name == (model.lower() or "unknown") else found.name
    notice = (
        f"{name}: the layout of a {model or 'sensor without a model'} with {n_taxels} taxels is "
        f"not known; {layout} is assumed (sensor=FILE.json in the URI gives another)"
    )
    return Skin(number, model, {name: found}, notices=(notice,))


def _built_in(number: int, model: str, n_taxels: int) -> dict[str, Sensor]:
    try:
        return module_sensors(model, n_taxels)
    except ValueError as cause:
        raise SourceError(
            f"sensor {number}: {cause}; sensor=FILE.json in the URI tells of another layout"
        ) from cause


def _in_newtons(skin: Skin) -> Skin:
    modules = {
        name: replace(module, unit="N", limits=None) for name, module in skin.modules.items()
    }
    return replace(skin, modules=modules)


def _check(made: Mapping[int, Skin], names: Mapping[int, str], given: Sensor | None) -> None:
    separate = [skin for skin in made.values() if skin.order is None]
    there = ", ".join(f"{skin.number} ({skin.model})" for skin in made.values())
    if strangers := sorted(set(names) - {skin.number for skin in separate}):
        raise SourceError(
            f"fingers= names {', '.join(map(str, strangers))}; separate sensors have names, "
            f"the server has {there}"
        )
    if given is not None and all(given.n_taxels != skin.n_taxels for skin in separate):
        raise SourceError(
            f"sensor= has {given.n_taxels} taxels and fits none that the server has: "
            + ", ".join(f"{skin.number} ({skin.n_taxels} taxels)" for skin in made.values())
        )
    modules = [name for skin in made.values() for name in skin.modules]
    if len(set(modules)) < len(modules):
        raise SourceError(f"two modules of one name: {', '.join(modules)}; fingers= tells others")
