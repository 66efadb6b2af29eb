"""A detector for what arrives from a source: rate, faults on the way, tare. No clock, no thread."""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from holdfast.contact import ContactState, Fault, HandEstimate, Reason, with_faults
from holdfast.detector import Detector
from holdfast.errors import ModelError, StreamError
from holdfast.features import Tare
from holdfast.model import Model
from holdfast.recordings import GAP_PERIODS
from holdfast.resampling import Resampler
from holdfast.sensors import Sensor, sensor
from holdfast.sources import Arrival

RATE_SECONDS = 0.5
"""How much of a stream is looked at to find its rate; it is judged afterwards [s]."""
MOST_KEPT = 4096
"""So many samples are kept for that at the most: the clock of a device may stand still."""
LEAST_SILENCE = 0.1
"""A source that says nothing for so long is silent, however fast it is [s]."""

Samples = Mapping[str, npt.NDArray[Any]]


def warm_up() -> None:
    """Loads the compiled kernels, so that no live source waits for them."""
    Detector(Model.load("builtin:noise-floor"), {"index": sensor("uskin-4x4")})


class Decision(NamedTuple):
    """What is said after an arrival.

    Attributes:
        estimate: of the hand.
        fingers: whose estimates are new: they have a sample, or have had none for too long.
    """

    estimate: HandEstimate
    fingers: tuple[str, ...]


