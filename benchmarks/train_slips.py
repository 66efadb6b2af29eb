"""Add a slip rule to a model, or the speed of slips: trained on true sliding.

    holdfast simulate twin/ --seed 0
    holdfast simulate slips/ --profile slips --cases 2 --repeats 4 --seed 0
    python benchmarks/train_slips.py builtin:twin twin/ slips/ --own-features \
        -o src/holdfast/models/twin.json
    holdfast simulate hands/ --randomize --measured scan,filter,noise,vibration \\
        --repeats 150 --grasps 3 --seed 0
    python benchmarks/train_slips.py any.json hands/ -o any.json
    python benchmarks/train_slips.py builtin:twin twin/ slips/ --only-speed \
        -o src/holdfast/models/twin.json

With --only-speed, the slip rule of the model gets a speed rule, and the model stays as it is.

The features and the classifier of stability stay. With --own-features, the rule gets the list
`SLIP_FEATURES` and squares; else it has the features of that classifier. It is fitted without a
fifth of the objects (or hands), five times; the threshold is the lowest with at most one false
alarm a minute of all held time in the decisions about what was left out. Below the metrics of all
recordings, by thresholds that were chosen without them, are those of each folder at the threshold
of the model. A model of normalised features gets a rule on them: those of a grasp are normalised by
the other grasps of the same hand. Nothing here reads a real recording.
"""

import argparse
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
from hand_handling import NORMALISED_BY, moments_by, read_grasp
from holdfast.classifiers.slip import SlipRule

from holdfast.features import FeatureSpec, Tare
from holdfast.features.specs import SLIP_FEATURES
from holdfast.io import load_dataset
from holdfast.metrics import score_recording
from holdfast.metrics.slips import SlipCurve, SlipMetrics, slip_metrics
from holdfast.model import Model
from holdfast.parallel import Engine
from holdfast.recordings import Recording
from holdfast.training.dataset_scan import scan_dataset, show_nothing
from holdfast.training.evaluation import compute_decisions
from holdfast.training.setting import Setting
from holdfast.training.slips import (
    SlipSamples,
    choose_slip_threshold,
    gather_slip_samples,
    with_slip_threshold,
)
from holdfast.training.splits import split_data
from holdfast.training.training_samples import SamplesPlan

N_FOLDS = 5


def main(options: argparse.Namespace) -> None:
    model, engine, out = Model.load(options.model), Engine(options.jobs), options.out
    if options.only_speed:
        add_speed(model, options, engine)
        return
    features = None
    if options.own_features:
        left_out = tuple(options.without)
        features = [x for x in SLIP_FEATURES if not any(text in str(x) for text in left_out)]
    recordings = [recording for folder in options.folders for recording in named(folder)]
    plan = plan_of(model, recordings, features or model.finger("*").features)
    samples = gather_slip_samples(recordings, plan, engine, show_nothing)["*"]
    if model.finger("*").normalised:
        samples = normalised_samples(model, samples, recordings, options.normalised_by)
    print(f"{len(recordings)} recordings, {samples.own.samples.stable.sum()} sliding samples")
    folds = folds_of_recordings(plan, recordings)
    units = plan.data_split.group_of
    held = [units[folds == fold].tolist() for fold in range(N_FOLDS)]
    models = [replaced(model, fitted(model, samples, left, features)) for left in held]
    calls = ((models[fold], item) for fold, item in zip(folds, recordings, strict=True))
    curves = list(engine.map_ordered(curves_of, calls))
    chosen = choose_slip_threshold(curves, folds.tolist(), seed=0)
    if chosen is None or chosen.place is None:
        raise SystemExit(chosen.reason if chosen else "no slips are known")
    print_metrics(chosen.metrics.pooled)
    for folder in options.folders:
        print_folder(folder.name, recordings, curves, chosen.place)
    complete = with_slip_threshold(replaced(model, fitted(model, samples, [], features)), chosen)
    print(msgspec.json.encode(complete.finger("*").slip.thresholds).decode())
    if out is not None:
        save(complete, recordings, out)


