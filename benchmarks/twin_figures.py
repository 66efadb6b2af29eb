"""Every table and picture of docs/twin.md, as Markdown on stdout.

    python benchmarks/twin_figures.py make twin            recordings, time, failed grasps
    python benchmarks/twin_figures.py compare twin         profiles, splits, classifiers
    python benchmarks/twin_figures.py unseen twin          other objects, another hand, profiles
    python benchmarks/twin_figures.py detail twin          fingers, events, phases (reference)
    python benchmarks/twin_figures.py labels twin          label conventions (reference)
    python benchmarks/twin_figures.py features twin        without sigma, without F_tip (reference)
    python benchmarks/twin_figures.py noise                noise of the skin
    python benchmarks/twin_figures.py truth twin           weight, creep, moment of slip
    python benchmarks/twin_figures.py objects FILE.png     a picture of every grasp

`make` runs `holdfast simulate twin/PROFILE --profile PROFILE --seed 0`, the same with the other
objects to twin/others, and with seed 1 to twin/fresh; the others read what it made. All is out of
fold, `unseen` on recordings of which the model has seen none, with the reference setting
(`holdfast train --trials 0 --max-samples 20000`).
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from holdfast.contact import STABLE, UNKNOWN, Cause, ContactState, Phase
from holdfast.features import parse_features
from holdfast.io import load_dataset
from holdfast.metrics import Decisions, Metrics, bootstrap_interval, ratio_of_sums, summarise
from holdfast.parallel import each
from holdfast.recordings import Label, Recording, Truth, labels_from_samples
from holdfast.training import Setting, decisions_of, evaluate
from holdfast.training.design import gather
from holdfast.training.fitting import Material, fit_all, fit_model
from holdfast.training.judging import pick
from holdfast.training.splits import divide
from holdfast.training.survey import survey
from holdfast.twin.control import EVERY, draw_controller
from holdfast.twin.hand import TIMESTEP
from holdfast.twin.labels import LabelRule, labels_from_truth
from holdfast.twin.objects import OTHER_OBJECTS, load_things, thing
from holdfast.twin.simulation import LONGEST, Grasp, simulate
from holdfast.twin.uskin_parameters import UskinParameters

PROFILES = ("gentle", "reference", "vigorous")
FOLDERS = {
    **{profile: ("--profile", profile, "--seed", "0") for profile in PROFILES},
    "others": ("--profile", "reference", "--seed", "0", "--table", str(OTHER_OBJECTS)),
    "fresh": ("--profile", "reference", "--seed", "1"),
}
"""What each folder is made with."""
SPLITS = ("recording", "object", "random")
CLASSIFIERS = {"logreg": "LogReg", "svm": "SVM"}
PAPER = {"logreg": 95.3, "svm": 96.4}
"""Accuracy that the paper reports over a random split of its samples [%]."""
GRAVITY = 9.81
ATTEMPTS = 4
MAX_SAMPLES = 20_000
"""A finger to fit to, evenly spread (`--max-samples`); judged is every sample."""


def main() -> None:
    arguments = parse()
    arguments.run(arguments)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(required=True)
    for run, given in (
        (make, "folder"),
        (compare, "folder"),
        (unseen, "folder"),
        (detail, "folder"),
        (labels, "folder"),
        (features, "folder"),
        (noise, None),
        (truth, "folder"),
        (objects, "file"),
    ):
        verb = verbs.add_parser(run.__name__)
        verb.set_defaults(run=run)
        verb.add_argument("--jobs", type=int, default=2)
        if given:
            verb.add_argument(given, type=Path)
        if run is compare:
            verb.add_argument("--classifiers", default="logreg,svm")
            verb.add_argument("--profiles", default=",".join(PROFILES))
        if run is noise:
            verb.add_argument("--repeats", type=int, default=3)
    return parser.parse_args()


# What every table is made of


def out_of_fold(
    recordings: Sequence[Recording], setting: Setting, jobs: int = 1
) -> Iterator[Decisions]:
    """What models that have not seen a recording say of it, as `holdfast train` judges."""
    found = survey(recordings)
    division = divide(found.entries, setting.split, setting.seed)
    designs = gather(recordings, found, setting, division)
    material = Material(found, division, designs)
    parameters = {finger: setting.recipe_of(finger).reference for finger in designs}
    tasks = [(material, setting, parameters, {unit}) for unit in range(len(division.units))]
    models = list(each(fit_model, tasks, jobs))
    for place, recording in enumerate(recordings):
        if setting.split != "random":
            yield decisions_of(models[division.group_of[place]], recording)
            continue
        judged = [decisions_of(model, recording) for model in models]
        yield pick(judged, lambda n, at=place: division.units_of(at, n), len(designs))


def measured(recordings: Sequence[Recording], jobs: int = 1, **chosen: object) -> Metrics:
    setting = Setting(trials=0, max_samples=MAX_SAMPLES, **chosen)
    return summarise(out_of_fold(recordings, setting, jobs))


def load(folder: Path) -> list[Recording]:
    return list(load_dataset(folder))


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    print("| " + " | ".join(header) + " |")
    print("|" + "---|" * len(header))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print(flush=True)


def ranged(value: float | None, interval: Sequence[float | None] | None, digits: int = 1) -> str:
    if value is None:
        return "infinite"
    if interval is None:
        return f"{value:.{digits}f}"
    low, high = (("inf" if end is None else f"{end:.{digits}f}") for end in interval)
    return f"{value:.{digits}f} ({low} to {high})"


def stable_share(metrics: Metrics) -> float:
    (tn, fp), (fn, tp) = metrics.pooled.confusion
    return 100 * (fn + tp) / (tn + fp + fn + tp)


# The tables


def make(arguments: argparse.Namespace) -> None:
    rows = []
    for name, options in FOLDERS.items():
        out = arguments.folder / name
        command = [str(Path(sys.executable).with_name("holdfast")), "simulate", str(out)]
        start = time.monotonic()
        subprocess.run([*command, *options, "--jobs", str(arguments.jobs), "--force"], check=True)
        rows.append(made_row(name, out, time.monotonic() - start))
    table(
        ("folder", "recordings", "of them failed", "samples a finger", "of grasps that did not "
         "fail", "simulated s", "wall s", f"times real time, {arguments.jobs} processes"),
        rows,
    )  # fmt: skip


def made_row(name: str, folder: Path, wall: float) -> tuple[object, ...]:
    recordings = load(folder)
    n = np.array([len(recording.truth.times) for recording in recordings])
    failed = np.array([recording.metadata["case"] == "failed" for recording in recordings])
    seconds = n.sum() / 150
    names = ", ".join(r.name for r, bad in zip(recordings, failed, strict=True) if bad)
    print(f"{name}, failed: {names or 'none'}\n")
    return (
        name,
        len(recordings),
        int(failed.sum()),
        f"{n.sum():,}",
        f"{n[~failed].sum():,}",
        f"{seconds:,.0f}",
        f"{wall:.0f}",
        f"{seconds / wall:.1f}",
    )


def compare(arguments: argparse.Namespace) -> None:
    rows = []
    for profile in arguments.profiles.split(","):
        recordings = load(arguments.folder / profile)
        for classifier in arguments.classifiers.split(","):
            for split in SPLITS:
                start = time.monotonic()
                metrics = measured(recordings, arguments.jobs, split=split, classifier=classifier)
                took = time.monotonic() - start
                print(f"{profile} {classifier} {split}: {took:.0f} s", file=sys.stderr)
                rows.append(compare_row(profile, classifier, split, metrics))
    table(
        ("profile", "classifier", "split", "recordings", "accuracy %", "FDR %", "AUC", "AUC in "
         "contact", "labelled stable %", "paper's accuracy %"),
        rows,
    )  # fmt: skip


def compare_row(profile: str, classifier: str, split: str, metrics: Metrics) -> tuple[object, ...]:
    pooled, intervals = metrics.pooled, metrics.intervals
    return (
        profile,
        CLASSIFIERS[classifier],
        "random (leaky)" if split == "random" else split,
        intervals.n_recordings,
        ranged(pooled.accuracy, intervals.accuracy),
        ranged(pooled.fdr, intervals.fdr),
        ranged(pooled.auc, intervals.auc, 3),
        ranged(pooled.auc_contact, intervals.auc_contact, 3),
        f"{stable_share(metrics):.1f}",
        PAPER[classifier] if split == "random" else "",
    )


def unseen(arguments: argparse.Namespace) -> None:
    """A model of all of `reference` on what it has seen nothing of."""
    recordings = load(arguments.folder / "reference")
    rows = []
    for classifier, title in CLASSIFIERS.items():
        setting = Setting(classifier=classifier, trials=0, max_samples=MAX_SAMPLES)
        model = fit_all(recordings, setting, setting.recipe_of("index").reference)
        for name in FOLDERS:
            if name != "reference":
                metrics = evaluate(model, load(arguments.folder / name))
                missed = f"{metrics.pooled.fnr:.1f}"
                rows.append((title, *figure_row(name, metrics), missed))
    table(("classifier", "judged on", *FIGURES[1:], "missed stable (FNR) %"), rows)


def detail(arguments: argparse.Namespace) -> None:
    recordings = load(arguments.folder / "reference")
    for classifier, title in CLASSIFIERS.items():
        setting = Setting(classifier=classifier, trials=0, max_samples=MAX_SAMPLES)
        judged = list(out_of_fold(recordings, setting, arguments.jobs))
        metrics = summarise(judged)
        print(f"### {title}, split by recording, {len(judged)} recordings\n")
        finger_table(metrics)
        event_table(metrics)
        phase_table(recordings, judged)
        push_table(recordings, judged)
        case_table(recordings, judged)


def finger_table(metrics: Metrics) -> None:
    table(
        ("finger", "samples", "accuracy %", "FDR %", "missed stable (FNR) %", "AUC", "AUC in "
         "contact"),
        [
            (name, f"{m.n:,}", f"{m.accuracy:.1f}", f"{m.fdr:.1f}", f"{m.fnr:.1f}",
             f"{m.auc:.3f}", f"{m.auc_contact:.3f}")
            for name, m in metrics.fingers.items()
        ],
    )  # fmt: skip


def event_table(metrics: Metrics) -> None:
    hand, intervals = metrics.events.hand, metrics.intervals.hand
    rows = [("events (onsets of instability in a held contact)", hand.n_events)]
    rows += [
        (f"not told within {post} s, %", ranged(missed, intervals.missed[post]))
        for post, missed in hand.missed.items()
    ]
    rows += [
        ("median delay, s", ranged(hand.delay_median, intervals.delay_median, 3)),
        ("95th percentile of the delay, s", ranged(hand.delay_p95, intervals.delay_p95, 3)),
        (
            "false alarms per minute of stable hold",
            ranged(hand.false_alarms_per_minute, intervals.false_alarms_per_minute),
        ),
    ]
    table(("hand, by event", "value"), rows)


def phase_table(recordings: Sequence[Recording], judged: Sequence[Decisions]) -> None:
    """Errors by what the experiment was doing, pooled over fingers."""
    counts = np.array(
        [
            [phase_counts(recording, each, phase) for phase in Phase]
            for recording, each in zip(recordings, judged, strict=True)
        ]
    )
    errors = counts[:, :, 1].sum()
    rows = []
    for place, phase in enumerate(Phase):
        n, wrong, stable = counts[:, place].sum(axis=0)
        if not n:
            continue
        interval = bootstrap_interval(
            ratio_of_sums(100 * counts[:, place, 1], counts[:, place, 0]),
            n_recordings=len(recordings), n=1000, seed=0, level=0.95,
        )  # fmt: skip
        rows.append(
            (phase.value, f"{n:,}", f"{100 * stable / n:.1f}", ranged(100 * wrong / n, interval),
             f"{100 * wrong / errors:.1f}")
        )  # fmt: skip
    table(("phase", "samples", "labelled stable %", "errors %", "share of all errors %"), rows)


def phase_counts(recording: Recording, judged: Decisions, phase: Phase) -> tuple[int, int, int]:
    return counts_where(recording, judged, recording.truth.hand["phase"] == phase)


def counts_where(recording: Recording, judged: Decisions, where: np.ndarray) -> tuple[int, ...]:
    """Judged samples there, wrong ones, and those labelled stable, over all fingers."""
    total = np.zeros(3, dtype=np.int64)
    for finger in judged.fingers.values():
        at = np.searchsorted(recording.truth.times, finger.times + 1e-6) - 1
        known = (finger.labels != UNKNOWN) & (finger.states != UNKNOWN) & where[at]
        stable = finger.labels == STABLE
        wrong = stable != (finger.states == STABLE)
        total += [known.sum(), (known & wrong).sum(), (known & stable).sum()]
    return tuple(total.tolist())


def push_table(recordings: Sequence[Recording], judged: Sequence[Decisions]) -> None:
    """Within disturbances, while the pushing finger touches the object, and while it does not."""
    counts = np.zeros((2, 3), dtype=np.int64)
    n_disturbances = 0
    for recording, decisions in zip(recordings, judged, strict=True):
        hand = recording.truth.hand
        during = np.isin(hand["phase"], (Phase.DISTURBED, Phase.SLIPPING))
        pushed = np.linalg.norm(hand["outside_force"], axis=1) > LabelRule().contact
        for row, where in enumerate((during & pushed, during & ~pushed)):
            counts[row] += counts_where(recording, decisions, where)
        n_disturbances += int((during & ~np.append(False, during[:-1])).sum())
    table(
        ("in a disturbance", "samples", "errors %"),
        [
            (name, f"{n:,}", f"{100 * wrong / n:.1f}")
            for name, (n, wrong, _) in zip(
                ("the pushing finger touches", "it does not"), counts.tolist(), strict=True
            )
        ],
    )
    print(f"{n_disturbances} disturbances, each from its first touch to its last\n")


def case_table(recordings: Sequence[Recording], judged: Sequence[Decisions]) -> None:
    """The same by object and by case."""
    rows = []
    for key in ("case", "object"):
        for value in dict.fromkeys(recording.metadata[key] for recording in recordings):
            some = [
                each
                for recording, each in zip(recordings, judged, strict=True)
                if recording.metadata[key] == value
            ]
            metrics = summarise(some)
            interval = metrics.intervals.accuracy if metrics.intervals else None
            rows.append(
                (f"{key} {value}", len(some), ranged(metrics.pooled.accuracy, interval),
                 f"{stable_share(metrics):.1f}")
            )  # fmt: skip
    table(("only", "recordings", "accuracy %", "labelled stable %"), rows)


def labels(arguments: argparse.Namespace) -> None:
    recordings = load(arguments.folder / "reference")
    conventions: dict[str, Callable[[Truth, str], tuple[Label, ...]]] = {
        "intervals, margin 0.1 s, merged below 0.35 s (the default)": labels_from_truth,
        "intervals, no margin": by_rule(LabelRule(margin=0.0)),
        "intervals, margin 0.25 s": by_rule(LabelRule(margin=0.25)),
        "intervals, no margin, none merged": by_rule(LabelRule(margin=0.0, merge=0.0)),
        "intervals, merged below 1 s": by_rule(LabelRule(merge=1.0)),
        "sample by sample: an outside force over 0.05 N, or sliding": sample_wise,
        "only sliding counts, a push without it is stable": only_slip,
    }
    rows = []
    for name, convention in conventions.items():
        metrics = measured([relabelled(r, convention) for r in recordings], arguments.jobs)
        rows.append(figure_row(name, metrics))
    table(FIGURES, rows)


def features(arguments: argparse.Namespace) -> None:
    recordings = load(arguments.folder / "reference")
    rows = []
    for names in ("F_a,F_x,F_y,F_z,sigma", "F_a,F_x,F_y,F_z", "F_a,sigma", "F_a", "sigma"):
        metrics = measured(recordings, arguments.jobs, features=parse_features(names, 14))
        rows.append(figure_row(names.replace(",", ", "), metrics))
    table(FIGURES, rows)


FIGURES = (
    "", "recordings", "accuracy %", "FDR %", "AUC", "AUC in contact", "labelled stable %",
)  # fmt: skip


def figure_row(name: str, metrics: Metrics) -> tuple[object, ...]:
    pooled, intervals = metrics.pooled, metrics.intervals
    return (
        name,
        intervals.n_recordings,
        ranged(pooled.accuracy, intervals.accuracy),
        ranged(pooled.fdr, intervals.fdr),
        ranged(pooled.auc, intervals.auc, 3),
        ranged(pooled.auc_contact, intervals.auc_contact, 3),
        f"{stable_share(metrics):.1f}",
    )


def relabelled(
    recording: Recording, convention: Callable[[Truth, str], tuple[Label, ...]]
) -> Recording:
    modules = {
        finger: replace(module, labels=convention(recording.truth, finger))
        for finger, module in recording.modules.items()
    }
    return replace(recording, modules=modules)


def by_rule(rule: LabelRule) -> Callable[[Truth, str], tuple[Label, ...]]:
    return lambda known, finger: labels_from_truth(known, finger, rule)


def only_slip(known: Truth, finger: str) -> tuple[Label, ...]:
    phase = known.hand["phase"]
    held = np.isin(phase, (Phase.LOCKED, Phase.DISTURBED, Phase.SLIPPING))
    nobody = np.zeros_like(known.hand["outside_force"])
    hand = {"phase": np.where(held, Phase.LOCKED.value, phase), "outside_force": nobody}
    return labels_from_truth(Truth(known.times, hand, known.fingers), finger)


def sample_wise(known: Truth, finger: str) -> tuple[Label, ...]:
    arrays = known.fingers[finger]
    phase = known.hand["phase"]
    held = np.isin(phase, (Phase.LOCKED, Phase.DISTURBED, Phase.SLIPPING))
    touching = np.linalg.norm(arrays["contact_force"], axis=1) > LabelRule().contact
    troubled = np.linalg.norm(known.hand["outside_force"], axis=1) > LabelRule().contact
    troubled |= arrays["slip_speed"] > LabelRule().sliding
    states = [
        (ContactState.NO_CONTACT, None)
        if not touches
        else (ContactState.STABLE, None)
        if holds and not shaken
        else (ContactState.UNSTABLE, Cause.DISTURBANCE if holds else None)
        for touches, holds, shaken in zip(
            touching.tolist(), held.tolist(), troubled.tolist(), strict=True
        )
    ]
    period = float(np.median(np.diff(known.times)))
    return labels_from_samples(known.times, states, period=period, evidence="truth")


def noise(arguments: argparse.Namespace) -> None:
    rows = []
    for counts in (0.3, 0.9, 2.0, 4.0):
        tasks = [
            (Grasp(name, case, repeat + 1), counts)
            for name in load_things()
            for case in (1, 2)
            for repeat in range(arguments.repeats)
        ]
        made = [r for some in each(with_noise, tasks, arguments.jobs) for r in some]
        metrics = measured(made, arguments.jobs)
        newton = 1e3 * counts / UskinParameters().counts_per_newton[0]
        rest = np.median([r.truth.hand["phase"].size for r in made])
        print(f"{counts}: {len(made)} recordings, median {rest:.0f} samples", file=sys.stderr)
        rows.append(figure_row(f"{counts:g} counts rms ({newton:.2f} mN on x)", metrics))
    table(FIGURES, rows)


def with_noise(grasp: Grasp, counts: float) -> list[Recording]:
    """The grasp and its failed attempts, as `holdfast simulate` makes them."""
    made = []
    for attempt in range(ATTEMPTS):
        tried = replace(grasp, attempt=attempt)
        made.append(simulate(tried, UskinParameters(noise_counts=counts)))
        if made[-1].metadata["case"] != "failed":
            break
    return made


def truth(arguments: argparse.Namespace) -> None:
    weight_table(load(arguments.folder / "reference"))
    slip_table()


def weight_table(recordings: Sequence[Recording]) -> None:
    """Forces and sliding while nobody touches the object, from 1 s after the lock on."""
    rows = []
    for name, item in load_things().items():
        some = [r for r in recordings if r.metadata["object"] == name and r.metadata["case"] == "1"]
        forces, slips, calm = zip(*(alone(recording) for recording in some), strict=True)
        weight = item.mass * GRAVITY
        off = [100 * (force - [0, 0, weight]) / weight for force in forces]
        means = [np.linalg.norm(each.mean(axis=0)) for each in off]
        every = np.linalg.norm(np.concatenate(off), axis=1)
        slip, quiet = 1e3 * np.concatenate(slips), np.concatenate(calm)
        rows.append(
            (
                name,
                len(some),
                f"{weight:.2f}",
                f"{max(means):.2f}",
                f"{100 * quiet.mean():.0f}",
                f"{every[quiet].max():.2f}",
                f"{100 * (slip[quiet] < 1e-3).mean():.2f}",
                f"{slip[quiet].max():.2f}",
                f"{100 * (every < 2).mean():.1f}",
                f"{slip.max():.0f}",
            )
        )
    table(
        (
            "object",
            "recordings",
            "weight N",
            "mean of a hold off by at most %",
            "samples without glitch in the last second, %",
            "of these, a sample off by at most %",
            "of these, sliding under 0.001 mm/s, %",
            "of these, sliding at most mm/s",
            "of all, within 2 %, %",
            "of all, sliding at most mm/s",
        ),
        rows,
    )


def alone(recording: Recording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sum of the contact forces, largest slip speed, and whether no glitch was lately."""
    known = recording.truth
    outside = np.linalg.norm(known.hand["outside_force"], axis=1)
    still = (known.hand["phase"] == Phase.LOCKED) & (outside == 0)
    still &= known.times > recording.metadata["locked_at"] + 1.0
    total = sum(finger["contact_force"][still] for finger in known.fingers.values())
    slip = np.max([finger["slip_speed"][still] for finger in known.fingers.values()], axis=0)
    jumps = glitches(recording)
    times = known.times[still]
    calm = np.array([not ((jumps > at - 1.0) & (jumps < at + 0.01)).any() for at in times])
    return total, slip, calm


