"""Collection of the truth of a grasp, sample by sample."""

import numpy as np

from holdfast.contact import Phase
from holdfast.metrics.truth_labels import phases_from_touch
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast.twin.contact import SLIP, SLIPPING_SHARE
from holdfast.twin.hand import FINGERS, N_JOINTS
from holdfast.twin.protocol import MIN_TOUCH_LOAD, Command
from holdfast.twin.world import World


class TruthLog:
    """Collector of the truth, sample by sample."""

    def __init__(self) -> None:
        self._phase: list[Phase] = []
        self._rows: dict[str, list[Array]] = {
            name: [] for name in ("outside_force", "object_pose", "joints", "set_point_error")
        }
        self._tips: list[Array] = []
        self._bodies: list[Array] = []

    def add(self, world: World, command: Command) -> None:
        """Add the state of the world after a sample."""
        data = world.hand.data
        self._phase.append(command.phase)
        self._rows["outside_force"].append(world.outside[:3].copy())
        pose = np.concatenate([world.bodies[-1, :3], data.qpos[N_JOINTS + 3 :]])
        self._rows["object_pose"].append(pose)
        self._rows["joints"].append(data.qpos[:N_JOINTS].copy())
        self._rows["set_point_error"].append(np.array(world.set_point_error))
        self._tips.append(world.contact.tips.copy())
        self._bodies.append(world.bodies[:-1].copy())

    def truth(self, times: Array) -> Truth:
        """Return the truth of all samples, whose times are (n,) [s]."""
        tips = np.array(self._tips)
        bodies = np.array(self._bodies)
        fingers = {
            finger: {
                "contact_force": -tips[:, place, :3],
                "slip_speed": tips[:, place, SLIP],
                "slipping_share": tips[:, place, SLIPPING_SHARE],
                "tip_pose": _poses(bodies[:, place]),
            }
            for place, finger in enumerate(FINGERS)
        }
        hand = {name: np.array(rows) for name, rows in self._rows.items()}
        push = np.linalg.norm(hand["outside_force"], axis=1)  # the only other contact then
        phase = phases_from_touch(np.array(self._phase, dtype=str), push, MIN_TOUCH_LOAD)
        return Truth(times, {"phase": phase, **hand}, fingers)


def _poses(bodies: Array) -> Array:
    """Return positions [m] and quaternions w, x, y, z, (n, 7)."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(bodies[:, 3:12].reshape(-1, 3, 3)).as_quat()
    return np.column_stack([bodies[:, :3], turns[:, 3], turns[:, :3]])
