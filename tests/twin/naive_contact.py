"""The contact law again, node by node, in the world frame, as its equations are written."""

from dataclasses import dataclass, field

import numpy as np

from holdfast.sensors.types import Array
from holdfast.twin.objects import GraspObject, distance_to
from holdfast.twin.skin import Skin
from holdfast.twin.surface import Surface

H = 1e-6  # for central differences [m]


@dataclass
class NaiveFinger:
    surface: Surface
    item: GraspObject
    skin: Skin = field(default_factory=Skin)

    def __post_init__(self) -> None:
        n = len(self.surface.nodes)
        self.bristles, self.sliding = np.zeros((n, 3)), np.zeros(n)
        self.loads, self.forces = np.zeros(n), np.zeros((n, 3))

    def touch(self, tip: Array, item: Array, dt: float) -> None:
        """Forces on the nodes in the world frame, from two rows of `bodies`."""
        rotation, back = tip[3:12].reshape(3, 3), item[3:12].reshape(3, 3)
        arms = self.surface.nodes @ rotation.T
        points = arms + tip[:3]
        inside = (points - item[:3]) @ back
        velocities = tip[12:15] + np.cross(tip[15:18], arms)
        velocities -= item[12:15] + np.cross(item[15:18], points - item[:3])
        depths = -distance_to(self.item, inside)
        for i, depth in enumerate(depths):
            normal = back @ self._normal(inside[i])
            self._node(i, depth, normal, velocities[i], rotation, dt)

    def _normal(self, point: Array) -> Array:
        steps = H * np.eye(3)
        smooth = distance_to(_smooth(self.item), np.concatenate([point + steps, point - steps]))
        gradient = smooth[:3] - smooth[3:]
        return gradient / np.linalg.norm(gradient)

    def _node(
        self, i: int, depth: float, normal: Array, velocity: Array, rotation: Array, dt: float
    ) -> None:
        skin, item = self.skin, self.item
        elastic = skin.stiffness * self.surface.areas[i] * depth * (1 + skin.hardening * depth)
        leaving = velocity @ normal
        load = elastic * max(1 - skin.damping * leaving, 0)
        if depth <= 0 or load <= 0:
            self.bristles[i] = self.forces[i] = 0
            self.sliding[i] = self.loads[i] = 0
            return
        plane = np.eye(3) - np.outer(normal, normal)
        along = plane @ velocity
        drop = np.exp(-self.sliding[i] / skin.stribeck)
        limit = load * (item.mu_kinetic + (item.mu_static - item.mu_kinetic) * drop)
        stiffness = skin.shear * elastic / (depth + skin.engagement)
        bristle = plane @ (rotation @ self.bristles[i] + along * dt)
        stretched = np.linalg.norm(bristle)
        kept = min(stretched, limit / stiffness)
        bristle *= kept / max(stretched, 1e-300)
        self.bristles[i] = rotation.T @ bristle
        fade = 1 - np.exp(-dt / skin.memory)
        self.sliding[i] += fade * ((stretched - kept) / dt - self.sliding[i])
        friction = -stiffness * (bristle + skin.shear_time * along)
        friction *= min(1, limit / max(np.linalg.norm(friction), 1e-300))
        self.loads[i] = load
        self.forces[i] = load * normal + friction


def _smooth(item: GraspObject) -> GraspObject:
    from dataclasses import replace

    return replace(item, texture_amplitude=0.0)
