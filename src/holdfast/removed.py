"""What holdfast 0.3.0 had and later versions do not have, and what to use instead."""

LAST_COMMIT = "f7d623e5"
"""Commit of version 0.3.0, which still has all of it."""

REMOVED: dict[str, dict[str, str]] = {
    "verbs": {
        "bench": "python benchmarks/speed.py --json",
        "study data": "no replacement",
        "study score": "no replacement",
    },
    "options": {"study --benchmark": "no replacement"},
    "sources": {},
    "importers": {},
    "exporters": {},
    "hands": {},
}
"""What to use instead, by kind and name. The kinds are those of `PACKAGE_PARTS` of `errors.py`:
`verbs`, `options`, `sources`, ...; an option has its verb before it, as in "serve --hand"."""


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
