"""Make the tables and the picture of docs/study/twin.md; tables are printed as Markdown.

    python benchmarks/twin_figures.py make twin            simulate the recordings, with times
    python benchmarks/twin_figures.py count twin           number of recordings, and failed grasps
    python benchmarks/twin_figures.py labels twin          label conventions (reference)
    python benchmarks/twin_figures.py truth twin           weight, creep, time of slip (reference)
    python benchmarks/twin_figures.py objects FILE.png     picture of every object in the hand

`make` runs `holdfast simulate twin/NAME --profile finger-NAME --seed 0` for the three profiles of
holdfast 0.1, the same with the other objects to twin/others, and with seed 1 to twin/fresh.
`count`, `labels` and `truth` read these recordings. `holdfast study --twin` measures how well the
methods work on such recordings.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import HELD_PHASES, Cause, ContactState, Phase
from holdfast.io import load_dataset
from holdfast.metrics import Metrics
from holdfast.metrics.truth_labels import LabelRule, labels_from_truth
from holdfast.recordings import Label, Recording, Truth, labels_from_samples
from holdfast.training import Setting, train
from holdfast.twin.objects import OTHER_OBJECTS, load_objects, object_named
from holdfast.twin.simulation import Grasp, simulate

FOLDERS = {
    "gentle": ("--profile", "finger-gentle", "--seed", "0"),
    "reference": ("--profile", "finger-reference", "--seed", "0"),
    "vigorous": ("--profile", "finger-vigorous", "--seed", "0"),
    "others": ("--profile", "finger-reference", "--seed", "0", "--table", str(OTHER_OBJECTS)),
    "fresh": ("--profile", "finger-reference", "--seed", "1"),
}
"""Options of `holdfast simulate` for each folder."""
RATE = 150
"""Samples per second [Hz]."""
GRAVITY = 9.81
MIN_CREEP_SPEED = 1e-6
"""Minimum slip speed that counts as creep [m/s]."""
OLD_RULE = LabelRule(margin=0.1, glitch=None)
"""Label rule of the `finger-` profiles."""
MAX_SAMPLES = 20_000
"""Maximum number of training samples per finger (`--max-samples`)."""


def main() -> None:
    arguments = parse()
    arguments.run(arguments)


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    verbs = parser.add_subparsers(required=True)
    for run in (make, count, labels, truth, objects):
        verb = verbs.add_parser(run.__name__)
        verb.set_defaults(run=run)
        verb.add_argument("file" if run is objects else "folder", type=Path)
        if run in (make, labels):
            verb.add_argument("--jobs", type=int, default=2)
    return parser.parse_args()


# Functions for all tables


def load(folder: Path) -> list[Recording]:
    return list(load_dataset(folder))


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    print("| " + " | ".join(header) + " |")
    print("|" + "---|" * len(header))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print(flush=True)


def with_interval(value: float, interval: Sequence[float | None], digits: int = 1) -> str:
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
        wall = time.monotonic() - start
        seconds = sum(len(r.truth.times) for r in load(out)) / RATE
        rows.append((name, f"{seconds:,.0f}", f"{wall:.0f}", f"{seconds / wall:.1f}"))
    many = f"times real time, {arguments.jobs} processes"
    table(("folder", "simulated s", "wall s", many), rows)


def count(arguments: argparse.Namespace) -> None:
    recordings_of = {name: load(arguments.folder / name) for name in FOLDERS}
    table(
        ("folder", "recordings", "failed", "samples per finger", "samples of successful "
         "grasps", "simulated s", "empty hand, % of samples"),
        [count_row(name, recordings) for name, recordings in recordings_of.items()],
    )  # fmt: skip
    failed = [(n, r) for n, many in recordings_of.items() for r in many if has_failed(r)]
    table(
        ("folder", "failed", "lost, s after the lock", "last touch by the operator before, s after "
         "the lock"),
        [(name, r.name, *loss_times(r)) for name, r in failed],
    )  # fmt: skip


def count_row(name: str, recordings: Sequence[Recording]) -> tuple[object, ...]:
    n = np.array([len(recording.truth.times) for recording in recordings])
    failed = np.array([has_failed(recording) for recording in recordings])
    free = sum((recording.truth.hand["phase"] == Phase.FREE).sum() for recording in recordings)
    return (
        name,
        len(recordings),
        failed.sum(),
        f"{n.sum():,}",
        f"{n[~failed].sum():,}",
        f"{n.sum() / RATE:,.0f}",
        f"{100 * free / n.sum():.1f}",
    )


def has_failed(recording: Recording) -> bool:
    return recording.metadata["case"] == "failed"


def loss_times(recording: Recording) -> tuple[str, str]:
    """Return when the object was lost, and the last touch before, since the lock [s]."""
    facts, known = recording.metadata, recording.truth
    if facts["locked_at"] is None:
        return "never locked", ""
    outside = np.linalg.norm(known.hand["outside_force"], axis=1) > LabelRule().contact
    touched = known.times[outside & (known.times < facts["lost_at"])]
    lost_at, last = facts["lost_at"] - facts["locked_at"], touched.max() - facts["locked_at"]
    return f"{lost_at:.2f}", f"{last:.2f}"


def labels(arguments: argparse.Namespace) -> None:
    """Print metrics of the paper's classifier, trained and evaluated with one convention."""
    recordings = load(arguments.folder / "reference")
    conventions: dict[str, Callable[[Truth, str], tuple[Label, ...]]] = {
        "intervals, margin 0.1 s, merged below 0.35 s (the old profiles)": by_rule(OLD_RULE),
        "intervals, no margin": by_rule(replace(OLD_RULE, margin=0.0)),
        "intervals, no margin, glitches labelled (the new profiles)": by_rule(
            LabelRule(margin=0.0)
        ),
        "intervals, margin 0.25 s": by_rule(replace(OLD_RULE, margin=0.25)),
        "intervals, no margin, none merged": by_rule(replace(OLD_RULE, margin=0.0, merge=0.0)),
        "intervals, merged below 1 s": by_rule(replace(OLD_RULE, merge=1.0)),
        "sample by sample: outside force above 0.05 N, or slip": sample_wise,
        "only slip is unstable; a push without slip is stable": only_slip,
    }
    setting = Setting(trials=0, max_samples=MAX_SAMPLES)
    rows = []
    for name, convention in conventions.items():
        relabelled = [with_labels(recording, convention) for recording in recordings]
        metrics = train(relabelled, setting, n_jobs=arguments.jobs).cross_validation
        rows.append(figure_row(name, metrics))
    table(
        ("convention", "recordings", "accuracy %", "FDR %", "AUC", "AUC in contact",
         "labelled stable %"),
        rows,
    )  # fmt: skip


