"""Taxel poses out of a URDF file."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]


def taxel_poses(path: Path, base: str, match: str) -> tuple[Array, Array]:
    """Positions [m] and rotations of the joints below `base` whose names hold `match`.

    Args:
        path: a URDF file.
        base: the link whose frame the poses are in.
        match: text in the names of the joints.

    Returns:
        (n, 3) positions and (n, 3, 3) rotations, in the order of the file.

    Raises:
        ValueError: no URDF, no such link, or no such joint.
    """
    joints = _joints(path)
    parents = {joint.child: joint for joint in joints}
    links = set(parents) | {joint.parent for joint in joints}
    if base not in links:
        raise ValueError(f"{path} has no link {base!r}; it has {', '.join(sorted(links)[:10])}")
    poses = [pose for j in joints if match in j.name if (pose := _pose(j, base, parents))]
    if not poses:
        raise ValueError(f"{path} has no joint below {base!r} whose name holds {match!r}")
    return np.array([p for p, _ in poses]), np.array([r for _, r in poses])


class _Joint:
    def __init__(self, element: ET.Element) -> None:
        origin = element.find("origin")
        attributes = {} if origin is None else origin.attrib
        self.name = element.get("name", "")
        self.parent = _link(element, "parent")
        self.child = _link(element, "child")
        self.position = _three(attributes.get("xyz", "0 0 0"))
        angles = _three(attributes.get("rpy", "0 0 0"))
        self.rotation: Array = Rotation.from_euler("xyz", angles).as_matrix()


def _joints(path: Path) -> list[_Joint]:
    text = path.read_text("utf-8")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path} declares a document type: a plain URDF file has none")
    try:
        root = ET.fromstring(text)
        return [
            _Joint(element) for element in root.iter("joint") if element.find("parent") is not None
        ]
    except (ET.ParseError, ValueError) as cause:
        raise ValueError(
            f"{path} is no URDF file (is it a xacro not yet expanded?): {cause}"
        ) from cause


def _three(text: str) -> Array:
    numbers = np.array([float(word) for word in text.split()])
    if numbers.shape != (3,) or not np.isfinite(numbers).all():
        raise ValueError(f"three finite numbers expected, {text!r} given")
    return numbers


def _link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _pose(joint: _Joint, base: str, parents: dict[str, _Joint]) -> tuple[Array, Array] | None:
    """The joint's pose in the frame of `base`; None where it does not hang below it."""
    position, rotation = joint.position, joint.rotation
    seen = set()
    while joint.parent != base:
        if joint.parent not in parents or joint.parent in seen:
            return None
        seen.add(joint.parent)
        joint = parents[joint.parent]
        position = joint.position + joint.rotation @ position
        rotation = joint.rotation @ rotation
    return position, rotation
