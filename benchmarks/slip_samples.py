"""Samples of the randomized hands that train the slip heads of `builtin:any`, read once.

`read` returns the features of sliding of every finger of a recording at about 75 Hz, with the truth
of its slips and what the model takes for contact. Each recording that begins with an open hand is
read a second time as one that begins in contact, from a moment after the lock on.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from holdfast.contact import STABLE, UNSTABLE
from holdfast.detection import Model, Tare, detect
from holdfast.detection.features import extract
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import SLIDING_FEATURES
from holdfast.io import load_recording
from holdfast.metrics.slip_truth import SLIDING, STILL, SlipTruth, slip_truth
from holdfast.recordings import STARTS_LOADED, Recording
from holdfast.resampling import true_updates
from holdfast.training.calibration import location_and_scale

RATE = 75.0
"""Samples per second that are kept of each recording [Hz]."""
CUT = 0.3, 2.0
"""Range of the time after the lock at which the copy that begins in contact begins [s]."""
MICRO_SLIP = 1e-4
"""Slips under this distance are neither slips nor negatives [m]."""
MIN_HANDLING_SAMPLES = 100


@dataclass(eq=False)
class FingerSamples:
    """Samples of one finger of one recording.

    Attributes:
        hand: name of the hand.
        loaded: whether the recording begins in contact.
        times: (n,) [s].
        features: (n, 97).
        held: (n,) in contact by the model.
        truth: of the slips, at these samples.
    """

    hand: str
    loaded: bool
    times: np.ndarray
    features: np.ndarray
    held: np.ndarray
    truth: SlipTruth

    @property
    def slides(self) -> np.ndarray:
        """(n,) in a slip that is no micro-slip."""
        return (self.truth.codes == SLIDING) & ~self.in_micro_slips

    def begins(self, early: float | None) -> np.ndarray:
        """Return (n,) within some time from the onset of a slip [s]; all samples without one."""
        inside = np.full(len(self.times), early is None)
        for slip in self.truth.slips if early is not None else ():
            inside |= (self.times >= slip.onset) & (self.times <= slip.onset + early)
        return inside

    @property
    def still(self) -> np.ndarray:
        """(n,) held, and neither sliding nor creeping."""
        return (self.truth.codes == STILL) & ~self.in_micro_slips

    @property
    def in_micro_slips(self) -> np.ndarray:
        """(n,) from the onset to the end of a micro-slip."""
        inside = np.zeros(len(self.times), bool)
        for slip in self.truth.slips:
            if slip.distance < MICRO_SLIP:
                inside |= (self.times >= slip.onset) & (self.times <= slip.end)
        return inside

    def moments(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return location and scale of what is held without sliding; None of too little."""
        usable = self.held & self.still
        if usable.sum() < MIN_HANDLING_SAMPLES:
            return None
        return location_and_scale(self.features[usable].astype(float))


def read(path: Path, model: Model) -> list[FingerSamples]:
    """Return the samples of a recording, and of its copy that begins in contact."""
    recording = load_recording(path)
    samples = list(_fingers(recording, model))
    locked_at = recording.metadata.get("locked_at")
    if recording.metadata.get(STARTS_LOADED) is not True and locked_at is not None:
        digit = int(recording.digest[:6], 16) / 16**6
        start = float(locked_at) + CUT[0] + (CUT[1] - CUT[0]) * digit
        samples += _fingers(_cut(recording, start), model)
    return samples


def _cut(recording: Recording, start: float) -> Recording:
    modules = {
        name: module.slice(int(np.searchsorted(module.times, start)), module.n_samples)
        for name, module in recording.modules.items()
    }
    truth = recording.truth
    truth = truth and truth.slice(int(np.searchsorted(truth.times, start)), len(truth.times))
    metadata = {**recording.metadata, STARTS_LOADED: True}
    return Recording(f"{recording.name}-cut", modules, metadata, truth)


def _fingers(recording: Recording, model: Model) -> Iterator[FingerSamples]:
    recording = true_updates(recording)
    sensors = {n: m.sensor for n, m in recording.modules.items() if m.n_samples > 30}
    if not sensors:
        return
    features = dict.fromkeys(sensors, SLIDING_FEATURES)
    tare = Tare.parse(model.tare)
    plan = StreamPlan(sensors, features, model.window, tare, recording.rate)
    rows = extract(plan.for_recording(recording), recording)
    traces = detect(model, recording).fingers
    step = max(1, round(recording.rate / RATE))
    for name, finger in rows.items():
        module = recording.modules[name]
        truth = slip_truth(recording, name, module.times)
        if truth is None:
            continue
        state = traces[name].state
        held = ((state == STABLE) | (state == UNSTABLE)) & np.isfinite(finger.features).all(axis=1)
        kept = np.arange(len(held)) % step == 0
        yield FingerSamples(
            str(recording.metadata.get("hand", recording.name)),
            recording.metadata.get(STARTS_LOADED) is True,
            module.times[kept],
            np.where(held[:, None], finger.features, 0.0)[kept].astype(np.float32),
            held[kept],
            replace(truth, codes=truth.codes[kept], quiet=truth.quiet[kept]),
        )


def read_all(folders: Sequence[Path], cache: Path) -> list[FingerSamples]:
    """Return the samples of all recordings of some folders, kept in a folder for the next run."""
    import pickle

    cache.mkdir(parents=True, exist_ok=True)
    model, samples = Model.load("builtin:any"), []
    for folder in folders:
        for path in sorted(folder.glob("*.parquet")):
            kept = cache / f"{folder.name}-{path.stem}.pickle"
            if not kept.exists():
                kept.write_bytes(pickle.dumps(read(path, model)))
            kept_samples = pickle.loads(kept.read_bytes())
            # Folders of two seeds have hands of the same numbers.
            samples += [
                replace(sample, hand=f"{folder.name}/{sample.hand}") for sample in kept_samples
            ]
    return samples
