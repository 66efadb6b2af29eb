"""Plan of a comparison of laws, and its tasks, whose results are stored."""

from dataclasses import dataclass
from functools import cache

from holdfast.detection import Detector, Model
from holdfast.errors import ModelError
from holdfast.sensors import sensor
from holdfast.twin.hand import FINGERS
from holdfast.twin.plant import MILD, plant_named
from holdfast_grip.laws import LAWS
from holdfast_lab.tasks import Task
from holdfast_lab.trial.course import TrialCourse, follow
from holdfast_lab.trial.reference_rows import REFERENCE_ROWS, row_named
from holdfast_lab.trial.run import TrialResult, run_trial
from holdfast_lab.trial.trials import draw_trial

ALL_ROWS = (*LAWS, *REFERENCE_ROWS)
"""Laws, and the rows beside them."""


@dataclass(frozen=True)
class TrialPlan:
    """Plan of a comparison of laws on the same trials.

    Attributes:
        laws: names of the laws.
        n: number of trials with each law.
        seed: seed of the trials.
        model: name or path of the detector's model.
        plant: name of the plant.
        n_impacts: number of impacts before the load of each trial.

    Raises:
        ValueError: a law or plant does not exist or is given twice, or a number is too small.
        ModelError: the model does not exist, or does not fit the hand of the twin.
    """

    laws: tuple[str, ...] = ALL_ROWS
    n: int = 240
    seed: int = 0
    model: str = "builtin:twin"
    plant: str = MILD
    n_impacts: int = 0

    def __post_init__(self) -> None:
        plant_named(self.plant)
        for name in self.laws:
            row_named(name)
        twice = [name for name in self.laws if self.laws.count(name) > 1]
        if twice:
            raise ValueError(f"the law {twice[0]!r} is given twice")
        if self.n < 1:
            raise ValueError(f"at least 1 trial expected, {self.n} given")
        if self.n_impacts < 0:
            raise ValueError(f"at least 0 impacts expected, {self.n_impacts} given")
        if self.seed < 0:
            raise ValueError(f"a seed of at least 0 expected, {self.seed} given")
        # Before hours of trials: the model has all fingers of the twin, and can be used live.
        model = Model.load(self.model)
        lacking = [finger for finger in FINGERS if not {finger, "*"} & set(model.fingers)]
        if lacking:
            raise ModelError(
                f"the trials need {', '.join(FINGERS)}; the model has no {', '.join(lacking)}, "
                f"only {', '.join(model.fingers)}"
            )
        Detector(model, dict.fromkeys(FINGERS, sensor("uskin-curved")))

    @property
    def model_digest(self) -> str:
        """Digest of the content of the model."""
        return Model.load(self.model).digest

    @property
    def _set(self) -> tuple[str, str, str, int]:
        """Settings that the tasks of all trials share."""
        return self.model, self.model_digest, self.plant, self.n_impacts

    def trial_task(self, number: int, law: str) -> Task:
        """Return the task of one trial with one law."""
        arguments = (self.seed, number, law, *self._set)
        return Task(f"trial/{number}/{law}", run_numbered, arguments, TrialResult)

    def course_task(self, number: int, law: str) -> Task:
        """Return the task of the course of one trial with one law."""
        arguments = (self.seed, number, law, *self._set)
        return Task(f"course/{number}/{law}", course_of, arguments, TrialCourse)


def run_numbered(
    seed: int,
    number: int,
    law: str,
    model: str,
    digest: str,
    plant: str = MILD,
    n_impacts: int = 0,
) -> TrialResult:
    """Run one trial of a set with a law.

    Args:
        seed: seed of the set.
        number: number of the trial.
        law: name of the law.
        model: name or path of the model.
        digest: digest of its content.
        plant: name of the plant.
        n_impacts: number of impacts before the load.

    Raises:
        ModelError: the model has another content.
    """
    _check_digest(model, digest)
    return run_trial(draw_trial(number, seed, plant, n_impacts), law, model)


def course_of(
    seed: int,
    number: int,
    law: str,
    model: str,
    digest: str,
    plant: str = MILD,
    n_impacts: int = 0,
) -> TrialCourse:
    """Return the course of one trial of a set, with the arguments of `run_numbered`."""
    _check_digest(model, digest)
    return TrialCourse.of(follow(draw_trial(number, seed, plant, n_impacts), law, model))


# Once in a process, because every trial asks for the same model.
@cache
def _check_digest(model: str, digest: str) -> None:
    if Model.load(model).digest != digest:
        raise ModelError(f"the model {model} has another content here: copy it to every worker")
