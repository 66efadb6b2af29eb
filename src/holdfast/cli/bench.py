"""`holdfast bench`: speed against peers and against the limit of the machine."""

from typing import Annotated, Any

import typer

from holdfast.cli.console import print_json, say, show


def bench(
    samples: Annotated[
        int, typer.Option(help="Of one finger, for the batch features.")
    ] = 10_000_000,
    updates: Annotated[int, typer.Option(help="Of a hand, for the latency.")] = 20_000,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")] = False,
) -> None:
    """Measures speed, against peers and against the machine.

    All in one run, as ratios: batch features beside a copy of the same bytes, PyWavelets, SciPy
    and tsflex; the update of a hand beside PyWavelets with scikit-learn. Peers that are not
    installed are left out.

    Example:
      holdfast bench
      holdfast bench --samples 1000000 --json
    """
    from holdfast.benchmark import benchmark

    if samples < 1000 or updates < 1000:
        raise ValueError(f"at least 1000 samples and updates expected, {samples}, {updates} given")
    say("measuring: about half a minute")
    found = benchmark(samples, updates)
    if as_json:
        print_json(found)
        return
    _show(found["batch"], found["hand_update"])


def _show(batch: dict[str, Any], update: dict[str, Any]) -> None:
    show(f"batch features of {batch['n_samples']:,} samples, window {batch['window']}")
    show(f"  {1e9 * batch['seconds_per_sample']:.1f} ns a sample")
    show(f"  {batch['ratio_to_copy']:.2f} times as long as copying the same bytes")
    for peer in ("pywt", "scipy", "tsflex"):
        ratio = batch[f"speedup_over_{peer}"]
        show(f"  {ratio:,.0f} times faster than {peer}" if ratio else f"  {peer}: not installed")
    show(f"\nupdate of a hand, {update['n_fingers']} fingers of {update['n_taxels']} taxels")
    show("  " + ", ".join(f"{p} {1e6 * update[p]:.1f} us" for p in ("p50", "p99", "p999")))
    ratio = update["speedup_over_pywt_sklearn"]
    show(f"  {ratio:,.0f} times faster than pywt + scikit-learn" if ratio else "  pywt: missing")
