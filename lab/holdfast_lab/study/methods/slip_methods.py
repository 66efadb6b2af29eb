"""The methods whose decisions about the slip of a finger are compared.

All but one are fitted to true sliding against true rest. That one is our rule of stability,
fitted to the labels of stability and used as a decision about slip.
"""

from dataclasses import dataclass, replace
from typing import Literal

from holdfast_lab.study.methods import METHODS, RIVALS
from holdfast_lab.study.methods.holdfast import HOLDFAST
from holdfast_lab.study.methods.method import Method
from holdfast_lab.study.methods.wavelets import TREES

Target = Literal["sliding", "stability"]
"""Target of a method: true sliding of a finger, or the labels of stability."""


@dataclass(frozen=True)
class SlipMethod:
    """A method that decides whether a finger slides.

    Attributes:
        method: features and classifier.
        target: what it is fitted to.
    """

    method: Method
    target: Target = "sliding"


TREES_OF_OURS = replace(
    HOLDFAST,
    name="holdfast_trees",
    title="boosted trees on the features of holdfast",
    category="learning",
    source="ours: the features of holdfast, without a linear rule",
    recipe=TREES.recipe,
)

SLIP_METHODS: dict[str, SlipMethod] = {
    "holdfast": SlipMethod(HOLDFAST),
    "holdfast_stability": SlipMethod(HOLDFAST, "stability"),
    "holdfast_trees": SlipMethod(TREES_OF_OURS),
    **{name: SlipMethod(METHODS[name]) for name in RIVALS},
}
"""All of them by name, in the order of the table."""
