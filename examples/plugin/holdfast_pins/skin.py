"""The sensor `pin-skin`: where its taxels are, and how they are turned."""

from holdfast.sensors import Sensor, flat_sensor

N_ROWS, N_COLUMNS = 2, 3
PITCH = 4e-3
"""Distance between neighbouring taxels [m]."""
RATE = 100.0
"""Nominal sample rate [Hz]."""


def pin_skin() -> Sensor:
    """Return the sensor."""
    return flat_sensor("pin-skin", N_ROWS, N_COLUMNS, PITCH, rate=RATE)
