"""Plan of a comparison of laws, and its tasks, whose results are stored."""

from dataclasses import dataclass
from functools import cache
from hashlib import sha256

import msgspec

from holdfast.detector import Detector
from holdfast.errors import ModelError
from holdfast.model import Model
from holdfast.sensors import sensor
from holdfast.twin.hand import FINGERS
from holdfast.twin.plant import MILD, plant_named
from holdfast_grip import laws
from holdfast_grip.laws import LAWS
from holdfast_lab.source_digest import source_digest
from holdfast_lab.tasks import Task
from holdfast_lab.trial.course import TrialCourse, follow
from holdfast_lab.trial.film import film
from holdfast_lab.trial.reference_rows import REFERENCE_ROWS, row_named
from holdfast_lab.trial.run import TrialResult, run_trial
from holdfast_lab.trial.trials import draw_trial

SIMULATION = ("holdfast_lab.trial.run", "holdfast_lab.trial.trials")
"""Modules that draw and run a trial."""
COURSE = (*SIMULATION, "holdfast_lab.trial.course")
FILM = (*COURSE, "holdfast_lab.trial.film")
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
        """What the tasks of all trials share."""
        return self.model, self.model_digest, self.plant, self.n_impacts

    def trial_task(self, number: int, law: str) -> Task:
        """Return the task of one trial with one law."""
        version = law_version(law, SIMULATION)
        arguments = (self.seed, number, law, *self._set)
        return Task(f"trial/{number}/{law}", run_numbered, arguments, TrialResult, version=version)

    def course_task(self, number: int, law: str) -> Task:
        """Return the task of the course of one trial with one law."""
        arguments = (self.seed, number, law, *self._set)
        version = law_version(law, COURSE)
        return Task(f"course/{number}/{law}", course_of, arguments, TrialCourse, version=version)

    def film_task(self, number: int, laws: tuple[str, str]) -> Task:
        """Return the task of the film of one trial with two laws."""
        arguments = (self.seed, number, laws, *self._set)
        versions = (law_version(law, FILM) for law in laws)
        version = sha256("".join(versions).encode()).hexdigest()
        return Task(f"film/{number}", film_of, arguments, bytes, version=version)


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


def film_of(
    seed: int,
    number: int,
    laws: tuple[str, str],
    model: str,
    digest: str,
    plant: str = MILD,
    n_impacts: int = 0,
) -> bytes:
    """Return the film of one trial with two laws side by side, as a WebP file.

    Raises:
        OutputError: no back end of MuJoCo works here.
    """
    _check_digest(model, digest)
    return film(draw_trial(number, seed, plant, n_impacts), laws, model)


# Once in a process, because every trial asks for the same model.
@cache
def _check_digest(model: str, digest: str) -> None:
    if Model.load(model).digest != digest:
        raise ModelError(f"the model {model} has another content here: copy it to every worker")


@cache
def law_version(law: str, modules: tuple[str, ...]) -> str:
    """Return a digest of what a trial depends on: the source, and the constants of its law.

    The files of other laws are left out, so that a new law leaves the results of the others.

    Args:
        law: name of the law.
        modules: that make the result.
    """
    law_modules = {type(factory()).__module__ for factory in LAWS.values()}
    law_row = row_named(law)
    own = type(law_row).__module__
    source = source_digest((*modules, own), (*sorted(law_modules - {own}), laws.__name__))
    constants = msgspec.json.encode(_contents(law_row), order="deterministic")
    return sha256(source.encode() + constants).hexdigest()


def _contents(value: object) -> object:
    """Return a law, or a part of it, as plain values."""
    if isinstance(value, (str, int, float, bool, type(None))):
        return value
    if isinstance(value, (list, tuple)):
        return [_contents(each) for each in value]
    if isinstance(value, dict):
        return {str(key): _contents(each) for key, each in value.items()}
    kind = value if isinstance(value, type) else type(value)
    attributes = getattr(value, "__dict__", {}) if kind is not value else {}
    return [kind.__qualname__, {name: _contents(each) for name, each in attributes.items()}]
