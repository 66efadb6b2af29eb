import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from devices.sources.board import packet, some
from holdfast.devices.sources.anyskin import AnySkinDecoder

READING = st.floats(2**-9, 1e6, width=32) | st.floats(-1e6, -(2**-9), width=32) | st.just(0.0)
CRLF_INSIDE = np.frombuffer(b"\x00\x0d\x0a\x42\x0d\x0a\x00\x42", "<f4")
"""34.5 and 32.01: numbers of which CR LF are two bytes."""


def line(readings, temperature=25.0):
    return "\t".join(f"{x:.2f}\t{y:.2f}\t{z:.2f}\t{temperature}" for x, y, z in readings).encode()


def decoded(data, n_mags=5, piece=None, start=b"\r\n"):
    decoder = AnySkinDecoder(n_mags)
    data = start + data
    step = piece or len(data)
    parts = [decoder.feed(data[k : k + step]) for k in range(0, len(data), step)]
    samples = [sample for part in parts for sample in part.samples]
    return samples, sum(part.n_refused for part in parts), parts[-1].other_n_mags


@pytest.mark.parametrize("n_mags", [1, 2, 5, 16])
def test_packets_are_decoded_exactly(n_mags):
    given = some(4, n_mags)
    samples, n_refused, other = decoded(b"".join(map(packet, given)), n_mags)
    np.testing.assert_array_equal(samples, given)
    assert (n_refused, other) == (0, 0)
    assert all(sample.dtype == np.float32 and sample.dtype.isnative for sample in samples)


@given(
    st.lists(st.lists(READING, min_size=6, max_size=6), min_size=1, max_size=5),
    st.integers(1, 80),
    st.floats(-40, 125, width=32),
)
@example([[CRLF_INSIDE[0], CRLF_INSIDE[1]] * 3] * 4, 1, CRLF_INSIDE[0])
def test_pieces_of_any_size_give_the_same(rows, piece, temperature):
    given = np.array(rows, dtype=np.float32).reshape(-1, 2, 3)
    data = b"".join(packet(sample, temperature) for sample in given)
    samples, n_refused, _ = decoded(data, 2, piece)
    np.testing.assert_array_equal(samples, given)
    assert n_refused == 0


@given(
    st.lists(
        st.one_of(
            st.integers(0, 3).map(lambda seed: packet(some(1, 2, seed)[0])),
            st.integers(0, 3).map(lambda seed: line(some(1, 2, seed)[0]) + b"\t\r\n"),
            st.binary(max_size=90),
            st.sampled_from([b"\r\n", b"\n", b"1 2 3 4\n", b"12 13", b"1.0\t" * 40]),
        ),
        max_size=8,
    ),
    st.integers(1, 60),
)
def test_garbage_gives_the_same_in_pieces_of_any_size(parts, piece):
    data = b"".join(parts)
    tail = b"".join(map(packet, some(30, 2)))  # long enough to resynchronise
    whole = decoded(data + tail, 2)
    pieces = decoded(data + tail, 2, piece)
    np.testing.assert_array_equal(whole[0], pieces[0])
    assert whole[1] == pieces[1]
    np.testing.assert_array_equal(whole[0][-28:], some(30, 2)[-28:])


@pytest.mark.parametrize("bad", [np.nan, np.inf, 2e6, 1e-5])
def test_impossible_numbers_are_refused(bad):
    given = some(4)
    wrong = given[2].copy()
    wrong[3, 1] = bad
    samples, n_refused, _ = decoded(b"".join(map(packet, [*given[:2], wrong, given[3]])))
    np.testing.assert_array_equal(samples, given[[0, 1, 3]])
    assert n_refused == 1


@pytest.mark.parametrize("bad", [b"nan", b"ovf", b"1.2.3", b"1e30", b""])
def test_impossible_lines_are_refused(bad):
    lines = [line(sample) + b"\t\r\n" for sample in some(4)]
    words = lines[2].split(b"\t")
    lines[2] = b"\t".join([*words[:9], bad, *words[10:]])
    samples, n_refused, _ = decoded(b"".join(lines))
    np.testing.assert_allclose(samples, some(4)[[0, 1, 3]], atol=0.006)
    assert n_refused >= 1


@pytest.mark.parametrize("end", [b"\r\n", b"\n", b"\t\r\n", b" \n"])
@pytest.mark.parametrize("piece", [1, 7, None])
def test_lines_of_text_are_taken_from_the_second_on(end, piece):
    given = some(4)
    data = b"".join(line(sample) + end for sample in given)
    samples, n_refused, _ = decoded(data[20:], 5, piece, start=b"")
    np.testing.assert_allclose(samples, given[1:], atol=0.006)
    assert n_refused <= 1  # half a line may be longer than a packet


def test_an_expected_packet_clears_another_number():
    decoder = AnySkinDecoder(5)
    assert decoder.feed(b"\n" + b"".join(map(packet, some(9, 4)))).other_n_mags == 4
    assert decoder.feed(b"".join(map(packet, some(9, 5)))).other_n_mags == 0


def test_a_reset_drops_half_a_packet():
    first, second = some(2)
    decoder = AnySkinDecoder(5)
    decoder.feed(packet(first)[:50])
    decoder.reset()
    got = decoder.feed(b"\r\n" + packet(second))
    np.testing.assert_array_equal(got.samples, [second])
    assert got.n_refused == 0