def add_speed(model: Model, options: argparse.Namespace, engine: Engine) -> None:
    """Write the model with a speed rule in its slip rule, and change nothing else."""
    part = model.finger("*")
    if part.slip is None:
        raise SystemExit(f"{options.model} has no slip rule; one expected, whose features it uses")
    recordings = [recording for folder in options.folders for recording in named(folder)]
    plan = plan_of(model, recordings, part.slip.used_features(part.features))
    samples = gather_slip_samples(recordings, plan, engine, show_nothing)["*"]
    rule = samples.with_speed(part.slip, [])
    if samples.speeds is None or rule == part.slip:
        raise SystemExit(
            f"too few samples whose true speed is known in {len(recordings)} recordings"
        )
    print(f"{samples.speeds.n_sliding} sliding samples of slips over 1 mm")
    if options.out is not None:
        named_model = msgspec.structs.replace(replaced(model, rule), name=options.out.stem)
        named_model.save(options.out, force=True)
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
    return SamplesPlan(scan, setting, split_data(scan.recordings, setting.split, 0))


def folds_of_recordings(plan: SamplesPlan, recordings: Sequence[Recording]) -> np.ndarray:
    """Return the fold of each recording; those of one object, or of one random hand, share it."""
    names = [str(unit) for unit in plan.data_split.group_of]
    if plan.scan.relative:
        names = [str(item.metadata.get("hand", item.name)) for item in recordings]
    places = {name: place for place, name in enumerate(dict.fromkeys(names))}
    return np.array([places[name] % N_FOLDS for name in names])


def normalised_samples(
    model: Model, samples: SlipSamples, recordings: Sequence[Recording], name: str
) -> SlipSamples:
    """Return the samples normalised by own handling, by its name; by default handling without."""
    grasps = [read_grasp(model, recording) for recording in recordings]
    default, own = model.finger("*").default_handling, samples.own
    moments = [moments or default for moments in moments_by(name, grasps)]
    locations, scales = (np.array(values)[own.recordings] for values in zip(*moments, strict=True))
    features = (own.samples.features - locations) / scales
    return replace(samples, own=replace(own, samples=own.samples._replace(features=features)))


def fitted(
    model: Model,
    samples: SlipSamples,
    held: Collection[int],
    features: Sequence[FeatureSpec] | None,
) -> SlipRule | None:
    """Return a rule fitted without held units, on the raw features.

    Of a model of normalised features, mean and scale of the rule are default handling.
    """
    rule, part = samples.fit(held, features), model.finger("*")
    if rule is None or not part.normalised:
        return rule
    linear = rule.classifier
    location, scale = part.default_handling
    weights = np.array(linear.coefficients) / np.array(linear.scale)
    classifier = msgspec.structs.replace(
        linear,
        mean=tuple(location.tolist()),
        scale=tuple(scale.tolist()),
        coefficients=tuple(weights.tolist()),
        intercept=linear.intercept - float(weights @ np.array(linear.mean)),
    )
    return msgspec.structs.replace(rule, classifier=classifier)


def replaced(model: Model, rule: SlipRule | None) -> Model:
    part = msgspec.structs.replace(model.finger("*"), slip=rule)
    return msgspec.structs.replace(model, fingers={"*": part})


def print_folder(
    folder: str,
    recordings: Sequence[Recording],
    curves: Sequence[Mapping[str, SlipCurve]],
    place: int,
) -> None:
    """Print the metrics out of fold of the recordings of one folder, at the chosen threshold."""
    own = [
        SlipCurve.total(list(fingers.values()))
        for item, fingers in zip(recordings, curves, strict=True)
        if fingers and item.name.startswith(f"{folder}/")
    ]
    print(folder)
    print_metrics(slip_metrics(SlipCurve.total(own)[place]))


def curves_of(model: Model, recording: Recording) -> Mapping[str, SlipCurve]:
    return score_recording(compute_decisions(model, recording), slip_curves=True).slip_curves


def print_metrics(metrics: SlipMetrics) -> None:
    print(msgspec.json.format(msgspec.json.encode(metrics)).decode())


def save(model: Model, recordings: Sequence[Recording], out: Path) -> None:
    """Write the model; its provenance names the recordings of the slip rule, too."""
    training = model.training
    if training is not None:
        known = set(training.recordings.values())
        added = {item.name: item.digest for item in recordings if item.digest not in known}
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
    parser.add_argument("--normalised-by", choices=NORMALISED_BY, default="others",
                        help="of a model of normalised features")  # fmt: skip
    parser.add_argument("--only-speed", action="store_true", help="add a speed rule, no more")
    main(parser.parse_args())
