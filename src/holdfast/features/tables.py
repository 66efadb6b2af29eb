"""The tables of the C kernel, by the names of its structs in `kernel/kernel.h`."""

import numpy as np

from holdfast.features import arrays as at
from holdfast.features.arrays import Layout, Memory
from holdfast.features.haar import N_SUMS
from holdfast.features.specs import SCOPES, VALUE_KINDS
from holdfast.kernel import _extension
from holdfast.sensors.types import Array, Integers

Struct = dict[str, object]
StreamTables = tuple[Struct, list[Struct], list[Struct], list[Struct], Array, Array, Array, Array]


def c_stream(layout: Layout, memory: Memory) -> _extension.Stream:
    """Return the C stream of a layout, before its first sample.

    Args:
        layout: of the stream.
        memory: whose baseline it begins with, and which has the sizes of the rings.
    """
    return _extension.Stream(*stream_tables(layout, memory))


def stream_tables(layout: Layout, memory: Memory) -> StreamTables:
    """Return the tables of a stream: the arguments of a C stream, and the first of a detector."""
    n_lanes = -(-layout.n_taxels // _extension.LANES) * _extension.LANES
    return (
        _hand(layout, memory, int(n_lanes.sum())),
        [_finger(layout, f, int(n_lanes[:f].sum())) for f in range(len(layout.windows))],
        [
            _feature(codes, floor)
            for own_codes, own_floors in zip(layout.specs, layout.floors, strict=True)
            for codes, floor in zip(own_codes.tolist(), own_floors.tolist(), strict=True)
        ],
        [_lag(layout, index) for index in range(len(layout.lags))],
        _in_lanes(layout, n_lanes, (~layout.ignored).astype(np.float64)),
        _in_lanes(layout, n_lanes, layout.rotations),
        _in_lanes(layout, n_lanes, layout.places),
        memory.baseline,
    )


def _hand(layout: Layout, memory: Memory, n_lanes: int) -> Struct:
    return {
        "n_fingers": len(layout.windows),
        "n_lanes": n_lanes,
        "n_features": layout.specs.shape[1],
        "n_lags": len(layout.lags),
        "n_history": memory.blocks.shape[1],
        "n_channels": memory.blocks.shape[2] // (N_SUMS * layout.n_levels),
        "n_levels": layout.n_levels,
        "n_track": len(memory.taxel_forces),
        "period": layout.period,
        "tare_kind": layout.tare_kind,
        "tare_seconds": layout.tare_seconds,
        "noise_seconds": layout.noise_seconds,
        "average_gain": layout.average_gain,
        "alike": layout.alike,
        "has_centres": layout.has_centres,
        "has_ratios": layout.has_ratios,
    }


def _finger(layout: Layout, f: int, first: int) -> Struct:
    constants, windows = layout.constants[f].tolist(), layout.windows[f].tolist()
    return {
        "first_taxel": int(layout.offsets[f]),
        "n_taxels": int(layout.n_taxels[f]),
        "first": first,
        "n_used": constants[at.N_USED],
        "low": constants[at.LOW_LIMIT],
        "high": constants[at.HIGH_LIMIT],
        "low_end": constants[at.LOW_END],
        "high_end": constants[at.HIGH_END],
        "max_offset": constants[at.MAX_OFFSET],
        "min_noise": constants[at.MIN_NOISE],
        "rounding_noise": constants[at.ROUNDING_NOISE],
        "max_step": constants[at.MAX_STEP],
        **{f"normal[{axis}]": value for axis, value in enumerate(layout.normals[f].tolist())},
        "sigma_window": windows[at.SIGMA_WINDOW],
        "ready_window": windows[at.READY_WINDOW],
        "bridges": windows[at.BRIDGES],
    }


def _feature(codes: list[int], floor: float) -> Struct:
    kind = codes[at.KIND]
    is_padding, is_relative = kind < 0, kind >= len(VALUE_KINDS)
    return {
        "kind": kind,
        "transform": 0 if is_padding or is_relative else codes[at.TRANSFORM],
        "of_hand": not is_padding and codes[at.SCOPE] == SCOPES.index("hand"),
        "window": 0 if is_padding or is_relative else codes[at.WINDOW],
        "lag": codes[at.WINDOW] if is_relative else 0,
        "same_as": 0 if is_padding else codes[at.SAME_AS],
        "floor": floor,
    }


def _lag(layout: Layout, index: int) -> Struct:
    has_changes, has_seconds, has_means, has_ratios = layout.families[index].tolist()
    return {
        "samples": int(layout.lags[index]),
        "seconds": float(layout.lag_seconds[index]),
        "has_changes": has_changes,
        "has_seconds": has_seconds,
        "has_means": has_means,
        "has_ratios": has_ratios,
    }


def _in_lanes(layout: Layout, n_lanes: Integers, values: Array) -> Array:
    """Return values of all taxels (n_taxels, ...) in lanes: of each finger (..., n_lanes)."""
    parts = []
    for start, stop, n in zip(layout.offsets, layout.offsets[1:], n_lanes, strict=False):
        own = values[start:stop].reshape(stop - start, -1).T
        parts.append(np.pad(own, ((0, 0), (0, n - own.shape[1]))).ravel())
    return np.concatenate(parts)
