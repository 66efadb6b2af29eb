"""Facts about a model for `holdfast info`."""

from typing import Any

import msgspec

from holdfast.detection import Head, Model


def facts_of(model: Model) -> dict[str, Any]:
    """Return what a model is for, how it decides and what it was made from, as JSON has it.

    Means, scales and weights, and the location and scale of own handling, are in the file only.
    """
    fingers = {}
    for name, part in model.fingers.items():
        sensor = None if part.sensor is None else model.sensors[part.sensor]
        fingers[name] = {
            "sensor": part.sensor,
            "unit": None if sensor is None else sensor.unit,
            "heads": {head.name: _facts_of_head(head) for head in part.heads},
            "contact_threshold": part.contact_threshold,
            "contact_noise": part.contact_noise,
            "contact_load": part.contact_load,
            "normalised": part.normalised,
            "handling": {
                sensor_name: {
                    "seconds": handling.seconds,
                    "thresholds": handling.thresholds,
                    "recordings": list(handling.recordings),
                }
                for sensor_name, handling in part.handling.items()
            },
        }
    training = None
    if model.training is not None:
        training = msgspec.to_builtins(model.training)
        training["recordings"] = list(model.training.recordings)
        training.pop("blocks", None)
    return {
        "name": model.name,
        "rate": model.rate,
        "tare": model.tare,
        "debounce": msgspec.to_builtins(model.debounce),
        "fingers": fingers,
        "training": training,
    }


def _facts_of_head(head: Head) -> dict[str, Any]:
    fields: dict[str, Any] = msgspec.to_builtins(head)
    rule, n = fields.pop("rule"), head.rule.n_features
    fields["rule"] = f"{rule['type']}, {n} feature{'s' * (n > 1)}"
    fields["features"] = [str(spec) for spec in head.features]
    if head.choice is not None:
        fields["choice"] |= {"recordings": list(head.choice.recordings)}
    if head.link != "logit":
        del fields["threshold"]
    return fields
