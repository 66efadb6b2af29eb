"""Contact stability of robot fingertips, from 3-axis tactile sensors, at every sample.

The names below are the public interface; each is imported when it is first used, so that
`import holdfast` costs next to nothing.

Example:
    >>> from holdfast import Model, StreamDetector, open_source
    >>> from holdfast.demo_data import BOX_SLIPS  # a real robot; "xela://auto" is your hand
    >>> with open_source(BOX_SLIPS, speed=0) as source:
    ...     for event in StreamDetector(Model.load("builtin:any"), source).changes():
    ...         print(f"{event.time:.3f} s  {event.finger}: {event.state}")
    0.013 s  finger1: STABLE
    0.013 s  finger2: STABLE
    0.013 s  hand: STABLE
    1.103 s  finger1: UNSTABLE
    1.103 s  finger2: UNSTABLE
    1.103 s  hand: UNSTABLE
    3.624 s  finger2: NO_CONTACT
    3.674 s  finger1: NO_CONTACT
    3.674 s  hand: NO_CONTACT
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holdfast.contact import Cause as Cause
    from holdfast.contact import ContactEstimate as ContactEstimate
    from holdfast.contact import ContactEvent as ContactEvent
    from holdfast.contact import ContactState as ContactState
    from holdfast.contact import Fault as Fault
    from holdfast.contact import HandEstimate as HandEstimate
    from holdfast.contact import Reason as Reason
    from holdfast.detection import FEATURE_NAMES as FEATURE_NAMES
    from holdfast.detection import Detector as Detector
    from holdfast.detection import Model as Model
    from holdfast.detection import detect as detect
    from holdfast.detection import features_frame as features_frame
    from holdfast.detection import fingertip_force as fingertip_force
    from holdfast.detection import haar_features as haar_features
    from holdfast.devices.sources import Arrival as Arrival
    from holdfast.devices.sources import Source as Source
    from holdfast.devices.sources import open_source as open_source
    from holdfast.errors import EngineError as EngineError
    from holdfast.errors import HoldfastError as HoldfastError
    from holdfast.errors import MissingExtra as MissingExtra
    from holdfast.errors import ModelError as ModelError
    from holdfast.errors import OutputError as OutputError
    from holdfast.errors import RecordingError as RecordingError
    from holdfast.errors import SourceError as SourceError
    from holdfast.errors import StreamError as StreamError
    from holdfast.errors import TrainingError as TrainingError
    from holdfast.exporters import export as export
    from holdfast.io import load_dataset as load_dataset
    from holdfast.io import load_recording as load_recording
    from holdfast.io import save_recording as save_recording
    from holdfast.live.stream_detector import StreamDetector as StreamDetector
    from holdfast.metrics import event_metrics as event_metrics
    from holdfast.metrics import sample_metrics as sample_metrics
    from holdfast.recordings import Label as Label
    from holdfast.recordings import Recording as Recording
    from holdfast.recordings import Tactile as Tactile
    from holdfast.recordings import Truth as Truth
    from holdfast.sensors import Hand as Hand
    from holdfast.sensors import Sensor as Sensor
    from holdfast.sensors import sensor as sensor
    from holdfast.training import Setting as Setting
    from holdfast.training import StabilityClassifier as StabilityClassifier
    from holdfast.training import calibrate as calibrate
    from holdfast.training import evaluate as evaluate
    from holdfast.training import teach as teach
    from holdfast.training import train as train

_NAMES = {
    "sensors": ("Hand", "Sensor", "sensor"),
    "recordings": ("Label", "Recording", "Tactile", "Truth"),
    "exporters": ("export",),
    "io": ("load_dataset", "load_recording", "save_recording"),
    "detection": (
        "FEATURE_NAMES",
        "Detector",
        "Model",
        "detect",
        "features_frame",
        "fingertip_force",
        "haar_features",
    ),
    "contact": (
        "Cause",
        "ContactEstimate",
        "ContactEvent",
        "ContactState",
        "Fault",
        "HandEstimate",
        "Reason",
    ),
    "live.stream_detector": ("StreamDetector",),
    "devices.sources": ("Arrival", "Source", "open_source"),
    "training": ("Setting", "StabilityClassifier", "calibrate", "evaluate", "teach", "train"),
    "metrics": ("event_metrics", "sample_metrics"),
    "errors": (
        "EngineError",
        "HoldfastError",
        "MissingExtra",
        "ModelError",
        "OutputError",
        "RecordingError",
        "SourceError",
        "StreamError",
        "TrainingError",
    ),
}
"""Public names of each module."""
_HOMES = {name: module for module, names in _NAMES.items() for name in names}

# Without scikit-learn (extra `train`) `from holdfast import *` leaves its estimator out.
_MISSING = set() if find_spec("sklearn") else {"StabilityClassifier"}
__all__ = sorted({*_HOMES, "__version__"} - _MISSING)  # noqa: PLE0605 (one list of names, above)


def __getattr__(name: str) -> Any:  # noqa: ANN401 (the value is any of the public names)
    if name == "__version__":
        from holdfast.errors import DISTRIBUTION

        value: Any = import_module("importlib.metadata").version(DISTRIBUTION)
    elif name in _HOMES:
        value = getattr(import_module(f"holdfast.{_HOMES[name]}"), name)
    else:
        raise AttributeError(f"module 'holdfast' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
