"""One name has one meaning in the product and the laboratory (STYLE, Habit 11).

Two modules must not define a class of the same name, private or nested ones included. Two
modules must not define a public constant of the same name with different values: a constant with
one meaning is defined once and imported.
"""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = (
    "src/holdfast",
    *(str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("packages/*/holdfast_*"))),
    "lab/holdfast_lab",
)
PLUGIN_FOLDERS = (
    "src/holdfast/devices/sources",
    "src/holdfast/io/importers",
    "src/holdfast/labelling/rules",
    "src/holdfast/cli",
    "packages",
    "lab/holdfast_lab/study",
)
"""Folders of modules that are loaded by name: each may define the constants of their contract."""
CONTRACT = {"AUTHOR", "EXTRA", "HINT", "SOURCE", "TAKES_SENSORS", "TASK", "TITLE"}
"""Constants that every module of such a folder may have, as the contract of its kind."""
TYPE_VARIABLE = "TypeVar("
"""Begin of the value of a type variable, whose name means nothing outside of its function."""


def definitions(root=ROOT, packages=PACKAGES):
    """Yield kind, name, value and path of each class and each public module-level constant."""
    for package in packages:
        for path in sorted((root / package).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            where = path.relative_to(root).as_posix()
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    yield "class", node.name, "", where
            for name, value in constants(tree):
                yield "constant", name, value, where


def constants(tree):
    """Yield name and value, as source, of the public constants of a module."""
    for node in tree.body:
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            targets = [node.target]
        elif isinstance(node, ast.Assign):
            targets = node.targets
        else:
            continue
        for target in targets:
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            for name, value in zip(names, values_of(node.value, len(names)), strict=True):
                if isinstance(name, ast.Name) and not name.id.startswith("_"):
                    yield name.id, value


def values_of(node, n):
    """Return the source of the values that n names get."""
    if n == 1:
        return [ast.unparse(node)]
    if isinstance(node, ast.Tuple):
        return [ast.unparse(value) for value in node.elts]
    return [f"{ast.unparse(node)}[{place}]" for place in range(n)]


def is_contract(name, paths):
    """Return whether a constant belongs to the contract of modules in one folder of plugins."""
    return name in CONTRACT and all(path.startswith(PLUGIN_FOLDERS) for path in paths)


def repeated(found):
    """Return the names with more than one meaning, and where they are defined."""
    classes, values = defaultdict(list), defaultdict(dict)
    for kind, name, value, path in found:
        if kind == "class":
            classes[name].append(path)
        elif not value.startswith(TYPE_VARIABLE):
            values[name].setdefault(value, []).append(path)
    problems = {name: paths for name, paths in classes.items() if len(paths) > 1}
    for name, by_value in values.items():
        paths = [path for places in by_value.values() for path in places]
        if len(by_value) > 1 and not is_contract(name, paths):
            problems[name] = paths
    return problems


def test_one_name_has_one_meaning():
    problems = repeated(definitions())
    lines = [f"{name}: {', '.join(paths)}" for name, paths in sorted(problems.items())]
    assert not lines, "names with more than one meaning:\n" + "\n".join(lines)


@pytest.mark.parametrize(
    ("second", "expected"),
    [
        ("class _Part: ...", {"_Part"}),
        ("def f():\n    class _Part: ...", {"_Part"}),
        ("SIZE = 2", {"SIZE"}),
        ("SIZE: int = 2", {"SIZE"}),
        ("OTHER, SIZE = 1, 3", {"SIZE"}),
        ("SIZE = 1", set()),
        ("_SIZE = 2", set()),
        ("OTHER, SIZE = 3, 1", set()),
        ("T = TypeVar('T', bound=int)\n__all__ = ['a']", set()),
    ],
)
def test_what_counts_as_repeated(tmp_path, second, expected):
    package = tmp_path / "src/holdfast"
    package.mkdir(parents=True)
    (package / "a.py").write_text(
        "class _Part: ...\nSIZE = 1\n_SIZE = 1\nT = TypeVar('T')\n__all__ = []\n"
    )
    (package / "b.py").write_text(second)
    assert set(repeated(definitions(tmp_path, ["src/holdfast"]))) == expected
