"""What a study is about: which recordings, and how thoroughly."""

import msgspec

from holdfast.study.corpus import Corpus


class Plan(msgspec.Struct, frozen=True):
    """All that the tasks of a study follow from.

    Attributes:
        corpora: by role: "main" always; "fresh" (the same objects, other seeds), "others"
            (other objects), "gentle" and "vigorous" (other profiles) where there are.
        real: recordings of a real hand; None where there are none.
        quick: fewer windows, methods and trials.
        seed: of everything random.
    """

    corpora: dict[str, Corpus]
    real: Corpus | None = None
    quick: bool = False
    seed: int = 0

    @property
    def main(self) -> Corpus:
        """What is trained on."""
        return self.corpora["main"]
