"""matplotlib figures as files and as parts of an HTML document."""

import base64
import html
import io
import re

import matplotlib as mpl
from matplotlib.figure import Figure

LARGEST_SVG = 400_000
"""Above this many bytes a report holds the PNG instead."""
SHARP = 200
"""Resolution of a PNG [dots per inch]."""

_ID = re.compile(r'(?<= id=")(?=[^"]+")')
_REFERENCE = re.compile(r'(?<=url\(#)|(?<=href="#)')
_OPENING = re.compile(r'<svg [^>]*?viewBox="([^"]*)"[^>]*>')
_PATH = re.compile(r' d="[^"]*"')
_LONG = re.compile(r"(?<=\.\d\d)\d+")
"""Digits beyond 0.01 pt."""
_USELESS = re.compile(r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", re.DOTALL)


def svg_of(figure: Figure, name: str) -> str:
    """The figure as an SVG document, the same for the same figure and name.

    Args:
        figure: to write.
        name: what its inner names are made from.
    """
    file = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


def png_of(figure: Figure) -> bytes:
    """The figure as a PNG."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=SHARP, metadata={"Software": None})
    return file.getvalue()


def inline_image(figure: Figure, name: str, title: str) -> str:
    """The figure as a part of an HTML document: SVG, or PNG where that would be large.

    Args:
        figure: to draw.
        name: begins every id within, so that they do not meet those of other figures.
        title: for those who do not see it.

    Returns:
        An `svg` or an `img` element.
    """
    svg = inline_svg(svg_of(figure, name), name, title)
    if len(svg) <= LARGEST_SVG:
        return svg
    data = base64.b64encode(png_of(figure)).decode()
    return f'<img alt="{html.escape(title)}" src="data:image/png;base64,{data}">\n'


def inline_svg(document: str, name: str, title: str) -> str:
    """An SVG document as an element of HTML: no prologue, no metadata, ids of its own."""
    opening = _OPENING.search(document)
    if opening is None:
        raise ValueError(f"figure {name}: no SVG with a viewBox")
    inner = _USELESS.sub("", document[opening.end() :]).replace("xlink:href", "href")
    inner = re.sub(r"\n\s*", "\n", inner)
    inner = _PATH.sub(lambda path: _LONG.sub("", path[0]), inner)
    inner = _REFERENCE.sub(f"{name}-", _ID.sub(f"{name}-", inner))
    return (
        f'<svg role="img" aria-label="{html.escape(title)}" viewBox="{opening[1]}" '
        f'style="stroke-linejoin:round;stroke-linecap:butt">{inner}'
    )
