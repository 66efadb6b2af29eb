"""What `teach` prints, beside what its model gives on the next grasps: seed by seed, by labels.

    python benchmarks/taught_labels.py OUT 1 2 3 [--labels camera no-slip truth] [--films]
    python benchmarks/taught_labels.py OUT                # the table alone

Each seed is one hand of the twin. It performs the grasps of the guided protocol, which are labelled
and taught as by `holdfast teach twin: --unattended`, and then others: of the profiles `reference`,
`slips`, and `coupled`, which has knocks. Without --films the pictures are left out: the stickers
have their true places, with the noise of those that are read from rendered films. The same grasps
teach by the camera's three kinds of time; with all that the camera does not see as no slip; and by
the truth. The rival is the change of the force over 8 samples, as in `any_slips.py`, with a
threshold by the same rule on the same guided grasps. OUT keeps grasps and results, so that the
same command goes on.
"""

import argparse
import json
import time
import zlib
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
from any_slips import curve, model_scores, over_lag, rival_scores, shares

from holdfast.contact import ContactState
from holdfast.detection import Model
from holdfast.io import load_recording, save_recording
from holdfast.labelling.rules import video
from holdfast.labelling.taught_grasps import label_grasp
from holdfast.live.teaching.steps import STEPS, Check
from holdfast.metrics.masks import runs
from holdfast.metrics.slip_curves import SLIP_THRESHOLDS, choose_threshold
from holdfast.metrics.slip_truth import SLIDING, STILL, slip_truth
from holdfast.metrics.slips import slip_metrics
from holdfast.recordings import Label
from holdfast.training.teaching import taught_recording, teach_with_report
from holdfast.twin import webcam
from holdfast.twin.objects import load_objects
from holdfast.twin.scripted import perform
from holdfast.twin.simulation import Grasp, simulate

WANTED = 1.5
EXTRA_SECONDS = 4.0
"""Time for which the twin holds longer than a step takes, as in `teach` [s]."""
FAST_NOISE = np.array([[0.014, 0.012, 0.007], [0.012, 0.015, 0.008]])
SLOW_NOISE = np.array([[0.05, 0.025, 0.015], [0.025, 0.02, 0.011]])
"""Standard deviations of the poses of stickers read from a film, from picture to picture and over
a second [pixels]: measured on two rendered films of seed 7201."""
PROFILES = {"reference": "next", "slips": "sliding", "coupled": "knocks"}
"""Names of the next grasps by profile."""
COLUMNS = ("next", "best", "sliding", "knocks")
FOUR = ("carry", "pull", "push", "touch")


def poses_of(recording):
    """Return the times of the pictures of a film, and the poses of its stickers with noise."""
    camera = webcam.Webcam()
    _, stickers, times = webcam._in_picture(recording, camera)
    shift, n = webcam.clock_shift(recording), int((times[-1] - times[0]) * camera.fps)
    taken = times[0] + shift + np.arange(n) / camera.fps
    middle = (np.array([camera.width, camera.height]) - 1) / 2
    sides = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    plane = np.linalg.pinv(np.column_stack([sides, np.ones(4)]))
    generator = np.random.default_rng(
        [recording.metadata["seed"], zlib.crc32(recording.name.encode())]
    )
    poses = {}
    for number, corners in stickers.items():
        flat = corners.reshape(len(corners), -1).T

        def at(when, flat=flat):
            return np.stack([np.interp(when, times, x) for x in flat], axis=1)

        middles = taken + camera.row_time * at(taken)[:, 1::2].mean(axis=1) / camera.height
        instants = [middles + camera.exposure * (k + 0.5) / 3 for k in range(3)]
        seen = np.mean([at(x) for x in instants], axis=0).reshape(-1, 4, 2)
        pose = np.einsum("pk,nkc->ncp", plane, seen)
        pose[:, :, 2] -= middle
        keeps, slow = np.exp(-1 / camera.fps), generator.normal(size=pose.shape)
        for k in range(1, n):
            slow[k] = keeps * slow[k - 1] + np.sqrt(1 - keeps**2) * slow[k]
        poses[number] = pose + FAST_NOISE * generator.normal(size=pose.shape) + SLOW_NOISE * slow
    return taken, np.full(n, 120.0), poses


def film(recording, path, films):
    """Write the film of a recording, or let its stickers be read without pictures."""
    if films:
        taken = webcam.film_stickers(recording, path)
    else:
        path.touch()
        taken, levels, poses = poses_of(recording)
        video.read_stickers = lambda *_: (np.arange(len(taken), dtype=float), levels, poses)
    lines = "".join(f"{x:.6f}\n" for x in taken + 0.04)
    path.with_suffix(".times").write_text(lines)


