import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic

from holdfast.io import mcap_messages as messages
from holdfast.io.header import NUMBER_TYPES

SHAPES = [(), (3,), (2, 3), (0,)]


def example(number, n, shape):
    size = n * int(np.prod(shape, dtype=int))
    if number == "str":
        return np.array([f"é{k}" for k in range(size)], dtype="U8").reshape(n, *shape)
    return (np.arange(size) % 100).astype(number).reshape(n, *shape)


@pytest.mark.parametrize("number", NUMBER_TYPES)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("n", [1, 3])
def test_samples_come_back_and_others_read_them(number, shape, n):
    times, values = np.arange(n) + 0.5, example(number, n, shape)
    data = messages.encode_samples(times, values)
    got_times, got = messages.decode_samples(data, number)
    np.testing.assert_array_equal(got_times, times)
    np.testing.assert_array_equal(got, values)
    assert got.shape == values.shape
    if values.size:
        name = messages.samples_type(number)
        message = generate_dynamic(name, messages.samples_schema(number))[name](data)
        assert list(message.times) == times.tolist()
        assert list(message.shape) == list(shape)
        assert list(message.values) == values.ravel().tolist()


@given(time=st.floats(allow_nan=False), text=st.text(st.characters(codec="utf-8")))
def test_texts_come_back(time, text):
    assert messages.decode_text(messages.encode_text(time, text)) == (time, text)


def test_others_read_texts():
    message = generate_dynamic(messages.TEXT_TYPE, messages.TEXT_SCHEMA)[messages.TEXT_TYPE](
        messages.encode_text(1.5, "grüezi")
    )
    assert (message.time, message.text) == (1.5, "grüezi")


@pytest.mark.parametrize("number", ["uint16", "str"])
def test_a_message_cut_anywhere_is_refused(number):
    data = messages.encode_samples(np.arange(2.0), example(number, 2, (3,)))
    for size in range(len(data)):
        with pytest.raises(ValueError, match=r"."):
            messages.decode_samples(data[:size], number)


def test_a_shape_that_does_not_fit_is_refused():
    data = bytearray(messages.encode_samples(np.arange(2.0), np.zeros((2, 3), np.uint8)))
    data[data.index(b"\x03\x00\x00\x00")] = 4
    with pytest.raises(ValueError, match="6 values given for 2 samples of shape"):
        messages.decode_samples(bytes(data), "uint8")