class Judge:
    """Judges what arrives from a source.

    The first half second is kept until the rate of the source is known, and judged then. A
    source whose rate is not within 20 % of the model's is resampled to it. Faults that the
    source tells make their fingers UNKNOWN; whatever arrives well is judged as the same
    samples are in a recording.

    Args:
        model: that judges.
        sensors: of the source, by module.
        strict: refuse another rate than the model's instead of resampling.
        ignore: taxels that count for nothing, by finger.

    Attributes:
        fingers: that are judged.
        rate: of the source [Hz]; NaN while it is not known.
        resampled: whether the source is resampled to the model's rate.

    Raises:
        ModelError: the source has none of the model's fingers, or another sensor.
    """

    def __init__(
        self,
        model: Model,
        sensors: Mapping[str, Sensor],
        *,
        strict: bool = False,
        ignore: Mapping[str, tuple[int, ...]] | None = None,
    ) -> None:
        if Tare.parse(model.tare).kind == "interval":
            raise ModelError(
                f"the model's tare is the interval {model.tare} s of a recording, which nobody "
                "knows live; train with --tare 0.5, first or none"
            )
        self.model = model
        self.fingers = dict(model.fingers_of(sensors))
        self.rate = math.nan
        self.resampled = False
        self._strict = strict
        self._ignore = ignore
        self._kept: deque[Arrival] = deque(maxlen=MOST_KEPT)
        self._detector: Detector | None = None
        Detector(model, self.fingers, 100.0, ignore=ignore)  # refuses what it must
        self._resamplers: dict[str, Resampler] = {}
        self._faults: dict[str, tuple[Fault, ...]] = {}
        self._gone: set[str] = set()
        self._last: HandEstimate | None = None

    @property
    def silence(self) -> float:
        """How long without a packet means that the source is silent [s]."""
        if math.isnan(self.rate):
            return LEAST_SILENCE
        return max(GAP_PERIODS / self.rate, LEAST_SILENCE)

    def take(self, arrival: Arrival) -> list[Decision]:
        """Takes what arrived.

        Returns:
            What is to be said now, oldest first; nothing while the rate is not known.

        Raises:
            ModelError: the rate is not the model's, and `strict`.
        """
        if self._detector is not None:
            return list(self._judge(self._detector, arrival))
        self._keep(arrival)
        kept = [one for one in self._kept if one.samples]
        if not arrival.samples or arrival.time - kept[0].time < RATE_SECONDS:
            return []
        rate = _rate(kept, self.fingers)
        if rate is None:  # nothing of the model's fingers yet
            self._kept.clear()
            self._kept.append(arrival)
            return []
        return self._begin(rate)

    def finish(self) -> list[Decision]:
        """What is to be said of a source that ended before its rate was known."""
        kept = [one for one in self._kept if one.samples]
        if self._detector is not None or not kept:
            return []
        nominal = next(iter(self.fingers.values())).rate
        return self._begin(_rate(kept, self.fingers) or self.model.rate or nominal)

    def silent(self) -> Decision | None:
        """What is to be said while nothing arrives: every finger is UNKNOWN for a gap."""
        if self._last is None:
            return None
        self._gone = set(self.fingers)
        return Decision(self._told(), tuple(self.fingers))

    def tare(self) -> None:
        """Takes the tare anew, from the next sample on.

        Raises:
            StreamError: a finger is in contact.
        """
        if self._detector is None or self._last is None:
            return
        touching = [
            name
            for name, finger in self._last.fingers.items()
            if finger.state in (ContactState.STABLE, ContactState.UNSTABLE)
        ]
        if touching:
            raise StreamError(
                f"{', '.join(touching)} in contact: open the hand, then take the tare"
            )
        self._detector.reset()

    def tared(self, samples: Samples) -> dict[str, npt.NDArray[np.float64]]:
        """(n_taxels, 3) of each judged finger without its baseline, where that is known."""
        baselines = {} if self._detector is None else self._detector.baselines()
        return {
            name: samples[name] - baseline
            for name, baseline in baselines.items()
            if name in samples
        }

    def _keep(self, arrival: Arrival) -> None:
        """Keeps what arrives before the rate is known; of words in a row, one."""
        if self._kept and not (arrival.samples or self._kept[-1].samples):
            before = self._kept.pop()
            arrival = arrival._replace(faults={**before.faults, **arrival.faults})
        self._kept.append(arrival)

    def _begin(self, rate: float) -> list[Decision]:
        """Makes the detector, and judges what was kept."""
        model, self.rate = self.model, rate
        if model.rate is not None and not model.rate_fits(rate):
            if self._strict:
                raise ModelError(
                    f"{rate:.4g} Hz given, the model expects {model.rate:g} Hz within 20 % "
                    "(--rate resample takes it all the same)"
                )
            self.resampled = True
            self._resamplers = {name: Resampler(rate, model.rate) for name in self.fingers}
        self._detector = Detector(model, self.fingers, rate, ignore=self._ignore)
        kept = list(self._kept)
        self._kept.clear()
        return [said for one in kept for said in self._judge(self._detector, one)]

    def _judge(self, detector: Detector, arrival: Arrival) -> Iterator[Decision]:
        for name in arrival.samples:
            self._faults.pop(name, None)
            self._gone.discard(name)
        self._faults.update(arrival.faults)
        found = {name: arrival.samples[name] for name in self.fingers if name in arrival.samples}
        for time, samples in self._instants(arrival.time, found):
            before, self._last = self._last, detector.update(samples, time)
            lost = _lost(before, self._last) - samples.keys() if before else ()
            yield Decision(self._told(), (*samples, *lost))
        if not found and self._last is not None:
            named = tuple(name for name in self.fingers if name in arrival.faults)
            if named:
                yield Decision(self._told(), named)

    def _told(self) -> HandEstimate:
        """The last estimate, with what is wrong on the way."""
        if self._last is None or self._detector is None:
            raise StreamError("nothing has been judged yet")
        told, n_fingers = self._last, self._detector.n_fingers
        if self._faults:
            told = with_faults(told, self._faults, n_fingers)
        if self._gone:
            gap = dict.fromkeys(self._gone, (Fault.PACKET_GAP,))
            told = with_faults(told, gap, n_fingers, Reason.GAP)
        return told

    def _instants(self, time: float, samples: Samples) -> Iterator[tuple[float, Samples]]:
        """The samples as the detector takes them: as they are, or at the model's rate."""
        if not self.resampled:
            if samples:
                yield time, samples
            return
        at: dict[float, dict[str, npt.NDArray[Any]]] = {}
        for name, sample in samples.items():
            for when, value in self._resamplers[name].push(time, sample):
                at.setdefault(when, {})[name] = value
        last = -math.inf if self._last is None else self._last.time
        for when in sorted(at):
            last = max(when, math.nextafter(last, math.inf))
            yield last, at[when]


def _lost(before: HandEstimate, now: HandEstimate) -> set[str]:
    """Fingers of which something was known, and is not any more."""
    unknown = ContactState.UNKNOWN
    return {
        name
        for name, finger in now.fingers.items()
        if finger.state is unknown and before.fingers[name].state is not unknown
    }


def _rate(arrivals: list[Arrival], fingers: Mapping[str, Sensor]) -> float | None:
    """Samples per second of the fingers, by their mean step without gaps; None for no step."""
    rates = []
    for name in fingers:
        steps = np.diff([one.time for one in arrivals if name in one.samples])
        if len(steps):
            rates.append(1 / steps[steps <= GAP_PERIODS * np.median(steps)].mean())
    return float(np.median(rates)) if rates else None
