"""Tables of `holdfast info`: of a recording, of a folder of them, and of a model."""

from collections.abc import Iterator, Mapping, Sequence
from statistics import mean
from typing import Any

from holdfast.cli.terminal.console import print_line, print_lines, print_paragraph, print_table

MAX_VALUE_LENGTH = 90
"""Maximum number of characters of a metadata value in the table."""
ANSWERS = {"stable": "STABLE", "slip": "slides", "slip_changes": "slides, begun in contact,"}
"""Answer of a head whose value reaches its threshold."""
# As the documents of `content_of` name them; an import of them would slow the start of the verb.
LABELLED_STATES = ("stable", "unstable", "no_contact")
LABEL_HEADINGS = tuple(f"{state} [s]" for state in LABELLED_STATES)
N_NAMES = 3
"""Number of names that are printed of a long list."""


def print_recording(content: Mapping[str, Any]) -> None:
    """Print tables of a recording, of its modules and markers, and one paragraph per finding."""
    rows = [
        ("duration", f"{content['duration']:.3f} s from {content['start']:.3f} s"),
        ("complete", "yes" if content["complete"] else "no: the end of the file is cut off"),
        ("digest", content["digest"] or "not known: loading the recording takes too much memory"),
        *((key, _shorten(value)) for key, value in content["metadata"].items()),
        *((f"media at {x['offset']:g} s", x["path"]) for x in content["media"]),
    ]
    if truth := content["truth"]:
        fingers = truth["fingers"].items()
        channels = [f"{finger}.{name}" for finger, names in fingers for name in names]
        rows.append(("truth", _shorten(", ".join([*truth["hand"], *channels]))))
    print_table(("recording", content["name"]), rows)
    print_line()
    _print_modules(content["modules"])
    if content["findings"]:
        print_lines(("", "findings:"))
    for finding in content["findings"]:
        text = f"{finding['module']}: {finding['text']}" if finding["module"] else finding["text"]
        print_paragraph(text, "- ", "  ")
    if content["markers"]:
        from holdfast.recordings import shown_origin

        # Times since 1970 are shown from the first sample on.
        origin = shown_origin(content["start"])
        print_line()
        if origin:
            print_line("markers since the first sample")
        markers = [(f"{m['time'] - origin:.3f}", m["text"]) for m in content["markers"]]
        print_table(("marker [s]", "text"), markers)


def _print_modules(modules: Mapping[str, Mapping[str, Any]]) -> None:
    """Print two tables: the samples of each module, then its labels and faults."""
    header = ("module", "sensor", "taxels", "unit", "samples", "rate [Hz]", "gaps", "repeats")
    print_table(
        header,
        [
            (name, m["sensor"], m["n_taxels"],
             f"{m['step']:g} {m['unit']}" if "step" in m else m["unit"],
             m["n_samples"], f"{m['rate']:.1f}", m["gaps"], m["repeats"])
            for name, m in modules.items()
        ],
    )  # fmt: skip
    print_line()
    faults = (", ".join(f"{x} {n}" for x, n in m["faults"].items()) for m in modules.values())
    print_table(
        ("module", *LABEL_HEADINGS, "drift [1/min]", "faults"),
        [
            (
                name,
                *_label_cells([m]),
                "-" if m["drift"] is None else f"{m['drift']:.3g}",
                text or "none",
            )
            for (name, m), text in zip(modules.items(), faults, strict=True)
        ],
    )


