import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from holdfast.io.timed_arrays import time_spans

TIMES = st.lists(st.floats(-1e6, 1e17), unique=True, max_size=30).map(sorted).map(np.array)


@given(
    times=st.dictionaries(st.sampled_from("abc"), TIMES, min_size=1),
    seconds=st.sampled_from([1e-3, 1.0, 1e5, np.inf]),
    max_samples=st.integers(1, 10),
)
def test_spans_have_every_sample_once_in_order(times, seconds, max_samples):
    ends = dict.fromkeys(times, 0)
    for span in time_spans(times, seconds, max_samples):
        held = np.concatenate([times[key][cut] for key, cut in span.items()])
        assert len(held) > 0
        assert held.max() - held.min() <= seconds
        for key, cut in span.items():
            assert cut.start == ends[key]
            assert cut.stop - cut.start <= max_samples
            ends[key] = cut.stop
    assert ends == {key: len(array) for key, array in times.items()}


def test_only_given_arrays_are_limited():
    times = {"a": np.arange(4.0), "b": np.arange(0, 4, 0.1)}
    found = list(time_spans(times, np.inf, 2, ["a"]))
    assert [span["b"].stop - span["b"].start for span in found] == [20, 20]
