"""The laws of a living skin, one after the other and slowly: what was read is kept as it is."""

import numpy as np


class Laws:
    """What shows whether a finger keeps the laws.

    Attributes:
        faults: of the finger as a whole, at the last update.
        equals: taxels that are equal to another.
        fallen: taxels whose noise has gone.
        total: sums of the readings of each axis.
        is_new: whether they changed.
    """

    def __init__(self, n_taxels, period):
        self.n_taxels, self.period = n_taxels, period
        self.faults, self.equals, self.fallen = set(), set(), set()
        self.lanes, self.total, self.is_new = [], None, False
        self.pauses = [0]  # numbers of updates before a pause
        self.n_left = self.n_returned = 0
        self.is_repeated = False
        self.changed = [[], [], []]  # of each axis, whether each wide update changed it
        self.same, self.longest, self.n_equal = [0, 0, 0], [0, 0, 0], [0, 0, 0]
        self.taxel, self.alike, self.n_watched, self.n_alike = 0, set(), 0, 0
        self.levels, self.n_levelled, self.n_settled, self.n_steady = {}, 0, 0, 0

    def update(self, now, before, taxels, n_news):
        """Take readings, those of the sample before, and the memory of the taxels."""
        lanes = [tuple(now[lane::4].sum(axis=0)) for lane in range(4)]
        self.total = tuple(now.sum(axis=0))
        self.is_new = not self.lanes or lanes != self.lanes[-1]
        if not self.is_new:
            return
        sums = now.sum(axis=0)
        last = np.sum(self.lanes[-1], axis=0) if self.lanes else np.zeros(3)
        self.lanes = [*self.lanes, lanes]
        self.faults = {"repeated"} if self.has_returned(now, before, taxels, n_news) else set()
        old = self.lanes[-2] if len(self.lanes) > 1 else [None] * 4
        n_new = sum(a != b for a, b in zip(lanes, old, strict=True))
        if self.has_stuck_axis(sums, last, n_new >= min(3, self.n_taxels)):
            self.faults.add("stuck")
        self.compare_taxels(now, before)

    def run_before(self, n, left_out):
        """The 16 updates up to number n, from 1, without a lane."""
        return [
            [lane for k, lane in enumerate(lanes) if k != left_out]
            for lanes in self.lanes[n - 16 : n]
        ]

    def has_returned(self, now, before, taxels, n_news):
        n = len(self.lanes)
        self.n_left = max(0, self.n_left - 1)
        self.n_returned = self.n_returned + 1 if self.n_left else 0
        self.is_repeated = self.is_repeated and self.n_left > 0
        marks = [m for m in range(16, n, 16) if n - m <= 512 and m > self.pauses[-1]]
        for mark in marks:
            if self.run_before(n, None) == self.run_before(mark, None):
                ways = [None]
            else:
                ways = [k for k in range(4) if self.run_before(n, k) == self.run_before(mark, k)]
            for left_out in ways:
                if len(set(map(str, self.run_before(n, left_out)))) < 3:
                    continue
                self.n_left = 16
                n_varying = 0
                for i, taxel in taxels.items():
                    if i % 4 != left_out:
                        is_recent = n_news - taxel.at < 16 + self.n_returned
                        moves = (now[i] != before[i]) | (is_recent & (taxel.step != 0))
                        n_varying += int(moves.sum())
                self.is_repeated |= n_varying >= (12 if left_out is None else 9)
        return self.is_repeated

    def has_stuck_axis(self, sums, last, is_wide):
        found, least = False, 0.5 / self.period
        for axis in range(3):
            is_new, past = bool(sums[axis] != last[axis]), self.changed[axis]
            same, n_changed = self.same[axis], sum(past) + is_wide
            is_frozen = 2 * n_changed > len(past) + is_wide - same and n_changed >= least
            is_frozen &= same >= max(least, 10 * (self.longest[axis] + 1))
            if is_new and not is_frozen:
                self.longest[axis] = max(self.longest[axis], same)
            self.same[axis] = 0 if is_new else same + is_wide
            past.extend([is_new] * is_wide)
            is_equal = sums[axis] == sums[(axis + 1) % 3]
            self.n_equal[axis] = self.n_equal[axis] + is_new if is_equal else 0
            found |= self.n_equal[axis] >= 20 or (is_frozen and not is_new and sums[axis] != 0)
        return found

    def compare_taxels(self, now, before):
        if self.alike:
            i = self.taxel
            self.n_watched += 1
            self.n_alike += bool((now[i] != before[i]).any())
            self.alike = {j for j in self.alike if (now[i] == now[j]).all()}
            if self.n_alike >= 20 and self.alike and self.n_watched < 160:
                self.equals |= {i, *self.alike}
                self.alike = set()
            if self.n_watched >= 160:
                self.alike = set()
        elif len(self.lanes) % 2 == 0:
            i = self.taxel = (self.taxel + 1) % self.n_taxels
            if (now[i] != before[i]).any() and now[i].any():
                self.alike = {
                    j for j in range(self.n_taxels) if j != i and (now[i] == now[j]).all()
                }
                self.n_watched = self.n_alike = 0
                if not self.alike:
                    self.equals.discard(i)

    def compare_levels(self, taxels, n_news, fresh, invalid):
        self.n_settled = 0 if fresh else self.n_settled + 1
        self.n_levelled += 1
        if self.n_levelled * self.period < 0.25:
            return
        self.n_levelled, self.fallen = 0, set()
        if self.n_settled * self.period < 1:
            return
        is_known, low = self.n_steady * 0.25 >= 5, set()
        for i, taxel in taxels.items():
            if i in invalid:
                continue
            power = taxel.smooth(n_news)[1]
            level = self.levels.get(i, 0.0) or power
            lively = taxel.changed and max(taxel.longest, n_news - taxel.at) < 8
            if lively and power < 0.01 * level:
                low.add(i)
            if i not in low or not is_known:
                lower = max(power, 0.9 * level) if is_known else power
                self.levels[i] = min(level, lower)
        self.fallen = low if is_known else set()
        self.n_steady = 0 if low and not is_known else self.n_steady + 1
