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


LEFT_OUT = (
    "logreg_unweighted", "svm_unweighted", "log_two", "log_hand", "energy", "jl_local_svm",
    "jl_global_svm", "trees",
)  # fmt: skip
"""Rivals that another one stands for: variants of the paper's method, the SVMs of James & Lepora,
which decide nearly as their logistic regression, and trees whose classes have no weights."""

BALANCED = {**TREES.recipe.reference, "n_trees": 150, "class_weight": "balanced"}
"""Parameters of boosted trees: without weights ours found a third fewer slips, which are rare."""
TREES_OF_OURS = replace(
    HOLDFAST,
    name="holdfast_trees",
    title="boosted trees on the features of holdfast",
    category="learning",
    source="ours: the features of holdfast, without a linear rule",
    recipe=TREES.recipe,
    parameters=BALANCED,
)

SLIP_METHODS: dict[str, SlipMethod] = {
    "holdfast": SlipMethod(HOLDFAST),
    "holdfast_stability": SlipMethod(HOLDFAST, "stability"),
    "holdfast_trees": SlipMethod(TREES_OF_OURS),
    **{name: SlipMethod(METHODS[name]) for name in RIVALS if name not in LEFT_OUT},
    "slip_trees": SlipMethod(replace(TREES, name="slip_trees", parameters=BALANCED)),
}
"""All of them by name, in the order of the table."""
