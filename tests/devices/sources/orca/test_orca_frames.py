import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.sources.orca.hand import FINGERS, answer, encoder_frame, some_frames, touch_frame
from holdfast.devices.sources.orca_frames import OrcaClient, OrcaHand, forces_of

FRAMES, FORCES = some_frames(6)
FEWER = {"thumb": 51, "middle": 87, "ring": 87}
"""A hand of which two fingers are unplugged."""


def begun(fingers=FINGERS, now=0.0):
    """A client whose questions are answered."""
    client = OrcaClient()
    while request := client.request(now):
        client.feed(answer(request, fingers), now)
    return client


def fed(client, data, piece=None):
    step = piece or len(data)
    parts = [client.feed(data[k : k + step], 1.0) for k in range(0, len(data), step)]
    samples = [sample for part in parts for sample in part[0]]
    return samples, sum(part[1] for part in parts), sum(part[2] for part in parts)


@pytest.mark.parametrize("fingers", [FINGERS, FEWER, {"pinky": 51}])
def test_the_hand_says_which_fingers_it_has(fingers):
    assert begun(fingers).fingers == fingers
    frames, forces = some_frames(2, fingers)
    np.testing.assert_array_equal(fed(begun(fingers), b"".join(frames))[0], forces)


@given(st.lists(st.integers(1, 3000), min_size=1, max_size=30))
def test_pieces_of_any_size(sizes):
    """Responses, frames and joint encoders, byte by byte or at once."""
    client, left, samples = begun(), b"", []
    for k, frame in enumerate(FRAMES):
        left += frame + encoder_frame(k)
    while left:
        for size in sizes:
            samples += client.feed(left[:size], 0.0)[0]
            left = left[size:]
    np.testing.assert_array_equal(samples, FORCES)


def test_the_encoding_of_the_public_driver():
    """Axes of a taxel: int8, int8, uint8, 0.1 N a count."""
    np.testing.assert_allclose(forces_of(b"\x80\x7f\xff\x01\xff\x00"), [[-12.8, 12.7, 25.5],
                               [0.1, -0.1, 0.0]])  # fmt: skip
    requests = []
    client = OrcaClient()
    while request := client.request(0.0):
        requests.append(request.hex(" "))
        client.feed(answer(request), 0.0)
    assert requests == [
        "55 aa 00 03 10 00 04 00 ea",
        "55 aa 00 03 30 00 38 00 96",
        "55 aa 00 10 16 00 01 00 02 d8",
        "55 aa 00 10 17 00 01 00 01 d8",
    ]


DAMAGED = {
    "checksum": (FRAMES[1][:-1] + bytes([FRAMES[1][-1] ^ 1]), 1, 0),
    "one bit of a force": (FRAMES[1][:500] + bytes([FRAMES[1][500] ^ 4]) + FRAMES[1][501:], 1, 0),
    "length of 8193": (FRAMES[1][:3] + b"\x01\x20" + FRAMES[1][5:], 1, 0),
    "its second half is missing": (FRAMES[1][:500], 0, 1),
    "its first half is missing": (FRAMES[1][500:], 0, 1),
    "the hand reports an error": (touch_frame(FRAMES[1][6:-1], error=3), 1, 0),
    "joint encoders": (encoder_frame(), 0, 0),
    "a late response": (answer(bytes.fromhex("55aa000310000400ea")), 0, 0),
    "text of a reset": (b"boot v1.2\r\n", 0, 1),
}


@pytest.mark.parametrize("piece", [None, 1, 7])
@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_and_lost_frames_are_counted_and_the_next_one_is_read(name, piece):
    data, n_damaged, n_lost = DAMAGED[name]
    samples, *counted = fed(begun(), FRAMES[0] + data + FRAMES[2] + FRAMES[3], piece)
    assert counted == [n_damaged, n_lost]
    np.testing.assert_array_equal(samples, FORCES[[0, 2, 3]])


@given(st.binary(max_size=300))
def test_no_bytes_stop_it(noise):
    """The stream goes on behind any bytes, but a false frame of encoders may cost 8 kB."""
    samples, *_ = fed(begun(), FRAMES[0] + noise + b"".join(FRAMES * 3))
    np.testing.assert_array_equal(samples[-6:], FORCES)


def test_the_stream_is_requested_again_after_2_s_of_silence():
    client = begun(now=10.0)
    client.feed(FRAMES[0], 11.0)
    asked = {t: client.request(t) for t in np.arange(11.0, 40.0, 0.1)}
    # Unanswered: the first question again and again.
    (first, *_) = filter(None, asked.values())
    times = [t for t, request in asked.items() if request == first]
    assert times[0] == pytest.approx(15.0, abs=0.11)  # 5 s after the last time
    assert np.diff(times) == pytest.approx(0.5, abs=0.11)
    client = begun(now=10.0)
    for k in range(10):
        client.feed(FRAMES[0], 11.0 + k)
        assert not client.request(12.0 + k)
    assert client.request(22.0)
    while request := client.request(22.6):
        client.feed(answer(request, FEWER), 22.6)
    assert client.fingers == FEWER  # it was reset without two of its fingers
    assert fed(client, some_frames(1, FEWER)[0][0])[0][0].shape == (225, 3)


def test_a_lost_response_is_waited_for_half_a_second():
    client = OrcaClient()
    first = client.request(0.0)
    assert (client.request(0.4), client.request(0.5)) == (b"", first)
    client.feed(answer(first), 0.6)
    assert client.request(0.6) not in (b"", first)


@pytest.mark.parametrize("piece", [1, 5, 1000])
def test_the_imitation_is_understood(piece):
    """What `holdfast play --orca` sends: rounded, clipped, finger after finger."""
    hand, client = OrcaHand(FEWER), OrcaClient()
    while request := client.request(0.0):
        for k in range(0, len(request), piece):
            client.feed(hand.feed(request[k : k + piece]), 0.0)
    assert (client.fingers, hand.is_streaming) == (FEWER, True)
    forces = {name: np.full((n, 3), k + 0.07) for k, (name, n) in enumerate(FEWER.items())}
    forces["ring"][:] = (-99.0, 99.0, 99.0)
    ((sample,), *_) = fed(client, hand.frame(forces))
    np.testing.assert_allclose(sample[:51], 0.1)
    np.testing.assert_allclose(sample[51:-87], 1.1)
    np.testing.assert_allclose(sample[-87:], np.tile([-12.8, 12.7, 25.5], (87, 1)))
