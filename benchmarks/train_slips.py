"""Add a head of slips to a model, or the speed of slips: trained on true sliding.

    holdfast simulate twin/ --seed 0
    holdfast simulate slips/ --profile slips --cases 2 --repeats 4 --seed 0
    python benchmarks/train_slips.py builtin:twin twin/ slips/ --own-features \
        -o src/holdfast/models/twin.json
    python benchmarks/train_slips.py builtin:twin twin/ slips/ --only-speed \
        -o src/holdfast/models/twin.json

With --only-speed, the model gets a head of the speed, with the features of its head of slips, and
stays as it is.

The head of stability stays. With --own-features, that of slips gets the list `SLIP_FEATURES` and
squares; else it has the features of stability. It is fitted without a
fifth of the objects (or hands), five times; the threshold is the lowest with at most one false
alarm a minute of all held time in the decisions about what was left out. Below the metrics of all
recordings, by thresholds that were chosen without them, are those of each folder at the threshold
of the model. Nothing here reads a real recording. The heads of `builtin:any` are those of
`train_any_slips.py`.
"""

import argparse
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np

from holdfast.detection import FeatureSpec, Head, Model, Tare
from holdfast.detection.specs import SLIP_FEATURES
from holdfast.io import load_dataset
from holdfast.metrics import score_recording
from holdfast.metrics.slip_curves import SLIP_THRESHOLDS
from holdfast.metrics.slips import SlipCounts, SlipMetrics, slip_metrics
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.training.dataset_scan import scan_dataset
from holdfast.training.evaluation import compute_decisions
from holdfast.training.head_fits import fit_slip, fit_speed
from holdfast.training.setting import Setting
from holdfast.training.splits import split_data
from holdfast.training.targets import TargetSamples
from holdfast.training.thresholds import choose_slip_threshold, with_slip_threshold
from holdfast.training.training_samples import SamplesPlan, gather_samples

N_FOLDS = 5


def main(options: argparse.Namespace) -> None:
    model, engine, out = Model.load(options.model), Engine(options.jobs), options.out
    if options.only_speed:
        add_speed(model, options, engine)
        return
    features = model.finger("*").stable.features
    if options.own_features:
        left_out = tuple(options.without)
        features = tuple(x for x in SLIP_FEATURES if not any(text in str(x) for text in left_out))
    recordings = [recording for folder in options.folders for recording in named(folder)]
    plan = plan_of(model, recordings, features)
    gathered = gather_samples(recordings, plan, engine)
    samples = gathered.of("slip")["*"]
    speeds = gathered.of("slip_speed").get("*")
    print(f"{len(recordings)} recordings, {samples.n_positive} sliding samples")
    folds = folds_of_recordings(plan, recordings)
    units = plan.data_split.group_of
    held = [units[folds == fold].tolist() for fold in range(N_FOLDS)]
    squares = options.own_features
    models = [replaced(model, fitted(samples, speeds, left, features, squares)) for left in held]
    calls = ((models[fold], item) for fold, item in zip(folds, recordings, strict=True))
    curves = list(engine.map_ordered(curves_of, calls))
    chosen = choose_slip_threshold(curves, folds.tolist(), seed=0)
    if chosen.point is None:
        raise SystemExit(chosen.reason)
    index = SLIP_THRESHOLDS.tolist().index(chosen.point.threshold)
    print_metrics(chosen.metrics.pooled)
    for folder in options.folders:
        print_folder(folder.name, recordings, curves, index)
    complete = replaced(model, fitted(samples, speeds, [], features, squares))
    complete = with_slip_threshold(complete, chosen.point)
    print(msgspec.json.encode(complete.finger("*").slip.choice).decode())
    if out is not None:
        save(complete, recordings, out)


def add_speed(model: Model, options: argparse.Namespace, engine: Engine) -> None:
    """Write the model with a head of the speed, and change nothing else."""
    part = model.finger("*")
    if part.slip is None:
        raise SystemExit(f"{options.model} has no slip rule; one expected, whose features it uses")
    recordings = [recording for folder in options.folders for recording in named(folder)]
    plan = plan_of(model, recordings, part.slip.features)
    samples = gather_samples(recordings, plan, engine).of("slip_speed").get("*")
    head = samples and fit_speed(samples, [], part.slip.features)
    if not samples or not head:
        raise SystemExit(
            f"too few samples whose true speed is known in {len(recordings)} recordings"
        )
    print(f"{samples.n_positive} sliding samples of slips over 1 mm")
    if options.out is not None:
        complete = model.changed(lambda finger_model: finger_model.with_heads(head))
        msgspec.structs.replace(complete, name=options.out.stem).save(options.out, force=True)
        print(f"{options.out} written")


