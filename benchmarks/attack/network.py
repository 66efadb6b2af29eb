"""Attacks from the network: packets, servers, clients, web requests, kills."""

from collections.abc import Iterator

from attack.clients import attack_play, attack_serve
from attack.packets import attack_cdr, attack_clocks, attack_serial, attack_xela
from attack.result import Result
from attack.servers import attack_client, attack_reconnection


def attacks(scale: float) -> Iterator[Result]:
    """Yield the results of all attacks; `scale` 1 has more than a million packets."""

    def n(full: int) -> int:
        return max(round(scale * full), 1)

    yield attack_xela(n(250_000), "1.7")
    yield attack_xela(n(250_000), "1.8")
    yield attack_xela(n(20_000), "1.8", whole=True)
    yield attack_cdr(n(250_000))
    yield attack_serial(n(200_000), text=False)
    yield attack_serial(n(100_000), text=True)
    yield from attack_clocks()
    yield attack_client(n(10))
    yield attack_reconnection(n(200))
    yield from attack_serve(n(1100))
    yield attack_play(n(100), n(60))
