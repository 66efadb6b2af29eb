import re
from pathlib import Path

import msgspec
import pytest

from holdfast.errors import RecordingError
from holdfast.io.header import decode_header, encode_header, header_of


def test_it_comes_back(make_recording):
    header = header_of(make_recording(), "a")
    assert decode_header(encode_header(header), Path("a")) == header


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda h: h.update(extra=1), "`extra`"),
        (lambda h: h.update(schema="holdfast.recording/9"), "/9"),
        (lambda h: h.pop("name"), "`name`"),
        (lambda h: h["modules"]["thumb"].update(n_samples="9"), "n_samples"),
        (lambda h: h["modules"]["thumb"]["sensor"].update(skin=1), "'skin'"),
        (lambda h: h["modules"]["thumb"]["sensor"].update(rate=0), "rate"),
        (lambda h: h["modules"]["thumb"]["sensor"].pop("normal"), "'normal'"),
        (lambda h: h["truth"]["hand"]["phase"].update(shape=[0.5]), "shape"),
    ],
)
def test_invalid_headers_are_refused(make_recording, change, text):
    data = msgspec.json.decode(encode_header(header_of(make_recording(), "a")))
    change(data)
    with pytest.raises(RecordingError, match=re.escape(text)) as caught:
        decode_header(msgspec.json.encode(data), Path("a.parquet"))
    assert str(caught.value).startswith("a.parquet: ")


def test_invalid_json_is_refused():
    with pytest.raises(RecordingError, match=r"a\.parquet: "):
        decode_header(b"", Path("a.parquet"))
