import numpy as np
import pytest

from detection.detector.build import sensor as made
from holdfast.detection import Tare
from holdfast.detection.kernel_config import packed, stream_config
from holdfast.detection.plan import StreamPlan
from holdfast.detection.specs import ANY_FEATURES, HOLDFAST_FEATURES
from holdfast.sensors import sensor
from kernel.extension import extension

PATCH = sensor("uskin-4x4")
HUGE = 2**64 - 1


@pytest.fixture
def plan():
    features = (*HOLDFAST_FEATURES, *ANY_FEATURES)
    return StreamPlan(
        {"one": PATCH, "two": PATCH}, {"one": features, "two": features}, 14, Tare.parse("0.5"), 100
    )


FIRST_RELATIVE = len(HOLDFAST_FEATURES)


def refused(plan, field, value):
    """Return what the kernel says of constants of which one is another."""
    config = stream_config(plan)
    *names, last = field.split(".")
    if names[1:]:
        getattr(config, names[0])[int(names[1])][last] = value
    elif names:
        getattr(config, names[0])[int(last)] = value
    else:
        config.hand[0][last] = value
    with pytest.raises(ValueError) as raised:
        extension.Stream(*packed(config), plan.baseline.tobytes())
    return str(raised.value).removeprefix("constants that do not fit: ")


class TestCheck:
    @pytest.mark.parametrize(
        ("field", "value", "wrong"),
        [
            ("n_history", 63, "n_history"),
            ("n_history", 0, "n_history"),
            ("n_history", HUGE - 1, "n_history"),
            ("n_history", 32, "n_levels"),
            ("n_channels", 2, "n_channels"),
            ("n_channels", 1, "n_channels, too few for a feature"),
            ("n_levels", 0, "n_levels"),
            ("n_levels", 5, "n_levels"),
            ("n_levels", HUGE, "n_levels"),
            ("n_track", 2, "n_lags or n_track"),
            ("n_track", HUGE, "n_lags or n_track"),
            ("n_slides", 4, "n_slides"),
            ("lags.1.sliding", 1, "a lag"),
            ("period", 0.0, "period"),
            ("period", np.nan, "period"),
            ("period", np.inf, "period"),
            ("tare_kind", 4, "tare_kind"),
            ("tare_kind", -1, "tare_kind"),
            ("tare_seconds", np.nan, "tare_seconds or noise_seconds"),
            ("noise_seconds", np.inf, "tare_seconds or noise_seconds"),
            ("lags.1.seconds", np.nan, "a lag"),
            ("lags.1.samples", HUGE, "a lag"),
            ("fingers.1.first", 4, "first, first_taxel or n_taxels of a finger"),
            ("fingers.1.first_taxel", 4, "first, first_taxel or n_taxels of a finger"),
            ("fingers.1.n_taxels", HUGE, "first, first_taxel or n_taxels of a finger"),
            ("fingers.0.n_taxels", 0, "first, first_taxel or n_taxels of a finger"),
            ("fingers.0.n_taxels", 13, "used"),
            ("fingers.0.n_used", 15.0, "n_used of a finger"),
            ("fingers.0.n_used", np.nan, "n_used of a finger"),
            ("fingers.0.sigma_window", 13, "sigma_window or ready_window of a finger"),
            ("fingers.0.sigma_window", 66, "sigma_window or ready_window of a finger"),
            ("fingers.0.ready_window", 65, "sigma_window or ready_window of a finger"),
            ("features.0.kind", 64, "kind of a feature"),
            ("features.0.kind", -2, "kind of a feature"),
            ("features.0.transform", 3, "transform or floor of a feature"),
            ("features.0.floor", np.nan, "transform or floor of a feature"),
            ("features.0.same_as", 1, "same_as of a feature"),
            ("features.1.same_as", 0, "same_as of a feature"),
            ("features.0.window", 2, "window of a feature"),
            ("features.1.window", 3, "window of a feature"),
            ("features.1.window", 0, "window of a feature"),
            ("features.1.window", 66, "window of a feature"),
            ("features.1.lag", 1, "lag of a feature"),
            (f"features.{FIRST_RELATIVE}.lag", HUGE, "lag of a feature"),
            (f"features.{FIRST_RELATIVE}.window", 2, "window of a feature"),
            ("used.3", 0.5, "used"),
            ("used.3", np.nan, "used"),
            ("used.3", 0.0, "n_used of a finger"),
            ("rotations.5", np.inf, "a rotation or a position of a taxel"),
            ("positions.5", np.nan, "a rotation or a position of a taxel"),
        ],
    )
    def test_what_does_not_fit_is_named(self, plan, field, value, wrong):
        assert refused(plan, field, value) == wrong

    def test_bridged_gaps_need_lags(self):
        plan = StreamPlan({"one": PATCH}, {"one": HOLDFAST_FEATURES}, 14, Tare.parse("first"), 100)
        assert refused(plan, "fingers.0.bridges", True) == "bridges of a finger without lags"

    def test_a_padding_has_no_scope(self):
        plan = StreamPlan(
            {"one": PATCH, "two": PATCH},
            {"one": HOLDFAST_FEATURES, "two": HOLDFAST_FEATURES[:1]},
            14, Tare.parse("first"), 100,
        )  # fmt: skip
        index = len(HOLDFAST_FEATURES) + 1
        assert stream_config(plan).features[index]["kind"] == -1
        assert refused(plan, f"features.{index}.of_hand", True) == "of_hand of a padding"

    def test_a_set_holds_512_taxels(self):
        plan = StreamPlan({"f": made(512)}, {"f": HOLDFAST_FEATURES}, 14, Tare.parse("first"), 100)
        config = stream_config(plan)
        extension.Stream(*packed(config), plan.baseline.tobytes())  # 512
        config.hand["n_lanes"] = 516
        config.fingers["n_taxels"], config.fingers["n_used"] = 513, 513.0
        used = (np.arange(516) < 513).astype(float)
        wide = config._replace(used=used, rotations=np.zeros(9 * 516), positions=np.zeros(3 * 516))
        with pytest.raises(ValueError, match="first, first_taxel or n_taxels of a finger"):
            extension.Stream(*packed(wide), bytes(513 * 24))

    def test_normals_are_finite(self, plan):
        normal = (0.0, 1.0, np.inf)
        assert refused(plan, "fingers.1.normal", normal) == "normal or max_field of a finger"
