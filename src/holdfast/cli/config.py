"""The configuration file `holdfast.toml`: one's own hand, so that URIs need no retyping."""

import os
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import msgspec

from holdfast.files import read_toml

CONFIG_NAME, CONFIG_VARIABLE = "holdfast.toml", "HOLDFAST_CONFIG"
HAND = "hand"
"""Name of the configured source on the command line."""


class Config(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Content of a configuration file; every key may be missing.

    Attributes:
        model: default of MODEL.
        source: URI of the hand; by default the XELA server at `host`.
        host: host and port of the XELA server; by default `auto`.
        fingers: name of each module by its number.
        sensor: name of a built-in sensor, or a JSON file; for devices that do not name theirs.
        values: `counts` or `calibrated`.
        ignore: taxels to ignore by finger, counted from 1.
    """

    model: str | None = None
    source: str | None = None
    host: str | None = None
    fingers: dict[str, str] = {}
    sensor: str | None = None
    values: str | None = None
    ignore: dict[str, list[int]] = {}

    def complete(self, source: str) -> str:
        """Return the URI of a source with the parameters that it does not have.

        Args:
            source: path or URI from the command line, or `hand`.
        """
        from holdfast.devices.uri import is_uri, parse, source_module

        # A recording of this name is meant, if there is one.
        if source == HAND and not Path(HAND).exists():
            source = self.source or f"xela://{self.host or 'auto'}"
        if not is_uri(source):
            return source
        scheme, address = parse(source)
        known = getattr(source_module(scheme), "PARAMETERS", ())
        fingers = ",".join(f"{number}:{name}" for number, name in self.fingers.items())
        missing = {
            key: value
            for key, value in (
                ("fingers", fingers or None),
                ("sensor", self.sensor),
                ("values", self.values),
            )
            # A scheme refuses parameters that it does not have.
            if key in known and key not in address.parameters and value is not None
        }
        if not missing:
            return source
        return f"{source}{'&' if '?' in source else '?'}{urlencode(missing, safe=':,/')}"

    def defaults(self) -> dict[str, str]:
        """Return the default values of arguments and options."""
        defaults: dict[str, str] = {"source": HAND}
        if self.model is not None:
            defaults["model"] = self.model
        if self.ignore:
            taxels = (f"{finger}:{k}" for finger, ks in self.ignore.items() for k in ks)
            defaults["ignore"] = ",".join(taxels)
        return defaults


def find_config(option: Path | None = None) -> Path | None:
    """Return the configuration file: that of `--config`, HOLDFAST_CONFIG, or holdfast.toml here.

    Raises:
        ValueError: the file of the option or the variable does not exist.
    """
    variable = os.environ.get(CONFIG_VARIABLE)
    # --config outranks the variable, and both outrank the file in this folder.
    for path, where in ((option, "--config"), (variable and Path(variable), CONFIG_VARIABLE)):
        if path:
            if not path.is_file():
                raise ValueError(f"{where}: there is no file {path}")
            return path
    here = Path(CONFIG_NAME)
    return here if here.is_file() else None


def load_config(path: Path) -> Config:
    """Read a configuration file. Paths in it are relative to its folder.

    Raises:
        ValueError: it is not TOML, or has an unknown key or a value of another type.
    """
    from holdfast.sensors.taxel_numbers import FIRST_TAXEL

    try:
        content = read_toml(path)
    except OSError as cause:
        raise ValueError(f"{path}: {cause.strerror}") from cause
    except ValueError as cause:
        raise ValueError(f"{path} is not TOML: {cause}") from cause
    known = Config.__struct_fields__
    # msgspec names one unknown key, and not those that exist.
    if unknown := sorted(set(content) - set(known)):
        raise ValueError(
            f"{path}: unknown key {', '.join(unknown)}; there are {', '.join(sorted(known))}"
        )
    try:
        config = msgspec.convert(content, Config)
    except msgspec.ValidationError as cause:
        raise ValueError(f"{path}: {cause}") from cause
    if config.source is not None and config.host is not None:
        raise ValueError(f"{path}: source or host expected, both given")
    if wrong := [number for number in config.fingers if not number.isdecimal()]:
        raise ValueError(
            f'{path}: fingers: 1 = "thumb" expected, the number of a module, {wrong[0]!r} given'
        )
    for finger, taxels in config.ignore.items():
        for taxel in taxels:
            if taxel < FIRST_TAXEL:
                raise ValueError(
                    f"{path}: ignore: taxels from {FIRST_TAXEL} expected, {taxel} given for "
                    f"{finger}"
                )
    files = {  # a name without .json is that of a built-in model or sensor, and no path
        key: (str(path.parent / value) if value.endswith(".json") else value)
        for key in ("model", "sensor")
        if (value := getattr(config, key)) is not None
    }
    return msgspec.structs.replace(config, **files)


def config_state(config: Config | None) -> dict[str, Any]:
    """Return the path, the content and the error of the configuration file, for JSON.

    Args:
        config: of `--config`; by default that of the file which verbs read.
    """
    path, error = None, None
    try:
        path = find_config()
        config = config or (None if path is None else load_config(path))
    except ValueError as cause:
        error = str(cause)
    content = {} if config is None else msgspec.to_builtins(config)
    return {
        "path": None if path is None else str(path),
        "content": {key: value for key, value in content.items() if value},
        "error": error,
    }