def figure_row(name: str, metrics: Metrics) -> tuple[object, ...]:
    pooled, intervals = metrics.pooled, metrics.intervals
    return (
        name,
        intervals.n_recordings,
        with_interval(pooled.accuracy, intervals.accuracy),
        with_interval(pooled.fdr, intervals.fdr),
        with_interval(pooled.auc, intervals.auc, 3),
        with_interval(pooled.auc_contact, intervals.auc_contact, 3),
        f"{stable_share(metrics):.1f}",
    )


def with_labels(
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
    held = np.isin(phase, HELD_PHASES)
    no_force = np.zeros_like(known.hand["outside_force"])
    hand = {"phase": np.where(held, Phase.LOCKED.value, phase), "outside_force": no_force}
    return labels_from_truth(Truth(known.times, hand, known.fingers), finger)


def sample_wise(known: Truth, finger: str) -> tuple[Label, ...]:
    arrays = known.fingers[finger]
    phase = known.hand["phase"]
    held = np.isin(phase, HELD_PHASES)
    touching = np.linalg.norm(arrays["contact_force"], axis=1) > LabelRule().contact
    disturbed = np.linalg.norm(known.hand["outside_force"], axis=1) > LabelRule().contact
    disturbed |= arrays["slip_speed"] > LabelRule().sliding
    states = [
        (ContactState.NO_CONTACT, None)
        if not touches
        else (ContactState.STABLE, None)
        if holds and not shaken
        else (ContactState.UNSTABLE, Cause.DISTURBANCE if holds else None)
        for touches, holds, shaken in zip(
            touching.tolist(), held.tolist(), disturbed.tolist(), strict=True
        )
    ]
    period = float(np.median(np.diff(known.times)))
    return labels_from_samples(known.times, states, period=period, evidence="truth")


def truth(arguments: argparse.Namespace) -> None:
    recordings = load(arguments.folder / "reference")
    held = [recording for recording in recordings if recording.metadata["case"] == "1"]
    weight_table(held)
    slide_table(held)
    slip_table()


def weight_table(recordings: Sequence[Recording]) -> None:
    """Print the forces on the object without outside force, from 1 s after the lock."""
    rows = []
    for name, item in load_objects().items():
        some = [
            hold_samples(recording)
            for recording in recordings
            if recording.metadata["object"] == name
        ]
        if not some:
            continue
        off = [100 * hold.off for hold in some]
        quiet = np.concatenate([hold.quiet for hold in some])
        every = np.linalg.norm(np.concatenate(off), axis=1)
        rows.append(
            (
                name,
                len(some),
                f"{item.mass * GRAVITY:.2f}",
                f"{max(np.linalg.norm(each.mean(axis=0)) for each in off):.2f}",
                f"{100 * quiet.mean():.0f}",
                f"{every[quiet].max():.2f}",
                f"{100 * (every < 2).mean():.1f}",
            )
        )
    table(
        (
            "object",
            "recordings",
            "weight N",
            "largest error of the mean of a hold, %",
            "samples without glitch in the last second, %",
            "largest error of these samples, %",
            "all samples: error below 2 %, %",
        ),
        rows,
    )


def slide_table(recordings: Sequence[Recording]) -> None:
    """Print slip of the same samples, with and without a glitch in the last second."""
    holds = [hold_samples(recording) for recording in recordings]
    off = np.linalg.norm(np.concatenate([hold.off for hold in holds]), axis=1)
    slip, since, quiet = (
        np.concatenate([getattr(hold, name) for hold in holds])
        for name in ("slip", "since", "quiet")
    )
    rows = []
    for name, some in (("no", quiet), ("yes", ~quiet)):
        creeps = some & (slip >= MIN_CREEP_SPEED)
        rows.append(
            (name, f"{some.sum():,}", (some & (off > 0.02)).sum(),
             f"{creeps.sum()} ({100 * creeps.sum() / some.sum():.2f} %)",
             (creeps & (since < 3)).sum(), (some & (slip > LabelRule().sliding)).sum(),
             f"{1e3 * slip[some].max():.1f}")
        )  # fmt: skip
    table(
        ("glitch in the last second", "samples", "error above 2 %", "slip of at least 0.001 "
         "mm/s", "of these within 3 s of the lock", "slip above 1 mm/s", "largest slip, "
         "mm/s"),
        rows,
    )  # fmt: skip


class Hold(NamedTuple):
    """Samples in which only the hand touches the object.

    Attributes:
        off: (n, 3) sum of the contact forces minus the weight, as a share of the weight.
        slip: (n,) largest slip speed of a finger [m/s].
        since: (n,) time since the lock [s].
        quiet: (n,) True without a wrong set-point in the last second.
    """

    off: np.ndarray
    slip: np.ndarray
    since: np.ndarray
    quiet: np.ndarray


def hold_samples(recording: Recording) -> Hold:
    """Return the samples from 1 s after the lock until the operator's hand returns (case 1)."""
    known = recording.truth
    outside = np.linalg.norm(known.hand["outside_force"], axis=1)
    since = known.times - recording.metadata["locked_at"]
    still = (known.hand["phase"] == Phase.LOCKED) & (outside == 0) & (since > 1.0)
    weight = recording.metadata["object_mass"] * GRAVITY
    total = sum(finger["contact_force"][still] for finger in known.fingers.values())
    slip = np.max([finger["slip_speed"][still] for finger in known.fingers.values()], axis=0)
    wrong = known.times[known.hand["set_point_error"] > 0]
    quiet = [not ((wrong > at - 1.0) & (wrong <= at)).any() for at in known.times[still]]
    return Hold((total - [0, 0, weight]) / weight, slip, since[still], np.array(quiet))


def slip_table() -> None:
    """Print when a smooth box in flat pads slips: like a block on a spring, when F = mu_s N."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    from tests.twin.grip import Grip
    from tests.twin.test_contact import flat_patch

    smooth = replace(object_named("box"), texture_amplitude=0.0)
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
        ("indentation mm", "push N/s", "friction limit N", "reached after s", "slip (above "
         "1 mm/s) later by ms", "samples"),
        rows,
    )  # fmt: skip


# Pictures

TILE = (480, 400)
CAMERA = ((0.074, 0.0, 0.010), 0.52, 165.0, -38.0)
"""Camera from which the thumb and the fingers are visible."""
FIELD_OF_VIEW = 25.0
"""Field of view [degrees]; a small one keeps vertical lines vertical."""


class _PictureTakenError(Exception):
    """Stops the simulation when the picture is taken."""


def objects(arguments: argparse.Namespace) -> None:
    from PIL import Image, ImageDraw, ImageFont

    names = list(load_objects())
    width, height = TILE
    sheet = Image.new("RGB", (3 * width, 2 * height), "white")
    font = ImageFont.load_default(20)
    draw = ImageDraw.Draw(sheet)
    for place, name in enumerate(names[:6]):
        left, top = place % 3 * width, place // 3 * height
        sheet.paste(Image.fromarray(held(name)), (left, top))
        text = f"{name}, {1e3 * object_named(name).mass:.0f} g"
        draw.text((left + 14, top + 10), text, fill="#222222", font=font)
    sheet.quantize(256, dither=Image.Dither.NONE).save(arguments.file, optimize=True)


def held(name: str) -> np.ndarray:
    """Return a picture of the object five seconds after the lock."""
    from holdfast.twin.render import Camera, Renderer

    taken = []
    locked = [0]

    def take(world, command) -> None:
        locked[0] += command.phase == Phase.LOCKED
        if locked[0] == 5 * 150:
            forces = np.column_stack([world.bodies[:-1, :3], world.contact.contact_force])
            model, data = world.hand.model, world.hand.data
            model.vis.global_.fovy = FIELD_OF_VIEW
            with Renderer(model, *TILE, Camera(*CAMERA)) as renderer:
                taken.append(renderer.picture(data, forces))
            raise _PictureTakenError

    try:
        simulate(Grasp(name, 1, 1), on_sample=take)
    except _PictureTakenError:
        return taken[0]
    raise SystemExit(f"{name} was not held for five seconds")


if __name__ == "__main__":
    main()
