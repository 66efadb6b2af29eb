"""Skin of the curved fingertip as a quadrature: nodes, normals and areas.

The tables of the sensor have 30 taxels and no surface. The skin is assumed to be the smooth
surface through the taxels: a capsule (a half cylinder that ends in a dome) of varying radius.
"""

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import RBFInterpolator

from holdfast.sensors import sensor
from holdfast.sensors.types import Array

AXIS = 0.01254
"""Palmar coordinate of the capsule's axis [m]; the taxels of the outer walls are beside it."""
SHOULDER = 0.022
"""Distal coordinate where the cylinder ends and the dome begins [m]. Own choice: from the point of
the axis there, taxels of the dome are 12.5 to 13.3 mm away, as on a ball."""
BASE = 0.0005
"""Distal coordinate where the skin begins [m]: half a pitch before the first row of taxels."""
EDGE_MARGIN = 0.003
"""Width of the skin beyond the taxels of the outer walls [m]: half a pitch."""
NODE_PITCH = 0.0033
"""Distance of neighbouring nodes [m]: half the taxels' pitch, about four nodes per taxel."""
N_ELEMENT_PARTS = 6
"""Parts of an element along each side, to compute its area and mean normal."""

_RADIUS = 0.0135  # between the cylinder's 14 mm and the dome's 13, for lengths along the skin
_DIGITS = 9  # nanometres: the table must not depend on the linear algebra of the machine


class Surface(NamedTuple):
    """Quadrature of a skin in the fingertip frame (x palmar, z distal).

    Attributes:
        nodes: (n, 3) centres of the elements [m].
        normals: (n, 3) outward unit normals of the elements.
        areas: (n,) areas of the elements [m^2].
    """

    nodes: Array
    normals: Array
    areas: Array


@cache
def curved_fingertip(pitch: float = NODE_PITCH) -> Surface:
    """Compute the skin of a `uskin-curved` fingertip, with elements of pitch x pitch.

    Rows of elements follow each other along the finger and over the tip. Nodes are rounded to a
    nanometre, so that they are the same bits on every machine.

    Args:
        pitch: distance of neighbouring nodes, of which a row has a whole number [m].

    Returns:
        The quadrature, with read-only arrays.

    Example:
        >>> skin = curved_fingertip()
        >>> len(skin.nodes), round(skin.areas.sum() * 1e6)
        (158, 1643)
    """
    # The distance from the capsule's axis, by thin-plate splines on the unit capsule: it has no
    # singular point, while a pair of angles has one at the dome's pole.
    offsets = sensor("uskin-curved").positions - [AXIS, 0.0, 0.0]
    foot = np.zeros_like(offsets)
    foot[:, 2] = offsets[:, 2].clip(max=SHOULDER)
    distances = np.linalg.norm(offsets - foot, axis=1)
    unit = (offsets - foot) / distances[:, None] * _RADIUS + foot
    radius = RBFInterpolator(unit / _RADIUS, distances, kernel="thin_plate_spline")
    # Rows begin and end at lengths along the skin, from the base to the pole [m].
    straight, bent = SHOULDER - BASE, np.pi / 2 * _RADIUS
    parts = round((straight + bent) / pitch)
    edges = np.linspace(BASE, SHOULDER + bent, parts + 1).tolist()
    rows = [_row(radius, begin, end, pitch) for begin, end in pairwise(edges)]
    nodes, vectors = (np.concatenate(arrays) for arrays in zip(*rows, strict=True))
    areas = np.linalg.norm(vectors, axis=1)
    surface = Surface(
        np.round(nodes, _DIGITS),
        np.round(vectors / areas[:, None], _DIGITS),
        np.round(areas, _DIGITS + 6),
    )
    for array in surface:
        array.flags.writeable = False
    return surface


def _row(radius: RBFInterpolator, begin: float, end: float, pitch: float) -> tuple[Array, Array]:
    """Return nodes and area vectors of the elements between two lengths along the skin."""
    angle = np.pi / 2 + EDGE_MARGIN / _RADIUS
    elevation = max((begin + end) / 2 - SHOULDER, 0.0) / _RADIUS
    n = max(round(2 * angle * _RADIUS * np.cos(elevation) / pitch), 2)
    lengths = np.linspace(begin, end, N_ELEMENT_PARTS + 1)
    angles = np.linspace(-angle, angle, n * N_ELEMENT_PARTS + 1)
    # Corners of the parts, by length along the skin [m] and angle about its axis [rad].
    length, around = np.meshgrid(lengths, angles, indexing="ij")
    rise = np.maximum(length - SHOULDER, 0.0) / _RADIUS
    level = np.cos(rise)
    direction = np.stack([level * np.cos(around), level * np.sin(around), np.sin(rise)], -1)
    foot = np.zeros_like(direction)
    foot[..., 2] = np.minimum(length, SHOULDER)
    unit = direction + foot / _RADIUS
    distances = radius(unit.reshape(-1, 3)).reshape(length.shape)
    foot[..., 0] = AXIS
    corners: Array = direction * distances[..., None] + foot
    # The area vector of a part is half the cross product of its diagonals.
    across, along = np.diff(corners, axis=1), np.diff(corners, axis=0)
    vectors = np.cross(across[:-1] + across[1:], along[:, :-1] + along[:, 1:]) / 4
    vectors = vectors.reshape(N_ELEMENT_PARTS, n, N_ELEMENT_PARTS, 3).sum(axis=(0, 2))
    middle = np.arange(n) * N_ELEMENT_PARTS + N_ELEMENT_PARTS // 2
    return corners[N_ELEMENT_PARTS // 2, middle], vectors
