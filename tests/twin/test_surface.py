import numpy as np
import pytest
from scipy.spatial import cKDTree

from holdfast.sensors import sensor
from holdfast.twin.surface import AXIS, SHOULDER, curved_fingertip

SKIN = curved_fingertip()
TAXELS = sensor("uskin-curved")


def test_it_goes_through_all_taxels() -> None:
    """The skin near a taxel is a plane up to its curvature (14 mm) over half a pitch."""
    _, nearest = cKDTree(SKIN.nodes).query(TAXELS.positions)
    gap = TAXELS.positions - SKIN.nodes[nearest]
    height = np.abs((gap * SKIN.normals[nearest]).sum(axis=1))
    beside = np.linalg.norm(gap, axis=1)
    assert (height < beside**2 / (2 * 8e-3) + 2e-5).all()
    assert beside.max() < 2.4e-3


def test_it_faces_as_the_taxels_do() -> None:
    _, nearest = cKDTree(SKIN.nodes).query(TAXELS.positions)
    cosines = (SKIN.normals[nearest] * TAXELS.rotations[:, :, 2]).sum(axis=1)
    assert np.degrees(np.arccos(cosines)).max() < 15


def test_normals_are_unit_vectors_that_point_out() -> None:
    np.testing.assert_allclose(np.linalg.norm(SKIN.normals, axis=1), 1, atol=1e-8)
    foot = np.column_stack(
        [np.full(len(SKIN.nodes), AXIS), np.zeros(len(SKIN.nodes)), SKIN.nodes[:, 2]]
    )
    foot[:, 2] = foot[:, 2].clip(max=SHOULDER)
    out = SKIN.nodes - foot
    cosines = (SKIN.normals * out).sum(axis=1) / np.linalg.norm(out, axis=1)
    assert cosines.min() > 0.9


def test_left_and_right_are_mirror_images() -> None:
    mirrored = SKIN.nodes * [1, -1, 1]
    distance, twin = cKDTree(SKIN.nodes).query(mirrored)
    assert distance.max() < 2e-9
    np.testing.assert_allclose(SKIN.normals[twin], SKIN.normals * [1, -1, 1], atol=1e-6)
    np.testing.assert_allclose(SKIN.areas[twin], SKIN.areas, rtol=1e-6)


def test_elements_are_even_and_cover_walls_crown_and_tip() -> None:
    assert 140 <= len(SKIN.nodes) <= 180
    assert 8e-6 < SKIN.areas.min() < SKIN.areas.max() < 12e-6
    spacing = cKDTree(SKIN.nodes).query(SKIN.nodes, 2)[0][:, 1]
    assert 2.5e-3 < spacing.min() < spacing.max() < 3.6e-3
    low, high = SKIN.nodes.min(axis=0), SKIN.nodes.max(axis=0)
    assert low[0] < AXIS < high[0] < 0.027
    assert high[1] == pytest.approx(0.0143, abs=2e-4)
    assert low[2] < TAXELS.positions[:, 2].min()
    assert TAXELS.positions[:, 2].max() < high[2] < 0.037