def _label_cells(modules: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the duration of the labels of each state, the mean over the modules."""
    return [f"{mean(m['labels'][state] for m in modules):.2f}" for state in LABELLED_STATES]


def print_folder(documents: list[dict[str, Any]]) -> None:
    """Print two tables: the labels of each recording, then its samples and findings."""
    readable = [document for document in documents if "error" not in document]
    if readable:
        print_table(
            ("labels of", *LABEL_HEADINGS),
            [(x["name"], *_label_cells([*x["modules"].values()])) for x in readable],
        )
        print_line()
    rows: list[tuple[object, ...]] = []
    for x in documents:
        if "error" in x:
            rows.append((x["name"], *5 * ("-",), "unreadable"))
            continue
        modules = list(x["modules"].values())
        rates = sorted(m["rate"] for m in modules if m["n_samples"])
        faults = sorted({fault for m in modules for fault in m["faults"]})
        kinds = dict.fromkeys(finding["kind"] for finding in x["findings"])
        findings = [kind for kind in kinds if kind not in ("no_labels", "gaps")]  # other columns
        rows.append(
            (
                x["name"],
                len(modules),
                sum(m["n_samples"] for m in modules),
                f"{rates[len(rates) // 2]:.1f}",  # the median of the modules
                f"{x['duration']:.2f}",
                sum(m["gaps"] for m in modules),
                ", ".join(([] if x["complete"] else ["cut off"]) + [*faults, *findings]) or "ok",
            )
        )
    print_table(
        ("recording", "modules", "samples", "rate [Hz]", "duration [s]", "gaps", "state"),
        rows,
    )


def _shorten(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else " ".join(str(value).split())
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[: MAX_VALUE_LENGTH - 3]}..."


def print_model(document: dict[str, Any], name: str) -> None:
    """Print what a model is for, how it decides, and what it was trained and tuned on."""
    print_table(("model", document["name"] or name), _rows(document))


def _rows(document: dict[str, Any]) -> Iterator[tuple[str, str]]:
    debounce, rate = document["debounce"], document["rate"]
    switching = debounce.get("switching", 0.0)
    yield "rate", "any" if rate is None else f"{rate:g} Hz"
    yield "tare", document["tare"]
    yield (
        "debouncing",
        f"hold {debounce['hold']:g} s, minimum {debounce['min_duration']:g} s, hysteresis "
        f"{debounce['hysteresis']:g}"
        + (f", filter for {switching:g} switches per second" if switching else ""),
    )
    for name, part in document["fingers"].items():
        finger = "any finger" if name == "*" else name
        sensor = f"{part['sensor']} ({part['unit']})" if part["sensor"] else "any"
        yield finger, f"sensor {sensor}; {_contact(part)}"
        stable_features = part["heads"]["stable"]["features"]
        is_own = bool(part["handling"])
        heads = (
            line for x in part["heads"].values() for line in _head_lines(x, stable_features, is_own)
        )
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


def _head_lines(head: dict[str, Any], stable_features: list[str], is_own: bool) -> Iterator[str]:
    """Yield what a head answers, from which features, and on what its threshold was chosen.

    Of features that `stable` has not, the first are named. Of a calibrated model, the lines of own
    handling have the one threshold that is used.
    """
    name, texts = head["name"], [head["rule"]]
    if "threshold" in head and not is_own:
        texts.append(_answer(name, "a probability of ", head["threshold"]))
    if name in ("slip", "slip_changes"):
        texts.append(f"smoothing {head['smoothing']:g} s, hold {head['hold']:g} s")
    if head["highest"] is not None:
        texts.append(f"speed and distance of slips, up to {head['highest']:.3g} mm/s")
    if head["classes"]:
        texts.append(", ".join(head["classes"]))
    yield f"{name}: {'; '.join(texts)}"
    added = [feature for feature in head["features"] if feature not in stable_features]
    yield f"  of them new {_few(added)}" if added else f"  features {_few(head['features'])}"
    if (choice := head["choice"]) is None:
        return
    names = choice["recordings"]
    origin = f"{len(names)} recordings ({_few(names)})" if names else "the training, out of fold"
    # A slip is scored within a shorter time than a state, and per time of one held finger.
    is_stable = name == "stable"
    events, time, within = ("events", "stable", 0.2) if is_stable else ("slips", "held", 0.1)
    share = "" if choice["found"] is None else f"; {choice['found']:.0f} % found within {within} s"
    yield (
        f"  threshold from {origin}: {choice['false_alarms_per_minute']:.2g} false alarms a minute "
        f"(at most {choice['requested']:g} wanted) in {choice['minutes']:.3g} min of {time} time; "
        f"{choice['n']} {events}{share}"
    )


def _answer(name: str, what: str, threshold: float) -> str:
    """Return from which threshold on a head answers yes."""
    if name != "stable" and threshold == 1:
        return "no slips until calibrated (holdfast calibrate)"
    return f"{ANSWERS[name]} from {what}{threshold:.3g} on"


def _handling_lines(part: dict[str, Any]) -> Iterator[str]:
    """Yield the own handling of a finger on each sensor."""
    if part["normalised"] and not part["handling"]:
        yield "features normalised by default handling (holdfast calibrate: by your own)"
    for sensor, handling in part["handling"].items():
        names = handling["recordings"]
        texts = [
            f"; {_answer(name, '', handling['thresholds'].get(name, head['threshold']))}"
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
