"""Freeze taxels of recordings, and count the samples that are still called STABLE.

    holdfast simulate calm --objects can --repeats 1 --profile gentle
    holdfast simulate few --objects can,ball --cases 2 --repeats 1
    holdfast simulate rough --objects ball --cases 2 --repeats 1 --profile vigorous
    holdfast simulate other --objects can,ball,bottle --repeats 1 --seed 3
    holdfast train other --trials 0 --output paper.json
    python benchmarks/frozen_skin.py calm few rough --models builtin:any builtin:twin paper.json
    holdfast simulate hands --randomize --repeats 40 --seed 11
    python benchmarks/frozen_skin.py --healthy hands --data DATA

Some taxels of every finger keep one value: from the start of the recording, or from some time in a
quiet hold or in a push on. The first table gives the time until the fault, and the samples after
the first `GRACE` seconds in which the finger is pushed or released but called STABLE, as a share of
all such samples. `start` counts from the first sample on, with a limit of its own.

The second table has recordings of healthy skins (`--healthy` folders, and the real recordings in
`--data`, by their folders): the samples without an estimate, and those with a fault.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE, Fault
from holdfast.detector import detect
from holdfast.io import load_dataset
from holdfast.io.importers import import_recordings
from holdfast.metrics.masks import runs
from holdfast.model import Model
from holdfast.recordings import Recording, Tactile

N_FROZEN = (0, 1, 3, 7, 15, 20, 29)
MOMENTS = ("start", "hold", "push")
GRACE = {"start": 2.5, "hold": 0.6, "push": 0.6}
"""Time after which a frozen taxel has to be found [s]."""
BITS = sum(1 << place for place, fault in enumerate(Fault) if fault in ("stuck", "dead"))


class Case(NamedTuple):
    """What a detector did with one finger of which some taxels were frozen.

    Attributes:
        delay: from the beginning of the freeze to the fault [s]; infinite without one.
        moved: number of samples after the grace in which the finger is pushed or released.
        stable: number of those that are called STABLE.
    """

    delay: float
    moved: int
    stable: int


def frozen_table(models: Sequence[str], folders: Sequence[Path]) -> Iterator[str]:
    """Yield the lines of the first table."""
    recordings = [each for folder in folders for each in load_dataset(folder)]
    yield "| model | frozen from | taxels | fingers | found | median s | slowest s | STABLE % |"
    yield "|---" * 8 + "|"
    for name in models:
        model = Model.load(name)
        for moment in MOMENTS:
            for n in N_FROZEN:
                cases = [c for each in recordings for c in cases_of(model, each, moment, n)]
                delays = [case.delay for case in cases]
                found = [delay for delay in delays if delay < np.inf]
                moved, stable = (sum(c[place] for c in cases) for place in (1, 2))
                yield (
                    f"| {Path(name).stem} | {moment} | {n} | {len(cases)} | {len(found)} "
                    f"| {np.median(delays):.2f} | {max(delays):.2f} "
                    f"| {100 * stable / max(moved, 1):.2f} |"
                )


def cases_of(model: Model, recording: Recording, moment: str, n: int) -> Iterator[Case]:
    """Freeze n taxels of every finger of a recording, and yield what the detector does."""
    starts, modules = {}, {}
    rng = np.random.default_rng([n, MOMENTS.index(moment)])
    for name, module in recording.modules.items():
        start = begin(module, moment)
        values = np.array(module.readings)
        if start is not None:
            taxels = rng.permutation(module.sensor.n_taxels)[:n]
            values[start:, taxels] = values[start, taxels]
            starts[name] = start
        modules[name] = Tactile(module.sensor, module.times, values)
    detection = detect(model, Recording(recording.name, modules))
    for name, start in starts.items():
        trace, module = detection.fingers[name], recording.modules[name]
        faulty = np.flatnonzero((trace.faults[start:] & BITS) != 0)
        delay = (
            float(trace.times[start + faulty[0]] - trace.times[start]) if len(faulty) else np.inf
        )
        late = trace.times > trace.times[start] + GRACE[moment]
        moved = late & np.isin(module.label_states, (UNSTABLE, NO_CONTACT))
        yield Case(delay, int(moved.sum()), int((moved & (trace.state == STABLE)).sum()))


def begin(module: Tactile, moment: str) -> int | None:
    """Return the sample at which the freeze begins; None if there is no such moment.

    A hold is frozen in the middle of the longest stable stretch, and a push at the beginning of the
    unstable stretch that follows it.
    """
    if moment == "start":
        return 0
    stretches = runs(module.label_states == STABLE)
    if not len(stretches):
        return None
    first, end = max(stretches.tolist(), key=lambda run: run[1] - run[0])
    return (first + end) // 2 if moment == "hold" else min(end, module.n_samples - 1)


def healthy_table(
    models: Sequence[str], folders: Sequence[Path], data: Path | None
) -> Iterator[str]:
    """Yield the lines of the second table."""
    sets = {str(folder): list(load_dataset(folder)) for folder in folders}
    if data is not None:
        sets |= real_recordings(data)
    yield "| model | recordings | fingers | samples | without estimate % | dead or stuck % |"
    yield "|---" * 6 + "|"
    for name in models:
        model = Model.load(name)
        for label, recordings in sets.items():
            traces = [t for each in recordings for t in detect(model, each).fingers.values()]
            n = sum(map(len, traces))
            unknown = sum(int((trace.state == UNKNOWN).sum()) for trace in traces)
            faulty = sum(int(((trace.faults & BITS) != 0).sum()) for trace in traces)
            yield (
                f"| {Path(name).stem} | {label} | {len(traces)} | {n} "
                f"| {100 * unknown / n:.1f} | {100 * faulty / n:.1f} |"
            )


def real_recordings(data: Path) -> dict[str, list[Recording]]:
    """Return the real recordings of a folder of data sets, by set."""
    names = ("gtac_v2", "gtac", "uskin_pick_move", "eflesh_slip")
    return {name: list(import_recordings(data / name)) for name in names}


def main(arguments: argparse.Namespace) -> None:
    if arguments.folders:
        for line in frozen_table(arguments.models, arguments.folders):
            print(line, flush=True)
    if arguments.healthy or arguments.data:
        for line in healthy_table(arguments.models, arguments.healthy, arguments.data):
            print(line, flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="*", type=Path, help="recordings whose taxels freeze")
    parser.add_argument("--models", nargs="+", default=["builtin:any"])
    parser.add_argument("--healthy", nargs="*", type=Path, default=[], help="healthy recordings")
    parser.add_argument("--data", type=Path, help="folder with the sets of real recordings")
    main(parser.parse_args())
