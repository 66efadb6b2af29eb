"""ROS domains of tests: processes that run at the same time have no domain in common."""

import functools
import itertools
import os
import tempfile
from pathlib import Path

from holdfast.files import lock

N_BLOCKS, DOMAINS_OF_BLOCK = 4, 57
"""The domains 1 to 228, by blocks; DDS has ports for 232. A process that is killed stays in its
domain for seconds, so a block has many."""
_numbers = itertools.count()


def new_domain():
    """Return the number of a ROS domain, another than the 56 before it in this process."""
    return 1 + DOMAINS_OF_BLOCK * _block() + next(_numbers) % DOMAINS_OF_BLOCK


@functools.cache
def _block():
    """Return the first block that no other process has locked. It is locked until this one ends."""
    for block in range(N_BLOCKS):
        path = Path(tempfile.gettempdir()) / f"holdfast-test-domains-{block}"
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            lock(handle)
        except OSError:
            os.close(handle)
        else:
            return block
    return os.getpid() % N_BLOCKS