def named(folder: Path) -> list[Recording]:
    """Return the recordings of a folder, named so that two folders may have the same names."""
    return [replace(item, name=f"{folder.name}/{item.name}") for item in load_dataset(folder)]


def plan_of(
    model: Model, recordings: Sequence[Recording], features: Sequence[FeatureSpec]
) -> SamplesPlan:
    """Return what the samples depend on: the features, and the tare of the model."""
    relative = all(spec.seconds for spec in features)
    setting = Setting(
        features=tuple(features), window=model.window, tare=Tare.parse(model.tare), shared=True,
        split="recording" if relative else "object", hold=model.debounce.hold,
    )  # fmt: skip
    scan = scan_dataset(recordings, model.rate, relative=relative)
    data_split = split_data(scan.recordings, setting.split, 0)
    return SamplesPlan(scan, setting, data_split, setting.features)


def folds_of_recordings(plan: SamplesPlan, recordings: Sequence[Recording]) -> np.ndarray:
    """Return the fold of each recording; those of one object, or of one random hand, share it."""
    names = [str(unit) for unit in plan.data_split.group_of]
    if plan.scan.relative:
        names = [str(item.metadata.get("hand", item.name)) for item in recordings]
    indices = {name: index for index, name in enumerate(dict.fromkeys(names))}
    return np.array([indices[name] % N_FOLDS for name in names])


def fitted(
    samples: TargetSamples,
    speeds: TargetSamples | None,
    held: Collection[int],
    features: tuple[FeatureSpec, ...],
    squares: bool,
) -> list[Head]:
    """Return the heads of slips fitted without held units."""
    is_any = all(spec.seconds for spec in features)
    slip = fit_slip(samples, held, features, is_any=is_any, squares=squares)
    if slip is None:
        return []
    speed = fit_speed(speeds, held, features) if speeds and squares else None
    return [slip] if speed is None else [slip, speed]


def replaced(model: Model, heads: Sequence[Head]) -> Model:
    """Return the model with these heads of slips, and no others."""
    return model.changed(lambda part: part.without_heads("slip", "slip_speed").with_heads(*heads))


def print_folder(
    folder: str,
    recordings: Sequence[Recording],
    curves: Sequence[Mapping[str, SlipCounts]],
    index: int,
) -> None:
    """Print the metrics out of fold of the recordings of one folder, at the chosen threshold."""
    paths = [
        SlipCounts.total(fingers.values())
        for item, fingers in zip(recordings, curves, strict=True)
        if fingers and item.name.startswith(f"{folder}/")
    ]
    print(folder)
    print_metrics(slip_metrics(SlipCounts.total(paths)[index]))


def curves_of(model: Model, recording: Recording) -> Mapping[str, SlipCounts]:
    return score_recording(compute_decisions(model, recording), slip_curves=True).slip_curves


def print_metrics(metrics: SlipMetrics) -> None:
    print(msgspec.json.format(msgspec.json.encode(metrics)).decode())


def save(model: Model, recordings: Sequence[Recording], out: Path) -> None:
    """Write the model; its provenance names the recordings of the head of slips, too."""
    training = model.training
    if training is not None:
        known_digests = set(training.recordings.values())
        added = {item.name: item.digest for item in recordings if item.digest not in known_digests}
        digests = training.recordings | added
        training = msgspec.structs.replace(training, recordings=digests)
    msgspec.structs.replace(model, training=training, name=out.stem).save(out, force=True)
    print(f"{out} written")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("model")
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("-o", "--out", type=Path)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--own-features", action="store_true", help="SLIP_FEATURES, with squares")
    parser.add_argument("--without", nargs="*", default=[], metavar="TEXT",
                        help="leave out those of them whose names contain it")  # fmt: skip
    parser.add_argument("--only-speed", action="store_true", help="add the speed, no more")
    main(parser.parse_args())
