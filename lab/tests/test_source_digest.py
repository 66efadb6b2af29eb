import sys

import pytest

from holdfast_lab import source_digest as module
from holdfast_lab.source_digest import source_digest

FILES = {
    "__init__": "",
    "made/__init__": "",
    "made/result": "from toy.made import step\nimport toy.shared\n",
    "made/step": "def run():\n    from toy.made.late import late\n",
    "made/late": "",
    "made/typed": "",
    "made/other": "",
    "shared": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import toy.made.typed\n",
    "kinds/__init__": "from importlib import import_module\n",
    "kinds/one": "",
    "shown/__init__": "",
    "shown/page": "",
}


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A package in place of holdfast, with a function that changes one of its files."""
    folder = tmp_path / "toy"
    for name, text in FILES.items():
        path = folder / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace("\\n", "\n"))
    (folder / "made" / "table.csv").write_text("1\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(module, "PACKAGES", ("toy",))
    monkeypatch.setattr(module, "WITHOUT_RESULTS", ("toy.shown",))
    yield folder
    clear()
    for name in [name for name in sys.modules if name.split(".")[0] == "toy"]:
        del sys.modules[name]


def clear():
    module.source_digest.cache_clear()
    module.module_files.cache_clear()
    module.imported_modules.cache_clear()


def changes(folder, name, root="toy.made.result", without=()):
    """Return whether the digest of a module changes with a file."""
    clear()
    before = source_digest((root,), without)
    with (folder / name).open("a") as file:
        file.write("# more\n")
    clear()
    return source_digest((root,), without) != before


@pytest.mark.parametrize(
    "name",
    ["made/result.py", "made/step.py", "made/late.py", "shared.py", "made/table.csv"],
)
def test_a_result_depends_on_what_its_module_imports(toy, name):
    assert changes(toy, name)


@pytest.mark.parametrize(
    "name", ["made/other.py", "made/typed.py", "shown/page.py", "kinds/one.py"]
)
def test_it_depends_on_nothing_else(toy, name):
    assert not changes(toy, name)


def test_a_module_that_imports_by_name_depends_on_its_neighbours(toy):
    assert changes(toy, "kinds/one.py", root="toy.kinds")


def test_modules_can_be_left_out(toy):
    assert not changes(toy, "made/step.py", without=("toy.made.step",))


def test_a_function_of_another_package_has_a_digest():
    assert source_digest(("builtins",)) == source_digest(("math",))
