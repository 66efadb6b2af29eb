"""Provenance of a model: its training recordings, parameters and metrics; adaptation warnings."""

from collections.abc import Collection, Iterator, Mapping
from importlib.metadata import version

from msgspec import UNSET

from holdfast.classifiers import Parameters
from holdfast.metrics import SampleMetrics
from holdfast.model import Model, Training
from holdfast.training.dataset_scan import DatasetScan
from holdfast.training.setting import Setting

FIGURES = ("accuracy", "fdr", "fnr", "auc_contact", "auc")
"""Metrics out of fold that a model file has."""


def training_record(
    setting: Setting,
    scan: DatasetScan,
    parameters: Mapping[str, Parameters],
    pooled: SampleMetrics,
    thinned: Mapping[str, tuple[int, int]],
) -> Training:
    """Return the provenance of a model, which its file contains.

    Args:
        setting: of the training.
        scan: of the training recordings.
        parameters: hyper-parameters of each finger's classifier.
        pooled: metrics out of fold, of all fingers and recordings.
        thinned: number of used and of all samples of each finger of which not all are used.
    """
    return Training(
        recordings=_digests(setting.init, scan),
        split=setting.split,
        parameters={finger: dict(found) for finger, found in parameters.items()},
        figures={name: getattr(pooled, name) for name in FIGURES},
        seed=setting.seed,
        samples=dict(thinned) or UNSET,
        versions={name: version(name) for name in ("holdfast", "numpy", "scikit-learn")},
    )


def adaptation_warnings(init: Model, scan: DatasetScan, fingers: Collection[str]) -> Iterator[str]:
    """Yield the reasons why the metrics of an adapted model may be wrong.

    Args:
        init: the model to adapt.
        scan: of the recordings that it is adapted to.
        fingers: names of the classifiers; `"*"` for one of all fingers.

    Raises:
        ModelError: the model to adapt lacks one of the fingers.
    """
    parts = {finger: init.finger(finger) for finger in fingers}
    name = init.name or "the model to adapt"
    fingers_of: dict[tuple[str, str], list[str]] = {}
    for finger, sensor in scan.sensors.items():
        part = parts.get(finger) or init.finger(finger)
        if part.sensor is not None and init.sensors[part.sensor] != sensor:
            expected, given = init.sensors[part.sensor], sensor
            pair = (f"{given.name} ({given.unit})", f"{expected.name} ({expected.unit})")
            fingers_of.setdefault(pair, []).append(finger)
    for (given_text, expected_text), names in fingers_of.items():
        yield (
            f"{', '.join(names)}: the sensor is {given_text}, {name} was trained on "
            f"{expected_text}; its features are used unchanged, its weights may not fit"
        )
    if known := known_recordings(init, scan):
        first = ", ".join(known[:3]) + (" ..." if len(known) > 3 else "")
        yield (
            f"{name} was trained on {len(known)} of these {len(scan.recordings)} recordings "
            f"({first}): the metrics on them are too good"
        )


def known_recordings(init: Model, scan: DatasetScan) -> list[str]:
    """Return the names of the recordings that the model to adapt was trained on."""
    digests = _training_recordings(init).values()
    return [recording.name for recording in scan.recordings if recording.digest in digests]


def _digests(init: Model | None, scan: DatasetScan) -> dict[str, str]:
    """Return the digest of each training recording, including those of the adapted model."""
    own = {recording.name: recording.digest for recording in scan.recordings}
    before = {} if init is None else _training_recordings(init)
    return {f"{name} (init)": digest for name, digest in before.items()} | own


def _training_recordings(model: Model) -> dict[str, str]:
    return {} if model.training is None else model.training.recordings
