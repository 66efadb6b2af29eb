"""What `holdfast info` prints of a model file."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from holdfast.cli.terminal.console import print_json, print_table

if TYPE_CHECKING:
    from holdfast.classifiers.slip import SlipRule
    from holdfast.model import FingerModel, Handling, Model

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
    tuning = None
    if model.tuning is not None:
        tuning = msgspec.to_builtins(model.tuning)
        tuning["recordings"] = list(model.tuning.recordings)
    return {
        "name": model.name,
        "rate": model.rate,
        "tare": model.tare,
        "debounce": msgspec.to_builtins(model.debounce),
        "fingers": {name: _finger(model, part) for name, part in model.fingers.items()},
        "training": training,
        "tuning": tuning,
    }


def _finger(model: "Model", part: "FingerModel") -> dict[str, Any]:
    sensor = None if part.sensor is None else model.sensors[part.sensor]
    n = part.classifier.n_features
    kind = part.classifier.__struct_config__.tag
    return {
        "sensor": part.sensor,
        "unit": None if sensor is None else sensor.unit,
        "features": [str(spec) for spec in part.features],
        "classifier": f"{kind}, {n} feature{'s' * (n > 1)}",
        "threshold": part.classifier.threshold,
        "contact_threshold": part.contact_threshold,
        "contact_noise": part.contact_noise,
        "contact_load": part.contact_load,
        "slip": None if part.slip is None else _slip(part.slip),
        "normalised": bool(part.normalised),
        "handling": {name: _handling(handling) for name, handling in part.own_handling.items()},
    }


def _handling(handling: "Handling") -> dict[str, Any]:
    """Return the facts about own handling; location and scale are in the model file."""
    return {
        "seconds": handling.seconds,
        "threshold": handling.threshold,
        "slip_threshold": handling.slip_threshold,
        "recordings": list(handling.recordings),
    }


def _slip(rule: "SlipRule") -> dict[str, Any]:
    """Return the facts about a slip rule."""
    import msgspec

    chosen = None
    if rule.thresholds is not None:
        chosen = msgspec.to_builtins(rule.thresholds)
        chosen["recordings"] = list(rule.thresholds.recordings)
    features = () if rule.features is msgspec.UNSET else rule.features
    return {
        "features": [str(spec) for spec in features] or None,
        "threshold": rule.classifier.threshold,
        "smoothing": rule.smoothing,
        "hold": rule.hold,
        "highest_speed": None if rule.speed is msgspec.UNSET else rule.speed.highest,
        "chosen_on": chosen,
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
        yield finger, f"sensor {sensor}; {part['classifier']}"
        yield "", f"features {_few(part['features'])}"
        yield "", f"STABLE from a probability of {part['threshold']:.3g} on; {_contact(part)}"
        yield from (("", line) for line in (*_slip_lines(part), *_handling_lines(part)))
    training = document["training"]
    yield "trained on", "nothing" if training is None else _trained(training)
    tuned = list(_tuned_lines(document))
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


def _slip_lines(part: dict[str, Any]) -> Iterator[str]:
    """Yield the slip rule of a finger, and on what its threshold was chosen."""
    slip = part["slip"]
    if slip is None:
        yield "no slip rule"
        return
    yield (
        f"slides from a probability of {slip['threshold']:.3g} on; smoothing "
        f"{slip['smoothing']:g} s, hold {slip['hold']:g} s"
    )
    if slip["features"] is not None:
        added = [name for name in slip["features"] if name not in part["features"]]
        yield f"slips by {len(slip['features'])} features, of them new {_few(added)}"
    if slip["highest_speed"] is not None:
        yield f"speed and distance of slips, up to {slip['highest_speed']:.3g} mm/s"
    chosen = slip["chosen_on"]
    if chosen is None:
        yield "threshold of slips given, not chosen on recordings"
        return
    names = chosen["recordings"]
    place = f"{len(names)} recordings ({_few(names)})" if names else "the training, out of fold"
    found = "" if chosen["found"] is None else f"; {chosen['found']:.0f} % found within 0.1 s"
    yield (
        f"threshold of slips from {place}: {chosen['false_alarms_per_minute']:.2g} false alarms a "
        f"minute (at most {chosen['requested']:g} wanted) in {chosen['held_minutes']:.3g} min of "
        f"held time; {chosen['n_slips']} slips{found}"
    )


def _handling_lines(part: dict[str, Any]) -> Iterator[str]:
    """Yield the own handling of a finger on each sensor."""
    if part["normalised"] and not part["handling"]:
        yield "features normalised by default handling (holdfast calibrate: by your own)"
    for sensor, handling in part["handling"].items():
        names = handling["recordings"]
        stable, slips = handling["threshold"], handling["slip_threshold"]
        texts = [f"; STABLE from {part['threshold'] if stable is None else stable:.3g} on"]
        if part["slip"] is not None:
            slips = part["slip"]["threshold"] if slips is None else slips
            texts.append(f"; slides from {slips:.3g} on")
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


def _tuned_lines(document: dict[str, Any]) -> Iterator[str]:
    """Yield on what the threshold of stability was tuned, and on what those of slips were."""
    if document["tuning"] is not None:
        yield _tuned(document["tuning"])
    rules = [part["slip"] for part in document["fingers"].values() if part["slip"] is not None]
    chosen = [rule["chosen_on"]["recordings"] for rule in rules if rule["chosen_on"] is not None]
    for names in dict.fromkeys(tuple(names) for names in chosen if names):
        yield f"{len(names)} recordings ({_few(list(names))}) for slips, see above"


def _tuned(tuning: dict[str, Any]) -> str:
    names, missed = tuning["recordings"], tuning["missed"]["0.2"]
    share = "no event" if missed is None else f"{missed:.0f} % missed within 0.2 s"
    return (
        f"{len(names)} recordings ({_few(names)}): {tuning['false_alarms_per_minute']:.2g} false "
        f"alarms a minute (at most {tuning['requested']:g} wanted), {share}"
    )


def _few(names: list[str]) -> str:
    return ", ".join(names[:N_NAMES]) + (", ..." if len(names) > N_NAMES else "")
