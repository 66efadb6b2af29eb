"""Sensors and hands as values: where each taxel sits and how it is turned."""

from holdfast.sensors.layouts import built_in_hands, built_in_sensors, hand, sensor
from holdfast.sensors.types import Hand, HandModule, Sensor

__all__ = [
    "Hand",
    "HandModule",
    "Sensor",
    "built_in_hands",
    "built_in_sensors",
    "hand",
    "sensor",
]
