"""Where the sensors of a recording are: the frame of each module over time."""

import csv
from dataclasses import dataclass
from importlib import resources

import numpy as np

from holdfast.recordings import Recording
from holdfast.sensors import hand
from holdfast.sensors.types import Array

WORLD, PALM_LINK = "world", "palm_link"
"""Frames that others are given in."""
OBJECT_FRAME = "object"
ALLEGRO = "allegro-uskin"
FIRST_JOINTS = {"index": 0, "middle": 4, "ring": 8, "thumb": 12}
"""First joint of each finger of the Allegro hand, in the order of its driver."""
N_ALLEGRO_JOINTS = 16
SIDE_GAP = 1.5
"""Distance between modules that are shown side by side, as a multiple of the widest."""

RigidPose = tuple[Array, Array]
"""Position (3,) [m] and rotation matrix (3, 3)."""


@dataclass(frozen=True)
class Frame:
    """Frame over time, in its parent frame.

    Attributes:
        name: of the frame.
        parent: name of the frame that the poses are given in.
        times: (n,) [s]; one for a frame that does not move.
        poses: (n, 7) positions [m] and quaternions w x y z.
    """

    name: str
    parent: str
    times: Array
    poses: Array

    def at(self, time: float) -> Array:
        """Return the latest pose up to a time, (7,); the first one before it."""
        k = int(np.searchsorted(self.times, time, side="right")) - 1
        return np.asarray(self.poses[max(k, 0)])


def module_frame(module: str) -> str:
    """Return the name of the frame of a module.

    Example:
        >>> module_frame("index/1")
        'module/index/1'
    """
    return f"module/{module}"


def frames_of(recording: Recording) -> list[Frame]:
    """Return the frames of all modules, parents first.

    Measured poses of the fingertips (`tip_pose` of the truth) come first, then the built-in
    Allegro hand with its measured joints or, without them, with straight fingers. All other
    modules are side by side.
    """
    truth = recording.truth
    if truth is not None and len(truth.times):
        tips = {
            finger: np.asarray(arrays["tip_pose"], dtype=np.float64)
            for finger, arrays in truth.fingers.items()
            if finger in recording.modules and are_poses(arrays.get("tip_pose"))
        }
        if tips:
            frames = [Frame(module_frame(f), WORLD, truth.times, tips[f]) for f in tips]
            rest = [name for name in recording.modules if name not in tips]
            frames += object_frames(recording)
            return [*frames, *side_by_side(recording, rest)]
    allegro = hand(ALLEGRO)
    # By name and sensor: a pad of another hand may have the name of one of this.
    on_hand = [
        name
        for name, module in recording.modules.items()
        if name in allegro.modules and allegro.modules[name].sensor.name == module.sensor.name
    ]
    rest = [name for name in recording.modules if name not in on_hand]
    if not on_hand:
        return [*side_by_side(recording, rest), *object_frames(recording)]
    times, joints = hand_joints(recording)
    tracks: dict[str, list[Array]] = {name: [] for name in on_hand}
    mounts: dict[str, tuple[str, RigidPose]] = {}
    for name in on_hand:
        module = allegro.modules[name]
        # The hand names links by finger (`index_link3`), the table by joint, as the URDF of the
        # maker.
        link = module.link
        if link != PALM_LINK:
            finger, number = link.split("_link")
            link = f"link_{FIRST_JOINTS[finger] + int(number)}.0"
        # The table has the pose of each taxel on the link, the sensor has it in its own frame: one
        # taxel is enough, as the sensor is rigid.
        rotation = module.rotations[0] @ module.sensor.rotations[0].T
        mounts[name] = link, (module.positions[0] - rotation @ module.sensor.positions[0], rotation)
    for angles in joints:
        links = allegro_links(angles)
        for name in on_hand:
            link, mount = mounts[name]
            position, turned = links[link]
            tracks[name].append(_pose((position + turned @ mount[0], turned @ mount[1])))
    frames = [
        Frame(module_frame(name), PALM_LINK, times, np.array(track))
        for name, track in tracks.items()
    ]
    # Where the palm is in the world is not known: it stands at the origin.
    palm = Frame(PALM_LINK, WORLD, times[:1], np.array([_pose((np.zeros(3), np.eye(3)))]))
    return [palm, *frames, *side_by_side(recording, rest)]


