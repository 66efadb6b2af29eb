"""Models: features, classifiers and decision rule of a hand, as plain validated data."""

import math
from collections.abc import Callable, Mapping
from hashlib import sha256
from importlib import resources
from pathlib import Path
from typing import Any, Literal, Self

import msgspec
import numpy as np
import numpy.typing as npt

from holdfast.classifiers import LinearClassifier, ModelClassifier, OnnxClassifier
from holdfast.classifiers.cause import CauseClassifier
from holdfast.classifiers.onnx_classifier import MAX_ONNX_SIZE
from holdfast.classifiers.slip import SlipRule
from holdfast.errors import ModelError, OutputError
from holdfast.features import DEFAULT_WINDOW, FeatureSpec, Tare
from holdfast.features.stream import StreamPlan, extract
from holdfast.files import check_keys, read_input, whole_file, write_whole
from holdfast.recordings import Recording
from holdfast.sensors import Sensor
from holdfast.sensors.types import MAX_RATE, ROTATION_TOLERANCE

SCHEMA = "holdfast.model/1"
ANY_FINGER = "*"
"""Name in place of a finger, for a model of any finger."""
MAX_FILE_SIZE = 1 << 24
"""Maximum size of a model file; one of all 18 modules of a hand has 2 MB [bytes]."""
MAX_WINDOW = 1 << 16
"""Maximum length of a window [samples]."""
MAX_FEATURES = 1024
"""Maximum number of features of a finger."""
MAX_FINGERS = 256
"""Maximum number of fingers, and of sensors, in a model."""
MAX_TAXELS = 4096
"""Maximum number of taxels of a sensor in a model."""
EXACT_RATE = 0.05
"""Tolerance of a measured rate beside a nominal one, as a share of it."""
RELATIVE_RATES = (30.0, 500.0)
"""Rates for which relative features are made [Hz]."""
RATE_TOLERANCE = 0.2
"""A source whose rate differs less from the model's, as a share of it, is not resampled."""


class FingerModel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Model of one finger.

    Attributes:
        features: input of the classifier, in its order.
        classifier: maps features to a probability of stability.
        sensor: name of the sensor of the training; None for any sensor.
        contact_threshold: F_a below it is no contact [unit of the readings]; None for none.
        contact_noise: the same as a multiple of the noise during the tare, used if
            `contact_threshold` is None.
        contact_load: threshold of contact on the load, as a multiple of the noise of the stream,
            for relative features; used instead of the others if it is given.
        causes: tells the causes of an unstable contact apart; None for none.
        slip: decides from the same features whether the finger slides; None for none.

    Raises:
        ModelError: the fields contradict each other.
    """

    features: tuple[FeatureSpec, ...]
    classifier: ModelClassifier
    sensor: str | None = None
    contact_threshold: float | None = None
    contact_noise: float | None = None
    contact_load: float | None = None
    causes: CauseClassifier | None = None
    slip: SlipRule | None = None

    def __post_init__(self) -> None:
        if self.causes is not None and self.causes.n_features != len(self.features):
            raise ModelError(
                f"{len(self.features)} features given, the causes expect {self.causes.n_features}"
            )
        if self.slip is not None and self.slip.classifier.n_features != len(self.features):
            raise ModelError(
                f"{len(self.features)} features given, the slip rule expects "
                f"{self.slip.classifier.n_features}"
            )
        _check_limit("features of a finger", len(self.features), MAX_FEATURES)
        _check_limit(
            "samples in a window", max((x.window for x in self.features), default=0), MAX_WINDOW
        )
        if self.contact_load is not None and not any(spec.seconds for spec in self.features):
            raise ModelError("contact_load given; it needs at least one relative feature")
        if len(self.features) != self.classifier.n_features:
            raise ModelError(
                f"{len(self.features)} features given, the classifier expects "
                f"{self.classifier.n_features}"
            )
        for value in (self.contact_threshold, self.contact_noise, self.contact_load):
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ModelError(f"a contact threshold of at least 0 expected, {value} given")


class Debounce(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Debouncing of state changes. By default, and for the paper's figures, there is none.

    Attributes:
        min_duration: time that a new state must last before it is reported [s].
        hysteresis: distance past its threshold that a probability needs to change the state.
        hold: time for which UNSTABLE is still reported after the last unstable sample, while
            the finger is in contact, so that one disturbance is one alarm [s].

    Raises:
        ModelError: a value is out of range.
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
    """

    recordings: dict[str, str]
    split: str
    parameters: dict[str, dict[str, float | str | None]]
    figures: dict[str, float | None] = {}
    seed: int = 0
    versions: dict[str, str] = {}
    samples: dict[str, tuple[int, int]] | msgspec.UnsetType = msgspec.UNSET


class ThresholdPoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Errors of the hand at one threshold.

    Attributes:
        threshold: probability from which a contact is stable.
        false_alarms_per_minute: per minute of stable label.
        missed: share of the events without an alarm within 0.2 s [%]; None without events.
    """

    threshold: float
    false_alarms_per_minute: float
    missed: float | None


class Tuning(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How the threshold of a model was chosen, and the metrics of the hand that it gave.

    Attributes:
        recordings: content digest of each recording, by name.
        requested: maximum number of false alarms per minute of stable label.
        threshold: that was chosen.
        false_alarms_per_minute: on the recordings.
        missed: by `post` [s], share of the events without an alarm until then [%].
        delay_median: of the alarms [s]; None if it is infinite, or without events.
        n_events: number of events in the recordings.
        stable_minutes: duration of stable labels [min].
        points: errors at the thresholds that were tried, lowest first.
    """

    recordings: dict[str, str]
    requested: float
    threshold: float
    false_alarms_per_minute: float
    missed: dict[str, float | None]
    delay_median: float | None
    n_events: int
    stable_minutes: float
    points: tuple[ThresholdPoint, ...] = ()


class Model(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Model of a hand: a classifier for each finger, or one for all fingers (`"*"`).

    Attributes:
        fingers: models of the fingers, by name; `"*"` alone is for any finger.
        sensors: the sensors that the fingers name.
        rate: samples per second for which the windows are meant [Hz]; None for any rate.
        window: N_w of the instability that is reported [samples].
        tare: how the baseline is found, as text: "0.5", "first", "none" or "START:END".
        debounce: debouncing of state changes.
        training: provenance; None for a model without training.
        tuning: how the threshold was chosen; None if it follows from the training.
        schema: version of the file format.
        name: of the model.

    Raises:
        ModelError: the fields contradict each other.

    Example:
        >>> model = Model.load("builtin:twin")
        >>> model.rate, list(model.fingers), [str(x) for x in model.finger("thumb").features[:2]]
        (150.0, ['*'], ['log(F_a)', 'log(sigma_xyz[4])'])
    """

    fingers: dict[str, FingerModel]
    rate: float | None = None
    sensors: dict[str, Sensor] = {}
    window: int = DEFAULT_WINDOW
    tare: str = "0.5"
    debounce: Debounce = Debounce()
    training: Training | None = None
    tuning: Tuning | None = None
    schema: Literal["holdfast.model/1"] = "holdfast.model/1"
    name: str = ""

    def __post_init__(self) -> None:
        if not self.fingers:
            raise ModelError("a model of at least one finger expected, none given")
        if ANY_FINGER in self.fingers and len(self.fingers) > 1:
            raise ModelError(f"a model for any finger ('*') has no others; {list(self.fingers)}")
        if self.rate is not None and not (math.isfinite(self.rate) and self.rate > 0):
            raise ModelError(f"a rate above 0 Hz expected, {self.rate} given")
        _check_limit("samples in a second", self.rate or 0, MAX_RATE)
        _check_limit("fingers", max(len(self.fingers), len(self.sensors)), MAX_FINGERS)
        _check_limit("samples in a window", self.window, MAX_WINDOW)
        for sensor in self.sensors.values():
            _check_limit(f"taxels of {sensor.name}", sensor.n_taxels, MAX_TAXELS)
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
        """Load a model from a file, or a built-in model by its name (`builtin:twin`).

        Raises:
            ModelError: the file or name does not exist; the file is not JSON; it has an unknown
                field, another shape, a number that is not finite, or another schema; an ONNX
                file that it names is missing, too large or another.
        """
        if str(path).startswith("builtin:"):
            return cls(**msgspec.structs.asdict(built_in(str(path))))
        try:
            data = read_input(path, MAX_FILE_SIZE)
        except OSError as cause:
            raise ModelError(f"cannot read the model {path}: {cause.strerror}") from cause
        try:
            check_keys(data)
            _check_sensors(data)
            model = msgspec.json.decode(data, type=cls, dec_hook=_decode)
            return model._with_contents(Path(path).parent)
        except (ModelError, TypeError, ValueError, ArithmeticError, RecursionError) as cause:
            raise ModelError(f"{path} is not a model of {SCHEMA}: {cause}") from cause

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the model as JSON, and its ONNX files beside it: all of them or none.

        Raises:
            OutputError: the file exists and `force` is not given, or it cannot be written.
        """
        if str(path).startswith("builtin:"):
            raise OutputError(f"{path} is the name of a built-in model; a file expected")
        written: list[Path] = []
        try:
            with whole_file(path, force=force) as part:
                part.write_bytes(msgspec.json.format(self._encoded(), indent=1) + b"\n")
                for classifier in self._onnx_classifiers():
                    file = Path(path).with_name(classifier.file)
                    is_new = not file.exists()
                    if is_new or file.read_bytes() != classifier.content:
                        write_whole(file, classifier.content, force=force)
                    if is_new:
                        written.append(file)
        except BaseException:
            for file in written:
                file.unlink(missing_ok=True)
            raise

    @property
    def digest(self) -> str:
        """Digest of the content, for results that depend on the model."""
        return sha256(self._encoded()).hexdigest()

    def finger(self, name: str) -> FingerModel:
        """Return the model of a finger.

        Raises:
            ModelError: the model does not have that finger.
        """
        if ANY_FINGER in self.fingers:
            return self.fingers[ANY_FINGER]
        if name not in self.fingers:
            raise ModelError(f"the model has no finger {name!r}; it has {', '.join(self.fingers)}")
        return self.fingers[name]

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
        """Return the plan of the feature stream of some fingers, for a source of a rate [Hz].

        Raises:
            ModelError: the features are relative, and the rate is outside `RELATIVE_RATES`.
        """
        relative = any(spec.seconds for name in sensors for spec in self.finger(name).features)
        low, high = RELATIVE_RATES
        rate = self.rate or source_rate
        if relative and not low * (1 - EXACT_RATE) <= rate <= high * (1 + EXACT_RATE):
            raise ModelError(
                f"{rate:.4g} Hz given, the model expects {low:g} to {high:g} Hz; resample the "
                "recording, or set the sensor to another rate"
            )
        return StreamPlan(
            sensors=sensors,
            features={name: self.finger(name).features for name in sensors},
            window=self.window,
            tare=Tare.parse(self.tare),
            rate=rate,
        )

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
        found = extract(self.plan(present, recording.rate), recording)
        return {
            name: self.finger(name).classifier.probability(found[name].features) for name in present
        }

    def _onnx_classifiers(self) -> list[OnnxClassifier]:
        classifiers = (finger.classifier for finger in self.fingers.values())
        return [classifier for classifier in classifiers if isinstance(classifier, OnnxClassifier)]

    def _encoded(self) -> bytes:
        """Return the JSON, without the contents of ONNX files; their digests are in it."""
        return msgspec.json.encode(self._map_contents(lambda _: b""), enc_hook=_encode)

    def _with_contents(self, folder: Path) -> Self:
        """Return the model with the contents of its ONNX files, which are in a folder.

        Raises:
            ModelError: the model file holds a content, or a file is missing, or not that file.
        """
        if any(classifier.content for classifier in self._onnx_classifiers()):
            raise ModelError("a model file names its ONNX file; it does not hold the content")
        return self._map_contents(lambda classifier: _read_onnx(folder / classifier.file))

    def _map_contents(self, content_of: Callable[[OnnxClassifier], bytes]) -> Self:
        if not self._onnx_classifiers():
            return self
        replace = msgspec.structs.replace
        fingers = {
            name: replace(
                finger, classifier=replace(finger.classifier, content=content_of(finger.classifier))
            )
            if isinstance(finger.classifier, OnnxClassifier)
            else finger
            for name, finger in self.fingers.items()
        }
        return replace(self, fingers=fingers)

    def _any_fingers(self, modules: Mapping[str, Sensor]) -> dict[str, Sensor]:
        wanted = self.fingers[ANY_FINGER].sensor
        tips = {name: sensor for name, sensor in modules.items() if "/" not in name} or modules
        if wanted is None:
            return dict(tips)
        fitting = {name: sensor for name, sensor in tips.items() if sensor.name == wanted}
        if not fitting:
            raise _other_sensor(
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
            raise _other_sensor(
                f"{name}: {sensor.n_taxels} taxels ({sensor.name}) given, the model expects "
                f"{known.n_taxels} ({known.name})"
            )
        if sensor.unit != known.unit:
            raise _other_sensor(
                f"{name}: readings in {sensor.unit} given, the model expects {known.unit}"
            )
        if not np.allclose(sensor.rotations, known.rotations, atol=ROTATION_TOLERANCE):
            raise _other_sensor(
                f"{name}: the taxels of {sensor.name} have other rotations than those of the "
                "training"
            )


def _read_onnx(path: Path) -> bytes:
    try:
        content = read_input(path, MAX_ONNX_SIZE)
    except OSError as cause:
        raise ModelError(f"cannot read {path.name} beside it: {cause.strerror}") from cause
    if not content:
        raise ModelError(f"{path.name} beside it is empty")
    return content


def _other_sensor(text: str) -> ModelError:
    """Return the error of a model for another sensor, with the built-in model that fits."""
    return ModelError(f"{text}; builtin:any fits every 3-axis sensor")


def _check_limit(what: str, given: float, most: float) -> None:
    if given > most:
        raise ModelError(f"at most {most:.7g} {what} expected, {given} given")


def built_in(name: str) -> Model:
    """Return a built-in model by its name.

    Raises:
        ModelError: the name is unknown.
    """
    if name not in BUILT_IN:
        raise ModelError(f"unknown model {name!r}; built in are {', '.join(BUILT_IN)}")
    return BUILT_IN[name]()


def _twin() -> Model:
    """Return the model trained on recordings of the twin, see docs/training.md."""
    data = (resources.files("holdfast") / "models" / "twin.json").read_bytes()
    model = msgspec.json.decode(data, type=Model, dec_hook=_decode)
    return msgspec.structs.replace(model, name="builtin:twin")


def _any() -> Model:
    """Return the model of any hand, trained on randomized hands of the twin."""
    data = (resources.files("holdfast") / "models" / "any.json").read_bytes()
    model = msgspec.json.decode(data, type=Model, dec_hook=_decode)
    return msgspec.structs.replace(model, name="builtin:any")


def _noise_floor() -> Model:
    """Return a model without training: stable while sigma is under three times the noise.

    The noise is that of the tare. At the noise itself the probability is 0.9, at nine times the
    noise it is 0.1.
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


BUILT_IN = {"builtin:any": _any, "builtin:twin": _twin, "builtin:noise-floor": _noise_floor}


def _check_sensors(data: bytes) -> None:
    """Refuse fields that no sensor has, which msgspec ignores in a dataclass."""
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
