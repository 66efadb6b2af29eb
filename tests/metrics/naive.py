"""Slow obvious twins: events by integer ticks of 0.01 s, pairs by two loops."""

from itertools import pairwise

import numpy as np

from holdfast.contact import STABLE, UNKNOWN, hand_state


def segments(labels):
    """[kind, first, stop] in ticks: "s" stable, "n" not stable, "u" unlabelled."""
    out = []
    for k, label in enumerate(labels):
        kind = "s" if label == STABLE else "u" if label == UNKNOWN else "n"
        if out and out[-1][0] == kind:
            out[-1][2] = k + 1
        else:
            out.append([kind, k, k + 1])
    return out


def close_gaps(parts):
    indices = [i for i, part in enumerate(parts) if part[0] == "n"]
    for i, j in pairwise(indices):
        if parts[j][1] - parts[i][2] < 10:
            joined = ["n", parts[i][1], parts[j][2]]
            return close_gaps([*parts[:i], joined, *parts[j + 1 :]])
    return parts


def events(labels):
    parts = close_gaps(segments(labels))
    found = []
    for before, part in pairwise(parts):
        long_enough = part[2] - part[1] >= 5
        held = before[0] == "s" and before[2] - before[1] >= 50
        if part[0] == "n" and long_enough and held:
            found.append((part[1], part[2]))
    return found


def match(labels, states):
    """Events as (onset, end, alarm or None), and false alarms, in ticks."""
    alarms = [
        k
        for k in range(1, len(states))
        if states[k - 1] == STABLE and states[k] not in (STABLE, UNKNOWN)
    ]
    matched, false = {}, []
    for alarm in alarms:
        owners = [(on, end) for on, end in events(labels) if on - 2 <= alarm <= end + 25]
        if not owners:
            false += [alarm] * int(labels[alarm] != UNKNOWN)
        elif max(owners) not in matched:
            matched[max(owners)] = alarm
    return [(on, end, matched.get((on, end))) for on, end in events(labels)], false


def mann_whitney_u(positive, negative):
    return sum((p > q) + 0.5 * (p == q) for p in positive for q in negative)


def latest(times, codes, instant):
    code = UNKNOWN
    for time, value in zip(times, codes, strict=True):
        if time <= instant:
            code = value
    return code


def hand(fingers, at, n_model_fingers):
    """A code of 4 is a dead finger."""
    codes = ([latest(times, codes, t) for times, codes in fingers] for t in at)
    return [
        hand_state(np.array([c for c in each if c < 4]), n_model_fingers, each.count(4))
        for each in codes
    ]
