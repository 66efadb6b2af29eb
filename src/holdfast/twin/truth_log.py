"""Collection of the truth of a simulation, sample by sample."""

from collections.abc import Sequence

import numpy as np

from holdfast.contact import Phase
from holdfast.recordings import Truth
from holdfast.sensors.types import Array
from holdfast.twin.contact import SLIP, SLIPPING_SHARE, Contact


class TruthLog:
    """Collector of the truth of all samples.

    Args:
        fingers: names of the fingertips.
    """

    def __init__(self, fingers: Sequence[str]) -> None:
        self._fingers = fingers
        self._phase: list[Phase] = []
        self._rows: dict[str, list[Array]] = {}
        self._tips: list[Array] = []

    def __len__(self) -> int:
        return len(self._phase)

    def add(self, phase: Phase, contact: Contact, **rows: Array | float) -> None:
        """Add the state after a sample: phase, contact and other rows of the truth by name."""
        self._phase.append(phase)
        self._tips.append(contact.tips.copy())
        for name, row in rows.items():
            self._rows.setdefault(name, []).append(np.array(row))

    def truth(self, times: Array) -> Truth:
        """Return the truth of all samples, whose times are (n,) [s]."""
        tips = np.array(self._tips)
        fingers = {
            finger: {
                "contact_force": -tips[:, place, :3],
                "slip_speed": tips[:, place, SLIP],
                "slipping_share": tips[:, place, SLIPPING_SHARE],
            }
            for place, finger in enumerate(self._fingers)
        }
        hand = {name: np.array(rows) for name, rows in self._rows.items()}
        return Truth(times, {"phase": np.array(self._phase, dtype=str), **hand}, fingers)
