"""Build of the package: its C extensions, and the backend, which is this file too (decision 29).

pip and uv import this file as the backend: setuptools' own, which takes a compiler from the package
index where the machine has none. setuptools then runs the file, which compiles them.
"""

import importlib.util
import os
import platform
import runpy
import shutil
import sys
import sysconfig
import tempfile
from pathlib import Path

from setuptools import Extension, build_meta, setup
from setuptools.build_meta import *  # noqa: F403 (the hooks of a backend)
from setuptools.command.build_ext import build_ext

PACKAGE = Path("src/holdfast")  # backends run in the folder of pyproject.toml
EXTENSIONS = {
    "kernel._extension": [
        f"kernel/{name}.c" for name in ("module", "module_avx2", "haar", "force", "offline")
    ],
    "twin.steps": ["twin/c/module.c"],
}
"""Names of the extension modules, and the C files that are compiled for each."""
DEFINITIONS = {
    "Py_LIMITED_API": "0x030B0000",
    "HF_API": "extern",
}
COMPILER_PACKAGE = "ziglang==0.15.2"
FLAGS = ["-std=c99", "-O3", "-ffp-contract=off", "-fno-math-errno"]
"""The same bits by every compiler: no fused multiply-add, and sums in the order of the source. A
square root that does not set `errno` can be computed several at a time."""


def compiler() -> str | None:
    """Return the command of a C compiler, or None if there is none."""
    commands = (os.environ.get("CC"), sysconfig.get_config_var("CC"), "cc", "gcc", "clang")
    return next((found for found in commands if found and shutil.which(found.split()[0])), None)


def _with_compiler(required: list[str]) -> list[str]:
    missing = os.name == "posix" and compiler() is None
    return [*required, COMPILER_PACKAGE] if missing else required


def get_requires_for_build_wheel(config_settings: dict[str, str] | None = None) -> list[str]:
    """Return what the build of a wheel needs."""
    return _with_compiler(build_meta.get_requires_for_build_wheel(config_settings))


def get_requires_for_build_editable(config_settings: dict[str, str] | None = None) -> list[str]:
    """Return what `pip install -e` and `uv sync` need."""
    return _with_compiler(build_meta.get_requires_for_build_editable(config_settings))


def choose_compiler() -> None:
    """Set `CC`, which setuptools reads, or exit with one line about what is missing."""
    if sysconfig.get_config_var("Py_GIL_DISABLED"):
        sys.exit("holdfast needs a Python with the GIL: this one is free-threaded")
    header = Path(sysconfig.get_path("include"), "Python.h")
    if not header.exists():
        sys.exit(f"no {header}: install the headers of Python (Debian: apt install python3-dev)")
    command = compiler()
    if command is None and importlib.util.find_spec("ziglang"):
        command = f"{sys.executable} -m ziglang cc"
        if sys.platform == "linux":  # for every glibc since 2.17, as other wheels
            command += f" -target {platform.machine()}-linux-gnu.2.17"
            # Debian's Python.h includes a file of it; the compiler's own headers come first
            command += " -idirafter /usr/include"
    if command is None:
        sys.exit("no C compiler: install one (Debian: apt install gcc libc6-dev), or set CC")
    os.environ["CC"] = command


class BuildKernel(build_ext):
    """Compile the extensions by the flags above."""

    def run(self) -> None:
        """Choose the compiler here: lists of requirements and sdists are made without one."""
        if os.name == "posix":
            choose_compiler()
        super().run()

    def build_extensions(self) -> None:
        """Set what differs between compilers."""
        if self.compiler.compiler_type == "unix":
            for extension in self.extensions:
                extension.extra_compile_args, extension.libraries = FLAGS, ["m"]
            # sysconfig has the path of the libraries of the machine that built Python, and Debian's
            # an option that the linker of the package index refuses
            unwanted = ["-Wl,-rpath"] + ["-Wl,-Bsymbolic"] * ("ziglang" in os.environ["CC"])
            self.compiler.linker_so = [
                word for word in self.compiler.linker_so if not word.startswith(tuple(unwanted))
            ]
        super().build_extensions()


if __name__ == "__main__":
    digest = runpy.run_path(str(PACKAGE / "kernel" / "sources.py"))["digest"](PACKAGE)
    extensions = [
        Extension(
            f"holdfast.{name}",
            [str(PACKAGE / source) for source in sources],
            define_macros=[*DEFINITIONS.items(), ("HOLDFAST_SOURCES", f'"{digest}"')],
            py_limited_api=True,
        )
        for name, sources in EXTENSIONS.items()
    ]
    # setuptools packs whatever an earlier build left in its folder: each build has its own
    with tempfile.TemporaryDirectory() as folder:
        setup(
            ext_modules=extensions,
            cmdclass={"build_ext": BuildKernel},
            options={"build": {"build_base": folder}, "bdist_wheel": {"py_limited_api": "cp311"}},
        )
