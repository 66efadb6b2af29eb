"""layout.js: positions of taxels on the map."""

import numpy as np
import pytest

from holdfast.sensors import sensor

LAYOUT = "async (given) => (await import('/page/layout.js')).layout(...given)"
TURNED = "async (given) => (await import('/page/layout.js')).toMapFrame(...given)"


def laid_out(page, layout):
    parts = (layout.positions, layout.rotations, layout.normal)
    found = page.evaluate(LAYOUT, [part.tolist() for part in parts])
    return {name: np.array(value) for name, value in found.items()}


@pytest.mark.parametrize("name", ["uskin-4x4", "gtac"])
def test_a_flat_patch_does_not_change(module, name):
    layout = sensor(name)
    found = laid_out(module, layout)
    assert found["points"] == pytest.approx(layout.positions[:, :2])
    assert found["right"] == pytest.approx(np.tile([1.0, 0, 0], (layout.n_taxels, 1)))
    assert found["up"] == pytest.approx(np.tile([0, 1.0, 0], (layout.n_taxels, 1)))


def test_the_curved_fingertip_shows_all_its_taxels(module):
    layout = sensor("uskin-curved")
    found = laid_out(module, layout)
    points = found["points"]
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert apart[~np.eye(30, dtype=bool)].min() > 5e-3
    # Left is the mirror of right: the table lists the right side first, in the same order.
    for left, right in ((16, 10), (17, 11), (21, 15), (22, 6), (25, 9), (26, 1), (30, 5)):
        assert points[left - 1] == pytest.approx(points[right - 1] * [-1, 1], abs=1e-9)
    # The tip is up, and the lateral axis to the right.
    assert points[9, 1] > points[14, 1]
    assert points[0, 0] > 0


def test_a_push_to_the_tip_points_up_on_every_taxel_of_the_wall(module):
    layout = sensor("uskin-curved")
    found = laid_out(module, layout)
    for k in (3, 4, 13, 14, 19, 20, 28, 29):  # their skin is parallel to the axis
        reading = layout.rotations[k].T @ [0, 0, 2.0]
        rotation = layout.rotations[k].tolist()
        arrow = module.evaluate(
            TURNED,
            [reading.tolist(), rotation, found["right"][k].tolist(), found["up"][k].tolist()],
        )
        assert arrow == pytest.approx([0, 2, 0], abs=1e-6)