def guided(seed, folder, films, sensor):
    """Perform the grasps of the protocol, one that fails twice at most, and label them."""
    objects, number = list(load_objects(None)), 1
    for step in STEPS:
        for k in range(step.n_grasps):
            if step.check is Check.HEALTH:
                number += 1
                continue
            for _ in range(2):
                path = folder / f"{step.name}-{k + 1}.mcap"
                item = objects[number % len(objects)]
                grasp = Grasp(item, 1, number, seed=seed, sensor=sensor)
                made = perform(grasp, step.name, step.n_actions, step.seconds + EXTRA_SECONDS)
                made = replace(made, name=path.stem)
                path.with_suffix(".labels.json").unlink(missing_ok=True)
                save_recording(made, path, force=True)
                if step.in_view:
                    film(made, path.with_suffix(".mp4"), films)
                slides, note = label_grasp(path, step)
                number += 1
                if step.check is not Check.SLID or len(slides or ()) >= 2:
                    break
            print(seed, path.stem, len(slides or ()), "slides", note, flush=True)


def next_grasps(seed, folder, sensor):
    objects = list(load_objects(None))
    plan = [("reference", x) for x in objects]
    plan += [("slips", x) for x in objects[::3]] + [("coupled", x) for x in objects[1::3]]
    for profile, name in plan:
        path = folder / f"{PROFILES[profile]}_{name}.mcap"
        if path.exists():
            continue
        grasp = Grasp(name, 2, 1, profile, seed, sensor=sensor)
        made = simulate(grasp)
        if made.metadata["case"] == "failed":
            made = simulate(replace(grasp, attempt=1))
        save_recording(replace(made, name=path.stem), path)


def unknown_is_still(camera):
    """Return the labels of a camera with all held time outside its slips as no slip."""
    modules = {}
    for name, module in camera.modules.items():
        labels = ()
        if module.labels:
            codes = slip_truth(replace(camera, truth=None), name, module.times).codes
            unknown = ~np.isin(codes, (STILL, SLIDING)) & (codes >= 0)
            filled = [
                Label(
                    module.times[a], module.times[b - 1], "UNSTABLE", "disturbance", author="rule"
                )
                for a, b in runs(unknown)
                if b - a > 1
            ]
            kept = [x for x in module.labels if x.cause or x.state != ContactState.UNSTABLE]
            labels = tuple(sorted([*kept, *filled], key=lambda x: x.start))
        modules[name] = replace(module, labels=labels)
    return replace(camera, modules=modules)


RIVAL = rival_scores(over_lag)


def by_profile(fresh, scores, model):
    """Return the counts of other grasps at each threshold, by profile."""
    names = dict.fromkeys(recording.name.split("_")[0] for recording in fresh)
    return {
        name: curve([x for x in fresh if x.name.startswith(name)], scores, model, SLIP_THRESHOLDS)
        for name in names
    }


def at_threshold(totals, index):
    """Return the figures of each profile at a threshold, and at the best one of the test itself."""
    best = choose_threshold(totals["next"], WANTED)
    at = {name: shares(slip_metrics(total[index])) for name, total in totals.items()}
    return {
        "best": [None] * 4 if best is None else shares(slip_metrics(totals["next"][best])),
        **at,
    }


def result(recordings, fresh):
    """Return what teaching prints, and what its model gives on other grasps, by profile."""
    taught = teach_with_report(Model.load("builtin:any"), recordings, false_alarms=WANTED)
    model, pooled = taught.model, taught.slips.pooled
    index = int(np.argmin(np.abs(SLIP_THRESHOLDS - model.finger("index").slip.threshold)))
    totals = by_profile(fresh, model_scores, model)
    guided = [taught_recording(recording) for recording in recordings]
    own = curve(guided, RIVAL, model, SLIP_THRESHOLDS)
    choices = (choose_threshold(own, WANTED, counted_in) for counted_in in ("use", "held"))
    rival = next((choice for choice in choices if choice is not None), -1)
    metrics = slip_metrics(totals["next"][index])
    return {
        "slips": pooled.n, "minutes": pooled.held_minutes,
        "printed": [pooled.incipient["0.1"], pooled.false_alarms_per_minute["held"]],
        "interval": taught.slips.intervals.incipient["0.1"],
        "micro": 100 * (1 - metrics.n_over_1mm / metrics.n),
        **at_threshold(totals, index),
        "rival": at_threshold(by_profile(fresh, RIVAL, model), rival),
    }  # fmt: skip


