"""Findings about a recording that matter before it is labelled or trained on.

`with_oddities` adds what is odd about its times and labels, and what to do about it.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import combinations
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from holdfast.contact import MAX_TAXELS
from holdfast.detection import EXACT_RATE, RELATIVE_RATES
from holdfast.errors import HoldfastError
from holdfast.io.label_files import decode_labels, label_bytes, labels_path
from holdfast.labelling.review.scan import FindingsScan, ModuleScan
from holdfast.labelling.rules.forces import evidence_of_contact, hand_force
from holdfast.labelling.server.workspace import summary_of
from holdfast.metrics.masks import runs
from holdfast.recordings import Recording, Tactile, shown_origin

CONSTANT_SECONDS = 0.5
"""Shortest stretch without any change of the readings that is reported [s]."""
AXES = "xyz"
INVALID_SHARE = 0.002
"""Share of samples with an invalid reading above which a person should see it."""

FindingKind = Literal[
    "constant",
    "dead",
    "axes",
    "unit",
    "sentinel",
    "zeros",
    "unsigned",
    "wraps",
    "gravity",
    "angle",
    "norm",
    "turned",
    "one_taxel",
    "many_taxels",
    "rate",
    "starts_loaded",
    "no_contact",
    "hidden_labels",
    "unlikely_rate",
    "gaps",
    "clock_drift",
    "no_labels",
    "copy",
    "held",
    "invalid",
    "stuck",
]


class Finding(NamedTuple):
    """A property of a recording that a person should see.

    Attributes:
        module: name of the module; empty for the whole recording.
        kind: what was found.
        text: what was found, and what follows from it, in one line.
    """

    module: str
    kind: FindingKind
    text: str


def findings_of(recording: Recording) -> list[Finding]:
    """Return the findings about the readings of a recording, module by module.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> findings_of(synthetic_recording("made", seed=0))
        []
    """
    scan = FindingsScan()
    scan.add(recording)
    return findings_of_scan(scan)


def findings_of_scan(scan: FindingsScan) -> list[Finding]:
    """Return the findings of a recording that came in parts, as `findings_of`."""
    findings = [
        Finding(name, kind, text)
        for name, module in scan.modules.items()
        if module.force.n_samples > 1
        for kind, text in _of_module(module)
    ]
    forces = {n: m.force.readings for n, m in scan.modules.items() if not m.still.all()}
    for (first, force), (second, other) in combinations(forces.items(), 2):
        if np.array_equal(force, other):
            text = f"has the same readings as {first}: one sensor is read twice, or written to "
            findings.append(Finding(second, "copy", text + "both; check the channels"))
    if reason := evidence_of_contact(scan.recording):
        text = f"begins in contact ({reason}): the first samples are load (`holdfast detect "
        text += "--in-contact`); or z of the sensor points inwards (docs/sensors.md)"
        return [*findings, Finding("", "starts_loaded", text)]
    with suppress(HoldfastError):  # no sample for the tare
        if not hand_force(scan.recording).n_touching.any():
            text = "no finger is in contact in the whole recording"
            findings.append(Finding("", "no_contact", text))
    return findings


def faulty_readings(
    name: str, n_invalid: int, n_samples: int, stuck: Sequence[int]
) -> list[Finding]:
    """Return findings about taxels of a module whose readings cannot be true.

    Args:
        name: of the module.
        n_invalid: number of samples with the fault `invalid`; a few are none.
        n_samples: number of samples.
        stuck: numbers of the taxels with the fault `stuck`, from 1.
    """
    findings = []
    if n_invalid > INVALID_SHARE * n_samples:
        text = f"{n_invalid} samples ({100 * n_invalid / n_samples:.2g} %) have a reading that "
        text += "cannot be true, of one taxel, which is left out: is a magnetometer read before it "
        findings.append(Finding(name, "invalid", text + "is ready, or a byte lost?"))
    if stuck:
        taxels = f"taxel{'s' if len(stuck) > 1 else ''} {', '.join(map(str, stuck))}"
        text = f"no change of {taxels}, or of one axis, from some time on: left out since"
        findings.append(Finding(name, "stuck", text))
    return findings


def hidden_labels(path: Path) -> Finding | None:
    """Return a finding if labels of a rule hide labels inside a recording; else None.

    Args:
        path: of the recording.

    Raises:
        RecordingError: the recording or its label file cannot be read.
    """
    beside, data = labels_path(path), label_bytes(path)
    if data is None:
        return None
    file = decode_labels(data, beside)
    authors = [file.author, *(x.author for labels in file.modules.values() for x in labels)]
    rule = next((author for author in authors if author.startswith("rule:")), None)
    if rule is None or not (n_inside := summary_of(path).n_inside):
        return None
    text = f"{beside.name} has labels of {rule}, which outrank the {n_inside} labels that came "
    return Finding("", "hidden_labels", text + "with the recording; delete it to use those")


def report_hidden_labels(paths: Sequence[Path], report: Callable[[str], None]) -> None:
    """Report in one line how many recordings have labels of a rule that hide labels inside.

    Recordings that cannot be read are left out.

    Args:
        paths: of the recordings.
        report: receives the line; it is not called if there are no such recordings.
    """
    hidden = []
    for path in paths:
        with suppress(HoldfastError):
            hidden += [path.stem] if hidden_labels(path) is not None else []
    if hidden:
        report(
            f"labels of a rule outrank the labels that came with {len(hidden)} of {len(paths)} "
            f"recordings ({hidden[0]}{', ...' if len(hidden) > 1 else ''}); delete their "
            ".labels.json files to use those"
        )


def _of_module(module: ModuleScan) -> Iterator[tuple[FindingKind, str]]:
    low, high = RELATIVE_RATES
    rate = module.force.rate / module.rows_per_update
    if module.rows_per_update > 1:
        text = f"each reading comes in {module.rows_per_update:.3g} rows of "
        text += f"{module.force.rate:.4g} Hz: the true updates are used, {rate:.4g} Hz"
        yield "held", text
    if not low * (1 - EXACT_RATE) <= rate <= high * (1 + EXACT_RATE):
        yield "rate", f"{rate:.4g} Hz; builtin:any needs {low:g} to {high:g} Hz"
    if module.sensor.n_taxels == 1:
        yield "one_taxel", "one taxel: taxels cannot be compared, only its force is judged"
    if module.sensor.n_taxels > MAX_TAXELS:
        text = f"{module.sensor.n_taxels} taxels; a detector takes at most {MAX_TAXELS}, so no "
        yield "many_taxels", text + "faults are looked for"
    still = [axis for axis, is_still in zip(AXES, module.still, strict=True) if is_still]
    if len(still) == len(AXES):
        if not module.sensor.rests_at_zero or module.lowest != 0 or module.highest != 0:
            yield "dead", "the readings never change: the sensor is dead or disconnected"
        return
    if still:
        yield "axes", f"readings along {' and '.join(still)} never change; 3 axes are expected"
    times = module.force.times
    stretches = [(times[first], times[last]) for first, last in runs(module.repeats)]
    long = [(start, end) for start, end in stretches if end - start >= CONSTANT_SECONDS]
    if long:
        total = sum(end - start for start, end in long)
        text = f"no reading changes for {total:.2f} s in all, in stretches of {CONSTANT_SECONDS} s "
        text += f"or more, the first from {long[0][0]:.2f} to {long[0][1]:.2f} s"
        if long[0][0] <= times[0]:  # the threshold of contact comes from the noise of the tare
            text += ": the tare shows no noise; give train a --contact-threshold"
        yield "constant", text
    for finding in module.layout:
        yield finding.kind, finding.advice


MAX_RATE_RATIO = 5.0
"""A rate of a module is unlikely from this multiple of its sensor's rate on."""
MIN_CLOCK_DIFFERENCE = 1e-3
"""Smallest relative difference of the clocks of two modules that is reported."""
MAX_GAPS_SHOWN = 2
DRIFT_KEY = "clock_drift"
"""Field of the metadata of a bag: how much faster the bag's clock runs than the device's."""
_ORDER: tuple[FindingKind, ...] = (
    "dead", "copy", "invalid", "stuck", "unlikely_rate", "unit", "sentinel", "zeros", "unsigned",
    "wraps", "gravity", "angle", "norm", "turned", "starts_loaded", "axes", "gaps",
    "clock_drift", "constant", "hidden_labels", "held", "rate", "one_taxel", "many_taxels",
    "no_contact", "no_labels",
)  # fmt: skip


