"""Leave families of candidate features of slip out, or use one alone: twin, hands, real data.

    holdfast simulate train/ --seed 0
    holdfast simulate test/ --seed 1
    python benchmarks/slip_features.py train/ --test test/ --real "$HOLDFAST_DATA"

The candidates are computed here, not by the kernel, from turned taxel readings g_i with shares of
the load w_i. Lags are in seconds, and every change is in multiples of the noise of the sensor, so
that they need no unit. Squares of the standardised candidates are features, too: a very large
second difference is a glitch, not a slip. A logistic regression without class weights is fitted
to the first 0.1 s of slips. Each unit (object, or hand) of TRAIN is scored by a model without it,
and TEST by models without its objects. The threshold is chosen out of fold on TRAIN, at one false
alarm a minute of held time. Real recordings train nothing: AUC of slip against stable of the box
recordings that have slip, and of the sequences of the tugs.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from real_slips import TUG_QUIET, auc, boxes, tugs

from holdfast.classifiers.fitting import Samples
from holdfast.classifiers.linear import Linear
from holdfast.classifiers.logreg import LogisticRegression
from holdfast.contact import STABLE, Cause, ContactState
from holdfast.features.tare import Tare, baseline_of
from holdfast.io import load_dataset
from holdfast.metrics.slip_thresholds import (
    SLIP_THRESHOLDS,
    choose_threshold,
    slip_curve,
)
from holdfast.metrics.slip_truth import SLIDING, STILL, SlipDecisions, SlipTruth, slip_truth
from holdfast.metrics.slips import SlipCurve, SlipMetrics, slip_metrics
from holdfast.metrics.truth_labels import LabelRule, labels_by_truth
from holdfast.recordings import Recording, Tactile, label_states
from holdfast.sensors.types import Array, Flags
from holdfast.training.head_fits import SLIP_HOLD_TIME, SLIP_SMOOTHING
from holdfast.training.targets import EARLY_DURATION

LAG_SECONDS = (0.0067, 0.0267, 0.0533, 0.107, 0.213)
"""Lags of first differences [s]."""
SPACING_SECONDS = (0.0067, 0.0133, 0.0267)
"""Spacings of second differences [s]."""
AVERAGE_SECONDS = 0.03
"""Time constant of the averages of squared second differences [s]."""
PEAK_SECONDS = 5.0
"""Time constant with which the largest load and the largest friction ratio are forgotten [s]."""
NOISE_SECONDS = 0.2
"""Duration of a block over which the noise is measured [s]."""
MAX_DEVIATION = 5.0
"""Squares are of values of at most this many standard deviations."""
N_FOLDS = 5
FALSE_ALARMS = 1.0
STILL_STEP, QUIET_STEP = 2, 20
"""Only every so many samples of held contacts train that are disturbed or quiet."""
ALWAYS = "load"
FAMILIES = ("force", "ratio", "residual", "shear", "pressure", "second", "hand")


@dataclass(frozen=True)
class FingerRows:
    """Candidates of one finger of a recording, by name with the family before a colon."""

    unit: str
    times: Array
    columns: dict[str, Array]
    truth: SlipTruth | None


def taxel_sums(g: Array, shares: Array, tangent: Array, back: int, order: int, out: Array) -> None:
    """Fill (n, 5) sums over taxels of squares of differences of g.

    With d_i the first (or second) difference of g_i over `back` samples, and D their sum:
    sum |d_i|^2, n sum w_i |d_i|^2, sum |d_i - w_i D|^2, n max |d_i|^2 of taxels with more than
    their share of the load, sum max(d_i . t, 0).
    """
    d, (n, n_taxels, _) = g, g.shape
    for _ in range(order):
        d = d[back:] - d[:-back]
    w, t, sums = (values[n - len(d) :] for values in (shares, tangent, out))
    squares, whole = (d**2).sum(axis=2), d.sum(axis=1)
    # sum |d_i - w_i D|^2 = sum |d_i|^2 - 2 D . sum w_i d_i + |D|^2 sum w_i^2.
    cross = (np.einsum("ni,nia->na", w, d) * whole).sum(axis=1)
    sums[:, 0] = squares.sum(axis=1)
    sums[:, 1] = n_taxels * (w * squares).sum(axis=1)
    own = sums[:, 0] - 2 * cross + (whole**2).sum(axis=1) * (w**2).sum(axis=1)
    sums[:, 2] = np.maximum(own, 0)
    sums[:, 3] = n_taxels * np.where(w * n_taxels > 1, squares, 0).max(axis=1)
    sums[:, 4] = np.maximum(np.einsum("nia,na->ni", d, t), 0).sum(axis=1)


def mean_over(values: Array, seconds: float, rate: float) -> Array:
    """Return the exponential averages of values; each gap of unknown values starts it anew."""
    gain, last, out = -np.expm1(-1 / (rate * seconds)), math.nan, []
    for value in values.tolist():
        is_first = not (math.isfinite(value) and math.isfinite(last))
        last = value if is_first else last + gain * (value - last)
        out.append(last if math.isfinite(value) else math.nan)
    return np.array(out)


def peak_of(values: Array, rate: float) -> Array:
    """Return the largest value so far, which is slowly forgotten."""
    keep, peak, out = np.exp(-1 / (rate * PEAK_SECONDS)), 0.0, []
    for value in values.tolist():
        peak = max(value, keep * peak)
        out.append(peak)
    return np.array(out)


def lagged(values: Array, back: int) -> Array:
    """Return x(k) - x(k - back); the first samples look back to the start."""
    return values - values[np.maximum(np.arange(len(values)) - back, 0)]


def noise_of(readings: Array, rate: float, least: float) -> Array:
    """Return (n,) the noise: the least root mean square step of the blocks so far, causal."""
    steps = np.r_[0.0, (np.diff(readings.reshape(len(readings), -1), axis=0) ** 2).sum(axis=1)]
    size = max(5, round(NOISE_SECONDS * rate))
    blocks = [steps[max(a, 1) : a + size].mean() for a in range(0, len(steps) - size + 1, size)]
    lowest = np.minimum.accumulate(np.array(blocks or [steps.mean()]))
    place = np.clip(np.arange(len(steps)) // size - 1, 0, len(lowest) - 1)
    return np.sqrt(np.maximum(lowest[place] / 2, least**2))


def beyond(squares: Array, noise: Array, share: float) -> Array:
    """Return log sqrt(max(v^2 / noise^2 - share, 0) + share / 16): v beyond what noise gives."""
    return np.asarray(0.5 * np.log(np.maximum(squares / noise**2 - share, 0) + share / 16))


def candidates(module: Tactile, tare: Tare, rate: float) -> dict[str, Array]:
    """Return the candidates of one finger but those of the hand."""
    tip = module.sensor
    baseline, _ = baseline_of(module.readings, module.times, tare, 1 / rate)
    g = np.einsum("iab,nib->nia", tip.rotations, module.readings - baseline)
    force, normal = g.sum(axis=1), np.array(tip.normal, dtype=np.float64)
    least = (1 / np.sqrt(12) if tip.unit == "count" else 1e-6) * np.sqrt(3 * tip.n_taxels)
    taxel_noise, noise = noise_of(g, rate, least), noise_of(force, rate, least)
    # The reference, as in holdfast.features.motion: the sample of the least F . n so far.
    pressed = np.minimum(force @ normal, 0)
    lowest = np.minimum.accumulate(pressed)
    reference = np.maximum.accumulate(np.where(force @ normal <= lowest, np.arange(len(g)), -1))
    base = np.where(reference[:, None, None] < 0, 0, g[reference])
    h, load = g - base, force - base.sum(axis=1)
    along_normal = load @ normal
    scale = peak_of(np.linalg.norm(load, axis=1), rate) + 10 * noise
    pressure = np.abs(np.einsum("nia,ia->ni", h, tip.rotations[:, :, 2]))
    shares = pressure / np.maximum(pressure.sum(axis=1, keepdims=True), 1e-9)
    shear = load - along_normal[:, None] * normal
    size = np.linalg.norm(shear, axis=1)
    tangent = np.ascontiguousarray(shear / (size[:, None] + 1e-9))
    ratio = size / (np.abs(along_normal) + 10 * noise)
    places = tip.positions - tip.positions.mean(axis=0)
    places = places / max(np.sqrt((places**2).sum(axis=1).mean()), 1e-9)
    columns = {
        "load: to noise": np.log(scale / noise),
        "load: now": np.log(np.abs(along_normal) / scale + 0.02),
        "ratio: now": ratio,
        "ratio: to peak": ratio - np.r_[ratio[:1], peak_of(ratio, rate)[:-1]],
    }
    centre = shares @ places
    out = np.full((len(g), 5), np.nan)
    for seconds in LAG_SECONDS:
        back = max(1, round(seconds * rate))
        change = lagged(force, back)
        square = (change**2).sum(axis=1)
        taxel_sums(g, shares, tangent, back, 1, out)
        at_lag = f"{1e3 * seconds:.0f} ms"
        columns |= {
            f"force: change {at_lag}": beyond(square, noise, 2.0),
            f"force: along {at_lag}": (change * tangent).sum(axis=1) / scale,
            f"force: normal {at_lag}": change @ normal / scale,
            f"ratio: change {at_lag}": lagged(ratio, back),
            f"residual: {at_lag}": beyond(out[:, 2], taxel_noise, 2.0),
            f"shear: gained {at_lag}": out[:, 4] / scale,
            f"pressure: shift {at_lag}": np.log(
                np.linalg.norm(lagged(centre, back), axis=1) + 1e-2
            ),
        }
    for seconds in SPACING_SECONDS:
        back = max(1, round(seconds * rate))
        taxel_sums(g, shares, tangent, back, 2, out)
        for name, square in zip(("all", "shared", "own", "top"), out.T[:4].copy(), strict=True):
            at_lag = f"{name} {1e3 * seconds:.0f} ms"
            average = mean_over(square, AVERAGE_SECONDS, rate)
            columns[f"second: {at_lag}"] = beyond(square, taxel_noise, 6.0)
            columns[f"second: mean {at_lag}"] = beyond(average, taxel_noise, 6.0)
    return columns


OF_HAND = ("second: mean own 7 ms", "force: change 27 ms", "force: change 107 ms")


def fingers_of(recording: Recording, unit: str, tare: Tare) -> Iterator[FingerRows]:
    """Yield the candidates of the fingers of a recording."""
    rate = recording.rate
    modules = {n: m for n, m in recording.modules.items() if m.n_samples > 2 * rate * 0.25}
    found = {name: candidates(module, tare, rate) for name, module in modules.items()}
    expected = labels_by_truth(recording, LabelRule(margin=0)) if recording.truth else {}
    for name, module in modules.items():
        columns = dict(found[name])
        for of_hand in OF_HAND:
            others = [
                np.interp(module.times, modules[other].times, found[other][of_hand])
                for other in found
                if other != name
            ]
            columns[f"hand: {of_hand}"] = np.max(others, axis=0) if others else found[name][of_hand]
        labels = expected.get(name)
        quiet = None if labels is None else label_states(labels, module.times) == STABLE
        truth = slip_truth(recording, name, module.times, quiet)
        yield FingerRows(unit, module.times, columns, truth)


def used(names: Sequence[str], families: Sequence[str]) -> list[str]:
    return [name for name in names if name.split(":")[0] in (ALWAYS, *families)]


def training_rows(rows: FingerRows) -> tuple[Flags, Flags]:
    """Return the samples that slide, of the first 0.1 s of slips, and those that hold still."""
    truth = rows.truth
    if truth is None:
        return np.zeros(len(rows.times), bool), np.zeros(len(rows.times), bool)
    early, still = np.zeros(len(rows.times), bool), np.zeros(len(rows.times), bool)
    for slip in truth.slips:
        early |= (rows.times >= slip.onset) & (rows.times < slip.onset + EARLY_DURATION)
    holds = truth.codes == STILL
    still[np.flatnonzero(holds & truth.quiet)[::QUIET_STEP]] = True
    still[np.flatnonzero(holds & ~truth.quiet)[::STILL_STEP]] = True
    return early & (truth.codes == SLIDING), still


@dataclass(frozen=True)
class Fitted:
    """Classifier on chosen candidates and their squares."""

    names: tuple[str, ...]
    mean: Array
    scale: Array
    classifier: Linear

    def scores(self, rows: FingerRows) -> Array:
        """Return the smoothed log odds of each sample."""
        raw = _expand(np.stack([rows.columns[n] for n in self.names], 1), self.mean, self.scale)
        (weights,) = self.classifier.raw_weights()
        rate = 1 / np.median(np.diff(rows.times))
        return mean_over(raw @ weights[1:] + weights[0], SLIP_SMOOTHING, float(rate))

    def curve(self, rows: FingerRows) -> SlipCurve:
        """Return the counts of slips at all thresholds."""
        probability = 1 / (1 + np.exp(-self.scores(rows)))
        none = np.zeros(len(probability), bool)
        return slip_curve(SlipDecisions(rows.times, probability, none, SLIP_HOLD_TIME, rows.truth))


def _expand(raw: Array, mean: Array, scale: Array) -> Array:
    deviation = np.clip((raw - mean) / scale, -MAX_DEVIATION, MAX_DEVIATION)
    return np.concatenate([deviation, deviation**2], axis=1)


def fit(rows: Sequence[FingerRows], names: Sequence[str]) -> Fitted:
    """Fit the classifier to the training samples of fingers."""
    parts, slides = [], []
    for finger in rows:
        early, still = training_rows(finger)
        kept = early | still
        parts.append(np.stack([finger.columns[n][kept] for n in names], 1))
        slides.append(early[kept])
    raw, sliding = np.concatenate(parts), np.concatenate(slides)
    finite = np.isfinite(raw).all(axis=1)
    raw, sliding = raw[finite], sliding[finite]
    mean, scale = raw.mean(axis=0), raw.std(axis=0)
    scale[scale == 0] = 1.0
    samples = Samples(_expand(raw, mean, scale), sliding, np.zeros(len(raw), dtype=np.int64))
    fitted = LogisticRegression().fit(samples, {"C": 1.0, "class_weight": None}, 0)
    return Fitted(tuple(names), mean, scale, fitted.linear)


def simulated(
    train: Sequence[FingerRows], test: Sequence[FingerRows], names: Sequence[str]
) -> SlipMetrics:
    """Return the metrics of TEST (of TRAIN out of fold without it) by models without its unit."""
    units = sorted({rows.unit for rows in train})
    fold_of = {unit: place % N_FOLDS for place, unit in enumerate(units)}
    chosen, tested = [], []
    for fold in sorted(set(fold_of.values())):
        model = fit([rows for rows in train if fold_of[rows.unit] != fold], names)
        chosen += [model.curve(rows) for rows in train if fold_of[rows.unit] == fold]
        tested += [model.curve(rows) for rows in test if fold_of.get(rows.unit) == fold]
    place = choose_threshold(SlipCurve.total(chosen), FALSE_ALARMS)
    curve = SlipCurve.total(tested or chosen)
    return slip_metrics(curve[len(SLIP_THRESHOLDS) - 1 if place is None else place])


@dataclass(frozen=True)
class RealRows:
    """Candidates of the real recordings."""

    boxes: list[list[tuple[FingerRows, Flags, Flags]]]
    tugs: list[tuple[list[FingerRows], bool]]

    @classmethod
    def read(cls, data: Path) -> "RealRows":
        first, found = Tare.parse("first"), []
        for recording in boxes(data / "uskin_pick_move"):
            fingers = []
            rows = fingers_of(recording, recording.name, first)
            for finger, module in zip(rows, recording.modules.values(), strict=True):
                slips = tuple(label for label in module.labels if label.cause is Cause.SLIP)
                slid = label_states(slips, module.times) == ContactState.UNSTABLE.code
                held = label_states(module.labels, module.times) == ContactState.STABLE.code
                fingers.append((finger, slid, held))
            if any(slid.any() for _, slid, _ in fingers):
                found.append(fingers)
        sequences = [
            (list(fingers_of(recording, recording.name, first)), slipped)
            for recording, slipped in tugs(data / "eflesh_slip")
        ]
        return cls(found, sequences)

    def aucs(self, model: Fitted) -> list[float]:
        """Return the AUC of each box recording with slip, and that of the tugs."""
        figures = []
        for fingers in self.boxes:
            scored = [(model.scores(rows), slid, held) for rows, slid, held in fingers]
            slides = np.concatenate([scores[slid] for scores, slid, _ in scored])
            holds = np.concatenate([scores[held] for scores, _, held in scored])
            figures.append(auc(slides, holds))
        late = [
            np.nanmax([model.scores(r)[r.times > TUG_QUIET[1]] for r in rows])
            for rows, _ in self.tugs
        ]
        slipped, largest = np.array([slip for _, slip in self.tugs]), np.array(late)
        return [*figures, auc(largest[slipped], largest[~slipped])]


def read(folders: Sequence[Path], tare: Tare, unit: str) -> list[FingerRows]:
    return [
        rows
        for folder in folders
        for recording in load_dataset(folder)
        for rows in fingers_of(recording, str(recording.metadata.get(unit, recording.name)), tare)
        if rows.truth is not None
    ]


def print_row(title: str, n: int, metrics: SlipMetrics, real: Sequence[float]) -> None:
    cells = [
        f"{metrics.auc:.3f}",
        *(f"{metrics.incipient[limit]:.0f}" for limit in ("0.03", "0.05", "0.1")),
        f"{metrics.over_1mm['0.1']:.0f}",
        f"{metrics.before_1mm:.0f}",
        f"{metrics.gross['0.05']:.0f}",
        f"{metrics.false_alarms_per_minute['held']:.2f}",
        f"{metrics.raised_quiet:.2f}",
        *(f"{figure:.3f}" for figure in real),
    ]
    print(f"| {title} | {n} | {' | '.join(cells)} |", flush=True)


def main(options: argparse.Namespace) -> None:
    tare, unit = Tare.parse(options.tare), options.unit
    train, test = read(options.train, tare, unit), read(options.test, tare, unit)
    real = RealRows.read(options.real) if options.real else None
    names = list(train[0].columns)
    sets = {"all": FAMILIES}
    if not options.only_all:
        sets |= {f"without {f}": tuple(x for x in FAMILIES if x != f) for f in FAMILIES}
        sets |= {f"{f} alone": (f,) for f in FAMILIES}
    headings = "AUC | 30 ms | 50 | 100 | > 1 mm | before 1 mm | gross 50 ms | false/min | quiet %"
    print(f"| families | n | {headings}{' | box | box | tugs' if real else ''} |")
    print(f"|{'---|' * (14 if real else 11)}")
    for title, families in sets.items():
        chosen = used(names, families)
        metrics = simulated(train, test, chosen)
        figures = real.aucs(fit(train, chosen)) if real else []
        print_row(title, len(chosen), metrics, figures)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("train", type=Path, nargs="+")
    parser.add_argument("--test", type=Path, nargs="*", default=[])
    parser.add_argument("--real", type=Path)
    parser.add_argument("--tare", default="0.5", help="0.5, or first for hands")
    parser.add_argument("--unit", default="object", help="metadata left out together")
    parser.add_argument("--only-all", action="store_true")
    main(parser.parse_args())
