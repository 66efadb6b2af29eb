"""Frames of modules against MuJoCo and SciPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from holdfast.recordings import Recording, Tactile, Truth
from holdfast.sensors import hand, sensor
from holdfast_interop.scene.hand_frames import allegro_links, frames_of


def module(name):
    known = hand("allegro-uskin").modules[name].sensor
    return Tactile(known, [0.0, 0.01], np.zeros((2, known.n_taxels, 3)))


def test_links_are_those_of_the_twin():
    mujoco = pytest.importorskip("mujoco")
    from holdfast.twin.hand import hand_xml

    model = mujoco.MjModel.from_xml_string(hand_xml())
    data = mujoco.MjData(model)
    joints = np.random.default_rng(0).uniform(-0.2, 1.2, 16)
    for k, angle in enumerate(joints):
        data.qpos[model.joint(f"joint_{k}").qposadr[0]] = angle
    mujoco.mj_kinematics(model, data)
    palm = data.body("palm")
    turn = palm.xmat.reshape(3, 3)
    for name, (position, rotation) in allegro_links(joints).items():
        if name != "palm_link":
            body = data.body(name)
            assert np.abs(palm.xpos + turn @ position - body.xpos).max() < 1e-9, name
            assert np.abs(turn @ rotation - body.xmat.reshape(3, 3)).max() < 1e-9, name


def test_taxels_are_where_the_hand_has_them():
    names = ("thumb", "index/2", "palm/1")
    recording = Recording("whole", {name: module(name) for name in names})
    frames = frames_of(recording)
    assert [(frame.name, frame.parent) for frame in frames] == [
        ("palm_link", "world"), *((f"module/{name}", "palm_link") for name in names),
    ]  # fmt: skip
    links = allegro_links(np.zeros(16))
    links |= {"thumb_link3": links["link_15.0"], "index_link1": links["link_1.0"]}
    for frame, name in zip(frames[1:], names, strict=True):
        known = hand("allegro-uskin").modules[name]
        position, turn = links[known.link]
        pose = frame.at(5.0)
        turned = Rotation.from_quat(pose[[4, 5, 6, 3]]).as_matrix()
        got = pose[:3] + known.sensor.positions @ turned.T
        assert np.abs(got - (position + known.positions @ turn.T)).max() < 1e-5


def test_measured_joints_move_the_fingers():
    times = np.array([0.0, 0.01])
    truth = Truth(times, {"joints": np.full((2, 16), [[0.0], [0.5]])})
    frames = frames_of(Recording("bent", {"index": module("index")}, truth=truth))
    assert np.abs(frames[1].at(0.0) - frames[1].at(0.01)).max() > 0.01
    assert (frames[1].at(-1.0) == frames[1].at(0.0)).all()


def test_other_modules_are_side_by_side_with_their_normals_up():
    skin = sensor("uskin-curved")
    modules = {
        "a": Tactile(skin, [0.0], np.zeros((1, 30, 3))),
        "b": Tactile(sensor("anyskin"), [0.0], np.zeros((1, 5, 3))),
    }
    (left, right) = (frame.at(0.0) for frame in frames_of(Recording("two", modules)))
    assert right[0] - left[0] > np.ptp(skin.positions, axis=0).max()
    turned = Rotation.from_quat(left[[4, 5, 6, 3]]).apply(skin.normal.copy())
    assert turned == pytest.approx([0.0, 0.0, 1.0])
