"""The twin as a source and a hand at once: the simulation runs, and takes commands."""

import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from holdfast.devices.sources import Arrival, Source
from holdfast.devices.sources.twin import grasp_of
from holdfast.devices.uri import parse
from holdfast.sensors import Sensor
from holdfast.sensors.types import Array
from holdfast.twin.hand import FINGERS, RATE
from holdfast.twin.simulation import Simulation
from holdfast_grip.command import GripCommand
from holdfast_grip.errors import HandError
from holdfast_grip.hands import HandDevice
from holdfast_grip.hands.base import MAX_JOINT_REPORTS


class LiveTwin(Source, HandDevice):
    """Twin that simulates each sample when it is read, with the last command that it got.

    It is a source like any other, and a hand like any other. A grasp without commands gives the
    samples of its recording.

    Args:
        uri: as of the source: `twin:?object=can&seed=0&case=2&repeat=1&profile=reference`.
        speed: 1 is real time, 0 is as fast as samples are read.

    Attributes:
        simulation: the simulation; None while the twin is closed.

    Raises:
        ValueError: the URI is not valid, or asks for the effects of a server.

    Example:
        >>> from holdfast_grip import FingerCommand, LoopState
        >>> with LiveTwin("twin:?object=ball", speed=0) as twin:
        ...     arrival = twin.read(0.0)
        ...     _ = twin.send(GripCommand(0.0, LoopState.HOLD, {"thumb": FingerCommand(1.2)}))
        ...     arrival.samples["thumb"].shape
        (30, 3)
    """

    fingers = FINGERS

    def __init__(self, uri: str = "twin:", *, speed: float = 1.0) -> None:
        self.grasp = grasp_of(parse(uri)[1])
        if self.grasp.server:
            raise ValueError(f"{uri}: server=false expected while the twin takes commands")
        self.name, self.speed, self.paced = uri, speed, speed > 0
        self.simulation: Simulation | None = None
        self._scales = np.ones(len(FINGERS))
        self._begun_at: float | None = None
        self._reports: deque[Array] = deque(maxlen=MAX_JOINT_REPORTS)

    @property
    def sensors(self) -> Mapping[str, Sensor]:  # type: ignore[override]
        """Sensors by finger."""
        if self.simulation is None:
            return {}
        return {finger: skin.sensor for finger, skin in self.simulation.skins.items()}

    @property
    def metadata(self) -> Mapping[str, Any]:  # type: ignore[override]
        """Object, case and seed of the grasp."""
        grasp = self.grasp
        names = ("object", "case", "repeat", "profile", "seed")
        return {name: getattr(grasp, name) for name in names} | {"source": self.name}

    @property
    def ended(self) -> bool:
        """Whether the grasp is complete."""
        return self.simulation is None or self.simulation.is_over

    def open(self) -> None:
        """Begin the grasp."""
        self.forget()
        self.simulation = Simulation(self.grasp)
        self._scales = np.ones(len(FINGERS))
        self._begun_at = None

    def read(self, timeout: float) -> Arrival | None:
        """Simulate the next sample, and return it when it is due. The first read is the begin."""
        if self.simulation is None or self.ended:
            return None
        if self._begun_at is None:
            self._begun_at = time.monotonic()
        if self.paced:
            due = self._begun_at + self.simulation.n_samples / (RATE * self.speed)
            wait = due - time.monotonic()
            time.sleep(max(min(wait, timeout), 0.0))
            if wait > timeout:
                return None
        at = self.simulation.time
        self.simulation.step(self._scales)
        self._reports.append(self.simulation.joint_angles())
        return Arrival(at, self.simulation.read(), time.monotonic())

    def joint_reports(self) -> Sequence[Array]:
        """Return the joint angles (16,) of each sample since the last call [rad]."""
        return [self._reports.popleft() for _ in range(len(self._reports))]

    def _send(self, command: GripCommand) -> None:
        """Set the force scales from the next sample on, or release the object."""
        if self.simulation is None:
            raise HandError(f"{self.name} is not open")
        for finger, target in command.fingers.items():
            self._scales[FINGERS.index(finger)] = target.scale
        if command.release:
            self.simulation.protocol.release(self.simulation.time)

    def close(self) -> None:
        """End the grasp."""
        self.forget()
        self.simulation = None
