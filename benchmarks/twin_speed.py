"""Speed of the twin in one process: whole grasps, and grasps with commands sample by sample.

    python benchmarks/twin_speed.py [--objects can,ball,box] [--seed N]

It prints the CPU time, so other work on the machine changes the figures less. Imports and the
closing path of each object, which is computed once in a process, are not counted.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from holdfast.twin.hand import FINGERS
from holdfast.twin.objects import load_objects
from holdfast.twin.simulation import Grasp, Simulation


def main() -> None:
    """Print one line for each object and way of simulation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--objects", default=",".join(load_objects(None)))
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    _closed_loop(Simulation(Grasp("can", 1, 1)), n_samples=1)  # imports what a sample needs
    for name in given.objects.split(","):
        grasp = Grasp(name, 2, 1, seed=given.seed)
        for way, run in {"whole grasp": _whole, "step and read": _closed_loop}.items():
            _report(f"{name}, {way}", Simulation(grasp), run)


def _whole(simulation: Simulation) -> None:
    while not simulation.is_over:
        simulation.step()
    simulation.recording()


def _closed_loop(simulation: Simulation, n_samples: int = 1 << 20) -> None:
    scales = np.ones(len(FINGERS))
    while not simulation.is_over and simulation.n_samples < n_samples:
        simulation.step(scales)
        simulation.read()


def _report(name: str, simulation: Simulation, run: Callable[[Simulation], None]) -> None:
    begin = time.process_time()
    run(simulation)
    taken = time.process_time() - begin
    print(
        f"{name:24}{simulation.time:6.1f} s in {taken:5.2f} s: "
        f"{simulation.time / taken:5.1f} times real time, "
        f"{1e6 * taken / simulation.n_samples:4.0f} us per sample"
    )


if __name__ == "__main__":
    main()
