"""The model of a hand: features, classifiers and decision rule."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from hashlib import sha256
from importlib import resources
from pathlib import Path
from typing import Literal, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.blocks import MAX_PACKED, PACKED_BYTES, Digests, any_packed, pack
from holdfast.contact import MAX_TAXELS
from holdfast.detection.features import extract
from holdfast.detection.heads import (
    MAX_FINGERS,
    MAX_WINDOW,
    Choice,
    Debounce,
    FingerModel,
    Head,
    HeadName,
    Linear,
    check_limit,
)
from holdfast.detection.kernel_config import ModelConfig, model_config
from holdfast.detection.model_files import decode, encode, file_text, read_model, write_model
from holdfast.detection.plan import StreamPlan, Tare
from holdfast.detection.specs import DEFAULT_WINDOW, FeatureSpec
from holdfast.errors import ModelError
from holdfast.recordings import Recording
from holdfast.resampling import RATE_TOLERANCE
from holdfast.sensors import Sensor
from holdfast.sensors.types import MAX_RATE, ROTATION_TOLERANCE


class Training(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Provenance of a model.

    Attributes:
        recordings: content digest of each training recording, by name.
        split: split of the cross-validation.
        parameters: hyper-parameters of each finger's classifier.
        figures: pooled metrics out of fold.
        seed: seed of all random numbers.
        versions: versions of the packages that fitted it.
        samples: number of used and of all labelled samples of each finger of which only every
            n-th was used.
        sliding_samples: number of sliding samples that each slip rule was trained on.
        blocks: shortened digests of blocks of the recordings, by which parts of them are found.

    Raises:
        ModelError: the blocks are not whole.
    """

    recordings: dict[str, str]
    split: str
    parameters: dict[str, dict[str, float | str | None]]
    figures: dict[str, float | None] = {}
    seed: int = 0
    versions: dict[str, str] = {}
    samples: dict[str, tuple[int, int]] | msgspec.UnsetType = msgspec.UNSET
    sliding_samples: dict[str, int] | msgspec.UnsetType = msgspec.UNSET
    # Unset in models that were trained before there were blocks.
    blocks: bytes | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
        if self.blocks is not msgspec.UNSET and len(self.blocks) % PACKED_BYTES:
            raise ModelError(
                f"blocks of {PACKED_BYTES} bytes each expected, {len(self.blocks)} bytes given"
            )

    def has_any(self, blocks: Digests) -> bool:
        """Return whether one of some blocks is of a training recording, as far as is known."""
        return self.blocks is not msgspec.UNSET and any_packed(self.blocks, blocks)


ANY_FINGER = "*"
"""Name in place of a finger, for a model of any finger."""
EXACT_RATE = 0.05
"""Tolerance of a measured rate beside a nominal one, as a share of it."""
RELATIVE_RATES = (30.0, 1000.0)
"""Rates for which relative features are made [Hz]."""
MAX_PACKED_SHARE = 0.147
"""Most bytes of packed blocks, as a share of the file of the model. In Base64 they are a third
longer: 19.6 %."""


