import os

import numpy as np
import pytest

from holdfast.sensors import Sensor
from holdfast.sensors.urdf import taxel_poses

FINGER = """<?xml version="1.0" encoding="utf-8"?>
<robot name="finger">
  <link name="palm"/><link name="tip"/><link name="pad"/>
  <joint name="finger_joint" type="revolute">
    <origin xyz="0 0 0.1" rpy="0 0 0"/><parent link="palm"/><child link="tip"/>
  </joint>
  <joint name="mount" type="fixed">
    <origin xyz="0.01 0 0" rpy="0 1.5707963267948966 0"/><parent link="tip"/><child link="pad"/>
  </joint>
  <joint name="taxel_1" type="fixed">
    <origin xyz="0 0.002 0.003" rpy="0 0 0"/><parent link="pad"/><child link="t1"/>
  </joint>
  <joint name="taxel_2" type="fixed">
    <origin xyz="0 -0.002 0.003" rpy="0.3 -0.2 0.1"/><parent link="pad"/><child link="t2"/>
  </joint>
  <joint name="taxel_3" type="fixed"><parent link="tip"/><child link="t3"/></joint>
  <joint name="taxel_elsewhere" type="fixed"><parent link="palm"/><child link="t4"/></joint>
  <transmission name="drive"><joint name="taxel_drive"/></transmission>
</robot>
"""


@pytest.fixture
def finger(tmp_path):
    path = tmp_path / "finger.urdf"
    path.write_text(FINGER)
    return path


def changed(path, old, new):
    path.write_text(FINGER.replace(old, new))
    return path


def test_poses_add_up_along_the_joints(finger):
    one = Sensor.from_urdf(finger, "tip", rate=100, normal=(1, 0, 0))
    assert (one.name, one.n_taxels, one.rate) == ("finger", 3, 100)
    assert one.normal.tolist() == [1, 0, 0]
    np.testing.assert_allclose(
        one.positions, [[0.013, 0.002, 0], [0.013, -0.002, 0], [0, 0, 0]], atol=1e-15
    )
    np.testing.assert_allclose(one.rotations[0, :, 2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(one.rotations[2], np.eye(3))


def test_angles_are_about_fixed_axes(finger):
    """URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = 0.3, -0.2, 0.1
    x = [[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]]
    y = [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]]
    z = [[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]
    turn = np.array(z) @ np.array(y) @ np.array(x)
    np.testing.assert_allclose(Sensor.from_urdf(finger, "pad").rotations[1], turn, atol=1e-15)


def test_base_decides_what_belongs_to_it(finger):
    assert Sensor.from_urdf(finger, "pad").n_taxels == 2
    assert Sensor.from_urdf(finger, "palm").n_taxels == 4


def test_match(finger):
    assert Sensor.from_urdf(finger, "tip", match="taxel_1").n_taxels == 1
    with pytest.raises(ValueError, match="'tip'"):
        Sensor.from_urdf(finger, "tip", match="sensor")


def test_unknown_base(finger):
    with pytest.raises(ValueError, match="'hand'"):
        Sensor.from_urdf(finger, "hand")


def test_a_ring_of_joints_ends(finger):
    path = changed(
        finger,
        '<parent link="palm"/><child link="tip"/>',
        '<parent link="pad"/><child link="tip"/>',
    )
    with pytest.raises(ValueError, match="'t1'"):
        Sensor.from_urdf(path, "t1")


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ('xyz="0.01 0 0"', 'xyz="${width} 0 0"', "could not convert"),
        ('xyz="0.01 0 0"', 'xyz="0.01 0"', "three finite numbers"),
        ('xyz="0.01 0 0"', 'xyz="nan 0 0"', "three finite numbers"),
        ("</robot>", "", "no element found"),
    ],
)
def test_no_urdf(finger, old, new, hint):
    with pytest.raises(ValueError, match=hint):
        Sensor.from_urdf(changed(finger, old, new), "tip")


@pytest.mark.parametrize("declared", ["<!DOCTYPE robot>", '<!DOCTYPE r [<!ENTITY a "aa">]>'])
def test_document_types_are_refused(finger, declared):
    path = changed(finger, "<robot name", f"{declared}<robot name")
    text = r"declares a document type, which a URDF file never needs$"
    with pytest.raises(ValueError, match=text):
        Sensor.from_urdf(path, "tip")


def test_a_long_chain_is_walked_once(tmp_path):
    """Each link's pose is computed once: the joints of a chain are not walked for each taxel."""
    n = 3000
    joints = "".join(
        f'<joint name="taxel{k}"><origin xyz="0 0 0.001" rpy="0 0 0.1"/><parent link="l{k}"/>'
        f'<child link="l{k + 1}"/></joint>'
        for k in range(n)
    )
    path = tmp_path / "chain.urdf"
    path.write_text(f"<robot>{joints}</robot>")
    one = Sensor.from_urdf(path, "l0")
    np.testing.assert_allclose(one.positions[:, 2], 0.001 * (1 + np.arange(n)))
    angle = 0.1 * n
    np.testing.assert_allclose(one.rotations[-1, 0, :2], [np.cos(angle), -np.sin(angle)], atol=1e-9)


def test_a_pipe_and_other_encodings_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="regular file"):
        Sensor.from_urdf(tmp_path / "pipe", "a")
    (tmp_path / "a.urdf").write_text(FINGER, "utf-16")
    with pytest.raises(ValueError, match=r"a\.urdf"):
        Sensor.from_urdf(tmp_path / "a.urdf", "tip")


def test_rotations_equal_those_of_scipy(tmp_path):
    from scipy.spatial.transform import Rotation

    generator = np.random.default_rng(0)
    right_angles = generator.choice([0.0, np.pi / 2, -np.pi / 2, np.pi, 1.5708], (20, 3))
    angles = np.concatenate([generator.uniform(-4, 4, (80, 3)), right_angles])
    joints = "".join(
        f'<joint name="taxel_{k}"><origin xyz="0 0 0" rpy="{r!r} {p!r} {y!r}"/>'
        f'<parent link="base"/><child link="t{k}"/></joint>'
        for k, (r, p, y) in enumerate(angles.tolist())
    )
    (tmp_path / "a.urdf").write_text(f"<robot>{joints}</robot>")
    rotations = taxel_poses(tmp_path / "a.urdf", "base", "taxel_")[1]
    expected = Rotation.from_euler("xyz", angles).as_matrix()
    np.testing.assert_allclose(rotations, expected, rtol=0, atol=1e-15)
