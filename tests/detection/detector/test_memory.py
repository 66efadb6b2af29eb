import tracemalloc

import numpy as np

from holdfast.detection import Detector, Model
from holdfast.recordings import Recording, Tactile
from holdfast.sensors import sensor


def test_estimates_are_in_memory_once():
    n = 40_000
    readings = np.zeros((n, 5, 3), np.int16)
    recording = Recording("a", {"a": Tactile(sensor("anyskin"), np.arange(n) / 100, readings)})
    detector = Detector.for_recording(Model.load("builtin:any"), recording)
    tracemalloc.start()
    trace = detector.run(recording).fingers["a"]
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    kept = sum(column.nbytes for column in trace if column is not None)
    assert peak < 1.5 * kept
