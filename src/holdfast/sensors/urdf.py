"""Taxel poses from a URDF file."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from holdfast.files import read_input
from holdfast.sensors.types import Array

MAX_URDF_SIZE = 1 << 26
"""Maximum size of a URDF file [bytes]."""

LinkPose = tuple[Array, Array]
"""Position [m] and rotation matrix."""


def taxel_poses(path: Path, base: str, match: str) -> tuple[Array, Array]:
    """Return positions [m] and rotations of the joints below `base` with `match` in their name.

    Args:
        path: path of a URDF file.
        base: link in whose frame the poses are expressed.
        match: text that the names of the joints contain.

    Returns:
        (n, 3) positions and (n, 3, 3) rotations, in the order of the file.

    Raises:
        ValueError: the file is not a URDF file, or the link or the joints do not exist.
    """
    try:
        text = read_input(path, MAX_URDF_SIZE).decode()
    except UnicodeError as cause:
        raise ValueError(f"{path} is not a URDF file: {cause}") from cause
    # Entities can make a text of gigabytes out of a file of a few lines.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path} declares a document type, which a URDF file never needs")
    try:
        elements = list(ET.fromstring(text).iter("joint"))
        joints = [_Joint(element) for element in elements if element.find("parent") is not None]
    except (ET.ParseError, ValueError) as cause:
        raise ValueError(
            f"{path} is not a URDF file (a xacro file must be expanded first): {cause}"
        ) from cause
    # A link has one parent in a URDF; of a file that gives it two, the last counts.
    parents = {joint.child: joint for joint in joints}
    links = set(parents) | {joint.parent for joint in joints}
    if base not in links:
        raise ValueError(f"{path} has no link {base!r}; it has {', '.join(sorted(links)[:10])}")
    # The pose of `base` and of each link below it in the frame of `base`.
    below: dict[str, list[str]] = {}
    for link, joint in parents.items():
        below.setdefault(joint.parent, []).append(link)
    frames: dict[str, LinkPose] = {base: (np.zeros(3), np.eye(3))}
    left = [base]
    while left:
        link = left.pop()
        for child in below.get(link, ()):
            if child not in frames:  # links in a circle are visited once
                frames[child] = parents[child].frame(frames[link])
                left.append(child)
    poses = [j.frame(frames[j.parent]) for j in joints if match in j.name and j.parent in frames]
    if not poses:
        raise ValueError(f"{path} has no joint below {base!r} whose name contains {match!r}")
    return np.array([p for p, _ in poses]), np.array([r for _, r in poses])


class _Joint:
    """Joint of a URDF file: the pose of its child link in the frame of its parent link."""

    def __init__(self, element: ET.Element) -> None:
        origin = element.find("origin")
        # A joint without an origin has the frame of its parent link, as the format says.
        attributes = {} if origin is None else origin.attrib
        self.name = element.get("name", "")
        ends = (element.find(end) for end in ("parent", "child"))
        self.parent, self.child = ("" if end is None else end.get("link", "") for end in ends)
        triplets = []
        for key in ("xyz", "rpy"):
            text = attributes.get(key, "0 0 0")
            numbers = np.array([float(word) for word in text.split()])
            if numbers.shape != (3,) or not np.isfinite(numbers).all():
                raise ValueError(f"three finite numbers expected, {text!r} given")
            triplets.append(numbers)
        self.position, angles = triplets
        self.rotation: Array = _rotation(*angles)

    def frame(self, parent: LinkPose) -> LinkPose:
        """Return the pose of the link below, in the frame that the parent's pose is in."""
        position, rotation = parent
        return position + rotation @ self.position, rotation @ self.rotation


def _rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation matrix of roll, pitch and yaw [rad]: about x, then y, then z."""
    (cx, cy, cz), (sx, sy, sz) = ([f(a) for a in (roll, pitch, yaw)] for f in (math.cos, math.sin))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    result: Array = about_z @ about_y @ about_x
    return result
