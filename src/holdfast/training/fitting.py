"""Fitting a model to training samples, with or without some units."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from holdfast.classifiers import Parameters
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
            if design.samples.one_class:
                n_stable = int(np.count_nonzero(design.samples.stable))
                raise TrainingError(
                    f"{finger}: {n_stable} samples labelled stable and "
                    f"{len(design.samples.stable) - n_stable} labelled not stable; both classes "
                    "are needed"
                )

    def not_judged(self) -> dict[str, list[str]]:
        """By finger: the units without which it has only one class left.

        Raises:
            TrainingError: that is so for all units of all fingers.
        """
        names = np.array(self.division.units)
        n = len(names)
        if not any(each.judged(n).any() for each in self.designs.values()):
            raise TrainingError(
                f"no finger has both classes left without one {self.division.split}: nothing "
                "would be judged out of fold"
            )
        left_out = {f: each.present(n) & ~each.judged(n) for f, each in self.designs.items()}
        return {finger: names[units].tolist() for finger, units in left_out.items() if units.any()}


def fit_model(
    material: Material,
    setting: Setting,
    parameters: Mapping[str, Parameters],
    held: Collection[int],
) -> Model | None:
    """A model from all but the held units; it says nothing of its origin yet.

    Returns:
        The model of the fingers that have both classes left; None where none has.
    """
    recordings = material.division.recordings_without(held)
    fingers = {}
    for finger, design in material.designs.items():
        samples = design.without(held)
        if samples.one_class:
            continue
        threshold = setting.contact_threshold
        fingers[finger] = FingerModel(
            features=setting.features,
            classifier=setting.recipe_of(finger).fit(samples, parameters[finger], setting.seed),
            sensor=design.sensor.name,
            contact_threshold=(
                design.contact_threshold(recordings) if threshold is None else threshold
            ),
        )
    if not fingers:
        return None
    return Model(
        fingers=fingers,
        rate=material.found.rate,
        sensors={d.sensor.name: d.sensor for d in material.designs.values()},
        window=setting.window,
        tare=str(setting.tare),
        debounce=setting.debounce,
    )


def fit_whole(material: Material, setting: Setting, parameters: Mapping[str, Parameters]) -> Model:
    """A model of all fingers from all samples.

    Raises:
        TrainingError: a finger has only one class.
    """
    material.check_classes()
    model = fit_model(material, setting, parameters, ())
    if model is None:
        raise TrainingError("no finger given; at least one expected")
    return model


def fit_all(recordings: Sequence[Recording], setting: Setting, parameters: Parameters) -> Model:
    """A model from all those recordings, with the same parameters for every finger.

    Raises:
        TrainingError: no labels, or only one class.
    """
    found = survey(recordings, setting.rate)
    division = divide(found.entries, "random", setting.seed)
    designs = gather(recordings, found, setting, division)
    material = Material(found, division, designs)
    return fit_whole(material, setting, dict.fromkeys(designs, parameters))
