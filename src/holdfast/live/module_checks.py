"""What modules show over a longer time: drift of a hold, copies and cross-talk. No clock."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.recordings import Recording

CHECK_INTERVAL = 0.05
"""Time between the samples that are compared [s]; more would cost time and show nothing else."""
BLOCK_SECONDS = 1.0
"""Time over which a force is averaged before its drift is measured [s]."""
MIN_BLOCKS = 10
"""Blocks of a hold from which on its drift is known: a skin creeps most in the first seconds."""
HOLD_SHARE = 0.05
"""A hold goes on while the force changes by less than this share from block to block."""
START_NOISE_SECONDS = 0.5
"""Time from the start in which the noise is measured [s]."""
LOADED_TO_NOISE, SHOWN_TO_NOISE = 20.0, 5.0
"""A module is loaded, or shows anything, from these many times its noise on."""
MAX_CROSS_TALK = 0.5
"""Largest share of a load that another module shows of it; fingers share a grasp more evenly."""
LEAST_LIKENESS = 0.97
"""Least cosine between the changes of all readings of two modules: a grasp presses other taxels."""
COPY_SECONDS, CROSS_TALK_SECONDS = 2.0, 1.0
"""Time of changing readings after which two modules are reported [s]."""
MAX_UNLIKE_SHARE = 0.1
"""Largest share of the loaded time in which a module with cross-talk shows something else."""


class HoldDrift:
    """Drift of the force of a module in its longest hold so far: creep, or warming.

    Attributes:
        per_minute: change of the force's amplitude [unit of the readings / min]; NaN without a
            hold of ten seconds.
        seconds: duration of that hold [s].
        load: amplitude of the force at its beginning [unit of the readings].

    Example:
        >>> drift = HoldDrift()
        >>> for time in np.arange(0, 30, 0.05):
        ...     drift.update(np.array([0.0, 0.0, 100.0 + 0.5 * time]), time)
        >>> round(drift.per_minute, 3), drift.seconds
        (30.0, 29.0)
    """

    def __init__(self) -> None:
        self.per_minute, self.seconds, self.load = math.nan, 0.0, 0.0
        self._start, self._sum, self._n = -math.inf, np.zeros(3), 0
        self._first = self._last = 0.0  # amplitudes of the first and of the newest block
        self._n_blocks, self._moments = 0, np.zeros(3)  # sums of k, of a and of k a

    def update(self, force: npt.NDArray[np.float64], time: float) -> None:
        """Add a force (3,) since the start [unit of the readings], of a time [s]."""
        if not self._n or not 0 <= time - self._start < 2 * BLOCK_SECONDS:
            self._start, self._sum, self._n, self._n_blocks = time, np.zeros(3), 0, 0
        if time - self._start >= BLOCK_SECONDS:
            amplitude = float(np.linalg.norm(self._sum / self._n))
            # A larger change is a new grip, whose drift begins anew.
            if self._n_blocks and abs(amplitude - self._last) > HOLD_SHARE * self._last:
                self._n_blocks = 0
            if not self._n_blocks:
                self._first, self._moments = amplitude, np.zeros(3)
            k, self._last = self._n_blocks, amplitude
            self._moments += (k, amplitude, k * amplitude)
            self._n_blocks = n = k + 1
            if n >= MIN_BLOCKS and n * BLOCK_SECONDS > self.seconds:
                # Least squares: (n sum k a - sum k sum a) / (n sum k^2 - (sum k)^2).
                sum_k, sum_a, sum_ka = self._moments
                slope = (n * sum_ka - sum_k * sum_a) / (n * n * (n * n - 1) / 12)
                self.per_minute = float(slope) * 60 / BLOCK_SECONDS
                self.seconds, self.load = n * BLOCK_SECONDS, self._first
            self._start, self._sum, self._n = time, np.zeros(3), 0
        self._sum, self._n = self._sum + force, self._n + 1


class Likeness(NamedTuple):
    """Two modules of which one may be read twice.

    Attributes:
        module: the one that shows less, or the later of two copies.
        other: the one whose load it shows.
        share: of the load; 1 for a copy.
    """

    module: str
    other: str
    share: float

    @property
    def text(self) -> str:
        """What was found, and what to do."""
        if self.share == 1:
            return (
                f"has the same readings as {self.other}: one sensor is read twice, or written to "
                "both; check the channels"
            )
        return (
            f"shows {100 * self.share:.2g} % of the load of {self.other} while only that is "
            "loaded: cross-talk; check magnets, cables and channels"
        )


class ModuleComparison:
    """Comparison of the modules of a hand with each other, to find copies and cross-talk.

    Example:
        >>> rng, comparison = np.random.default_rng(0), ModuleComparison()
        >>> for time in np.arange(0, 4, 0.05):
        ...     readings = rng.normal(size=(4, 3))
        ...     for found in comparison.update({"thumb": readings, "index": readings}, time):
        ...         print(found)
        Likeness(module='index', other='thumb', share=1)
    """

    def __init__(self) -> None:
        # First readings and their noise by module, and by pair how often they were equal or alike;
        # `update` alone changes them.
        self._first: dict[str, npt.NDArray[np.float64]] = {}
        self._noise: dict[str, float] = {}
        self._start = self._last_time = -math.inf
        self._last: dict[str, bytes] = {}
        self._n_equal: dict[tuple[str, str], int] = {}
        self._n_alike: dict[tuple[str, str], tuple[int, int, float]] = {}
        self._reported: set[tuple[str, str]] = set()

    def is_due(self, time: float) -> bool:
        """Return whether samples of a time [s] would be compared."""
        # Times are rounded: without the 1e-6, samples of 20 Hz would be left out.
        return not 0 <= time - self._last_time < CHECK_INTERVAL - 1e-6

    def update(self, samples: Mapping[str, npt.NDArray[Any]], time: float) -> list[Likeness]:
        """Compare samples, (n_taxels, 3) by module, of a time [s]; return what is new."""
        if not self.is_due(time):
            return []
        self._last_time = time
        values = {n: np.array(x, dtype=np.float64) for n, x in samples.items()}
        shapes = {n: x.shape for n, x in values.items() if np.isfinite(x).all()}
        groups = [[n for n in shapes if shapes[n] == shape] for shape in {*shapes.values()}]
        found = [x for names in groups for x in self._compare(names, values, time)]
        new = [each for each in found if (each.module, each.other) not in self._reported]
        self._reported.update((each.module, each.other) for each in new)
        return new

    def update_recording(self, part: Recording) -> list[Likeness]:
        """Compare the modules of the next part of a recording; return what is new."""
        modules = {name: m for name, m in part.modules.items() if m.n_samples}
        if len(modules) < 2:
            return []
        first = max(m.times[0] for m in modules.values())
        times = np.arange(first, min(m.times[-1] for m in modules.values()), CHECK_INTERVAL)
        rows = {n: np.searchsorted(m.times, times, side="right") - 1 for n, m in modules.items()}
        found = []
        for k, time in enumerate(times.tolist()):
            samples = {
                name: m.readings[rows[name][k]]
                for name, m in modules.items()
                if time - m.times[rows[name][k]] < CHECK_INTERVAL
            }
            found += self.update(samples, time)
        return found

    def _compare(
        self, names: list[str], values: Mapping[str, npt.NDArray[np.float64]], time: float
    ) -> list[Likeness]:
        for name in names:
            if name not in self._first:
                self._first[name], self._noise[name] = values[name], 0.0
                self._start = time  # of the newest module: the noise of all is measured on
        change = np.array([(values[name] - self._first[name]).ravel() for name in names])
        products = change @ change.T
        size = np.sqrt(np.diag(products))
        if time - self._start <= START_NOISE_SECONDS:
            self._noise |= {
                n: max(self._noise[n], float(s)) for n, s in zip(names, size, strict=True)
            }
        noise = np.array([self._noise[name] for name in names])
        found = self._copies(names, values)
        for a in np.flatnonzero(size > LOADED_TO_NOISE * noise).tolist():
            for b in np.flatnonzero(size <= MAX_CROSS_TALK * size[a]).tolist():
                cosine = abs(products[a, b]) / (size[a] * max(size[b], 1e-300))
                if size[b] <= SHOWN_TO_NOISE * noise[b]:
                    continue
                is_alike = cosine >= LEAST_LIKENESS
                n_alike, n_unlike, share = self._n_alike.get((names[b], names[a]), (0, 0, 0.0))
                share = max(share, float(size[b] / size[a])) if is_alike else share
                n_alike, n_unlike = n_alike + is_alike, n_unlike + (not is_alike)
                self._n_alike[names[b], names[a]] = n_alike, n_unlike, share
                if n_alike * CHECK_INTERVAL >= CROSS_TALK_SECONDS and (
                    n_unlike <= MAX_UNLIKE_SHARE * n_alike
                ):
                    found.append(Likeness(names[b], names[a], share))
        return found

    def _copies(
        self, names: list[str], values: Mapping[str, npt.NDArray[np.float64]]
    ) -> list[Likeness]:
        found, texts = [], {name: values[name].tobytes() for name in names}
        for j, name in enumerate(names):
            for other in names[:j]:
                if texts[name] != texts[other]:
                    self._n_equal[name, other] = 0
                elif texts[name] != self._last.get(name):
                    n = self._n_equal[name, other] = self._n_equal.get((name, other), 0) + 1
                    if n * CHECK_INTERVAL >= COPY_SECONDS:
                        found.append(Likeness(name, other, 1))
        self._last |= texts
        return found
