"""Sensors and hands: the pose of each taxel, built-in layouts, and XELA's model names."""

from holdfast.sensors.built_in import (
    as_sensor,
    built_in_hands,
    built_in_sensors,
    flat_sensor,
    hand,
    sensor,
)
from holdfast.sensors.taxel_numbers import taxel_index, taxel_number, taxel_numbers
from holdfast.sensors.types import Hand, HandModule, Sensor

__all__ = [
    "Hand",
    "HandModule",
    "Sensor",
    "as_sensor",
    "built_in_hands",
    "built_in_sensors",
    "flat_sensor",
    "hand",
    "sensor",
    "taxel_index",
    "taxel_number",
    "taxel_numbers",
]
