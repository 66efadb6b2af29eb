"""Sources and models for the tests of live detection."""

import time
from collections import deque

import numpy as np

from holdfast.detection import Model
from holdfast.devices.sources.base import Arrival, Source
from holdfast.devices.sources.base import notice_arrival as make_notice
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording

FINGERS = ("thumb", "index", "middle")
TWIN = "builtin:twin"


PATIENCE = 30.0
"""Time after which a waiting test fails [s]."""


def wait_for(condition):
    """Wait until the work of a thread is done, and fail if it never is."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "the condition never became true"
        time.sleep(0.005)


def grasp(seed=1, name="grasp", fingers=FINGERS):
    """A synthetic recording of a grasp that is shaken, with curved fingertips."""
    return synthetic_recording(name, seed, fingers)


def grasp_file(folder, **options):
    recording = grasp(**options)
    path = folder / f"{recording.name}.parquet"
    save_recording(recording, path)
    return path, recording


def arrivals_of(recording):
    """One arrival for each instant of a recording whose modules share their times."""
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
    """Source of given arrivals, as fast as they are read; None stands for silence."""

    paced = False

    def __init__(self, sensors, steps=(), name="script", patient=False):
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
    """Source that repeats its last samples, with increasing times, after the given arrivals."""

    last = None

    def read(self, timeout):
        if self.steps or self.last is None:
            self.last = super().read(timeout)
            return self.last
        time.sleep(0.002)
        when = np.nextafter(self.last.time, np.inf)
        self.last = self.last._replace(time=when, received=time.monotonic())
        return self.last


def notice_arrival(text, **faults):
    """An arrival with a notice and with faults by module, without samples."""
    return make_notice(time.monotonic(), text, faults={k: tuple(v) for k, v in faults.items()})


def same(one, two):
    """Whether two estimates are equal; NaN equals NaN."""
    return np.array_equal(
        [one.time, one.stable_probability, one.instability, *one.force],
        [two.time, two.stable_probability, two.instability, *two.force],
        equal_nan=True,
    ) and (one.state, one.reason, one.faults) == (two.state, two.reason, two.faults)
