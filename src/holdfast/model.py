"""A model: the savable whole of what is needed to judge a hand, as plain checked data."""

import math
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.classifiers import LinearClassifier
from holdfast.errors import ModelError, OutputError
from holdfast.features import DEFAULT_WINDOW, FeatureSpec, Tare
from holdfast.features.stream import StreamPlan, extract
from holdfast.files import write_whole
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import ROTATION_TOLERANCE

SCHEMA = "holdfast.model/1"
ANY_FINGER = "*"
"""Key of a classifier that serves every finger."""
RATE_TOLERANCE = 0.2
"""A source whose rate is so close to the model's is taken as it is; another is resampled."""


class FingerModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """How one finger is judged.

    Attributes:
        features: what the classifier sees, in its order.
        classifier: from features to a probability of stability.
        sensor: name of the sensor it was trained on; None where any will do.
        contact_threshold: F_a below it is no contact [unit of the readings]; None for none.
        contact_noise: the same as a multiple of the noise of the tare stretch, where
            `contact_threshold` is None.
    """

    features: tuple[FeatureSpec, ...]
    classifier: LinearClassifier
    sensor: str | None = None
    contact_threshold: float | None = None
    contact_noise: float | None = None

    def __post_init__(self) -> None:
        if len(self.features) != self.classifier.n_features:
            raise ModelError(
                f"{len(self.features)} features given, the classifier expects "
                f"{self.classifier.n_features}"
            )
        for value in (self.contact_threshold, self.contact_noise):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ModelError(f"a contact threshold of at least 0 expected, {value} given")


