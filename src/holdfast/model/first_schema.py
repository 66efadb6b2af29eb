"""Model files of the schema holdfast.model/1, which had a type of its own for each head."""

from typing import Any

from holdfast.model.heads import LINKS

Document = dict[str, Any]


def upgraded(model: Document) -> Document:
    """Return the JSON document of a model of the first schema in the present one.

    What the first schema does not allow either passes through, and is refused with the rest.

    Raises:
        ValueError: a part has another form.
    """
    try:
        tuning = model.get("tuning")
        fingers = {name: _finger(part, tuning) for name, part in model["fingers"].items()}
        # One tuning for the whole model, which now is the choice of each head `stable`.
        kept = {key: value for key, value in model.items() if key != "tuning"}
        return {**kept, "fingers": fingers, "schema": "holdfast.model/2"}
    except (KeyError, TypeError, AttributeError, IndexError) as cause:
        raise ValueError(f"a model of holdfast.model/1 expected, {cause!r}") from cause


def _finger(part: Document, tuning: Document | None) -> Document:
    part = dict(part)
    features, classifier = part.pop("features"), part.pop("classifier")
    causes, slip = part.pop("causes", None), part.pop("slip", None)
    # In the order of `HEAD_NAMES`, as models of the present schema are written.
    heads = [_head("stable", features, classifier, choice=_tuned(tuning))]
    if slip is not None:
        slip = dict(
            slip
        )  # a copy, as each part of it is taken out; the rest are fields of the head
        own, speed = slip.pop("features", features), slip.pop("speed", None)
        rule = {**slip.pop("classifier"), "squares": slip.pop("squares", None)}
        choice = _chosen(slip.pop("thresholds", None))
        heads.append(_head("slip", own, rule, choice=choice, **slip))
        if speed is not None:
            highest = speed["highest"]
            rule = {key: value for key, value in speed.items() if key != "highest"}
            heads.append(_head("slip_speed", own, rule, highest=highest))
    if causes is not None:
        rule = {key: value for key, value in causes.items() if key != "causes"}
        heads.append(_head("cause", features, rule, classes=causes["causes"]))
    if "handling" in part:
        part["handling"] = {name: _handling(own) for name, own in part["handling"].items()}
    return {**part, "heads": heads}


def _head(name: Any, features: list[str], rule: Document, **fields: Any) -> Document:  # noqa: ANN401
    rule = dict(rule)
    if "threshold" in rule:
        fields["threshold"] = rule.pop("threshold")
    if "coefficients" in rule:
        rule.setdefault("type", "linear")
        rows = rule.pop("coefficients")
        # Causes had a row of weights for each; the other heads had one row without a table.
        is_table = "intercepts" in rule
        rule["weights"] = rows if is_table else [rows]
        rule["intercepts"] = rule["intercepts"] if is_table else [rule.pop("intercept")]
        squares = rule.pop("squares", None)
        rule["squares"] = [] if squares is None else [squares]
    used = {key: value for key, value in fields.items() if value is not None}
    return {"name": name, "link": LINKS[name], "features": features, "rule": rule, **used}


def _chosen(record: Document | None) -> Document | None:
    """Return the record of the choice of a threshold of slips."""
    if record is None:
        return None
    names = {"n_slips": "n", "held_minutes": "minutes"}
    return {names.get(key, key): value for key, value in record.items()}


def _tuned(record: Document | None) -> Document | None:
    """Return the record of the choice of a threshold of stability."""
    if record is None:
        return None
    missed = record["missed"]["0.2"]
    return {
        "found": None if missed is None else 100 - missed,
        "n": record["n_events"],
        "minutes": record["stable_minutes"],
        **{key: record[key] for key in ("requested", "false_alarms_per_minute", "recordings")},
        "points": record.get("points", []),
    }


def _handling(own: Document) -> Document:
    names = {"stable": "threshold", "slip": "slip_threshold"}
    thresholds = {name: own.get(key) for name, key in names.items()}
    kept = {key: value for key, value in own.items() if key not in names.values()}
    return {**kept, "thresholds": {k: v for k, v in thresholds.items() if v is not None}}
