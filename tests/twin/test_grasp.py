from dataclasses import replace

import numpy as np
import pytest

from holdfast.twin.grasp import PATH_GAPS, aims_of, closing_path, object_pose
from holdfast.twin.hand import FINGERS, JOINTS, HandModel
from holdfast.twin.objects import OTHER_OBJECTS, distance_to, load_objects, object_named

pytestmark = pytest.mark.slow

OBJECTS = tuple(load_objects())
OTHERS = tuple(load_objects(OTHER_OBJECTS))


@pytest.fixture(scope="module")
def can():
    return closing_path(object_named("can"))


@pytest.mark.parametrize(
    ("name", "table", "miss"),
    [(name, None, 0.002) for name in OBJECTS] + [(name, OTHER_OBJECTS, 0.004) for name in OTHERS],
)
def test_every_object_can_be_grasped(name, table, miss):
    item = object_named(name, table)
    path = closing_path(item)
    assert path.misses.max() < miss
    assert path.cosines.min() > 0.9  # 25 degrees
    limits = HandModel.build(item).limits()
    for index, finger in enumerate(FINGERS):
        own = limits[JOINTS[finger] : JOINTS[finger] + 4]
        assert (path.joints[index] >= own[:, 0]).all()
        assert (path.joints[index] <= own[:, 1]).all()
    assert np.abs(np.diff(path.joints, axis=1)).max() < 0.35  # no jump to another solution


@pytest.mark.parametrize("name", OBJECTS)
def test_pads_aim_at_the_surface_of_the_object_where_it_stands(name):
    item = replace(object_named(name), texture_amplitude=0.0)
    position, turn = object_pose(item)
    c, s = np.cos(turn), np.sin(turn)
    for finger in FINGERS:
        push, points = aims_of(item, finger)
        world = points @ [[1, 0, 0], [0, 0, 1], [0, -1, 0]] - position
        own = world @ [[c, -s, 0], [s, c, 0], [0, 0, 1]]
        far = distance_to(item, own)
        touch = np.abs(PATH_GAPS).argmin()
        assert far[touch] == pytest.approx(0.0, abs=3e-4)
        assert (np.diff(far[:touch]) < 0).all()
        assert push @ push == pytest.approx(1.0)


def test_targets_go_along_the_path(can):
    for k, depth in enumerate(can.depths):
        joints = can.targets(np.full(4, depth))
        for index, finger in enumerate(FINGERS):
            np.testing.assert_allclose(
                joints[JOINTS[finger] : JOINTS[finger] + 4], can.joints[index, k]
            )
    between = can.targets(np.full(4, 0.5 * (can.depths[3] + can.depths[4])))
    first = JOINTS["ring"]
    np.testing.assert_allclose(
        between[first : first + 4], 0.5 * (can.joints[3, 3] + can.joints[3, 4])
    )


def test_beyond_its_ends_the_path_stands_still(can):
    np.testing.assert_array_equal(can.targets(np.full(4, 0.2)), can.targets(np.full(4, 0.035)))
    np.testing.assert_array_equal(can.targets(np.full(4, -0.2)), can.targets(np.full(4, -0.025)))


@pytest.mark.parametrize("radius", [0.08, 0.020, 0.002])
def test_an_object_of_another_size_is_refused_in_one_line(radius):
    item = replace(object_named("can"), name="tub", size=(radius, 0.05, 0.001))
    with pytest.raises(ValueError, match=r"'tub' cannot be grasped: .*24 to 45 mm"):
        closing_path(item)
