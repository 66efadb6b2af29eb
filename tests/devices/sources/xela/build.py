"""Packets as a XELA server sends them, written down here on their own."""

import json

import numpy as np

START = 1_700_000_000.0
PERIOD = 0.01

OLD = (
    '{"message": 786, "time": 1619157045.6195483, "sensors": 1, "1": {"data": "FA00,FB00,FC00", '
    '"sensor": "1", "taxels": 1, "model": "uSPa11", "calibrated": null}}'
)
"""Version 1.7."""
NEW = (
    '{"message": 10416, "time": 1769494922.6083388, "sensors": 1, "type": "routine", '
    '"version": "1.8.0b_200801", "1": {"time": 1769494922.614261, "sensor": "1", '
    '"data": "804D,8276,8F6A", "model": "uSPa11", "taxels": 1, '
    '"integer": [32845, 33398, 36714], "temp": [304.6], "handedness": "right", '
    '"ups": [2.45]}, "sendtime": 1769494922.6143322}'
)
"""Version 1.8."""
WELCOME = '{"message": "Welcome", "version": "1.8.0b_200801"}'


def counts(n_taxels, k=0):
    return np.random.default_rng(k).integers(0, 65536, (n_taxels, 3), dtype=np.uint16)


def sensor(readings, model="uSPa44", **fields):
    """A sensor of a packet, as version 1.7 has it; a field of None is left out."""
    data = ",".join(f"{value:04X}" for value in np.ravel(readings))
    default = {"data": data, "sensor": "1", "taxels": len(readings), "model": model}
    return {name: value for name, value in (default | fields).items() if value is not None}


def text(k, sensors, **fields):
    """Packet number `k`; sensors in order, or by number."""
    if not isinstance(sensors, dict):
        sensors = dict(enumerate(sensors, 1))
    top = {"message": k, "time": START + k * PERIOD, "sensors": len(sensors)}
    return json.dumps(top | fields | {str(number): one for number, one in sensors.items()})


def patch(k, **fields):
    """Packet number `k` of a server with one 4 x 4 patch."""
    return text(k, [sensor(counts(16, k))], **fields)
