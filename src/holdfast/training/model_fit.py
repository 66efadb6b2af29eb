"""Fit of a model to training samples, with or without some units, and its provenance."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from typing import Self

import numpy as np
from msgspec import UNSET

from holdfast.detection import FeatureSpec, FingerModel, Head, Model, Training
from holdfast.errors import DISTRIBUTION, TrainingError
from holdfast.metrics import SampleMetrics
from holdfast.recordings import Recording
from holdfast.training.classifiers.fitting import Parameters
from holdfast.training.dataset_scan import DatasetScan, scan_dataset
from holdfast.training.finger_samples import FingerSamples
from holdfast.training.head_fits import fit_cause, fit_slip, fit_speed
from holdfast.training.setting import Setting
from holdfast.training.splits import DataSplit, split_data
from holdfast.training.training_samples import HeadSamples, SamplesPlan, gather_samples

FIGURES = ("accuracy", "fdr", "fnr", "auc_contact", "auc")
"""Metrics out of fold that a model file has."""


@dataclass(frozen=True)
class TrainingData:
    """Samples of a dataset, and its split.

    Attributes:
        scan: of the dataset.
        data_split: of the dataset into units.
        samples: training samples of each head.
        slip_features: of the heads of a slip.
        slip_squares: whether they have squares.
    """

    scan: DatasetScan
    data_split: DataSplit
    samples: HeadSamples
    slip_features: tuple[FeatureSpec, ...] = ()
    slip_squares: bool = False

    @classmethod
    def of(cls, recordings: Sequence[Recording], setting: Setting) -> Self:
        """Read the samples of recordings, one after the other in this process.

        Raises:
            TrainingError: the recordings have no labels, or cannot be split.
        """
        scan = scan_dataset(recordings, setting.rate, relative=setting.relative)
        data_split = split_data(scan.recordings, setting.split, setting.seed)
        plan = SamplesPlan(scan, setting, data_split, only_stable=True)
        return cls(scan, data_split, gather_samples(recordings, plan))

    @property
    def fingers(self) -> Mapping[str, FingerSamples]:
        """Training samples of the heads of stability."""
        return self.samples.stable

    @property
    def thinned(self) -> dict[str, tuple[int, int]]:
        """Number of used and of all labelled samples, by finger, where some are left out."""
        counts = {f: (len(pool.units), pool.n_usable) for f, pool in self.fingers.items()}
        return {finger: (used, n) for finger, (used, n) in counts.items() if used < n}

    def check_classes(self) -> None:
        """Check that the samples of every finger have both classes.

        Raises:
            TrainingError: a finger has only one class.
        """
        for finger, pool in self.fingers.items():
            if pool.samples.one_class:
                n_stable = int(np.count_nonzero(pool.samples.positive))
                raise TrainingError(
                    f"{finger}: {n_stable} samples labelled stable and "
                    f"{len(pool.samples.positive) - n_stable} labelled not stable; both classes "
                    "are needed"
                )

    def units_without_model(self) -> dict[str, list[str]]:
        """Return, by finger, the units without which only one class is left.

        A finger cannot be evaluated on them, for no model can be fitted without them.

        Raises:
            TrainingError: that is so for all units of all fingers.
        """
        names = np.array(self.data_split.units)
        n = len(names)
        if not any(pool.can_evaluate(n).any() for pool in self.fingers.values()):
            raise TrainingError(
                "no finger has both classes in the training samples when one "
                f"{self.data_split.split} is held out: cross-validation is not possible"
            )
        skipped = {f: pool.present(n) & ~pool.can_evaluate(n) for f, pool in self.fingers.items()}
        return {finger: names[units].tolist() for finger, units in skipped.items() if units.any()}


def fit_model(
    data: TrainingData,
    setting: Setting,
    parameters: Mapping[str, Parameters],
    left_out: Collection[int],
) -> Model | None:
    """Fit a model to all samples that are in no unit that is left out. It has no provenance yet.

    Args:
        data: to fit.
        setting: of the training.
        parameters: of each finger's classifier.
        left_out: units that are left out.

    Returns:
        The model of all fingers that have both classes left; None if there is no such finger.
    """
    recordings = data.data_split.recordings_without(left_out)
    fingers = {}
    for finger, pool in data.fingers.items():
        samples = pool.without(left_out)
        if samples.one_class:
            continue
        threshold = setting.contact_threshold
        rule, limit = setting.recipe_of(finger).fit(samples, parameters[finger], setting.seed)
        stable = Head(
            name="stable", link="logit", features=setting.features, rule=rule, threshold=limit
        )
        heads = [stable]
        slips, speeds, causes = (
            data.samples.of(head).get(finger) for head in ("slip", "slip_speed", "cause")
        )
        features, squares = data.slip_features, data.slip_squares
        if slips and (
            slip := fit_slip(slips, left_out, features, is_any=setting.relative, squares=squares)
        ):
            heads.append(slip)
            # The speed is a sum of squares too, and an answer only while `slip` reports one.
            if speeds and squares and (speed := fit_speed(speeds, left_out, features)):
                heads.append(speed)
        # No metric out of fold counts causes, so only the final model has them.
        if causes and not left_out and (cause := fit_cause(causes, left_out, setting.features)):
            heads.append(cause)
        fingers[finger] = FingerModel(
            heads=tuple(heads),
            sensor=None if pool.sensor is None else pool.sensor.name,
            contact_threshold=(
                pool.contact_threshold(recordings) if threshold is None else threshold
            ),
            contact_load=setting.contact_load_of(finger),
        )
    if not fingers:
        return None
    return Model(
        fingers=fingers,
        rate=data.scan.model_rate,
        sensors={pool.sensor.name: pool.sensor for pool in data.fingers.values() if pool.sensor},
        window=setting.window,
        tare=str(setting.used_tare),
        debounce=setting.debounce,
    )


def fit_full_model(
    data: TrainingData, setting: Setting, parameters: Mapping[str, Parameters]
) -> Model:
    """Fit a model of all fingers to all samples.

    Raises:
        TrainingError: a finger has only one class.
    """
    data.check_classes()
    model = fit_model(data, setting, parameters, ())
    if model is None:
        raise TrainingError("no finger given; at least one expected")
    return model


def fit_recordings(
    recordings: Sequence[Recording], setting: Setting, parameters: Parameters
) -> Model:
    """Fit a model to recordings, with the same parameters for every finger.

    Raises:
        TrainingError: the recordings have no labels, or only one class.
    """
    # Nothing is held out; the random split asks for no second recording and no object's name.
    data = TrainingData.of(recordings, replace(setting, split="random"))
    return fit_full_model(data, setting, dict.fromkeys(data.fingers, parameters))


def training_record(
    setting: Setting,
    scan: DatasetScan,
    parameters: Mapping[str, Parameters],
    pooled: SampleMetrics,
    thinned: Mapping[str, tuple[int, int]],
    sliding: Mapping[str, int],
) -> Training:
    """Return the provenance of a model, which its file contains.

    Args:
        setting: of the training.
        scan: of the training recordings.
        parameters: hyper-parameters of each finger's classifier.
        pooled: metrics out of fold, of all fingers and recordings.
        thinned: number of used and of all samples of each finger of which not all are used.
        sliding: number of sliding samples of each slip rule.
    """
    init = None if setting.init is None else setting.init.training
    before = {} if init is None else init.recordings
    return Training(
        recordings={f"{name} (init)": digest for name, digest in before.items()}
        | {recording.name: recording.readings_digest for recording in scan.recordings},
        split=setting.split,
        parameters={finger: dict(chosen) for finger, chosen in parameters.items()},
        figures={name: getattr(pooled, name) for name in FIGURES},
        seed=setting.seed,
        samples=dict(thinned) or UNSET,
        sliding_samples=dict(sliding) or UNSET,
        versions={name: version(name) for name in (DISTRIBUTION, "numpy", "scikit-learn")},
        blocks=UNSET if init is None else init.blocks,
    )
