"""Feature specifications: the input of a classifier as data that a model file can hold."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import msgspec
import numpy as np

DEFAULT_WINDOW = 14
"""N_w, the number of samples in the window, as in most of the paper."""

Family = Literal["force", "change", "load", "sliding"]


class FeatureKind(NamedTuple):
    """A row of the table of features: all that code beside the kernel has to know of a kind.

    Attributes:
        name: in model files and on the command line.
        family: what the kernel computes together. `force` comes from the history of the force
            (`hf_force_feature` of `kernel/stream.c`); all others from single taxels
            (`kernel/motion.c`, and `kernel/sliding.c` for `sliding`), which computes at a lag only
            the families that it needs, and of `sliding` the kinds.
        window: `sample` for kinds of one sample, `window` for those of N_w samples, `lag` for those
            that look back by seconds.
        min_taxels: number of taxels from which a sensor has it: 2 for kinds that compare taxels.
        transforms: that a feature of this kind may have.
        of_components: whether it needs Haar windows of F_x, F_y and F_z, beside that of F_a.
        reach: by how many times the lag it looks back.
        by_name: whether `parse_features` accepts it; the others are in named lists only.
    """

    name: str
    family: Family
    window: Literal["sample", "window", "lag"]
    min_taxels: int = 1
    transforms: tuple[str, ...] = ("none", "log")
    of_components: bool = False
    reach: int = 1
    by_name: bool = True


def _over_lag(name: str, family: Family, min_taxels: int = 1, reach: int = 1) -> FeatureKind:
    # A value over a lag has a unit and depends on the hand: only its ratio to the load or to the
    # noise, whose logarithm is `relative`, carries over.
    return FeatureKind(name, family, "lag", min_taxels, ("relative",), reach=reach, by_name=False)


KINDS = {
    kind.name: kind
    for kind in (
        # The paper's: |F_tip|, its components, and equations 1 and 2 of |F_tip|.
        FeatureKind("F_a", "force", "sample"),
        FeatureKind("F_x", "force", "sample"),
        FeatureKind("F_y", "force", "sample"),
        FeatureKind("F_z", "force", "sample"),
        FeatureKind("m", "force", "window"),
        # The noise of the sensor is measured as a sigma, so `noise` is for sigma alone.
        FeatureKind("sigma", "force", "window", transforms=("none", "log", "noise")),
        # The root of the sum of squares of the sigmas of the three components.
        FeatureKind("sigma_xyz", "force", "window", of_components=True, by_name=False),
        # The norm of the difference of F_tip between the last and the first sample of the window.
        FeatureKind("change", "force", "window", by_name=False),
        # The change of F_tip, and its part across the normal.
        _over_lag("force_change", "change"),
        _over_lag("shear_change", "change"),
        # How far the taxels move against their mean, and the part across the normal.
        _over_lag("residual", "change", 2),
        _over_lag("shear_residual", "change", 2),
        # How far the centre of pressure moves; the change of the moment about the normal.
        _over_lag("pressure_shift", "change", 2),
        _over_lag("moment_change", "change", 2),
        # The load itself, the same at all lags: `any` has it once, and what counts changes (the
        # activity of own handling) leaves it out.
        _over_lag("load_to_noise", "load"),
        # Of sliding, with the equations of docs/decisions/0019: the friction of the finger
        # and of its taxels, the force, and the friction beside the largest of the last seconds.
        _over_lag("friction", "sliding", reach=0),
        _over_lag("taxel_friction", "sliding", reach=0),
        _over_lag("force_to_noise", "sliding", reach=0),
        _over_lag("friction_margin", "sliding", reach=0),
        # Changes of the force by the load, of both frictions, along the shear, and of the centre.
        _over_lag("shear_by_load", "sliding"),
        _over_lag("normal_by_load", "sliding"),
        _over_lag("force_by_load", "sliding"),
        _over_lag("friction_rise", "sliding"),
        _over_lag("taxel_friction_rise", "sliding"),
        _over_lag("alignment", "sliding"),
        _over_lag("centre_shift", "sliding", 2),
        # How differently the taxels change, and the share of them whose shear falls or rises.
        _over_lag("divergence", "sliding", 2),
        _over_lag("relative_divergence", "sliding", 2),
        _over_lag("normal_divergence", "sliding"),
        _over_lag("falling_share", "sliding"),
        _over_lag("rising_share", "sliding"),
        # Energies of fast changes, where the lag is the spacing: of first differences of shear,
        # and of second ones of shear, normal force, both, and shear about its mean.
        *(
            _over_lag(f"fast_{what}{over}", "sliding", 2 if what == "own" else 1, reach=2)
            for over in ("", "_30ms", "_100ms", "_400ms")
            for what in ("step", "shear", "normal", "all", "own")
        ),
    )
}
"""All kinds by name. The order is that of the numbers in `kernel/holdfast.h`: the code of a kind is
its position, so a new one of a family stands at the end of that family in both."""
RELATIVE_KINDS = tuple(kind.name for kind in KINDS.values() if kind.window == "lag")
TRANSFORMS = ("none", "log", "noise", "relative")
"""All transforms. The code of one of the force is its position."""
SCOPES = ("finger", "hand")
if TYPE_CHECKING:
    Kind = str
else:
    Kind = Literal[tuple(KINDS)]  # msgspec refuses other kinds in a model file

MAX_LAG_SECONDS = 2.0
"""Longest lag of a relative feature [s]."""


def kinds_of(*families: Family) -> tuple[str, ...]:
    """Return the names of the kinds of some families, in the order of the table."""
    return tuple(kind.name for kind in KINDS.values() if kind.family in families)


DEPLOYED_FEATURES = ("F_a", "F_x", "F_y", "F_z", "sigma")
"""Features of the paper's deployed model, which leaves out m."""


