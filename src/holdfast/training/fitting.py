"""Fitting a model to training samples, with or without some units."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from holdfast.classifiers import Parameters, Samples
from holdfast.errors import TrainingError
from holdfast.model import FingerModel, Model
from holdfast.recordings import Recording
from holdfast.training.design import FingerDesign, gather
from holdfast.training.setting import Setting
from holdfast.training.splits import Division, divide
from holdfast.training.survey import Survey, survey


@dataclass(frozen=True)
class Material:
    """All that fitting needs of a dataset.

    Attributes:
        found: by the survey.
        division: into units.
        designs: the training samples of each finger.
    """

    found: Survey
    division: Division
    designs: Mapping[str, FingerDesign]

    def check_classes(self) -> None:
        """Does nothing where every finger has both classes.

        Raises:
            TrainingError: a finger has one.
        """
        for finger, design in self.designs.items():
            _check_classes(finger, design.samples, "")


def fit_model(
    material: Material,
    setting: Setting,
    parameters: Mapping[str, Parameters],
    held: Collection[int],
) -> Model:
    """A model from all but the held units; it says nothing of its origin yet.

    Raises:
        TrainingError: a finger has only one class left.
    """
    division = material.division
    names = ", ".join(division.units[unit] for unit in held)
    fingers = {}
    for finger, design in material.designs.items():
        samples = design.without(held)
        _check_classes(finger, samples, f" without {names}" if names else "")
        threshold = design.contact_threshold(division.recordings_without(held))
        asked = setting.contact_threshold
        fingers[finger] = FingerModel(
            features=setting.features,
            classifier=setting.recipe.fit(samples, parameters[finger], setting.seed),
            sensor=design.sensor.name,
            contact_threshold=threshold if asked is None else asked,
        )
    sensors = [design.sensor for design in material.designs.values()]
    return Model(
        fingers=fingers,
        rate=material.found.rate,
        sensors={sensor.name: sensor for sensor in sensors},
        window=setting.window,
        tare=str(setting.tare),
    )


def fit_all(recordings: Sequence[Recording], setting: Setting, parameters: Parameters) -> Model:
    """A model from all those recordings, with the same parameters for every finger.

    Raises:
        TrainingError: no labels, or only one class.
    """
    found = survey(recordings)
    division = divide(found.entries, "random", setting.seed)
    designs = gather(recordings, found, setting, division)
    material = Material(found, division, designs)
    return fit_model(material, setting, dict.fromkeys(designs, parameters), frozenset())


def _check_classes(finger: str, samples: Samples, situation: str) -> None:
    if samples.one_class:
        n_stable = int(np.count_nonzero(samples.stable))
        raise TrainingError(
            f"{finger}{situation}: {n_stable} samples labelled stable and "
            f"{len(samples.stable) - n_stable} labelled not stable; both classes are needed"
        )