def run(out, seed, kinds, films, sensor):
    """Yield the results of a seed that are not there."""
    folders = [out / str(seed) / name for name in ("guided", "next")]
    for folder, make in zip(
        folders,
        (lambda f: guided(seed, f, films, sensor), lambda f: next_grasps(seed, f, sensor)),
        strict=True,
    ):
        if not (folder / "complete").exists():
            folder.mkdir(parents=True, exist_ok=True)
            make(folder)
            (folder / "complete").touch()
    paths, others = (sorted(folder.glob("*.mcap")) for folder in folders)
    films = [load_recording(path) for path in paths]
    sets = {
        "camera": films,
        "four": [
            x for p, x in zip(paths, films, strict=True) if p.stem in {f"{n}-1" for n in FOUR}
        ],
        "no-slip": [unknown_is_still(x) for x in films],
        "truth": [load_recording(path, labels=False) for path in paths],
    }
    fresh = [load_recording(path) for path in others]
    for kind in kinds:
        began = time.process_time()
        try:
            found = result(sets[kind], fresh)
        except Exception as refusal:  # a table goes on
            found = {"refused": str(refusal)}
        yield {"seed": seed, "labels": kind, **found, "seconds": time.process_time() - began}


def cell(values):
    *found, rate = values
    shares = ", ".join("-" if x is None else f"{x:.0f}" for x in found)
    return shares if rate is None else f"{shares}; {rate:.2g}"


def show(rows):
    """Print a row for each model, and the means and ranges of each kind of labels.

    Of each column: found before 1 mm, within 0.05 s and within 0.1 s [%]; false alarms a minute.
    """
    rivals = [f"rival, {name}" for name in COLUMNS]
    print(f"| seed | labels | slips | printed (interval) | {' | '.join((*COLUMNS, *rivals))} |")
    kinds = defaultdict(list)
    for row in rows:
        cells = [row["seed"], row["labels"]]
        if "refused" in row:
            cells.append(row["refused"])
        else:
            kinds[row["labels"]].append(row)
            interval = cell([*row["interval"], None])
            cells += [row["slips"], f"{cell(row['printed'])} ({interval})"]
            cells += [cell(x[name]) for x in (row, row["rival"]) for name in COLUMNS]
        print(f"| {' | '.join(map(str, cells))} |")
    for kind, own in kinds.items():
        values = {name: np.array([row[name] for row in own], float)
                  for name in ("printed", *COLUMNS)}  # fmt: skip
        values |= {f"rival, {name}": np.array([row["rival"][name] for row in own], float)
                   for name in COLUMNS}  # fmt: skip
        for how in (np.nanmean, np.nanmin, np.nanmax):
            cells = [cell(how(x, axis=0)) for x in values.values()]
            print(f"| {how.__name__[3:]} | {kind} | | {' | '.join(cells)} |")
        _, _, true, rates = values["next"].T
        bias = values["printed"][:, 0] - true
        low, high = np.array([row["interval"] for row in own]).T
        inside = (low <= true) & (true <= high)
        print(
            f"{kind}: printed minus true {bias.mean():.1f} (deviation {bias.std():.0f}); the "
            f"interval, {np.mean(high - low):.0f} points wide, holds {inside.sum()} "
            f"of {len(own)}; {(rates < 2.5).sum()} have under 2.5 false alarms; up to 1 mm: "
            f"{np.mean([row['micro'] for row in own]):.0f} % of the slips"
        )


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("seeds", type=int, nargs="*")
    parser.add_argument("--labels", nargs="*", default=["camera"], help="none: grasps alone")
    parser.add_argument("--films", action="store_true")
    parser.add_argument("--sensor", default="uskin-curved", help="of every fingertip")
    options = parser.parse_args()
    results = options.out / "results.jsonl"
    rows = [json.loads(x) for x in results.read_text().splitlines()] if results.exists() else []
    for seed in options.seeds:
        done = {row["labels"] for row in rows if row["seed"] == seed}
        kinds = [x for x in options.labels if x not in done]
        for row in run(options.out, seed, kinds, options.films, options.sensor):
            rows.append(row)
            with results.open("a") as file:
                file.write(json.dumps(row) + "\n")
    show(rows)


if __name__ == "__main__":
    main()
