"""`holdfast bench`: speed, compared with other libraries and with copying memory."""

from typing import Annotated

import typer

from holdfast.cli.options import JsonOption
from holdfast.cli.terminal.console import print_json, print_line, print_message


def bench(
    samples: Annotated[
        int, typer.Option(help="Number of samples of one finger for the batch features.")
    ] = 10_000_000,
    updates: Annotated[
        int, typer.Option(help="Number of updates of a hand for the time per update.")
    ] = 20_000,
    as_json: JsonOption = False,
) -> None:
    """Measure the speed of the features and of the detector.

    Everything is measured in one run and given as ratios. The batch features are compared with a
    copy of the same number of bytes, with PyWavelets, SciPy and tsflex; the update of a hand with
    PyWavelets and scikit-learn. Libraries that are not installed are left out.

    Example:
      holdfast bench
      holdfast bench --samples 1000000 --json
    """
    from holdfast_lab.speed import benchmark

    if samples < 1000 or updates < 1000:
        raise ValueError(f"at least 1000 samples and updates expected, {samples}, {updates} given")
    print_message("measuring: about half a minute")
    report = benchmark(samples, updates)
    if as_json:
        print_json(report)
        return
    batch = report["batch"]
    print_line(f"batch features of {batch['n_samples']:,} samples, window {batch['window']}")
    print_line(f"  {1e9 * batch['seconds_per_sample']:.1f} ns a sample")
    print_line(f"  {batch['ratio_to_copy']:.2f} times as long as copying the same bytes")
    for peer in ("pywt", "scipy", "tsflex"):
        print_speedup(peer, batch[f"speedup_over_{peer}"])
    update = report["hand_update"]
    print_line()
    print_line(f"update of a hand, {update['n_fingers']} fingers of {update['n_taxels']} taxels")
    print_line("  " + ", ".join(f"{p} {1e6 * update[p]:.1f} us" for p in ("p50", "p99", "p999")))
    print_speedup("pywt + scikit-learn", update["speedup_over_pywt_sklearn"])


def print_speedup(peer: str, ratio: float | None) -> None:
    """Print how many times faster than a library the kernel is; None if it is not installed."""
    known = f"{ratio:,.0f} times faster than {peer}" if ratio else f"{peer}: not installed"
    print_line(f"  {known}")
