from holdfast.sources.xela.gathering import PATIENCE, Gathering


def told(gathering, given):
    """Of each packet: its time, and the samples of its modules with their times."""
    due = [one for time, samples in given for one in gathering.add(samples, time)]
    due += gathering.rest()
    return [(one.time, {n: (s, one.times[n]) for n, s in one.samples.items()}) for one in due]


def test_one_instant_is_one_packet():
    given = [(t, {"a": 10 + t, "b": 20 + t}) for t in range(3)]
    expected = [(t, {"a": (10 + t, t), "b": (20 + t, t)}) for t in range(3)]
    for own_stamps in (False, True):
        assert told(Gathering("ab", own_stamps=own_stamps), given) == expected


def test_with_own_stamps_every_sample_is_told_at_once():
    given = [(0.0, {"a": 1}), (0.1, {"b": 2}), (0.2, {"a": 3}), (0.3, {"a": 4})]
    assert told(Gathering("ab", own_stamps=True), given) == [
        (0.1, {"a": (1, 0.0), "b": (2, 0.1)}),
        (0.2, {"a": (3, 0.2), "b": (2, 0.1)}),
        (0.3, {"a": (4, 0.3), "b": (2, 0.1)}),
    ]


def test_without_own_stamps_samples_wait_for_each_other():
    given = [(0.0, {"a": 1}), (0.1, {"b": 2}), (0.2, {"b": 3}), (0.3, {"a": 4}), (0.4, {"a": 5})]
    assert told(Gathering("ab", own_stamps=False), given) == [
        (0.1, {"a": (1, 0.0), "b": (2, 0.1)}),
        (0.3, {"a": (4, 0.3), "b": (3, 0.2)}),
        (0.4, {"a": (5, 0.4), "b": (3, 0.2)}),
    ]


def test_a_module_that_has_the_next_is_not_held_up():
    given = [(0.0, {"a": 1, "b": 2}), (0.1, {"a": 3}), (0.2, {"a": 4})]
    assert told(Gathering("ab", own_stamps=False), given) == [
        (0.0, {"a": (1, 0.0), "b": (2, 0.0)}),
        (0.1, {"a": (3, 0.1), "b": (2, 0.0)}),
        (0.2, {"a": (4, 0.2), "b": (2, 0.0)}),
    ]


def test_a_module_that_never_comes_is_not_waited_for_for_ever():
    for own_stamps in (False, True):
        given = [(t, {"a": t}) for t in (0.0, 0.9 * PATIENCE, PATIENCE, PATIENCE + 0.1)]
        assert told(Gathering("ab", own_stamps=own_stamps), given) == [
            (t, {"a": (t, t)}) for t in (PATIENCE, PATIENCE + 0.1)
        ]


def test_a_module_that_comes_late_is_told_from_then_on():
    given = [(PATIENCE, {"a": 2}), (PATIENCE + 0.1, {"b": 3})]
    gathering = Gathering("ab", own_stamps=True)
    assert told(gathering, [(0.0, {"a": 1})]) == []
    assert told(gathering, given)[-1] == (
        PATIENCE + 0.1,
        {"a": (2, PATIENCE), "b": (3, PATIENCE + 0.1)},
    )
