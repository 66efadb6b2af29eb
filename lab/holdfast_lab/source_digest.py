"""Digests of the source files on which a result depends, found by following imports."""

import ast
from collections.abc import Iterable, Iterator
from functools import lru_cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from threading import Lock

PACKAGES = ("holdfast", "holdfast_grip", "holdfast_interop", "holdfast_lab")
"""Packages whose files count; other packages are pinned by the lock file."""
WITHOUT_RESULTS = (
    *("holdfast.cli", "holdfast.plots", "holdfast.web"),
    *("holdfast_lab.figures", "holdfast_lab.report", "holdfast_lab.verbs"),
)
"""Packages that only show results."""
DATA_SUFFIXES = (".csv", ".json", ".toml", ".c", ".h")
"""Data files beside a module, and C files, on which its results depend too."""

_PARSING = Lock()
"""`ast.parse` of Python 3.11 fails where two threads call it at once, as those of a worker of Dask
do (CPython issue 106905)."""


@lru_cache
def source_digest(roots: tuple[str, ...] = PACKAGES, without: tuple[str, ...] = ()) -> str:
    """Return a digest of modules, of all that they import, and of the data beside them.

    Imports are read from the source, also those inside functions. A module that imports others
    by a computed name counts with all modules of its folder.

    Args:
        roots: names of modules and packages; a package counts with all its modules.
        without: names of modules that are left out, beside the packages that show results.
    """
    with _PARSING:
        files = sorted(_closure(roots, without).items())
    digest = sha256()
    for name, path in files:
        digest.update(f"{name} {sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()


def _closure(roots: Iterable[str], without: tuple[str, ...]) -> dict[str, Path]:
    """Return the files of modules and of all that they import, by name."""
    files: dict[str, Path] = {}
    waiting = [name for root in roots for name in (root, *_members(root))]
    while waiting:
        name = waiting.pop()
        path = module_files().get(name)
        if (
            path is None
            or name in files
            or name in without
            or any(name == package or name.startswith(f"{package}.") for package in WITHOUT_RESULTS)
        ):
            continue
        files[name] = path
        # Data beside the module, and in sub-folders that are no packages.
        for folder in (path.parent, *(sub for sub in path.parent.iterdir() if sub.is_dir())):
            if folder == path.parent or not (folder / "__init__.py").exists():
                files |= {
                    f"{path.parent.name}/{data.relative_to(path.parent).as_posix()}": data
                    for data in folder.iterdir()
                    if data.suffix in DATA_SUFFIXES
                }
        waiting += imported_modules(name)
    return files


@lru_cache
def module_files() -> dict[str, Path]:
    """Return the file of each module of the packages, by its name."""
    files = {}
    for package in PACKAGES:
        spec = find_spec(package)
        folder = Path(str(spec.origin)).parent if spec is not None else Path()
        for path in folder.rglob("*.py"):
            parts = path.relative_to(folder).with_suffix("").parts
            files[".".join((package, *(part for part in parts if part != "__init__")))] = path
    return files


@lru_cache
def imported_modules(name: str) -> tuple[str, ...]:
    """Return the names that a module may import, with the packages that contain them."""
    tree = ast.parse(module_files()[name].read_text("utf-8"))
    names = set(_imports(tree))
    # A name that is computed can be any module of the folder. Not of a whole package, whose
    # `__init__` imports its names late: everything would depend on everything.
    by_name = any(isinstance(n, ast.Name) and n.id == "import_module" for n in ast.walk(tree))
    if name not in PACKAGES and by_name:
        is_package = module_files()[name].stem == "__init__"
        names.update(_members(name if is_package else name.rpartition(".")[0]))
    parts = [module.split(".") for module in names]
    return tuple({".".join(words[:n]) for words in parts for n in range(1, len(words) + 1)})


def _imports(node: ast.AST) -> Iterator[str]:
    """Yield the names that a syntax tree imports, without those for type checkers."""
    if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
        return
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module is not None:
        yield node.module
        yield from (f"{node.module}.{alias.name}" for alias in node.names)
    for child in ast.iter_child_nodes(node):
        yield from _imports(child)


def _members(package: str) -> list[str]:
    """Return the names of all modules inside a package."""
    return [name for name in module_files() if name.startswith(f"{package}.")]