def glitches(recording: Recording) -> np.ndarray:
    """When the hand's set-points jump [s], drawn again from the recording's seed."""
    facts = recording.metadata
    names = ("object", "planned_case", "repeat", "profile", "seed", "attempt")
    period = EVERY * TIMESTEP
    drawn = draw_controller(Grasp(*(facts[n] for n in names)).generator("world"), LONGEST, period)
    return np.flatnonzero(drawn.errors.any(axis=1)) * period


def slip_table() -> None:
    """A flat pad that holds a smooth box is a block on a spring: it slips when F = mu_s N."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from tests.twin.grip import Grip
    from tests.twin.test_contact import flat_patch

    smooth = replace(thing("box"), texture_amplitude=0.0)
    rows = []
    for depth in (1e-3, 2e-3):
        for rate in (1.0, 5.0, 20.0):
            grip = Grip(smooth, depth, surface=flat_patch())
            for _ in range(1000):
                grip.step(spin=False)
            limit = smooth.mu_static * grip.state.load.sum() - grip.mass * GRAVITY
            start = grip.time
            while grip.state.slip_speed.max() < LabelRule().sliding:
                grip.step((0.0, 0.0, -rate * (grip.time - start)), spin=False)
            late = grip.time - start - limit / rate
            rows.append(
                (f"{1e3 * depth:g}", f"{rate:g}", f"{limit:.2f}", f"{limit / rate:.3f}",
                 f"{1e3 * late:.1f}", f"{150 * late:.2f}")
            )  # fmt: skip
    table(
        ("pressed in mm", "push grows N/s", "friction gives way at N", "after s", "it slips (over "
         "1 mm/s) later by ms", "samples"),
        rows,
    )  # fmt: skip


# Pictures

TILE = (480, 400)
CAMERA = ((0.074, 0.0, 0.010), 0.52, 165.0, -38.0)
"""Thumb and fingers are both seen."""
FIELD = 25.0
"""Of view [degrees]: a long lens keeps upright what is upright."""


class _EnoughError(Exception):
    """The picture is taken."""


def objects(arguments: argparse.Namespace) -> None:
    from PIL import Image, ImageDraw, ImageFont

    names = list(load_things())
    width, height = TILE
    sheet = Image.new("RGB", (3 * width, 2 * height), "white")
    font = ImageFont.load_default(20)
    draw = ImageDraw.Draw(sheet)
    for place, name in enumerate(names[:6]):
        left, top = place % 3 * width, place // 3 * height
        sheet.paste(Image.fromarray(held(name)), (left, top))
        text = f"{name}, {1e3 * thing(name).mass:.0f} g"
        draw.text((left + 14, top + 10), text, fill="#222222", font=font)
    sheet.quantize(256, dither=Image.Dither.NONE).save(arguments.file, optimize=True)


def held(name: str) -> np.ndarray:
    """The object five seconds after it was locked."""
    from holdfast.twin.render import Camera, render

    taken = []
    locked = [0]

    def watch(world, command) -> None:
        locked[0] += command.phase == Phase.LOCKED
        if locked[0] == 5 * 150:
            forces = np.column_stack([world.bodies[:-1, :3], world.contact.contact_force])
            model, data = world.hand.model, world.hand.data
            model.vis.global_.fovy = FIELD
            taken.append(render(model, data, *TILE, Camera(*CAMERA), forces))
            raise _EnoughError

    try:
        simulate(Grasp(name, 1, 1), watch=watch)
    except _EnoughError:
        return taken[0]
    raise SystemExit(f"{name} was not held for five seconds")


if __name__ == "__main__":
    main()