def check_window(window: int) -> int:
    """Return the window as an integer, if it can be cut into pairs.

    Raises:
        ValueError: the window is odd or under 2.
    """
    if window != int(window) or window < 2 or window % 2:
        raise ValueError(f"an even window of at least 2 samples expected, {window} given")
    return int(window)


class FeatureSpec(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One feature of a finger at a sample.

    Attributes:
        kind: name of a row of `KINDS`, which says what each is.
        window: number of samples in the window, for kinds with one; 0 for the others.
        seconds: lag of a kind with one [s]; while a stretch is shorter, the longest that there
            is, from two samples on.
        transform: `none`; `log`, log(sqrt(value^2 + floor^2)); or `noise`, the logarithm of the
            ratio of sigma to the sigma of the sensor's noise alone; or, for the relative kinds
            only, `relative`: the logarithm of the ratio to the load, or that ratio itself for those
            kinds of sliding that have a sign or a bound.
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
        # From the coarse to the fine: each message may take for granted what was checked before.
        kind = KINDS[self.kind]
        over_lag = kind.window == "lag"
        if over_lag != (self.transform == "relative"):
            raise ValueError(
                f"the transform 'relative' is for {', '.join(RELATIVE_KINDS)}, and they for it; "
                f"{self.kind} with {self.transform!r} given"
            )
        if not (np.isfinite(self.seconds) and 0 <= self.seconds <= MAX_LAG_SECONDS):
            raise ValueError(
                f"a lag from 0 to {MAX_LAG_SECONDS:g} s expected, {self.seconds} given"
            )
        if over_lag != (self.seconds > 0):
            raise ValueError(
                f"a lag above 0 s expected for relative kinds alone; {self.kind} with "
                f"{self.seconds:g} s given"
            )
        if kind.window == "window":
            check_window(self.window)
        elif self.window != 0:
            raise ValueError(f"{self.kind} has no window; {self.window} given")
        # A window of two samples has one detail, whose deviation from its mean is 0: no logarithm.
        if self.transform not in kind.transforms or (self.transform == "noise" and self.window < 4):
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
        return KINDS[self.kind].min_taxels

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


def _relative(family: Family, lags: Sequence[float]) -> tuple[FeatureSpec, ...]:
    return tuple(
        FeatureSpec(kind, transform="relative", seconds=seconds)
        for kind in kinds_of(family)
        for seconds in lags
    )


ANY_LAGS = (0.017, 0.067, 0.133, 0.267, 0.533)
"""Lags of the features for any hand [s]."""

ANY_FEATURES = (*_relative("change", ANY_LAGS), *_relative("load", ANY_LAGS[:1]))
"""Features that carry over between hands, sensors, units and rates, named `any`."""


SLIDING_LAGS = (0.014, 0.03, 0.067, 0.133, 0.267, 0.533)
"""Lags of changes in features of sliding [s]; the first is the spacing of fast changes, too."""
_SLIDING = kinds_of("sliding")
_STATES, _MARGIN, _CHANGES, _FAST = _SLIDING[:3], _SLIDING[3], _SLIDING[4:16], _SLIDING[16:]


def _sliding(**lags: Sequence[float]) -> tuple[FeatureSpec, ...]:
    return tuple(
        FeatureSpec(kind, transform="relative", seconds=seconds)
        for kind in _SLIDING
        for seconds in lags.get(kind, ())
    )


SLIDING_FEATURES = _sliding(
    **dict.fromkeys((*_STATES, *_FAST), SLIDING_LAGS[:1]),
    **{_MARGIN: (0.5, 2.0)},
    **dict.fromkeys(_CHANGES, SLIDING_LAGS),
)
"""All features of sliding."""

SLIDING_CHOICE = _sliding(
    force_to_noise=(0.014,), friction_margin=(0.5, 2.0), shear_by_load=(0.03, 0.067, 0.133, 0.533),
    force_by_load=(0.533,), friction_rise=(0.267,), taxel_friction_rise=(0.067, 0.267),
    alignment=(0.133,), centre_shift=(0.267, 0.533), divergence=(0.133, 0.267, 0.533),
    relative_divergence=(0.03,), falling_share=(0.067, 0.133, 0.533),
    rising_share=(0.067, 0.133, 0.533), fast_step_30ms=(0.014,), fast_shear_30ms=(0.014,),
    fast_all_30ms=(0.014,), fast_own_30ms=(0.014,), fast_step_400ms=(0.014,),
    fast_shear_400ms=(0.014,), fast_all_400ms=(0.014,), fast_own_400ms=(0.014,),
)  # fmt: skip
"""Those of a linear head, from 450 hands: the ones with the least weights were left out in turn."""

ZERO_KINDS = (*_STATES, _MARGIN)
"""Kinds that mean nothing where the readings without contact are not known."""

FASTEST_SPACING = 0.0067
"""Spacing of the fastest changes in `SLIP_FEATURES` [s]: one sample at 150 Hz."""

SLIP_FEATURES = (
    *HOLDFAST_FEATURES,
    *SLIDING_FEATURES,
    *_sliding(**dict.fromkeys(_FAST, (FASTEST_SPACING,))),
)
"""Features of the slip rule of `builtin:twin`. Without the fastest changes it finds 74 in place of
90 % of the slips of objects left out before 1 mm."""


NAMED_FEATURES = {"holdfast": HOLDFAST_FEATURES, "any": ANY_FEATURES}
"""Lists of features by name."""


def parse_features(
    names: str | Sequence[str], window: int = DEFAULT_WINDOW
) -> tuple[FeatureSpec, ...]:
    """Return the specifications of named features.

    Args:
        names: names of the `KINDS` that have one for users (`by_name`), as a list or separated by
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
    texts = names.split(",") if isinstance(names, str) else list(names)
    wanted: list[str] = []
    for name in (name.strip() for name in texts):
        wanted += ["F_x", "F_y", "F_z"] if name == "F_tip" else [name]
    kinds = [kind.name for kind in KINDS.values() if kind.by_name]
    if unknown := [name for name in wanted if name not in kinds]:
        raise ValueError(
            f"unknown feature {unknown[0]!r}; there are {', '.join(kinds)}, F_tip for F_x, F_y "
            "and F_z, and holdfast or any alone for the project's own features"
        )
    if len(set(wanted)) < len(wanted):
        raise ValueError(f"a feature is given twice in {','.join(wanted)}")
    check_window(window)
    return tuple(FeatureSpec(n, window if KINDS[n].window == "window" else 0) for n in wanted)
