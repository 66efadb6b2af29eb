"""Modules of the sensors of XELA's server, by their models."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from holdfast.devices.sources.assembler import Device
from holdfast.errors import SourceError
from holdfast.sensors import Sensor
from holdfast.sensors.xela_models import is_known, module_sensors, whole_hand


def xela_devices(
    models: Mapping[int, tuple[str, int]],
    names: Mapping[int, str],
    stated: Sensor | None = None,
    *,
    calibrated: bool = False,
) -> dict[int, Device]:
    """Return the sensors of a server by number, with their modules.

    Args:
        models: model and number of taxels, by the server's number.
        names: names of separate sensors, by number; `finger1`, ... for the others.
        stated: layout of the separate sensors with this number of taxels, for any model.
        calibrated: whether readings are in newtons.

    Raises:
        SourceError: a model has another number of taxels, `names` or `stated` fits no sensor, or
            two modules have the same name.
    """
    hands = {number: whole for number, (model, _) in models.items() if (whole := whole_hand(model))}
    devices = {}
    for number, (model, n_taxels) in models.items():
        if number in hands:
            # Two hands have the same names of modules; one hand has them without a prefix.
            prefix = f"hand{number}/" if len(hands) > 1 else ""
            modules = _built_in(number, model, n_taxels)
            order = np.concatenate([hands[number].modules[name].flat_indices for name in modules])
            prefixed = {prefix + name: module for name, module in modules.items()}
            device = Device(number, model, prefixed, order)
        else:
            name = names.get(number, f"finger{number}")
            device = _separate(number, name, model, n_taxels, stated)
        if calibrated:  # the range is that of counts
            units = {n: replace(m, unit="N", range=None) for n, m in device.modules.items()}
            device = replace(device, modules=units)
        devices[number] = device
    _check(devices, names, stated)
    return devices


def _separate(number: int, name: str, model: str, n_taxels: int, stated: Sensor | None) -> Device:
    if stated is not None and stated.n_taxels == n_taxels:
        return Device(number, model, {name: stated})
    (device,) = _built_in(number, model, n_taxels).values()
    if is_known(model):
        return Device(number, model, {name: device})
    layout = "a flat grid" if device.name == (model.lower() or "unknown") else device.name
    notice = (
        f"{name}: the layout of a {model or 'sensor without a model'} with {n_taxels} taxels is "
        f"not known; {layout} is assumed (sensor=FILE.json in the URI gives another)"
    )
    return Device(number, model, {name: device}, notices=(notice,))


def _built_in(number: int, model: str, n_taxels: int) -> dict[str, Sensor]:
    try:
        return module_sensors(model, n_taxels)
    except ValueError as cause:
        raise SourceError(
            f"sensor {number}: {cause}; sensor=FILE.json in the URI gives another layout"
        ) from cause


def _check(devices: Mapping[int, Device], names: Mapping[int, str], stated: Sensor | None) -> None:
    # The modules of a whole hand have fixed names and layouts.
    separate = [device for device in devices.values() if device.order is None]
    present = ", ".join(f"{device.number} ({device.model})" for device in devices.values())
    if unknown := sorted(set(names) - {device.number for device in separate}):
        raise SourceError(
            f"fingers= names {', '.join(map(str, unknown))}; separate sensors have names, "
            f"the server has {present}"
        )
    if stated is not None and all(stated.n_taxels != device.n_taxels for device in separate):
        sizes = (f"{device.number} ({device.n_taxels} taxels)" for device in devices.values())
        raise SourceError(
            f"sensor= has {stated.n_taxels} taxels and fits no sensor of the server: "
            + ", ".join(sizes)
        )
    modules = [name for device in devices.values() for name in device.modules]
    if len(set(modules)) < len(modules):
        raise SourceError(
            f"two modules have the same name: {', '.join(modules)}; fingers= gives other names"
        )
