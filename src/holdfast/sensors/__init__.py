"""Sensors and hands: the pose of each taxel, built-in layouts, and XELA's model names."""

from holdfast.sensors.built_in import (
    SENSOR_PLUGINS,
    built_in_hands,
    built_in_sensors,
    flat_sensor,
    hand,
    sensor,
    sensor_names,
)
from holdfast.sensors.taxel_numbers import taxel_index, taxel_number, taxel_numbers
from holdfast.sensors.types import Hand, HandModule, Sensor

__all__ = [
    "SENSOR_PLUGINS",
    "Hand",
    "HandModule",
    "Sensor",
    "built_in_hands",
    "built_in_sensors",
    "flat_sensor",
    "hand",
    "sensor",
    "sensor_names",
    "taxel_index",
    "taxel_number",
    "taxel_numbers",
]
