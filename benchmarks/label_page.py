"""Time to paint and to zoom the labelling page, with 250,000 samples of four fingers.

`holdfast label` serves a synthetic recording from another process, and a headless Chromium opens
the page. The browser measures the times: from navigation to the first paint of the plots, and
from a turn of the mouse wheel to the new plots. The responses of the service are also measured
without a browser; `first` is the first response of a new process.

    uv run python benchmarks/label_page.py
    uv run python benchmarks/label_page.py --samples 1000000 --wheels 50
"""

import argparse
import json
import shutil
import statistics
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.request import urlopen

import numpy as np

from holdfast.io import save_recording
from holdfast.recordings import Recording
from holdfast.synthetic import SYNTHETIC_RATE, synthetic_recording

FINGERS = ("thumb", "index", "middle", "ring")
TIMEOUT = 120.0
"""Maximum time to wait for the page [s]."""
QUIET_TIME = 0.5
"""A zoom is finished when nothing was drawn for this time [s]."""
OPTIONS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run")

DRAWING_TIMES_SCRIPT = """
window.bench = {painted: null, wheel: null, drawn: []};
new MutationObserver(() => requestAnimationFrame(() => {
  window.bench.painted ??= performance.now();
})).observe(document, {attributes: true, subtree: true, attributeFilter: ["data-painted"]});
addEventListener("wheel", () => {
  window.bench.wheel = performance.now();
  window.bench.drawn = [];
}, {capture: true, passive: true});
const stroke = CanvasRenderingContext2D.prototype.stroke;
let waiting = false;
CanvasRenderingContext2D.prototype.stroke = function (...given) {
  if (!waiting) requestAnimationFrame(() => {
    waiting = false;
    window.bench.drawn.push(performance.now());
  });
  waiting = true;
  return stroke.apply(this, given);
};
"""
"""Script that stores when lines were drawn: at the next frame, when they are on the screen."""


def main() -> None:
    options = _options()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "long.parquet"
        save_recording(_recording(options.samples), path)
        report = {"samples": options.samples, "fingers": len(FINGERS)}
        with _served(path) as (url, process):
            report["service"] = _service(url)
            report["memory of the service, largest [MB]"] = _largest_memory(process)
        if not options.no_browser:
            report["page"] = _page(path, options)
    print(json.dumps(report, indent=1))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=250_000, help="samples of each finger")
    parser.add_argument("--wheels", type=int, default=20, help="number of turns of the mouse wheel")
    parser.add_argument("--no-browser", action="store_true", help="measure only the service")
    return parser.parse_args()


def _recording(n: int) -> Recording:
    """Return a recording that repeats a grasp until it has n samples."""
    grasp = synthetic_recording("long", 0, FINGERS)
    modules = {}
    for name, module in grasp.modules.items():
        times = -(-n // module.n_samples)
        readings = np.tile(module.readings, (times, 1, 1))[:n]
        modules[name] = replace(
            module, times=np.arange(n) / SYNTHETIC_RATE, readings=readings, labels=()
        )
    return Recording("long", modules)


@contextmanager
def _served(path: Path):
    """Run the labelling page in another process, and yield its URL and its process id."""
    holdfast = Path(sys.executable).with_name("holdfast")
    words = ("label", str(path), "--port", "0", "--no-browser", "--json")
    process = subprocess.Popen([holdfast, *words], stdout=subprocess.PIPE, text=True)
    try:
        yield json.loads(process.stdout.readline())["url"], process.pid
    finally:
        process.terminate()
        process.wait()


def _largest_memory(process: int) -> int:
    """Return the largest resident memory of a process so far [MB]."""
    status = Path(f"/proc/{process}/status").read_text("utf-8")
    (line,) = (line for line in status.splitlines() if line.startswith("VmHWM:"))
    return round(int(line.split()[1]) * 1024 / 1e6)


def _service(url: str) -> dict[str, float]:
    """Return the response times of the service without a browser [s]."""
    one = f"{url}api/v1/recordings/0"
    report = {
        "list": _timed(f"{url}api/v1/recordings"),
        "recording, with reading the file": _timed(one),
        "first signals": _timed(f"{one}/signals?points=1200"),
        "change points": _timed(f"{one}/changes"),
    }
    zooms = []
    end = json.loads(urlopen(one).read())["end"]
    for span in np.geomspace(end, 1.0, 40):
        part = f"start={(end - span) / 2}&end={(end + span) / 2}"
        zooms.append(_timed(f"{one}/signals?{part}&points=1200"))
    report["zoom, median"] = statistics.median(zooms)
    report["zoom, largest"] = max(zooms)
    return {name: round(value, 4) for name, value in report.items()}


def _timed(url: str) -> float:
    begin = time.perf_counter()
    with urlopen(url) as answer:
        answer.read()
    return time.perf_counter() - begin


def _page(path: Path, options: argparse.Namespace) -> dict[str, float]:
    """Return the times in the browser; the page is opened as soon as the service responds."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=OPTIONS)
        page = browser.new_page(viewport={"width": 1600, "height": 1000})
        page.add_init_script(DRAWING_TIMES_SCRIPT)
        with _served(path) as (url, _):
            page.goto(url)
            report = _visit(page, options.wheels)
        browser.close()
    return {name: round(value, 4) for name, value in report.items()}


def _visit(page, n_wheels: int) -> dict[str, float]:
    _until(page, "window.bench.painted !== null")
    first_paint = page.evaluate("window.bench.painted") / 1e3
    _wait_until_quiet(page)
    box = page.locator("canvas").last.bounding_box()  # the plots, which lie on each other
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    _wait_until_quiet(page)
    turns = [_turn(page, delta) for delta in (-120, 120) for _ in range(n_wheels // 2)]
    first, last = ([turn[k] for turn in turns] for k in (0, 1))
    return {
        "first paint [s]": first_paint,
        "zoom to first redraw, median [s]": statistics.median(first),
        "zoom to first redraw, largest [s]": max(first),
        "zoom to last redraw, median [s]": statistics.median(last),
        "zoom to last redraw, largest [s]": max(last),
    }


def _turn(page, delta: int) -> tuple[float, float]:
    """Return the times from a turn of the wheel to the first and the last drawing [s]."""
    page.evaluate("window.bench.wheel = null")
    page.mouse.wheel(0, delta)
    _until(page, "window.bench.wheel !== null && window.bench.drawn.length > 0")
    _wait_until_quiet(page)
    first, last = page.evaluate(
        "[window.bench.drawn[0], window.bench.drawn.at(-1)].map((t) => t - window.bench.wheel)"
    )
    return first / 1e3, last / 1e3


def _wait_until_quiet(page) -> None:
    _until(page, f"performance.now() - (window.bench.drawn.at(-1) ?? 0) > {1e3 * QUIET_TIME}")


def _until(page, condition: str) -> None:
    """Poll a condition; the security policy of the page does not allow to wait inside it."""
    end = time.monotonic() + TIMEOUT
    while not page.evaluate(condition):
        if time.monotonic() > end:
            raise TimeoutError(f"not within {TIMEOUT:g} s: {condition}")
        time.sleep(0.02)


if __name__ == "__main__":
    main()
