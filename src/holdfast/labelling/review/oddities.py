"""What is odd about the times and labels of a recording, and what to do about it."""

from itertools import combinations
from pathlib import Path

import numpy as np

from holdfast.labelling.review.findings import Finding, FindingKind
from holdfast.labelling.review.scan import FindingsScan
from holdfast.recordings import Tactile, shown_origin

MAX_RATE_RATIO = 5.0
"""Ratio of the rate of a module and that of its sensor from which on it is unlikely."""
MIN_CLOCK_DIFFERENCE = 1e-3
"""Smallest relative difference of the clocks of two modules that is reported."""
MAX_GAPS_SHOWN = 2
DRIFT_KEY = "clock_drift"
"""Field of the metadata of a bag: how much faster the bag's clock runs than the device's."""
_ORDER: tuple[FindingKind, ...] = (
    "dead", "copy", "invalid", "stuck", "unlikely_rate", "unit", "starts_loaded", "axes", "gaps",
    "cross_talk", "clock_drift", "constant", "hidden_labels", "rate", "one_taxel", "no_contact",
    "no_labels",
)  # fmt: skip


def with_oddities(findings: list[Finding], scan: FindingsScan, path: Path) -> list[Finding]:
    """Return findings with what is odd about times and labels, the most important first.

    Args:
        findings: of the readings.
        scan: of the recording.
        path: of the recording, for the commands.
    """
    found = [*findings]
    modules = {name: one.force for name, one in scan.modules.items() if one.force.n_samples > 1}
    for name, module in modules.items():
        nominal = scan.modules[name].sensor.rate
        ratio = max(module.rate / nominal, nominal / module.rate)
        if ratio > MAX_RATE_RATIO:
            text = f"{module.rate:.4g} Hz where the sensor has {nominal:g}: if the times have "
            text += "another unit, import with --columns time=COLUMN:ms (or s, us, ns)"
            found.append(Finding(name, "unlikely_rate", text))
        if module.n_gaps:
            found.append(Finding(name, "gaps", _gaps(module, shown_origin(scan.recording.start))))
    found += _drifts(modules, scan.recording.metadata.get(DRIFT_KEY))
    if modules and not any(one.labels for one in scan.modules.values()):
        text = f"no labels: draw them with holdfast label {path.name}"
        found.append(Finding("", "no_labels", text))
    return sorted(found, key=lambda finding: _ORDER.index(finding.kind))


def _gaps(module: Tactile, origin: float) -> str:
    """Return how many gaps a module has, with the longest ones in the order of time."""
    steps = np.diff(module.times)
    places = np.sort(np.argsort(-steps)[: min(module.n_gaps, MAX_GAPS_SHOWN)])
    shown = ", ".join(f"{steps[k]:.3g} s at {module.times[k] - origin:.2f} s" for k in places)
    first = "the longest " if module.n_gaps > MAX_GAPS_SHOWN else ""
    text = f"{module.n_gaps} gap{'s' if module.n_gaps > 1 else ''}: {first}{shown}; features begin "
    return text + "anew after each: look for lost packets (holdfast doctor SOURCE)"


def _drifts(modules: dict[str, Tactile], of_bag: object) -> list[Finding]:
    """Return findings about clocks of modules that run at different speeds."""
    found = []
    if isinstance(of_bag, float):
        text = f"the bag's clock gains {6e4 * of_bag:+.3g} ms a minute on that of the device: "
        found.append(Finding("", "clock_drift", text + "do not join its times with other topics"))
    for (first, one), (second, other) in combinations(modules.items(), 2):
        lengths = np.array([module.times[-1] - module.times[0] for module in (one, other)])
        drift = lengths[1] / lengths[0] - 1
        # Only modules that have lost nothing last equally long by the same clock.
        is_whole = one.n_samples == other.n_samples and not one.n_gaps + other.n_gaps
        if is_whole and abs(drift) >= MIN_CLOCK_DIFFERENCE:
            text = f"as many samples as {first} in {lengths[1]:.5g} s, where that has "
            text += f"{lengths[0]:.5g} s: one of their clocks drifts"
            return [*found, Finding(second, "clock_drift", text)]
    return found
