"""The sheet of stickers, drawn again from its PDF and read by OpenCV."""

import re

import numpy as np
import pytest

from holdfast.labelling.sticker_sheet import A4, SHEET_STICKERS, sticker_sheet

cv2 = pytest.importorskip("cv2")

PIXELS = 8
"""Pixels in a millimetre of the drawing."""


def test_opencv_finds_all_stickers_in_their_size():
    text = sticker_sheet().decode("ascii")
    page = np.full((round(A4[1] * PIXELS), round(A4[0] * PIXELS)), 255, np.uint8)
    for found in re.findall(r"^(\S+) (\S+) (\S+) (\S+) re f$", text, re.MULTILINE):
        x, y, width, height = (float(number) * PIXELS for number in found)
        page[round(y) : round(y + height), round(x) : round(x + width)] = 0
    finder = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50))
    corners, numbers, _ = finder.detectMarkers(page)
    sizes = {number: side for side, row in SHEET_STICKERS for number in row}
    assert sorted(set(numbers.ravel().tolist())) == sorted(sizes)
    for outline, number in zip(corners, numbers.ravel(), strict=True):
        sides = np.linalg.norm(np.diff(outline[0], axis=0), axis=1) / PIXELS
        assert sides == pytest.approx(np.full(3, sizes[int(number)]), abs=0.3)


def test_offsets_of_objects_in_the_file_are_right():
    content = sticker_sheet()
    start = int(content.split(b"startxref\n")[1].split()[0])
    assert content[start:].startswith(b"xref\n0 6\n")
    entries = re.findall(rb"^(\d{10}) 00000 n", content[start:], re.MULTILINE)
    for k, entry in enumerate(entries, 1):
        assert content[int(entry) :].startswith(b"%d 0 obj\n" % k)
    assert b"(0: object, 24 mm)" in content
