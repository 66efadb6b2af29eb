"""Names of columns and arrays: which say finger, taxel and axis, and which are no readings."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import takewhile
from typing import NamedTuple

from holdfast.errors import RecordingError
from holdfast.io.importers.columns import RUN, named_column
from holdfast.io.importers.table import some_names
from holdfast.sensors.taxel_numbers import FIRST_TAXEL, taxel_number

MAX_NAME = 200
"""Maximum length of a name that can say finger, taxel and axis [characters]."""
MODULE_OF_ROWS = re.compile(
    r"(?:(?:sensor|module|finger|device|source|topic)(?:[_ ]?id)?|id|name)", re.IGNORECASE
)
"""Names of a column with the module of each row."""
EPISODE_OF_ROWS = re.compile(r"(?:episode|trial)(?:[_ ]?(?:id|index))?", re.IGNORECASE)
"""Names of a column with the recording of each row."""
FINGER = re.compile(
    r"[\W_]*(?:thumb|index|middle|ring|little|pink(?:y|ie)|left|right|palm|finger(?:tip)?|tip|pad|"
    r"skin|sensor|module|board|hand|[lr]f?|[fmlr]f|th)?[\W_]*\d*[\W_]*",
    re.IGNORECASE,
)
"""Words of names that mean fingers; other words that differ may mean other quantities."""
OTHER_QUANTITIES = {
    "accelerometer": ("acc", "accel", "accelerometer", "acceleration", "imu"),
    "gyroscope": ("gyr", "gyro", "gyroscope", "angular"),
    "torque": ("torque", "torques", "moment", "tau"),
    "position": ("pos", "position", "positions", "pose"),
    "normal vector": ("normal", "normals"),
    "orientation": ("quat", "orientation", "euler", "rpy"),
    "velocity": ("vel", "velocity"),
    "displacement": ("disp", "displacement", "deformation"),
}
"""Words of names that are no forces and no fields, by what they are."""
POLAR = {"direction", "angle", "azimuth", "theta", "phi"}
"""Words of the angle of a force that is given by its size and its direction."""

_UNIT = re.compile(
    r"[\s_]*[\[(]\s*(?P<inside>[^\])\d][^\])]*?|)\s*[\])]\s*$"
    r"|[\s_](?P<word>N[_ ]?mm|N[_ ]?m|[mu]m|mN|N|[mun]T|counts?|raw|deg|rad|kPa|Pa|g)$"
)
_UNIT_NAMES = {"counts": "count", "raw": "count", "lsb": "count", "": None, "-": None}
_FORMS = (
    # The axis before the number of the taxel, as Fx1, mag_x_1 and X[0]; or after it, as 1x, p0_fx.
    re.compile(r"(?P<head>.*?)(?P<axis>[xyz])(?P<mid>[\W_]*)(?P<taxel>\d+)(?P<tail>[\W_]*)", re.I),
    re.compile(
        r"(?P<head>.*?)(?P<taxel>\d+)(?P<mid>[\W_]*(?:[a-z]{1,12}?[\W_]*)?)(?P<axis>[xyz])"
        r"(?P<tail>[\W_]*)",
        re.IGNORECASE,
    ),
    # No number: the one taxel of a module.
    re.compile(r"(?P<head>.*?)(?P<axis>[xyz])(?P<tail>[\W_]*)", re.IGNORECASE),
)
_WORDS = re.compile(r"[a-z]+", re.IGNORECASE)
Cells = Mapping[tuple[int, str], str]
"""Column by taxel (from 1) and axis."""


class Group(NamedTuple):
    """Common part of the columns of a module: their names without taxel and axis."""

    form: int
    head: str
    mid: str
    tail: str
    unit: str | None

    @property
    def words(self) -> set[str]:
        """Words of the names, in small letters."""
        return words_of(f"{self.head} {self.mid}")


def words_of(text: str) -> set[str]:
    """Return the words of a name, in small letters."""
    return {word.lower() for word in _WORDS.findall(text)}


def split_unit(name: str) -> tuple[str, str | None]:
    """Return a name without the unit at its end, and the unit; None without one.

    Example:
        >>> split_unit("Bx1 [uT]"), split_unit("p0_fz_N"), split_unit("level []")
        (('Bx1', 'uT'), ('p0_fz', 'N'), ('level', None))
    """
    match = _UNIT.search(name)
    if match is None:
        return name, None
    unit = match["inside"] if match["inside"] is not None else match["word"]
    unit = re.sub("[\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}]", "u", unit)
    return name[: match.start()].rstrip(" ,"), _UNIT_NAMES.get(unit.lower(), unit)


def quantity_of(words: Collection[str]) -> str | None:
    """Return what names with these words are, if they are no readings; else None."""
    named = {word for words_of in OTHER_QUANTITIES.values() for word in words_of}.intersection(
        words
    )
    return next((what for what, of in OTHER_QUANTITIES.items() if named.intersection(of)), None)


def named_groups(names: Sequence[str], n_taxels: Collection[int]) -> dict[Group, Cells]:
    """Return the columns of each module by the patterns of docs/importing.md.

    A group is complete: it has x, y and z of as many taxels as one of the sensors.

    Args:
        names: of all columns.
        n_taxels: numbers of taxels of the sensors; of any number if it is empty.

    Raises:
        RecordingError: a group lacks a column.
    """
    cells_of_group: dict[Group, dict[tuple[int, str], str]] = {}
    doubled: dict[Group, tuple[str, str]] = {}
    for name in names:
        if len(name) > MAX_NAME:
            continue
        bare, unit = split_unit(name)
        for form, pattern in enumerate(_FORMS):
            if match := pattern.fullmatch(bare):
                parts = match.groupdict()
                taxel = int(parts.get("taxel", FIRST_TAXEL))
                group = Group(form, parts["head"], parts.get("mid", ""), parts["tail"], unit)
                other = cells_of_group.setdefault(group, {}).setdefault(
                    (taxel, parts["axis"].lower()), name
                )
                if other != name:
                    doubled[group] = other, name
    groups: dict[Group, Cells] = {}
    for group, cells in cells_of_group.items():
        numbers = sorted({taxel for taxel, _ in cells})
        whole = [(taxel, axis) for taxel in numbers for axis in "xyz"]
        is_run = numbers[-1] - numbers[0] == len(numbers) - 1
        fits = not n_taxels or len(numbers) in n_taxels
        if is_run and fits and len(cells) == len(whole):
            if group in doubled:
                a, b = doubled[group]
                raise RecordingError(f"columns {a!r} and {b!r} are the same taxel and axis")
            first = numbers[0]
            groups[group] = {(taxel_number(t - first), axis): n for (t, axis), n in cells.items()}
        elif fits and len(whole) > len(cells) > 0.9 * len(whole):
            taxel, axis = next(cell for cell in whole if cell not in cells)
            missing = re.sub(
                "[xyz](?!.*[xyz])", axis, cells[next(c for c in cells if c[0] == taxel)]
            )
            raise RecordingError(f"column {missing!r} is missing: taxel {taxel} has no {axis}")
    return groups


def module_names(groups: Sequence[Group]) -> list[str]:
    """Return the names of the modules of groups: the part of the names in which they differ.

    Example:
        >>> module_names([Group(1, "B0S", "", "", None), Group(1, "B1S", "", "", None)])
        ['B0', 'B1']
    """
    if len(groups) == 1:
        match = re.fullmatch(r"(.+)[._]t", groups[0].head)  # of holdfast's own CSV
        return [match[1] if match else ""]
    return different_parts([f"{group.head} {group.mid}" for group in groups])


def different_parts(texts: Sequence[str], *, by_group: bool = False) -> list[str]:
    """Return the parts in which texts differ, in whole words; the texts if a part is empty.

    Args:
        texts: names, or paths with slashes.
        by_group: of paths, the names of groups are whole.
    """
    pattern = r"[^/]+|/" if by_group else r"[A-Za-z]*\d+|[A-Za-z]+|[^A-Za-z\d]+"
    words = [re.findall(pattern, text) for text in texts]
    start = len(_common(words))
    end = len(_common([word[start:][::-1] for word in words]))
    parts = ["".join(word[start : len(word) - end]).strip(" _.-/") for word in words]
    return parts if all(parts) and len(set(parts)) == len(parts) else list(texts)


def are_fingers(names: Iterable[str]) -> bool:
    """Return whether names that differ are those of fingers: by their words, or by numbers."""
    names = list(names)
    alike = len({re.sub(r"\d+", "0", name) for name in names}) == 1
    return alike or all(map(FINGER.fullmatch, names))


def run_of(text: str, names: Sequence[str]) -> list[str]:
    """Return the consecutive columns of FIRST..LAST.

    Raises:
        RecordingError: a column is missing, or they are none.
    """
    ends = [named_column(names, word.strip()) for word in text.split(RUN, 1)]
    if missing := [name for name in ends if name not in names]:
        raise RecordingError(f"taxels={text}: no column {missing[0]!r}; it has {some_names(names)}")
    run = list(names[names.index(ends[0]) : names.index(ends[1]) + 1])
    if not run:
        raise RecordingError(f"taxels={text}: 0 columns given; 3 for each taxel expected")
    return run


def _common(lists: Sequence[Sequence[str]]) -> list[str]:
    columns = zip(*lists, strict=False)
    return [words[0] for words in takewhile(lambda words: len(set(words)) == 1, columns)]