class Debounce(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How a change of state is held back; nothing is, by default and for the paper's figures.

    Attributes:
        min_duration: how long a new state must last before it is told [s].
        hysteresis: how far past its threshold a probability must go to change the state.
        hold: for how long UNSTABLE is told after the rule last said so, while the finger
            touches: one disturbance is one alarm [s].
    """

    min_duration: float = 0.0
    hysteresis: float = 0.0
    hold: float = 0.0

    def __post_init__(self) -> None:
        for seconds in (self.min_duration, self.hold):
            if not (math.isfinite(seconds) and seconds >= 0):
                raise ModelError(f"a duration of at least 0 s expected, {seconds} given")
        if not 0 <= self.hysteresis < 1:
            raise ModelError(f"a hysteresis from 0 to 1 expected, {self.hysteresis} given")


class Training(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Where a model came from.

    Attributes:
        recordings: content digest of each recording it has seen, by name.
        split: how its figures were cross-validated.
        parameters: of each finger's classifier.
        figures: pooled figures out of fold.
        seed: of everything random.
        versions: of the packages that fitted it.
    """

    recordings: dict[str, str]
    split: str
    parameters: dict[str, dict[str, float | str | None]]
    figures: dict[str, float | None] = {}
    seed: int = 0
    versions: dict[str, str] = {}


class Model(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is needed to judge a hand: a classifier per finger, or one for all (`"*"`).

    Attributes:
        fingers: by name; `"*"` alone serves any finger.
        sensors: the layouts that the fingers name.
        rate: samples per second that the windows are meant for [Hz]; None for any source's own.
        window: N_w of the instability that is reported [samples].
        tare: how the baseline is found, as text: "0.5", "first", "none" or "START:END".
        debounce: how changes of state are held back.
        training: where it came from; None for one that needed no training.
        schema: version of the file format.
        name: what it is called.

    Raises:
        ModelError: parts contradict each other.
    """

    fingers: dict[str, FingerModel]
    rate: float | None = None
    sensors: dict[str, Sensor] = {}
    window: int = DEFAULT_WINDOW
    tare: str = "0.5"
    debounce: Debounce = Debounce()
    training: Training | None = None
    schema: Literal["holdfast.model/1"] = "holdfast.model/1"
    name: str = ""

    def __post_init__(self) -> None:
        if not self.fingers:
            raise ModelError("a model of at least one finger expected, none given")
        if ANY_FINGER in self.fingers and len(self.fingers) > 1:
            raise ModelError(f"a model for any finger ('*') has no others; {list(self.fingers)}")
        if self.rate is not None and not (math.isfinite(self.rate) and self.rate > 0):
            raise ModelError(f"a rate above 0 Hz expected, {self.rate} given")
        for name, finger in self.fingers.items():
            if finger.sensor is not None and finger.sensor not in self.sensors:
                raise ModelError(
                    f"finger {name!r} names the sensor {finger.sensor!r}; "
                    f"the model holds {list(self.sensors)}"
                )
        Tare.parse(self.tare)
        FeatureSpec("sigma", self.window)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """The model in that file, or the built-in one of that name (`builtin:twin`).

        Raises:
            ModelError: no such file or name; no JSON; an unknown field, another shape, a
                number that is not finite, or another schema.
        """
        if str(path).startswith("builtin:"):
            return cls(**msgspec.structs.asdict(built_in(str(path))))
        try:
            data = Path(path).read_bytes()
        except OSError as cause:
            raise ModelError(f"cannot read the model {path}: {cause.strerror}") from cause
        try:
            _check_sensors(data)
            return msgspec.json.decode(data, type=cls, dec_hook=_decode)
        except (ModelError, TypeError, ValueError, RecursionError) as cause:  # msgspec's too
            raise ModelError(f"{path} is no model of {SCHEMA}: {cause}") from cause

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Writes the model as JSON, whole or not at all.

        Raises:
            OutputError: the file exists already (and no `force`), or cannot be written.
        """
        if str(path).startswith("builtin:"):
            raise OutputError(f"{path} is the name of a built-in model; a file expected")
        data = msgspec.json.encode(self, enc_hook=_encode)
        write_whole(path, msgspec.json.format(data, indent=1) + b"\n", force=force)

    def finger(self, name: str) -> FingerModel:
        """The part of the model that judges the finger of that name.

        Raises:
            ModelError: there is none.
        """
        if ANY_FINGER in self.fingers:
            return self.fingers[ANY_FINGER]
        if name not in self.fingers:
            raise ModelError(f"the model has no finger {name!r}; it has {', '.join(self.fingers)}")
        return self.fingers[name]

    def fingers_of(self, modules: Mapping[str, Sensor]) -> dict[str, Sensor]:
        """The fingers that the model is for on a hand with those modules, and their sensors.

        All fingers that the model names, even those that the hand lacks; a model for any
        finger judges every module of its sensor (fingertips only, where there are any).

        Raises:
            ModelError: none of its fingers is there, or one has another sensor.
        """
        if ANY_FINGER in self.fingers:
            return self._any_fingers(modules)
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
        """The stream of features that those fingers need, from a source of that rate [Hz]."""
        return StreamPlan(
            sensors=sensors,
            features={name: self.finger(name).features for name in sensors},
            window=self.window,
            tare=Tare.parse(self.tare),
            rate=self.rate or source_rate,
        )

    def rate_fits(self, rate: float) -> bool:
        """Whether a source of that rate [Hz] is taken as it is."""
        return self.rate is None or abs(rate / self.rate - 1) <= RATE_TOLERANCE

    def predict_proba(self, recording: Recording) -> dict[str, npt.NDArray[np.float64]]:
        """The probability of stability of every finger at each of its samples.

        Args:
            recording: at the model's rate.

        Returns:
            By finger, (n,); NaN where there is none (tare, warm-up, gap, fault).

        Raises:
            ModelError: the recording has other fingers or sensors.
        """
        sensors = self.fingers_of({n: m.sensor for n, m in recording.modules.items()})
        present = {name: sensor for name, sensor in sensors.items() if name in recording.modules}
        found = extract(self.plan(present, recording.rate), recording)
        return {
            name: self.finger(name).classifier.probability(found[name].features) for name in present
        }

    def _any_fingers(self, modules: Mapping[str, Sensor]) -> dict[str, Sensor]:
        wanted = self.fingers[ANY_FINGER].sensor
        tips = {name: sensor for name, sensor in modules.items() if "/" not in name} or modules
        if wanted is None:
            return dict(tips)
        fitting = {name: sensor for name, sensor in tips.items() if sensor.name == wanted}
        if not fitting:
            raise ModelError(
                f"the model is for fingers with the sensor {wanted!r}; given are "
                + ", ".join(f"{name} ({sensor.name})" for name, sensor in modules.items())
            )
        for name, sensor in fitting.items():
            self._check_sensor(name, sensor)
        return fitting

    def _check_sensor(self, name: str, sensor: Sensor) -> None:
        wanted = self.finger(name).sensor
        if wanted is None:
            return
        known = self.sensors[wanted]
        if (sensor.name, sensor.n_taxels) != (known.name, known.n_taxels):
            raise ModelError(
                f"{name}: {sensor.n_taxels} taxels ({sensor.name}) given, the model expects "
                f"{known.n_taxels} ({known.name})"
            )
        if sensor.unit != known.unit:
            raise ModelError(
                f"{name}: readings in {sensor.unit} given, the model expects {known.unit}"
            )
        if not np.allclose(sensor.rotations, known.rotations, atol=ROTATION_TOLERANCE):
            raise ModelError(
                f"{name}: the taxels of {sensor.name} are turned otherwise than those that the "
                "model was trained with"
            )


def built_in(name: str) -> Model:
    """The model of that name that comes with holdfast.

    Raises:
        ModelError: there is none.
    """
    if name not in BUILT_IN:
        raise ModelError(f"unknown model {name!r}; built in are {', '.join(BUILT_IN)}")
    return BUILT_IN[name]()


def _twin() -> Model:
    """Trained on recordings of the twin, reference profile: see docs/training.md."""
    data = (resources.files("holdfast") / "models" / "twin.json").read_bytes()
    model = msgspec.json.decode(data, type=Model, dec_hook=_decode)
    return msgspec.structs.replace(model, name="builtin:twin")


def _noise_floor() -> Model:
    """Stable while sigma is under three times what the noise of the tare stretch gives.

    It needs no training: at the noise itself the probability is 0.9, at nine times it 0.1.
    """
    slope = 2.0
    rule = LinearClassifier(
        mean=(math.log(3.0),), scale=(1.0,), coefficients=(-slope,), intercept=0.0
    )
    finger = FingerModel(
        features=(FeatureSpec("sigma", DEFAULT_WINDOW, "noise"),),
        classifier=rule,
        contact_noise=5.0,
    )
    return Model(name="builtin:noise-floor", fingers={ANY_FINGER: finger})


BUILT_IN = {"builtin:twin": _twin, "builtin:noise-floor": _noise_floor}


def _check_sensors(data: bytes) -> None:
    """Refuses fields that no sensor has: msgspec would pass over them in a dataclass."""
    found = msgspec.json.decode(data)
    sensors = found.get("sensors") if isinstance(found, dict) else None
    for fields in sensors.values() if isinstance(sensors, dict) else ():
        Sensor.from_dict(fields if isinstance(fields, dict) else {})


def _decode(kind: type, data: Any) -> Any:  # noqa: ANN401 (msgspec's own signature)
    return np.array(data, dtype=np.float64)  # the arrays of a sensor


def _encode(value: Any) -> Any:  # noqa: ANN401 (msgspec's own signature)
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(type(value))
