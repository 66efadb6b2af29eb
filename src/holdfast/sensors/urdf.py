"""Taxel poses from a URDF file."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]


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
    joints = _joints(path)
    parents = {joint.child: joint for joint in joints}
    links = set(parents) | {joint.parent for joint in joints}
    if base not in links:
        raise ValueError(f"{path} has no link {base!r}; it has {', '.join(sorted(links)[:10])}")
    poses = [pose for j in joints if match in j.name if (pose := _pose(j, base, parents))]
    if not poses:
        raise ValueError(f"{path} has no joint below {base!r} whose name contains {match!r}")
    return np.array([p for p, _ in poses]), np.array([r for _, r in poses])


class _Joint:
    def __init__(self, element: ET.Element) -> None:
        origin = element.find("origin")
        attributes = {} if origin is None else origin.attrib
        self.name = element.get("name", "")
        self.parent = _link(element, "parent")
        self.child = _link(element, "child")
        self.position = _three_numbers(attributes.get("xyz", "0 0 0"))
        angles = _three_numbers(attributes.get("rpy", "0 0 0"))
        self.rotation: Array = Rotation.from_euler("xyz", angles).as_matrix()


def _joints(path: Path) -> list[_Joint]:
    text = path.read_text("utf-8")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path} declares a document type, which a URDF file never needs")
    try:
        root = ET.fromstring(text)
        return [
            _Joint(element) for element in root.iter("joint") if element.find("parent") is not None
        ]
    except (ET.ParseError, ValueError) as cause:
        raise ValueError(
            f"{path} is not a URDF file (a xacro file must be expanded first): {cause}"
        ) from cause


def _three_numbers(text: str) -> Array:
    numbers = np.array([float(word) for word in text.split()])
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ValueError(f"three finite numbers expected, {text!r} given")
    return numbers


def _link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _pose(joint: _Joint, base: str, parents: dict[str, _Joint]) -> tuple[Array, Array] | None:
    """Return the pose of a joint in the frame of `base`; None if it is not below `base`."""
    position, rotation = joint.position, joint.rotation
    visited = set()
    while joint.parent != base:
        if joint.parent not in parents or joint.parent in visited:
            return None
        visited.add(joint.parent)
        joint = parents[joint.parent]
        position = joint.position + joint.rotation @ position
        rotation = joint.rotation @ rotation
    return position, rotation
