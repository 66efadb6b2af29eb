"""What `holdfast info` prints of a model file."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.cli.terminal.console import print_json, print_table

if TYPE_CHECKING:
    from holdfast.model import FingerModel, Handling, Head, Model

ANSWERS = {"stable": "STABLE", "slip": "slides"}
"""What a finger does from the threshold of a head on."""
N_NAMES = 3
"""Number of names that are printed of a long list."""


def is_model(path: Path) -> bool:
    """Return whether a path names a model: a built-in one, or a JSON file."""
    return str(path).startswith("builtin:") or (path.suffix == ".json" and path.is_file())


def print_model(path: Path, as_json: bool) -> None:
    """Print what a model is for, how it decides, and what it was trained and tuned on."""
    from holdfast.model import Model

    document = model_document(Model.load(path))
    if as_json:
        print_json(document)
        return
    print_table(("model", document["name"] or path.name), _rows(document))


def model_document(model: "Model") -> dict[str, Any]:
    """Return the facts about a model, for JSON and for the table."""
    import msgspec

    training = None
    if model.training is not None:
        training = msgspec.to_builtins(model.training)
        training["recordings"] = list(model.training.recordings)
    return {
        "name": model.name,
        "rate": model.rate,
        "tare": model.tare,
        "debounce": msgspec.to_builtins(model.debounce),
        "fingers": {name: _finger(model, part) for name, part in model.fingers.items()},
        "training": training,
    }


def _finger(model: "Model", part: "FingerModel") -> dict[str, Any]:
    sensor = None if part.sensor is None else model.sensors[part.sensor]
    return {
        "sensor": part.sensor,
        "unit": None if sensor is None else sensor.unit,
        "heads": {head.name: _head(head) for head in part.heads},
        "contact_threshold": part.contact_threshold,
        "contact_noise": part.contact_noise,
        "contact_load": part.contact_load,
        "normalised": part.normalised,
        "handling": {name: _handling(handling) for name, handling in part.handling.items()},
    }


def _head(head: "Head") -> dict[str, Any]:
    """Return the facts about a head; means, scales and weights are in the model file."""
    import msgspec

    fields: dict[str, Any] = msgspec.to_builtins(head)
    rule, n = fields.pop("rule"), head.rule.n_features
    fields["rule"] = f"{rule['type']}, {n} feature{'s' * (n > 1)}"
    fields["features"] = [str(spec) for spec in head.features]
    if head.choice is not None:
        fields["choice"] |= {"recordings": list(head.choice.recordings)}
    if head.link != "logit":
        del fields["threshold"]
    return fields


def _handling(handling: "Handling") -> dict[str, Any]:
    """Return the facts about own handling; location and scale are in the model file."""
    return {
        "seconds": handling.seconds,
        "thresholds": handling.thresholds,
        "recordings": list(handling.recordings),
    }


def _filter(debounce: dict[str, float]) -> str:
    rate = debounce.get("switching", 0.0)
    return f", filter for {rate:g} switches per second" if rate else ""


def _rows(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    debounce, rate = document["debounce"], document["rate"]
    yield "rate", "any" if rate is None else f"{rate:g} Hz"
    yield "tare", document["tare"]
    yield (
        "debouncing",
        f"hold {debounce['hold']:g} s, minimum {debounce['min_duration']:g} s, hysteresis "
        f"{debounce['hysteresis']:g}{_filter(debounce)}",
    )
    for name, part in document["fingers"].items():
        finger = "any finger" if name == "*" else name
        sensor = f"{part['sensor']} ({part['unit']})" if part["sensor"] else "any"
        yield finger, f"sensor {sensor}; {_contact(part)}"
        known = part["heads"]["stable"]["features"]
        is_own = bool(part["handling"])
        heads = (line for x in part["heads"].values() for line in _head_lines(x, known, is_own))
        yield from (("", line) for line in heads)
        if "slip" not in part["heads"]:
            yield "", "no slip rule"
        yield from (("", line) for line in _handling_lines(part))
    training = document["training"]
    yield "trained on", "nothing" if training is None else _trained(training)
    tuned = dict.fromkeys(
        f"{len(names)} recordings ({_few(names)}) for {head['name']}, see above"
        for part in document["fingers"].values()
        for head in part["heads"].values()
        if head["choice"] is not None and (names := head["choice"]["recordings"])
    )
    yield from zip(("tuned on", *[""] * len(tuned)), tuned or ["nothing"], strict=False)


def _contact(part: dict[str, Any]) -> str:
    """Return the threshold of contact."""
    for field, text in (
        ("contact_load", "contact from a load of {:g} times its noise"),
        ("contact_threshold", "contact from F_a = {:.3g}"),
        ("contact_noise", "contact from F_a = {:g} times the noise of the tare"),
    ):
        if part[field] is not None:
            return text.format(part[field])
    return "no threshold of contact"


def _head_lines(head: dict[str, Any], known: list[str], is_own: bool) -> Iterator[str]:
    """Yield what a head answers, from which features, and on what its threshold was chosen.

    Of features that `stable` has not, the first are named. Of a calibrated model, the lines of own
    handling have the one threshold that is used.
    """
    name, texts = head["name"], [head["rule"]]
    if "threshold" in head and not is_own:
        texts.append(f"{ANSWERS[name]} from a probability of {head['threshold']:.3g} on")
    if name == "slip":
        texts.append(f"smoothing {head['smoothing']:g} s, hold {head['hold']:g} s")
    if head["highest"] is not None:
        texts.append(f"speed and distance of slips, up to {head['highest']:.3g} mm/s")
    if head["classes"]:
        texts.append(", ".join(head["classes"]))
    yield f"{name}: {'; '.join(texts)}"
    added = [feature for feature in head["features"] if feature not in known]
    yield f"  of them new {_few(added)}" if added else f"  features {_few(head['features'])}"
    if head["choice"] is not None:
        yield f"  threshold from {_chosen(name, head['choice'])}"


def _chosen(name: str, choice: dict[str, Any]) -> str:
    """Return where a threshold was chosen, and what it gave there."""
    names = choice["recordings"]
    origin = f"{len(names)} recordings ({_few(names)})" if names else "the training, out of fold"
    events, time = ("events", "stable") if name == "stable" else ("slips", "held")
    within = "0.2" if name == "stable" else "0.1"
    found = "" if choice["found"] is None else f"; {choice['found']:.0f} % found within {within} s"
    return (
        f"{origin}: {choice['false_alarms_per_minute']:.2g} false alarms a minute (at most "
        f"{choice['requested']:g} wanted) in {choice['minutes']:.3g} min of {time} time; "
        f"{choice['n']} {events}{found}"
    )


def _handling_lines(part: dict[str, Any]) -> Iterator[str]:
    """Yield the own handling of a finger on each sensor."""
    if part["normalised"] and not part["handling"]:
        yield "features normalised by default handling (holdfast calibrate: by your own)"
    for sensor, handling in part["handling"].items():
        names = handling["recordings"]
        texts = [
            f"; {ANSWERS[name]} from {handling['thresholds'].get(name, head['threshold']):.3g} on"
            for name, head in part["heads"].items()
            if "threshold" in head
        ]
        yield (
            f"own handling of {sensor}: {handling['seconds']:.3g} s held in {len(names)} "
            f"recording{'s' * (len(names) != 1)} ({_few(names)}){''.join(texts)}"
        )


def _trained(training: dict[str, Any]) -> str:
    figures = training["figures"]
    name, auc = "AUC in contact", figures.get("auc_contact")
    if auc is None:
        name, auc = "AUC of all", figures.get("auc")
    figure = "" if auc is None else f"; {name} {auc:.3f} out of fold, by {training['split']}"
    names = training["recordings"]
    return f"{len(names)} recordings ({_few(names)}){figure}"


def _few(names: list[str]) -> str:
    return ", ".join(names[:N_NAMES]) + (", ..." if len(names) > N_NAMES else "")
