"""Balance of the internal forces of a grasp: what one finger adds, the others must carry.

In a quiet grasp the normal forces that the fingers measure balance each other: those of the
thumb those of the fingers opposite to it. If every force grows by the same amount, that balance
is lost as soon as the two sides have different numbers of fingers: three fingers that add 1 N
each push a thumb away that adds 1 N. The forces stay balanced if they change by balanced
amounts. With one finger on one side this has a closed form, so no optimiser is needed.
"""

from collections.abc import Sequence


def balanced(wanted: Sequence[float], forces: Sequence[float], opposed: int) -> list[float]:
    """Return the smallest balanced force scales that are at least the wanted ones.

    The forces f of the start are balanced: the finger `opposed`, t, carries the sum of the
    others. After a change by the scales s this holds if s_t = sum(s_j f_j) / sum(f_j) over the
    other fingers j. If the wanted s_t is the larger side, the smallest s_j are raised to a common
    value; otherwise s_t is raised. No scale is lowered.

    Args:
        wanted: (n,) force scale that each finger needs.
        forces: (n,) normal force of each finger when the grip began, any unit, at least 0.
        opposed: index of the finger opposite to all others.

    Returns:
        (n,) scales, none above the largest of `wanted`.

    Example:
        >>> balanced([1.0, 2.0, 1.0], [3.0, 1.0, 2.0], opposed=0)
        [1.3333333333333333, 2.0, 1.0]
        >>> balanced([2.0, 1.0, 1.5], [3.0, 1.0, 2.0], opposed=0)
        [2.0, 2.0, 2.0]
    """
    total = mean = 0.0
    for j, scale in enumerate(wanted):
        if j != opposed:
            total += forces[j]
            mean += scale * forces[j]
    out = list(wanted)
    if not total > 0:
        return out
    mean /= total
    if out[opposed] <= mean:
        out[opposed] = mean
    else:
        _raise_to_mean(out, forces, opposed, out[opposed] * total)
    return out


def _raise_to_mean(
    scales: list[float], forces: Sequence[float], opposed: int, needed: float
) -> None:
    """Raise the smallest scales to a common level, so that sum(s_j f_j) = needed."""
    order = sorted((j for j in range(len(scales)) if j != opposed), key=scales.__getitem__)
    above = sum(scales[j] * forces[j] for j in order)
    weight = 0.0
    level = scales[opposed]
    for k, j in enumerate(order):
        weight += forces[j]
        above -= scales[j] * forces[j]
        level = (needed - above) / weight if weight > 0 else level
        if k + 1 == len(order) or level <= scales[order[k + 1]]:
            break
    for j in order:
        scales[j] = max(scales[j], min(level, scales[opposed]))
