"""Matplotlib figures as files and as elements of an HTML document."""

import base64
import io
import re
from typing import NamedTuple, Self

import matplotlib as mpl
from matplotlib.figure import Figure

MAX_INLINE_SVG = 400_000
"""A larger SVG [bytes] is replaced by a PNG in the report."""
PNG_RESOLUTION = 200
"""Of a PNG [dots per inch]."""

_ID = re.compile(r'(?<= id=")(?=[^"]+")')
_REFERENCE = re.compile(r'(?<=url\(#)|(?<=href="#)')
_OPENING = re.compile(r'<svg [^>]*?viewBox="([^"]*)"[^>]*>')
_PATH = re.compile(r' d="[^"]*"')
_EXTRA_DIGITS = re.compile(r"(?<=\.\d\d)\d+")
"""Digits beyond 0.01 pt."""
_NOT_NEEDED = re.compile(r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->", re.DOTALL)


def svg_of(figure: Figure, name: str) -> str:
    """Return the figure as an SVG document, the same for the same figure and name.

    Args:
        figure: to write.
        name: from which the ids of its elements are made.
    """
    file = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name, "svg.fonttype": "path"}):
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()


def png_of(figure: Figure) -> bytes:
    """Return the figure as a PNG file."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=PNG_RESOLUTION, metadata={"Software": None})
    return file.getvalue()


class InlineImage(NamedTuple):
    """A figure inside an HTML document.

    Attributes:
        view_box: of the `svg` element.
        svg: contents of the `svg` element and its end; empty if the image is of another kind.
        data: of an `img` element, in base64; empty if the image is an SVG.
        kind: of the data: "png" or "webp".
    """

    view_box: str
    svg: str
    data: str
    kind: str = "png"

    @classmethod
    def of(cls, data: bytes, kind: str) -> Self:
        """Return the image for the content of a file."""
        return cls("", "", base64.b64encode(data).decode(), kind)


def inline_image(figure: Figure, name: str) -> InlineImage:
    """Return the figure for an HTML document: as SVG, or as PNG if the SVG would be large.

    Args:
        figure: to draw.
        name: begins every id of the SVG, so that ids of two figures differ.
    """
    # The viewBox and the contents of an SVG document, without metadata.
    document = svg_of(figure, name)
    opening = _OPENING.search(document)
    if opening is None:
        raise ValueError(f"figure {name}: an SVG with a viewBox expected, none given")
    inner = _NOT_NEEDED.sub("", document[opening.end() :]).replace("xlink:href", "href")
    inner = re.sub(r"\n\s*", "\n", inner)
    inner = _PATH.sub(lambda path: _EXTRA_DIGITS.sub("", path[0]), inner)
    view_box, svg = opening[1], _REFERENCE.sub(f"{name}-", _ID.sub(f"{name}-", inner))
    if len(svg) <= MAX_INLINE_SVG:
        return InlineImage(view_box, svg, "")
    return InlineImage.of(png_of(figure), "png")
