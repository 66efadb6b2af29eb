"""Files of ROS bags: their connections and the bytes of their messages, within a budget.

A bag is a file of an unknown person. Each kind of file is read by a module of its own, which
counts what it unpacks before it does so.
"""

from collections.abc import Collection, Iterator
from typing import NamedTuple, Protocol

MAX_BAG_CONNECTIONS = 4096
"""Maximum number of connections of a bag, and of its definitions of messages."""


class BagConnection(NamedTuple):
    """A topic as one publisher sent it.

    Attributes:
        number: number of the connection in its storage.
        topic: name of the topic.
        kind: type of its messages, `package/Type` or `package/msg/Type`.
        definition: text of the definition of its messages; empty if there is none.
        n_messages: number of messages that the bag lists.
    """

    number: int
    topic: str
    kind: str
    definition: str
    n_messages: int


class BagStorage(Protocol):
    """An open file of a bag, or a folder of such files.

    Attributes:
        complete: whether it has its end; else it is read up to where it was cut.
    """

    complete: bool

    @property
    def connections(self) -> list[BagConnection]:
        """All connections."""

    def messages(self, numbers: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield connection, time [ns] and bytes of each message of connections, by time."""


def check_number(n: int) -> None:
    """Check the number of connections of a bag.

    Raises:
        ValueError: there are too many.
    """
    if n > MAX_BAG_CONNECTIONS:
        raise ValueError(f"at most {MAX_BAG_CONNECTIONS} topics and types expected, more given")