class Model(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Model of a hand: heads for each finger, or the same for all fingers (`"*"`).

    Attributes:
        fingers: models of the fingers, by name; `"*"` alone is for any finger.
        sensors: the sensors that the fingers name.
        rate: samples per second for which the windows are meant [Hz]; None for any rate.
        window: N_w of the instability that is reported [samples].
        tare: how the baseline is found, as text: "0.5", "first", "none" or "START:END".
        debounce: debouncing of state changes.
        training: provenance; None for a model without training.
        schema: version of the file format.
        name: of the model.

    Raises:
        ModelError: the fields contradict each other.

    Example:
        >>> Model.load("builtin:twin")
        Model('builtin:twin', 150 Hz, fingers *: stable, slip, slip_speed, cause)
    """

    fingers: dict[str, FingerModel]
    rate: float | None = None
    sensors: dict[str, Sensor] = {}
    window: int = DEFAULT_WINDOW
    tare: str = "0.5"
    debounce: Debounce = Debounce()
    training: Training | None = None
    schema: Literal["holdfast.model/2"] = "holdfast.model/2"
    name: str = ""

    def __post_init__(self) -> None:
        if not self.fingers:
            raise ModelError("a model of at least one finger expected, none given")
        if ANY_FINGER in self.fingers and len(self.fingers) > 1:
            raise ModelError(f"a model for any finger ('*') has no others; {list(self.fingers)}")
        if self.rate is not None and not (math.isfinite(self.rate) and self.rate > 0):
            raise ModelError(f"a rate above 0 Hz expected, {self.rate} given")
        # A model file is untrusted: each limit bounds the memory that a detector would allocate.
        check_limit("samples in a second", self.rate or 0, MAX_RATE)
        check_limit("fingers", max(len(self.fingers), len(self.sensors)), MAX_FINGERS)
        check_limit("samples in a window", self.window, MAX_WINDOW)
        for sensor in self.sensors.values():
            check_limit(f"taxels of {sensor.name}", sensor.n_taxels, MAX_TAXELS)
        for name, finger in self.fingers.items():
            if finger.sensor is not None and finger.sensor not in self.sensors:
                raise ModelError(
                    f"finger {name!r} names the sensor {finger.sensor!r}; "
                    f"the model holds {list(self.sensors)}"
                )
        # Both raise for what cannot be used.
        Tare.parse(self.tare)
        FeatureSpec("sigma", self.window)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Load a model from a file, or a built-in model by its name (`builtin:twin`).

        Raises:
            ModelError: the file or name does not exist; the file is not JSON; it has an unknown
                field, another shape, a number that is not finite, or another schema.
        """
        # Fields, not the object: a subclass that loads a built-in model gets its own type.
        if str(path).startswith("builtin:"):
            return cls(**msgspec.structs.asdict(built_in(str(path))))
        return read_model(path, cls)

    @classmethod
    def of(cls, model: "Model | str | Path") -> "Model":
        """Return a model, given it, its file, or the name of a built-in one."""
        return model if isinstance(model, Model) else cls.load(model)

    def __repr__(self) -> str:
        rate = "any rate" if self.rate is None else f"{self.rate:g} Hz"
        heads = {head.name: None for part in self.fingers.values() for head in part.heads}
        return (
            f"Model({self.name!r}, {rate}, fingers {', '.join(self.fingers)}: {', '.join(heads)})"
        )

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the model as JSON.

        Raises:
            OutputError: the file exists and `force` is not given, or it cannot be written.
        """
        write_model(path, self.encoded(), force=force)

    def encoded(self) -> bytes:
        """Return the JSON of the model."""
        return encode(self, self.sensors)

    @property
    def digest(self) -> str:
        """Digest of the content, for results that depend on the model."""
        return sha256(self.encoded()).hexdigest()

    @property
    def has_slip_rule(self) -> bool:
        """Whether the model decides of any finger whether it slides."""
        return any(part.slip is not None for part in self.fingers.values())

    @property
    def reports_slips(self) -> bool:
        """Whether the model ever reports a slip: a threshold of 1 leaves it to `calibrate`."""
        names: tuple[HeadName, ...] = ("slip", "slip_changes")
        parts = self.fingers.values()
        limits = [handling.thresholds for part in parts for handling in part.handling.values()]
        limits += [{head.name: head.threshold for head in part.heads} for part in parts]
        return any(thresholds.get(name, 1.0) < 1 for thresholds in limits for name in names)

    @property
    def slip_advice(self) -> str:
        """Advice on how to set the threshold of slips, if the model reports none; else empty."""
        if self.reports_slips or not self.has_slip_rule:
            return ""
        name = self.name or "the model"
        if self.handled_sensors:
            return f"{name}: no slips, as its handling leaves no threshold (holdfast teach)"
        if any(part.normalised for part in self.fingers.values()):
            return f"{name}: no slips until calibrated (holdfast calibrate)"
        return f"{name}: no slips until taught (holdfast teach)"

    def with_training(self, training: Training, blocks: Sequence[Digests]) -> Self:
        """Return the model with its provenance, and as many blocks as make it 20 % larger at most.

        Args:
            training: provenance; its blocks, of a model that was adapted, are kept.
            blocks: of each training recording.
        """
        replace = msgspec.structs.replace
        before = b"" if training.blocks is msgspec.UNSET else training.blocks
        model = replace(self, training=replace(training, blocks=msgspec.UNSET))
        n_bytes = MAX_PACKED_SHARE * len(file_text(model.encoded())) - len(before)
        n_each = int(min(max(n_bytes / PACKED_BYTES / len(blocks), 1), MAX_PACKED))
        packed = before + pack(blocks, n_each)
        return replace(model, training=replace(training, blocks=packed or msgspec.UNSET))

    def changed(self, change: Callable[[FingerModel], FingerModel]) -> Self:
        """Return the model with each of its fingers changed by a function."""
        fingers = {name: change(part) for name, part in self.fingers.items()}
        return msgspec.structs.replace(self, fingers=fingers)

    def with_threshold(
        self, name: HeadName, threshold: float, choice: Choice | None = None
    ) -> Self:
        """Return the model with another threshold of a head, for all fingers and sensors."""

        def changed(part: FingerModel) -> FingerModel:
            head = part.head(name)
            # Own handling would win over the threshold that is set here.
            part = part.without_thresholds(name)
            return part if head is None else part.with_heads(head.at(threshold, choice))

        return self.changed(changed)

    def finger(self, name: str, sensor: Sensor | None = None) -> FingerModel:
        """Return the model of a finger.

        Args:
            name: of the finger.
            sensor: on which it is used. With it, own handling of that sensor is in the classifiers
                of the model (see `FingerModel.for_sensor`).

        Raises:
            ModelError: the model does not have that finger.
        """
        # A model of any finger has no others.
        part = self.fingers.get(ANY_FINGER) or self.fingers.get(name)
        if part is None:
            raise ModelError(f"the model has no finger {name!r}; it has {', '.join(self.fingers)}")
        return part if sensor is None else part.for_sensor(sensor.name)

    def with_handling_of(self, sensors: Mapping[str, Sensor]) -> Self:
        """Return the model with own handling in its classifiers, for the sensors of some fingers.

        Fingers of one classifier that have several sensors are left with default handling.

        Args:
            sensors: sensor of each finger; `"*"` or any finger of a model of any finger.
        """
        fingers = {}
        for name, part in self.fingers.items():
            used = {s.name for finger, s in sensors.items() if name in (ANY_FINGER, finger)}
            folded = part.for_sensor(used.pop()) if len(used) == 1 else part
            fingers[name] = msgspec.structs.replace(folded, handling={})
        return msgspec.structs.replace(self, fingers=fingers)

    @property
    def handled_sensors(self) -> tuple[str, ...]:
        """Sensors whose own handling the model has; with the finger, unless it is for any."""
        names = (
            _sensor_of(finger, name)
            for finger, part in self.fingers.items()
            for name in part.handling
        )
        return tuple(dict.fromkeys(names))

    def without_handling(self, sensors: Mapping[str, Sensor]) -> list[str]:
        """Return the sensors that lack own handling, as `handled_sensors`, while others have it.

        Args:
            sensors: sensor of each finger on which the model is used.
        """
        handled = self.handled_sensors
        any_finger = ANY_FINGER in self.fingers
        names = dict.fromkeys(
            _sensor_of(ANY_FINGER if any_finger else finger, sensor.name)
            for finger, sensor in sensors.items()
        )
        return [name for name in names if handled and name not in handled]

    def handling_advice(self, sensors: Mapping[str, Sensor]) -> str:
        """Return that default handling is used on some sensors, while others have their own.

        Args:
            sensors: sensor of each finger on which the model is used.

        Returns:
            A sentence for the user; empty if there is nothing to say.
        """
        missing = self.without_handling(sensors)
        if not missing:
            return ""
        return (
            f"{self.name or 'the model'} was calibrated on {', '.join(self.handled_sensors)}, not "
            f"on {', '.join(missing)}: default handling is used (holdfast calibrate)"
        )

    def n_fingers(self, fingers: Collection[str]) -> int:
        """Return the number of fingers on which the state of the hand depends.

        Args:
            fingers: of the hand, which a model of any finger decides about.
        """
        return len(fingers if ANY_FINGER in self.fingers else self.fingers)

    def fingers_of(self, modules: Mapping[str, Sensor]) -> dict[str, Sensor]:
        """Return the fingers that the model estimates on a hand, and their sensors.

        They are all fingers that the model names, even those that the hand lacks. A model of
        any finger estimates every module of its sensor (only fingertips, if there are any).

        Args:
            modules: sensor of each module of the hand.

        Raises:
            ModelError: the hand has none of the fingers, or a finger has another sensor.
        """
        if ANY_FINGER in self.fingers:
            wanted = self.fingers[ANY_FINGER].sensor
            # Pads and the palm have a slash: a model of any finger was trained on fingertips.
            tips = {name: s for name, s in modules.items() if "/" not in name} or dict(modules)
            fitting = {n: s for n, s in tips.items() if wanted is None or s.name == wanted}
            if wanted is not None and not fitting:
                raise _other_sensor(
                    f"the model is for fingers with the sensor {wanted!r}; given are "
                    + ", ".join(f"{name} ({sensor.name})" for name, sensor in modules.items())
                )
            for name, sensor in fitting.items():
                self._check_sensor(name, sensor)
            return fitting
        for name in set(self.fingers) & set(modules):
            self._check_sensor(name, modules[name])
        if not set(self.fingers) & set(modules):
            raise ModelError(
                f"the model is for {', '.join(self.fingers)}; {', '.join(modules)} given"
            )
        return {
            name: modules[name] if name in modules else self.sensors[str(finger.sensor)]
            for name, finger in self.fingers.items()
            if name in modules or finger.sensor is not None
        }

    def plan(self, sensors: Mapping[str, Sensor], source_rate: float) -> StreamPlan:
        """Return the plan of the feature stream of some fingers, for a source of a rate [Hz].

        Raises:
            ModelError: the features are relative, and the rate is outside `RELATIVE_RATES`.
        """
        features = {name: self.finger(name).features for name in sensors}
        relative = any(spec.seconds for specs in features.values() for spec in specs)
        low, high = RELATIVE_RATES
        # The model's rate where it has one: the source is resampled to it.
        rate = self.rate or source_rate
        if relative and not low * (1 - EXACT_RATE) <= rate <= high * (1 + EXACT_RATE):
            raise ModelError(
                f"{rate:.4g} Hz given, the model expects {low:g} to {high:g} Hz; resample the "
                "recording, or set the sensor to another rate"
            )
        return StreamPlan(
            sensors=sensors,
            features=features,
            window=self.window,
            tare=Tare.parse(self.tare),
            rate=rate,
        )

    def config(self, plan: StreamPlan) -> ModelConfig:
        """Return the constants of the C kernel for the fingers of a plan."""
        parts = [self.finger(*finger) for finger in plan.sensors.items()]
        return model_config(parts, self.debounce, self.n_fingers(plan.fingers), plan)

    def blind_features(self, finger: str, sensor: Sensor) -> tuple[str, ...]:
        """Return the kinds of features of a finger that need more taxels than a sensor has."""
        features = self.finger(finger).features
        return tuple(dict.fromkeys(x.kind for x in features if x.min_taxels > sensor.n_taxels))

    def rate_fits(self, rate: float) -> bool:
        """Return whether a source of a rate [Hz] needs no resampling."""
        return self.rate is None or abs(rate / self.rate - 1) <= RATE_TOLERANCE

    def predict_proba(self, recording: Recording) -> dict[str, npt.NDArray[np.float64]]:
        """Return the probability of stability of every finger at each of its samples.

        Args:
            recording: at the model's rate.

        Returns:
            By finger, (n,); NaN during tare, warm-up, gap and fault.

        Raises:
            ModelError: the recording has other fingers or sensors.
        """
        sensors = self.fingers_of({n: m.sensor for n, m in recording.modules.items()})
        present = {name: sensor for name, sensor in sensors.items() if name in recording.modules}
        rows = extract(self.plan(present, recording.rate), recording)
        probabilities = {}
        for name in present:
            part = self.finger(name, sensors[name])
            features = rows[name].features[:, part.indices(part.stable)]
            probabilities[name] = part.stable.rule.probability(features)
        return probabilities

    def _check_sensor(self, name: str, sensor: Sensor) -> None:
        wanted = self.finger(name).sensor
        if wanted is None:
            return
        expected = self.sensors[wanted]
        if (sensor.name, sensor.n_taxels) != (expected.name, expected.n_taxels):
            raise _other_sensor(
                f"{name}: {sensor.n_taxels} taxels ({sensor.name}) given, the model expects "
                f"{expected.n_taxels} ({expected.name})"
            )
        # The unit after the kind: another sensor has often another unit as well.
        if sensor.unit != expected.unit:
            raise _other_sensor(
                f"{name}: readings in {sensor.unit} given, the model expects {expected.unit}"
            )
        if not np.allclose(sensor.rotations, expected.rotations, atol=ROTATION_TOLERANCE):
            raise _other_sensor(
                f"{name}: the taxels of {sensor.name} have other rotations than those of the "
                "training"
            )


def _sensor_of(finger: str, sensor_name: str) -> str:
    """Return the name of a sensor, with its finger unless the model is for any."""
    return sensor_name if finger == ANY_FINGER else f"{finger} ({sensor_name})"


def _other_sensor(text: str) -> ModelError:
    """Return the error of a model for another sensor, with the built-in model that fits."""
    return ModelError(f"{text}; builtin:any fits every 3-axis sensor")


def built_in(name: str) -> Model:
    """Return a built-in model by its name.

    Raises:
        ModelError: the name is unknown.
    """
    if name not in BUILT_IN:
        raise ModelError(f"unknown model {name!r}; built in are {', '.join(BUILT_IN)}")
    return BUILT_IN[name]()


def _shipped(name: str) -> Model:
    """Return a model whose file is part of the package, see docs/models.md."""
    data = (resources.files("holdfast") / "models" / f"{name}.json").read_bytes()
    return msgspec.structs.replace(decode(data, Model), name=f"builtin:{name}")


def _noise_floor() -> Model:
    """Return a model without training: stable while sigma is under three times the noise.

    The noise is measured in the tare. At the noise itself the probability is 0.9, at nine times the
    noise it is 0.1.
    """
    slope = 2.0
    rule = Linear((math.log(3.0),), (1.0,), ((-slope,),), (0.0,))
    features = (FeatureSpec("sigma", DEFAULT_WINDOW, "noise"),)
    head = Head(name="stable", link="logit", features=features, rule=rule)
    finger = FingerModel(heads=(head,), contact_noise=5.0)
    return Model(name="builtin:noise-floor", fingers={ANY_FINGER: finger})


BUILT_IN: dict[str, Callable[[], Model]] = {
    "builtin:any": partial(_shipped, "any"),  # trained on randomized hands of the twin
    "builtin:twin": partial(_shipped, "twin"),  # trained on grasps of the twin
    "builtin:noise-floor": _noise_floor,
}
