"""Methods that learn nothing: what calling every contact stable gives, and the noise floor."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from holdfast.detection import ANY_FINGER, DEFAULT_WINDOW, Model
from holdfast.detection.features import extract
from holdfast.detection.heads import Linear
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import FeatureSpec
from holdfast.sensors.types import Array
from holdfast.training.classifiers import Parameters, Samples
from holdfast.training.classifiers.fitting import Fitted
from holdfast_lab.study.methods.method import HandSignal, Method, stretchwise


@dataclass(frozen=True)
class FixedRule:
    """A rule that no sample changes.

    Attributes:
        rule: of the probability.
        reference: reference parameters: none.
    """

    rule: Linear
    reference: Parameters = field(default_factory=dict)

    def fit(self, samples: Samples, parameters: Parameters, seed: int) -> Fitted:
        """Return the rule; the arguments are not used."""
        del samples, parameters, seed
        return Fitted(self.rule)


def noise_feature(hand: HandSignal) -> Mapping[str, Array]:
    """Return the feature of `builtin:noise-floor`: log of sigma over the noise of the tare."""
    sensors = {name: finger.sensor for name, finger in hand.fingers.items()}
    specs = dict.fromkeys(sensors, (FeatureSpec("sigma", DEFAULT_WINDOW, "noise"),))
    plan = StreamPlan(sensors, specs, DEFAULT_WINDOW, hand.tare, hand.rate)
    return {name: rows.features for name, rows in extract(plan, hand.recording).items()}


ALWAYS_STABLE = Method(
    "always_stable",
    "always stable in contact",
    "untrained",
    "nothing: every contact is stable, and nothing slides; the contact threshold is that of all "
    "methods",
    lambda hand: stretchwise(hand, lambda finger: finger.amplitude[:, None]),
    FixedRule(Linear((0.0,), (1.0,), ((0.0,),), (1.0,))),
)
NOISE_FLOOR = Method(
    "noise_floor",
    "noise floor (untrained)",
    "untrained",
    "ours: builtin:noise-floor, stable while sigma at N_w = 14 is under three times the noise of "
    "the tare",
    noise_feature,
    FixedRule(Model.load("builtin:noise-floor").finger(ANY_FINGER).stable.rule),
)
