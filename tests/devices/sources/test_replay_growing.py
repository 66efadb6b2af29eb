"""Replay of a recording that another program is still writing."""

import pytest

from holdfast.devices.sources import open_source
from holdfast.io.mcap_writer import RecordingWriter
from holdfast.synthetic import synthetic_recording

pytestmark = pytest.mark.slow


@pytest.fixture
def thumb():
    return synthetic_recording("grow", 0, ("thumb",)).modules["thumb"]


@pytest.fixture
def writer(thumb, tmp_path):
    with RecordingWriter(tmp_path / "grow.mcap", {"thumb": thumb.sensor}) as opened:
        yield opened


def append(writer, thumb, start, stop):
    for row in range(start, stop, 75):
        rows = slice(row, row + 75)
        writer.append("thumb", thumb.times[rows], thumb.readings[rows])
    writer.flush()


def read(source):
    """Return the arrivals of a source until its end."""
    arrivals = []
    while not source.ended:
        arrivals.append(source.read(1.0))
    return arrivals


@pytest.mark.parametrize("closes", [False, True])
@pytest.mark.parametrize("n_read", [0, 1, 300])
def test_what_was_written_when_it_was_opened_is_played(writer, thumb, tmp_path, n_read, closes):
    append(writer, thumb, 0, 600)
    with open_source(str(tmp_path / "grow.mcap"), speed=0) as source:
        arrivals = [source.read(1.0) for _ in range(n_read)]
        append(writer, thumb, 600, 1200)
        if closes:
            writer.close()
        arrivals += read(source)
    times = [arrival.time for arrival in arrivals if arrival.samples]
    assert times == thumb.times[: len(times)].tolist()
    assert 600 <= len(times) <= 1200
    notices = [notice for arrival in arrivals for notice in arrival.notices]
    assert [text.partition(" was cut off")[1] for text in notices] == [" was cut off"]