def quaternions(rotations: Array) -> Array:
    """Return unit quaternions w x y z of rotation matrices, (..., 3, 3) to (..., 4).

    Example:
        >>> quaternions(np.diag([1.0, -1.0, -1.0])).tolist()
        [0.0, 1.0, 0.0, 0.0]
    """
    m = np.asarray(rotations)
    trace = np.einsum("...ii", m)
    # Four times the products of the components; the row of the largest one is exact.
    products = np.empty((*m.shape[:-2], 4, 4))
    products[..., 0, 0] = 1 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        products[..., i + 1, i + 1] = 1 + 2 * m[..., i, i] - trace
        products[..., 0, i + 1] = products[..., i + 1, 0] = m[..., k, j] - m[..., j, k]
        mixed = m[..., j, i] + m[..., i, j]
        products[..., i + 1, j + 1] = products[..., j + 1, i + 1] = mixed
    largest = np.einsum("...ii->...i", products).argmax(axis=-1)
    rows = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(rows / np.linalg.norm(rows, axis=-1, keepdims=True))


def allegro_links(joints: Array) -> dict[str, RigidPose]:
    """Return the pose of each link of the right Allegro hand in the frame of its palm.

    Args:
        joints: (16,) angles in the order of the driver [rad].
    """
    path = resources.files("holdfast.twin").joinpath("tables", "allegro_right.csv")
    lines = path.read_text("utf-8").splitlines()
    poses: dict[str, RigidPose] = {PALM_LINK: (np.zeros(3), np.eye(3))}
    # The table has parents before their links.
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        position, rotation = poses[row["parent"]]
        joint = int(row["joint"].removeprefix("joint_").removesuffix(".0"))
        axis = np.array([float(row[f"axis_{a}"]) for a in "xyz"])
        offset = np.array([float(row[a]) for a in "xyz"])
        # As in URDF: about the fixed axes x, then y, then z.
        roll, pitch, yaw = (float(row[a]) for a in ("roll", "pitch", "yaw"))
        x, y, z = np.eye(3)
        fixed = rotation_about(z, yaw) @ rotation_about(y, pitch) @ rotation_about(x, roll)
        turned = rotation @ fixed @ rotation_about(axis, float(joints[joint]))
        poses[row["link"]] = position + rotation @ offset, turned
    return poses


def hand_joints(recording: Recording) -> tuple[Array, Array]:
    """Return times (n,) [s] and joints (n, 16) [rad] of the hand."""
    truth = recording.truth
    if truth is not None and len(truth.times):
        joints = truth.hand.get("joints")
        if joints is not None and joints.shape[1:] == (N_ALLEGRO_JOINTS,):
            return truth.times, joints.astype(np.float64)
    return np.array([recording.start]), np.zeros((1, N_ALLEGRO_JOINTS))


def _pose(pose: RigidPose) -> Array:
    return np.concatenate([pose[0], quaternions(pose[1])])


def side_by_side(recording: Recording, names: list[str]) -> list[Frame]:
    """Return modules in a row along x, with their normals along z."""
    widths = [np.ptp(recording.modules[n].sensor.positions, axis=0).max() for n in names]
    # At least 1 cm: a sensor of one taxel has no width.
    step = SIDE_GAP * max([*widths, 0.01])
    frames = []
    for k, name in enumerate(names):
        x, y, z = recording.modules[name].sensor.normal
        if abs(z) > 1 - 1e-9:  # along the z axis there is no axis of rotation to compute
            rotation = np.eye(3) if z > 0 else np.diag([1.0, -1.0, -1.0])
        else:
            axis = np.array([y, -x, 0.0]) / np.hypot(x, y)
            rotation = rotation_about(axis, float(np.arccos(z)))
        pose = _pose((np.array([(k - (len(names) - 1) / 2) * step, 0.0, 0.0]), rotation))
        frames.append(Frame(module_frame(name), WORLD, np.array([recording.start]), pose[None]))
    return frames


def object_frames(recording: Recording) -> list[Frame]:
    """Return the frame of the object if its poses were measured."""
    truth = recording.truth
    poses = None if truth is None or not len(truth.times) else truth.hand.get("object_pose")
    if truth is None or poses is None or not are_poses(poses):
        return []
    return [Frame(OBJECT_FRAME, WORLD, truth.times, poses.astype(np.float64))]


def are_poses(array: Array | None) -> bool:
    """Return whether an array has a position and a quaternion in each row, all finite."""
    return array is not None and array.shape[1:] == (7,) and bool(np.isfinite(array).all())


def rotation_about(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit axis by an angle [rad], by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