def with_oddities(findings: list[Finding], scan: FindingsScan, path: Path) -> list[Finding]:
    """Return findings with what is odd about times and labels, the most important first.

    Args:
        findings: of the readings.
        scan: of the recording.
        path: of the recording, for the commands.
    """
    all_findings = [*findings]
    modules = {name: x.force for name, x in scan.modules.items() if x.force.n_samples > 1}
    for name, module in modules.items():
        nominal = scan.modules[name].sensor.rate
        ratio = max(module.rate / nominal, nominal / module.rate)
        if ratio > MAX_RATE_RATIO:
            text = f"{module.rate:.4g} Hz where the sensor has {nominal:g}: if the times have "
            text += "another unit, import with --columns time=COLUMN:ms (or s, us, ns)"
            all_findings.append(Finding(name, "unlikely_rate", text))
        if module.n_gaps:
            all_findings.append(
                Finding(name, "gaps", _gaps(module, shown_origin(scan.recording.start)))
            )
    all_findings += _drifts(modules, scan.recording.metadata.get(DRIFT_KEY))
    if modules and not any(x.labels for x in scan.modules.values()):
        text = f"no labels: draw them with holdfast label {path.name}"
        all_findings.append(Finding("", "no_labels", text))
    return sorted(all_findings, key=lambda finding: _ORDER.index(finding.kind))


