"""A sheet of stickers to print: PDF of black squares, with their number and size."""

from collections.abc import Iterator

import numpy as np

MILLIMETRE = 72 / 25.4
"""Points of a PDF in a millimetre."""
A4 = (210.0, 297.0)
"""Width and height of A4, which US Letter contains but for 18 mm at the foot [mm]."""
SHEET_STICKERS = ((24.0, (0,)), (15.0, (1, 2, 3, 4, 5)))
"""Side [mm] and numbers of the stickers in each row: the object, then the fingers."""
N_ROWS = 3
"""Times that each row is printed: stickers wear off."""


def sticker_sheet() -> bytes:
    """Return the PDF of a sheet, without a compressed part."""
    drawing = "\n".join(_drawing())
    objects = (
        "<< /Type /Catalog /Pages 2 0 R >>",
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {A4[0] * MILLIMETRE:.2f} "
        f"{A4[1] * MILLIMETRE:.2f}] /Contents 5 0 R "
        "/Resources << /Font << /F 4 0 R >> >> >>",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        f"<< /Length {len(drawing)} >>\nstream\n{drawing}\nendstream",
    )
    text, offsets = "%PDF-1.4\n", []
    for k, content in enumerate(objects, 1):
        offsets.append(len(text))
        text += f"{k} 0 obj\n{content}\nendobj\n"
    table = "".join(f"{offset:010d} 00000 n \n" for offset in offsets)
    n = len(objects) + 1
    text += f"xref\n0 {n}\n0000000000 65535 f \n{table}trailer\n<< /Size {n} /Root 1 0 R >>\n"
    return f"{text}startxref\n{text.index('xref')}\n%%EOF\n".encode("ascii")


def _drawing() -> Iterator[str]:
    """Yield the operators of the page, in millimetres from its upper left corner."""
    yield f"{MILLIMETRE:.6f} 0 0 {-MILLIMETRE:.6f} 0 {A4[1] * MILLIMETRE:.3f} cm 0.1 w"
    yield _words(20, 18, 4, "Stickers of holdfast: print at 100 %, on matt paper; cut on the lines")
    yield _words(20, 25, 3, "This line is 100 mm long; if not, give the sides that you measure:")
    yield "20 29 100 1 re f"
    yield _words(20, 36, 3, "--set object_size=0.024 --set tip_size=0.015")
    y = 45.0
    for side, numbers in SHEET_STICKERS * N_ROWS:
        x = 20.0
        for number in numbers * (4 if len(numbers) == 1 else 1):
            rim = cell = side / 6  # a cell of white around the pattern lets OpenCV find its edge
            yield f"{x} {y} {side + 2 * rim} {side + 2 * rim} re S"
            for row, column in np.argwhere(_is_black(number)):
                yield f"{x + rim + column * cell:.3f} {y + rim + row * cell:.3f} {cell} {cell} re f"
            owner = f"finger {number}" if number else "object"
            yield _words(x, y + side + 2 * rim + 3, 2.5, f"{number}: {owner}, {side:g} mm")
            x += side + 2 * rim + 6
        y += side + side / 3 + 10


def _words(x: float, y: float, size: float, text: str) -> str:
    # y points down on this page: letters are mirrored back.
    return f"BT /F {size} Tf 1 0 0 -1 {x} {y} Tm ({text}) Tj ET"


def _is_black(number: int) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    """Return (6, 6) the cells of a pattern of OpenCV's DICT_4X4_50, with its black rim."""
    import cv2

    book = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return np.asarray(cv2.aruco.generateImageMarker(book, number, 6) == 0, dtype=np.bool_)
