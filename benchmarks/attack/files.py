"""Attacks by files: recordings, imports, models, labels, sensors; and kills of a recorder."""

import resource
from collections.abc import Iterator

from attack.documents import (
    attack_definitions,
    attack_label_bits,
    attack_labels,
    attack_models,
    attack_others,
)
from attack.expansions import attack_expansions
from attack.imports import attack_imports, attack_videos
from attack.recordings import (
    DAMAGES,
    attack_damage,
    attack_headers,
    attack_kills,
    attack_sealed,
)
from attack.result import CpuResult, Result


def attacks(scale: float) -> Iterator[Result]:
    """Yield the results of all attacks; `scale` 1 has more than 200,000 files and 200 kills."""

    def n(full: int) -> int:
        return max(round(scale * full), 20)

    for suffix in (".parquet", ".mcap"):
        for name, damage in DAMAGES.items():
            yield attack_damage(n(20_000), suffix, name, damage)
        yield attack_headers(n(5_000), suffix)
    yield attack_sealed(n(10_000))
    yield attack_models(n(10_000))
    yield attack_labels(n(10_000))
    yield attack_label_bits(n(10_000))
    yield from attack_others(n(5_000))
    yield attack_definitions(n(10_000))
    yield from attack_imports(n(3_000))
    yield attack_videos(n(3_000))
    yield attack_kills(n(200))
    yield from attack_expansions()
    yield _memory()


def _memory() -> Result:
    """Return the largest memory of the process so far, as a note."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return CpuResult("memory of all of this", n_tried=1, note=f"{peak / 1024:.0f} MB at most")
