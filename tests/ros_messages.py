"""Messages for the tests, written by rosbags, an independent program."""

import numpy as np
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from holdfast.io.definitions import NUMBER_CODES

SENSOR_FULL = """uint32 message
float64 time
string model
uint8 sensor_pos
Taxel[] taxels
Forces[] forces
"""
TAXEL = "# one taxel\nuint16 x\nuint16 y\nuint16 z\n"
FORCES = "float32 x\nfloat32 y\nfloat32 z\n"
XELA = {"SensStream": "SensorFull[] sensors", "SensorFull": SENSOR_FULL, "Taxel": TAXEL,
        "Forces": FORCES}  # fmt: skip
OLD = {
    "XStream": "int16 sensors\nXSensor[] data\n",
    "XSensor": "int16 sensor\nint16 taxels\nSensPoint[] xyz\n",
    "SensPoint": "uint32 x\nuint32 y\nuint32 z\n",
    "xServerMsg": "Header header\nint16 sensor\nstring model\nxSensorData[] points\n",
    "xSensorData": "uint8 taxels\ngeometry_msgs/Point point\n",
}
PILLARS = {
    "SensorState": """std_msgs/Header header
int64 tus
PillarState[] pillars
float32 gfX
float32 gfY
float32 gfZ
float32 gtX
float32 gtY
float32 gtZ
float32 friction_est
float32 target_grip_force
bool is_sd_active
bool is_ref_loaded
bool is_contact
""",
    "PillarState": """int32 STILL=0 # a constant
std_msgs/Header header
int32 id
float32 dX
float32 dY
float32 dZ
float32 fX
float32 fY
float32 fZ
bool in_contact
int32 slip_state
""",
}
PILLARS_OF_ROS2 = {
    name: "\n".join(line for line in text.lower().splitlines() if "header" not in line)
    .replace("pillarstate[]", "PillarState[]")
    .replace("still=", "STILL=")
    for name, text in PILLARS.items()
}
"""As in the manual of the maker: small letters, and no headers."""


def store(package, texts, *, ros2):
    """rosbags' types, with those of a package added."""
    types = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
    found = {}
    for name, text in texts.items():
        full = text.replace("Header header", "H header").replace("std_msgs/H ", "H ")
        full = full.replace("H header", f"{'std_msgs/' if ros2 else ''}Header header")
        found.update(get_types_from_msg(full, f"{package}/msg/{name}"))
    types.register(found)
    return types


def header(types, stamp=0.0, *, ros2):
    whole = int(stamp)
    time = types.types["builtin_interfaces/msg/Time"](whole, round((stamp - whole) * 1e9))
    fields = (time, "hand") if ros2 else (7, time, "hand")
    return types.types["std_msgs/msg/Header"](*fields)


def sens_stream(types, package, *sensors):
    """A message of (number, model, message, time, counts, forces) of each sensor."""
    kinds = {name: types.types[f"{package}/msg/{name}"] for name in XELA}
    return kinds["SensStream"](
        [
            kinds["SensorFull"](
                count, time, model, number,
                [kinds["Taxel"](*map(int, point)) for point in counts],
                [kinds["Forces"](*map(float, point)) for point in forces],
            )
            for number, model, count, time, counts, forces in sensors
        ]
    )  # fmt: skip


def x_server(types, package, number, model, stamp, counts, *, ros2):
    kinds = {name: types.types[f"{package}/msg/{name}"] for name in ("xServerMsg", "xSensorData")}
    point = types.types["geometry_msgs/msg/Point"]
    points = [kinds["xSensorData"](k + 1, point(*map(float, p))) for k, p in enumerate(counts)]
    return kinds["xServerMsg"](header(types, stamp, ros2=ros2), number, model, points)


def x_stream(types, package, *counts):
    kinds = {name: types.types[f"{package}/msg/{name}"] for name in OLD}
    sensors = [
        kinds["XSensor"](k + 1, len(c), [kinds["SensPoint"](*map(int, p)) for p in c])
        for k, c in enumerate(counts)
    ]
    return kinds["XStream"](len(sensors), sensors)


def sensor_state(types, package, tus, stamp, forces, *, ros2):
    kinds = {name: types.types[f"{package}/msg/{name}"] for name in PILLARS}
    head = header(types, stamp, ros2=ros2)
    pillars = [
        kinds["PillarState"](head, k, 0.1, 0.2, 0.3, *map(float, f), True, 2)
        for k, f in enumerate(forces)
    ]
    fields = (0.5,) * 8
    return kinds["SensorState"](head, tus, pillars, *fields, True, False, True)


def sensor_state_of_ros2(types, package, tus, forces):
    kinds = {name: types.types[f"{package}/msg/{name}"] for name in PILLARS}
    pillars = [
        kinds["PillarState"](k, 0.1, 0.2, 0.3, *map(float, f), True, 2)
        for k, f in enumerate(forces)
    ]
    return kinds["SensorState"](tus, pillars, *(0.5,) * 8, True, False, True)


def counts(n_taxels, seed=0):
    return np.random.default_rng(seed).integers(0, 65536, (n_taxels, 3)).astype(np.uint16)


INNER = "bool flag\nstring name\nfloat64[2] pair\n"
TEXT = "\n".join(
    f"{kind} a_{kind}\n{kind}[] many_{kind}" for kind in NUMBER_CODES if kind != "byte"
)
OUTER = f"uint8 X=3\nstring S=a # b\n{TEXT}\nInner inner\nInner[] inners\nstring[] words\n"


def number_of(kind, draw):
    dtype = np.dtype(NUMBER_CODES[kind])
    if kind == "bool":
        return draw(st.booleans())
    if dtype.kind == "f":
        return draw(st.floats(allow_nan=False, width=8 * dtype.itemsize))
    limits = np.iinfo(dtype)
    return draw(st.integers(int(limits.min), int(limits.max)))


@st.composite
def values(draw):
    """Of all fields of OUTER, as dictionaries."""
    words = st.text(st.characters(codec="utf-8", exclude_characters="\x00"), max_size=5)

    def inner():
        pair = [draw(st.floats(allow_nan=False)) for _ in range(2)]
        return {"flag": draw(st.booleans()), "name": draw(words), "pair": pair}

    fields = {}
    for kind in NUMBER_CODES:
        if kind != "byte":
            fields[f"a_{kind}"] = number_of(kind, draw)
            n = draw(st.integers(0, 3))
            fields[f"many_{kind}"] = [number_of(kind, draw) for _ in range(n)]
    inners = [inner() for _ in range(draw(st.integers(0, 2)))]
    return fields | {"inner": inner(), "inners": inners, "words": draw(st.lists(words, max_size=3))}


def message_of(types, values):
    def inner(one):
        return types.types["p/msg/Inner"](one["flag"], one["name"], np.array(one["pair"]))

    fields = {
        name: np.array(value, NUMBER_CODES[name.removeprefix("many_")])
        if name.startswith("many_")
        else value
        for name, value in values.items()
    }
    fields |= {"inner": inner(values["inner"]), "inners": [inner(x) for x in values["inners"]]}
    return types.types["p/msg/Outer"](**fields)


def plain(value):
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value.tolist() if isinstance(value, np.ndarray) else value
