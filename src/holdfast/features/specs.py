"""Feature specifications: the input of a classifier as data that a model file can hold."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from holdfast.features.haar import DEFAULT_WINDOW, FEATURE_NAMES, check_window

VALUE_KINDS = (*FEATURE_NAMES, "sigma_xyz", "change")
"""Kinds that the kernel computes from the force."""
WINDOWED = ("m", "sigma", "sigma_xyz", "change")
"""Those of them that are computed over a window; the others need one sample."""
OF_COMPONENTS = ("sigma_xyz",)
"""Those of them that need Haar windows of the components of the force, too."""
UNNAMED = ("sigma_xyz", "change")
"""Those of them that `parse_features` does not accept by name: `holdfast` has them."""

CHANGE_KINDS = (
    "force_change",
    "shear_change",
    "residual",
    "shear_residual",
    "pressure_shift",
    "moment_change",
)
LAG_KINDS = (*CHANGE_KINDS, "load_to_noise")
"""Kinds over a lag in seconds that a stream computes together."""
SECOND_KINDS = ("second_all", "second_shared", "second_shear", "second_own", "second_top")
"""Kinds of second differences of the taxels, at a spacing in seconds."""
MEAN_SECOND_KINDS = tuple(f"mean_{kind}" for kind in SECOND_KINDS)
"""The same, averaged over the last samples."""
RATIO_KINDS = ("shear_gain", "normal_gain", "ratio_gain")
"""Kinds of the change of the ratio of tangential to normal force, and of either force."""
RELATIVE_KINDS = (*LAG_KINDS, *SECOND_KINDS, *MEAN_SECOND_KINDS, *RATIO_KINDS)
"""Kinds that look back by a lag in seconds, relative to load or noise; see `kernel/motion.c`."""

OF_TWO_TAXELS = (
    "residual",
    "shear_residual",
    "pressure_shift",
    "moment_change",
    *(f"{mean}second_{name}" for mean in ("", "mean_") for name in ("shared", "own", "top")),
)
"""Kinds that compare taxels, so that a sensor of one taxel has none of them."""

FEATURE_KINDS = (*VALUE_KINDS, *RELATIVE_KINDS)
"""All kinds. The code of a kind is its position."""
TRANSFORMS = ("none", "log", "noise", "relative")
SCOPES = ("finger", "hand")
if TYPE_CHECKING:
    Kind = str
else:
    Kind = Literal[FEATURE_KINDS]  # msgspec refuses other kinds in a model file

MAX_LAG_SECONDS = 2.0
"""Longest lag of a relative feature [s]."""

DEPLOYED_FEATURES = ("F_a", "F_x", "F_y", "F_z", "sigma")
"""Features of the paper's deployed model, which leaves out m."""


class FeatureSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One feature of a finger at a sample.

    Attributes:
        kind: `F_a`, `F_x`, `F_y`, `F_z`, `m` or `sigma`, as in the paper; `sigma_xyz`, the root
            of the sum of squares of the sigmas of the three components; or `change`, the norm
            of the difference of F_tip between the last and the first sample of the window. Or a
            relative kind, over a lag of `seconds`: `force_change` and `shear_change`, the change
            of F_tip and its part across the normal; `residual` and `shear_residual`, how far the
            taxels move against their mean; `pressure_shift`, how far the centre of pressure
            moves; `moment_change`, the change of the moment about the normal; `load_to_noise`, the
            load itself. Second differences of the taxels at a spacing of `seconds`: `second_all`,
            of all; `second_shared`, weighted by their share of the load, and `second_shear`, its
            part across the normal; `second_own`, against their common motion; `second_top`, the
            largest of loaded taxels; the same after `mean_`, averaged over the last samples.
            `ratio_gain`, the change of the ratio of tangential to normal force; `shear_gain` and
            `normal_gain`, the signed change of either force, as a share of the normal force.
        window: number of samples in the window, for the last four kinds; 0 for the others.
        seconds: lag of a relative kind [s]; while a stretch is shorter, the longest that there
            is, from two samples on.
        transform: `none`; `log`, log(sqrt(value^2 + floor^2)); or `noise`, the logarithm of the
            ratio of sigma to the sigma of the sensor's noise alone; or, for the relative kinds
            only, `relative`: the logarithm of the ratio to the load, that of the ratio to the
            noise for second differences, or the share itself for the last three.
        scope: `finger`; or `hand`, the largest value of all fingers of the hand.
        floor: value that keeps the logarithm of `log` finite [unit of the readings].

    Raises:
        ValueError: the fields contradict each other.
    """

    kind: Kind
    window: int = 0
    transform: Literal["none", "log", "noise", "relative"] = "none"
    scope: Literal["finger", "hand"] = "finger"
    floor: float = 0.0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        if (self.kind in RELATIVE_KINDS) != (self.transform == "relative"):
            raise ValueError(
                f"the transform 'relative' is for {', '.join(RELATIVE_KINDS)}, and they for it; "
                f"{self.kind} with {self.transform!r} given"
            )
        if not (np.isfinite(self.seconds) and 0 <= self.seconds <= MAX_LAG_SECONDS):
            raise ValueError(
                f"a lag from 0 to {MAX_LAG_SECONDS:g} s expected, {self.seconds} given"
            )
        if (self.kind in RELATIVE_KINDS) != (self.seconds > 0):
            raise ValueError(
                f"a lag above 0 s expected for relative kinds alone; {self.kind} with "
                f"{self.seconds:g} s given"
            )
        if self.kind in WINDOWED:
            check_window(self.window)
        elif self.window != 0:
            raise ValueError(f"{self.kind} has no window; {self.window} given")
        if self.transform == "noise" and (self.kind != "sigma" or self.window < 4):
            raise ValueError(
                f"the transform 'noise' expects sigma over 4 samples or more; {self} given"
            )
        if self.transform == "log" and self.floor == 0:
            raise ValueError(
                f"{self}: a floor above 0 expected, which keeps the logarithm finite; 0 given"
            )
        if not (np.isfinite(self.floor) and self.floor >= 0):
            raise ValueError(f"a floor of at least 0 expected, {self.floor} given")

    @property
    def min_taxels(self) -> int:
        """Number of taxels from which a sensor has the feature."""
        return 2 if self.kind in OF_TWO_TAXELS else 1

    def __str__(self) -> str:
        text = f"{self.kind}[{self.window}]" if self.window else self.kind
        text = f"{text}[{self.seconds:g} s]" if self.seconds else text
        text = text if self.transform == "none" else f"{self.transform}({text})"
        return text if self.scope == "finger" else f"hand {text}"


FORCE_FLOOR, SIGMA_FLOOR, CHANGE_FLOOR = 20.0, 3.0, 5.0
"""Approximate noise of the values on a uSkin fingertip: 30 taxels of 0.9 counts rms [count]."""


def _rich(scope: Literal["finger", "hand"]) -> tuple[FeatureSpec, ...]:
    return (
        *(FeatureSpec("sigma_xyz", n, "log", scope, SIGMA_FLOOR) for n in (4, 14, 32, 64)),
        *(FeatureSpec("change", n, "log", scope, CHANGE_FLOOR) for n in (4, 16, 64)),
    )


HOLDFAST_FEATURES = (
    FeatureSpec("F_a", 0, "log", floor=FORCE_FLOOR),
    *_rich("finger"),
    *_rich("hand"),
)
"""The project's own features, named `holdfast` in the study."""


