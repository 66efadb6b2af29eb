"""Sources and models for the tests of what is live."""

import time
from collections import deque

import numpy as np

from holdfast.io import save_recording
from holdfast.model import Model
from holdfast.sources.base import Arrival, Source, notice_arrival
from holdfast.synthetic import synthetic_recording

FINGERS = ("thumb", "index", "middle")
TWIN = "builtin:twin"


def grasp(seed=1, name="grasp", fingers=FINGERS):
    """A recording of curved fingertips with a grasp that is shaken."""
    return synthetic_recording(name, seed, fingers)


def grasp_file(folder, **options):
    recording = grasp(**options)
    path = folder / f"{recording.name}.parquet"
    save_recording(recording, path)
    return path, recording


def arrivals_of(recording):
    """Every instant of a recording whose modules share their times."""
    first = next(iter(recording.modules.values()))
    return [
        Arrival(
            when,
            {name: module.readings[k] for name, module in recording.modules.items()},
            time.monotonic(),
        )
        for k, when in enumerate(first.times.tolist())
    ]


def model():
    return Model.load(TWIN)


class Script(Source):
    """Gives what it is told to, as fast as it is taken: arrivals, None for silence."""

    paced = False

    def __init__(self, sensors, steps, name="script", patient=False):
        self.name = name
        self.sensors = dict(sensors)
        self.metadata = {"source": name}
        self.steps = deque(steps)
        self.patient = patient
        self.n_closed = 0

    @classmethod
    def of(cls, recording, steps=None, **options):
        sensors = {name: module.sensor for name, module in recording.modules.items()}
        return cls(sensors, arrivals_of(recording) if steps is None else steps, **options)

    def open(self):
        """Nothing to open."""

    def read(self, timeout):
        if not self.steps:
            time.sleep(timeout)
            return None
        step = self.steps.popleft()
        if step is None:
            time.sleep(timeout)
            return None
        return step._replace(received=time.monotonic())

    @property
    def ended(self):
        return not self.steps and not self.patient

    def close(self):
        self.n_closed += 1


class Lasting(Script):
    """Goes on with its last samples, a moment later each time, where it is told no more."""

    last = None

    def read(self, timeout):
        if self.steps or self.last is None:
            self.last = super().read(timeout)
            return self.last
        time.sleep(0.002)
        when = np.nextafter(self.last.time, np.inf)
        self.last = self.last._replace(time=when, received=time.monotonic())
        return self.last


def told(text, **faults):
    """Word of faults by module, without samples."""
    return notice_arrival(time.monotonic(), text, faults={k: tuple(v) for k, v in faults.items()})


def same(one, two):
    """Whether two estimates are equal, NaN where NaN is expected."""
    return np.array_equal(
        [one.time, one.stable_probability, one.instability, *one.force],
        [two.time, two.stable_probability, two.instability, *two.force],
        equal_nan=True,
    ) and (one.state, one.reason, one.faults) == (two.state, two.reason, two.faults)
