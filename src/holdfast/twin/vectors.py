"""Vectors of three numbers for compiled code, as tuples, which need no allocation."""

from holdfast.compiled import compiled

Three = tuple[float, float, float]
Nine = tuple[Three, Three, Three]


@compiled
def add(a: Three, b: Three) -> Three:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def subtract(a: Three, b: Three) -> Three:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def cross(a: Three, b: Three) -> Three:
    """Return the cross product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def dot(a: Three, b: Three) -> float:
    """Return the dot product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def apply(m: Nine, v: Three) -> Three:
    """Return M v, with M given by rows."""
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


@compiled
def apply_transposed(m: Nine, v: Three) -> Three:
    """Return the transpose of M times v."""
    return (
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    )


@compiled
def scaled(v: Three, by: float) -> Three:
    """Return a vector times a number."""
    return v[0] * by, v[1] * by, v[2] * by