ANY_LAGS = (0.017, 0.067, 0.133, 0.267, 0.533)
"""Lags of the features for any hand [s]."""

ANY_FEATURES = (
    *(
        FeatureSpec(kind, transform="relative", seconds=seconds)
        for kind in CHANGE_KINDS
        for seconds in ANY_LAGS
    ),
    FeatureSpec("load_to_noise", transform="relative", seconds=ANY_LAGS[0]),
)
"""Features that carry over between hands, sensors, units and rates, named `any`."""


SLIP_SPACINGS = (0.0067, 0.0133)
"""Spacings of second differences of the taxels [s]: one and two samples at 150 Hz."""
SLIP_LAGS = (0.0067, 0.0267, 0.107)
"""Lags of changes of the ratio of forces [s]."""

SLIP_FEATURES = (
    *HOLDFAST_FEATURES,
    *(
        FeatureSpec(kind, transform="relative", seconds=seconds)
        for kind in SECOND_KINDS
        for seconds in SLIP_SPACINGS
    ),
    *(
        FeatureSpec(kind, transform="relative", seconds=SLIP_SPACINGS[0])
        for kind in MEAN_SECOND_KINDS
    ),
    *(
        FeatureSpec(kind, transform="relative", seconds=seconds)
        for kind in RATIO_KINDS
        for seconds in SLIP_LAGS
    ),
)
"""Features of the slip rule of `builtin:twin`."""


NAMED_FEATURES = {"holdfast": HOLDFAST_FEATURES, "any": ANY_FEATURES}
"""Lists of features by name."""


def parse_features(
    names: str | Sequence[str], window: int = DEFAULT_WINDOW
) -> tuple[FeatureSpec, ...]:
    """Return the specifications of named features.

    Args:
        names: names from `VALUE_KINDS` without those in `UNNAMED`, as a list or separated by
            commas. `F_tip` stands for F_x, F_y, F_z. `holdfast` alone stands for the project's
            own features, which have their own windows; `any` alone for the relative features of
            any hand.
        window: N_w, number of samples.

    Raises:
        ValueError: a name is unknown or given twice, there is no name, or the window is odd.

    Example:
        >>> [str(feature) for feature in parse_features("F_a,sigma")]
        ['F_a', 'sigma[14]']
    """
    if isinstance(names, str) and names in NAMED_FEATURES:
        return NAMED_FEATURES[names]
    given = names.split(",") if isinstance(names, str) else list(names)
    wanted: list[str] = []
    for name in (name.strip() for name in given):
        wanted += ["F_x", "F_y", "F_z"] if name == "F_tip" else [name]
    known = [kind for kind in VALUE_KINDS if kind not in UNNAMED]
    if unknown := [name for name in wanted if name not in known]:
        raise ValueError(
            f"unknown feature {unknown[0]!r}; there are {', '.join(known)}, F_tip for F_x, F_y "
            "and F_z, and holdfast or any alone for the project's own features"
        )
    if len(set(wanted)) < len(wanted):
        raise ValueError(f"a feature is given twice in {','.join(wanted)}")
    check_window(window)
    return tuple(FeatureSpec(n, window if n in WINDOWED else 0) for n in wanted)
