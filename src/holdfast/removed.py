"""What holdfast 0.3.0 had and later versions do not have, and what to use instead."""

LAST_COMMIT = "f7d623e5"
"""Commit of version 0.3.0, which still has all of it."""

_WRITTEN_OUT = (
    "write MODEL, URI and --ignore out, as in holdfast detect builtin:any "
    '"xela://auto?fingers=1:thumb,2:index" --ignore index:7'
)
_NONE = "nothing but that commit"

REMOVED: dict[str, dict[str, str]] = {
    "verbs": {},
    "options": {"--config": _WRITTEN_OUT},
    "sources": {"hand": _WRITTEN_OUT},
    "importers": {},
    "exporters": {},
    "hands": {},
    "files": {"holdfast.toml": _WRITTEN_OUT},
    "plugins": {
        "sensors": "a file of the sensor, as holdfast sensors --template 3x3 > sensor.json makes",
        "classifiers": "holdfast.features_frame, which gives the features to any classifier",
        "labels": "CSV, as holdfast label import reads it",
        "panels": _NONE,
        "players": _NONE,
        "laws": _NONE,
        "groups": _NONE,
    },
}
"""What to use instead, by kind and name. The kinds are those of `PACKAGE_PARTS` of `errors.py`:
`verbs`, `options`, `sources`, ...; an option has its verb before it, as in "serve --hand". `files`
are those that verbs read in the working folder; `plugins` are kinds of plug-ins."""


def removal(kind: str, name: str, what: str) -> str:
    """Return one line about a part that was removed; empty if no such part was.

    Args:
        kind: of the part, as in `REMOVED`.
        name: of the part.
        what: what the name stands for, as in "the verb hold".
    """
    if (instead := REMOVED.get(kind, {}).get(name)) is None:
        return ""
    return f"{what} was removed after 0.3.0 (commit {LAST_COMMIT} has it): {instead}"
