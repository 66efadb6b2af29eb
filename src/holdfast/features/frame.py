"""The paper's features of recordings, in unbroken stretches, and as a pandas DataFrame."""

from typing import TYPE_CHECKING

import numpy as np

from holdfast.errors import require_extras
from holdfast.features.force import tared_force
from holdfast.features.haar import DEFAULT_WINDOW, FEATURE_NAMES, haar_features
from holdfast.features.tare import Tare, TareArgument
from holdfast.recordings import GAP_PERIODS, Recording, Tactile
from holdfast.sensors.types import Array, Integers

if TYPE_CHECKING:
    from pandas import DataFrame


def stretch_features(
    module: Tactile, force: Array, window: int = DEFAULT_WINDOW
) -> tuple[Array, Integers]:
    """Return the paper's features of a module, without windows across its gaps.

    Args:
        module: whose times have the gaps.
        force: (n, 3) F_tip of its samples [unit of the readings].
        window: N_w [samples].

    Returns:
        (n, 6) features in the order of `FEATURE_NAMES`, NaN without a full window; and the
        indices of the first sample after each gap.
    """
    gaps = np.flatnonzero(np.diff(module.times) > GAP_PERIODS * module.period) + 1
    # A window across a gap has no sigma: a sample of NaN stands in the gap, and is taken out again.
    features = haar_features(np.insert(force, gaps, np.nan, axis=0), window)
    return np.delete(features, gaps + np.arange(len(gaps)), axis=0), gaps


def features_frame(
    recording: Recording, window: int = DEFAULT_WINDOW, tare: TareArgument | Tare = 0.5
) -> "DataFrame":
    """Return the paper's features of a recording as a pandas DataFrame.

    Args:
        recording: of which all modules with samples are in the frame.
        window: N_w, number of samples in the window; even, at least 2.
        tare: how the baseline of each module is found, see `fingertip_force`.

    Returns:
        A row for each finger and sample, in the order of time: `time` [s], `finger`, and the
        columns `FEATURE_NAMES` [unit of the readings], NaN without a full window.

    Raises:
        MissingExtra: pandas is not installed.
        ValueError: the window or the tare is invalid, or no finite sample lies in its time.

    Example:
        >>> from holdfast.synthetic import synthetic_recording
        >>> frame = features_frame(synthetic_recording("made", seed=0))
        >>> list(frame.columns), len(frame)
        (['time', 'finger', 'F_a', 'F_x', 'F_y', 'F_z', 'm', 'sigma'], 5175)
    """
    require_extras("pandas")
    import pandas as pd

    parts = []
    for finger, module in recording.modules.items():
        if module.n_samples:
            features, _ = stretch_features(module, tared_force(module, tare).force, window)
            part = pd.DataFrame(features, columns=list(FEATURE_NAMES))
            part.insert(0, "time", module.times)
            part.insert(1, "finger", finger)
            parts.append(part)
    return pd.concat(parts).sort_values("time", kind="stable", ignore_index=True)