def _gaps(module: Tactile, origin: float) -> str:
    """Return how many gaps a module has, with the longest ones in the order of time."""
    steps = np.diff(module.times)
    indices = np.sort(np.argsort(-steps)[: min(module.n_gaps, MAX_GAPS_SHOWN)])
    shown = ", ".join(f"{steps[k]:.3g} s at {module.times[k] - origin:.2f} s" for k in indices)
    first = "the longest " if module.n_gaps > MAX_GAPS_SHOWN else ""
    text = f"{module.n_gaps} gap{'s' if module.n_gaps > 1 else ''}: {first}{shown}; features begin "
    return text + "again after each: look for lost packets (holdfast doctor SOURCE)"


def _drifts(modules: dict[str, Tactile], of_bag: object) -> list[Finding]:
    """Return findings about clocks of modules that run at different speeds."""
    drifts = []
    if isinstance(of_bag, float):
        text = f"the bag's clock gains {6e4 * of_bag:+.3g} ms a minute on that of the device: "
        drifts.append(Finding("", "clock_drift", text + "do not join its times with other topics"))
    for (first, base), (second, other) in combinations(modules.items(), 2):
        lengths = np.array([module.times[-1] - module.times[0] for module in (base, other)])
        drift = lengths[1] / lengths[0] - 1
        # Only modules that have lost nothing last equally long by the same clock.
        is_whole = base.n_samples == other.n_samples and not base.n_gaps + other.n_gaps
        if is_whole and abs(drift) >= MIN_CLOCK_DIFFERENCE:
            text = f"as many samples as {first} in {lengths[1]:.5g} s, where that has "
            text += f"{lengths[0]:.5g} s: one of their clocks drifts"
            return [*drifts, Finding(second, "clock_drift", text)]
    return drifts
