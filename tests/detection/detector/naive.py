"""A slow and simple detector with the same results: lists, dictionaries, one rule at a time."""

import math

import numpy as np

from detection import naive_features as naive

from .naive_laws import Laws

NAN = math.nan


ORDER = (
    "not_finite", "stuck", "saturated", "tare_loaded", "dead", "noisy", "out_of_range",
    "tare_drift", "offset", "repeated", "field", "invalid",
    "equal_taxels", "copied", "rezeroed",
)  # fmt: skip


class Taxel:
    """Memory of one taxel, by the number of the sample that changed the finger."""

    def __init__(self, share):
        self.share = share
        self.changed = []
        self.at = 0  # number of the last change
        self.longest = 0  # samples without a change, but not by a fault
        self.steps = np.empty((0, 3))  # number, squared change, squared change of the change
        self.step = np.zeros(3)

    def watch(self, before, now, number, fresh, n_before, long):
        change = now - before
        self.zero = not now.any()
        if change.any():
            still = self.still(number) - 1
            if not self.changed:
                self.longest = n_before - 1
            elif len(self.changed) < 10 or still < max(long, 10 * (self.longest + 1)):
                self.longest = max(self.longest, still)
            if self.still(number) * self.share > 1:
                self.step = np.zeros(3)
            self.changed.append(number)
            self.at = number
            if before.any() and now.any():
                turn = change - self.step
                self.steps = np.vstack([self.steps, (number, change @ change, turn @ turn)])
                self.step = change
            else:
                self.step = np.zeros(3)
        if fresh:
            self.steps, self.step = self.steps[:0], np.zeros(3)

    def smooth(self, number):
        """Smoothed squared change, and squared change of the change."""
        weights = self.share * (1 - self.share) ** (number - self.steps[:, 0])
        return weights @ self.steps[:, 1:]

    def still(self, number):
        return number - self.at

    def busy(self):
        return bool(self.changed) and len(self.changed) > 0.5 * self.at

    def suspect(self, number, period):
        if len(self.changed) < 10:
            return self.still(number) >= 2 / period
        return self.still(number) >= max(0.5 / period, 10 * (self.longest + 1))


class Mask:
    """What is filled in for faulty taxels, and what fades after they come back."""

    def __init__(self, finger):
        self.finger, self.taxels, self.too_many = finger, set(), False
        self.known, self.unloaded, self.ratio = False, False, 1.0
        self.unweighed = set()
        self.shapes, self.fades, self.since = {}, {}, {}

    def beyond(self, readings, i):
        return readings[i] - self.finger.baseline[i]

    def load(self, readings, i):
        if i in self.finger.noisy_taxels | self.finger.lost:
            return np.zeros(3)
        if i in self.taxels and not self.too_many:
            return self.ratio * self.shapes[i]
        return self.beyond(readings, i) + self.fades.get(i, np.zeros(3))

    def weigh(self, readings, taxels):
        """Whether the load is known, and whether half of it, or of the taxels, is healthy."""
        used = self.finger.used
        loads = {i: self.load(readings, i) for i in used}
        sizes = {i: float(np.linalg.norm(loads[i])) for i in used}
        known = sum(size**2 for size in sizes.values()) > (10 * self.finger.noise) ** 2
        masked = taxels & set(used)
        healthy = sum(sizes[i] for i in used if i not in taxels)
        unknown = {i for i in masked if self.is_unweighed(i)} if known else masked
        enough = len(masked) < len(used) and 2 * (len(used) - len(unknown)) >= len(used)
        return known, enough and (not known or healthy >= 0.5 * sum(sizes.values()))

    def is_unweighed(self, i):
        if i in self.taxels:
            return i in self.unweighed
        unknown = self.finger.noisy_taxels | self.finger.lost | self.unweighed
        return i in unknown or not self.finger.taxels[i].changed

    def note_saturated(self, readings):
        samples, sensor = self.finger.samples, self.finger.sensor
        low, high = sensor.range or (-math.inf, math.inf)
        for i in set(self.finger.used) - self.taxels:
            at_limit = ((readings[i] <= low) | (readings[i] >= high)).any()
            if at_limit:
                fade = self.fades.get(i, np.zeros(3))
                self.fades[i] = fade + samples[-2][1][i] - readings[i]

    def update(self, readings, taxels, time):
        if taxels != self.taxels or self.too_many or self.unloaded:
            self.change(readings, taxels, time)
        if not self.too_many:
            self.fill(readings)
        return not self.too_many

    def change(self, readings, taxels, time):
        finger, before = self.finger, set() if self.too_many else self.taxels
        known, enough = self.weigh(readings, taxels)
        shapes = {i: self.load(readings, i) for i in finger.used}
        still = {i for i in finger.used if finger.taxels[i].still(finger.n_news) >= 2}
        unknown = {i for i in taxels if not known or self.is_unweighed(i)}
        self.unweighed = unknown | (self.unweighed & still) - taxels
        for i in taxels:
            self.fades.pop(i, None)
            if i not in before:
                self.since[i] = time
        for i in before - taxels:
            if time - self.since[i] > 0.10001:
                self.fades[i] = self.ratio * self.shapes[i] - self.beyond(readings, i)
            shapes[i] = self.beyond(readings, i) + self.fades.get(i, np.zeros(3))
        if finger.noisy_taxels - self.taxels or (before and not enough):
            finger.stretch = []
        self.shapes, self.ratio, self.taxels, self.too_many = shapes, 1.0, set(taxels), not enough
        healthy = [i for i in finger.used if i not in taxels]
        self.unloaded = False
        self.known = known and any(shapes[i].any() for i in healthy)

    def fill(self, readings):
        finger = self.finger
        for i, fade in self.fades.items():
            readings[i] = readings[i] + fade
        noise = finger.noise / math.sqrt(len(finger.used))
        largest = max([0.0, *(abs(fade).max() for fade in self.fades.values())])
        keep = 1 - min(1, finger.period / 2)
        fades = self.fades if largest > 0.1 * noise else {}
        self.fades = {i: keep * fade for i, fade in fades.items()}
        if self.known:
            healthy = [i for i in finger.used if i not in self.taxels]
            self.ratio = sum(self.beyond(readings, i) @ self.shapes[i] for i in healthy)
            self.ratio /= sum(self.shapes[i] @ self.shapes[i] for i in healthy)
            left = sum(self.beyond(readings, i) @ self.beyond(readings, i) for i in healthy)
            self.unloaded = left < (10 * finger.noise) ** 2
        for i in self.taxels:
            readings[i] = finger.baseline[i] + self.ratio * self.shapes[i]


class Finger:
    others = ()

    def __init__(self, sensor, part, window, tare, period, ignored=()):
        self.arguments = sensor, part, window, tare, period, ignored
        self.unchanged, self.alive = [], False
        self.zero, self.provisional_end = "provisional", math.inf
        self.first_step = self.first_size = 0.0
        self.used = [i for i in range(sensor.n_taxels) if i not in ignored]
        self.taxels = {i: Taxel(min(1, period / 0.25)) for i in self.used}
        self.rotations = sensor.rotations[self.used]
        self.n_news = 0
        self.wrong, self.wrong_taxels = set(), set()
        self.noisy_taxels, self.lost, self.lost_faults, self.n_refused = set(), set(), set(), 0
        self.mask = Mask(self)
        self.faulty_taxels = ()
        self.slow = self.roused = NAN
        self.rest, self.peak, self.shaken = np.zeros(3), 0.0, -math.inf
        self.above = "under"
        self.sensor, self.part, self.window, self.period = sensor, part, window, period
        self.kind, self.seconds = tare.kind, tare.seconds
        self.longest = max([window, *(spec.window for spec in part.features)])
        self.samples = []  # every finite sample: (time, readings)
        self.laws, self.rest_readings = Laws(sensor.n_taxels, period), None
        self.jumped, self.pending, self.offsets, self.shown = set(), {}, {}, 0.0
        self.rezeroed, self.rezeroed_at = False, NAN
        self.axes, self.stuck_axes = {}, [set(), set(), set()]
        self.moved = np.zeros((sensor.n_taxels, 3), dtype=bool)  # since they were looked at
        self.field = self.still_field = np.zeros(3)
        self.common, self.speeds = np.zeros((2, 3)), np.zeros((2, 3))
        self.is_turned, self.is_load, self.n_unclear = False, False, 0
        self.field_speed, self.is_shared = 0.0, False
        self.is_deep, self.n_skipped = False, 0
        self.stretch = []  # forces since the last interruption
        self.last = None
        self.gapped = False
        self.frozen = self.changes = self.pulling = self.longest_rest = 0
        self.largest = 0.0
        self.noise = NAN
        self.baseline = None
        self.status = "tare" if self.kind == "seconds" else "warm_up"
        self.faults = ()
        self.force = (NAN, NAN, NAN)
        self.sigma = self.probability = NAN
        self.end_slip(NAN)
        self.state = self.candidate = "UNKNOWN"
        self.since = self.unstable_at = NAN

    def wait(self, time):
        if self.last is not None and time - self.last > 3.0003 * self.period:
            self.interrupt()
            self.gapped, self.status, self.faults, self.faulty_taxels = True, "gap", (), ()
            self.frozen = self.pulling = 0

    def interrupt(self):
        self.stretch = []
        self.force, self.sigma = (NAN, NAN, NAN), NAN

    def refuse(self, faults, taxels):
        self.interrupt()
        self.status, self.faults = "fault", tuple(fault for fault in ORDER if fault in faults)
        self.faulty_taxels = tuple(sorted(taxels))

    def take(self, time, given):
        self.take_living(time, given)
        if self.is_dead():
            self.status, self.faults, self.faulty_taxels = "fault", ("dead",), ()

    def is_dead(self):
        """Whether no reading has changed for half a second, and ten samples, from the first on."""
        return not self.alive and len(self.unchanged) >= max(0.5 / self.period, 10)

    def watch_life(self, readings, time):
        """Whether any reading changes; a dead finger of which all taxels do begins anew."""
        if self.alive or not np.isfinite(readings).all():
            return
        dead, rests = self.is_dead(), getattr(self.sensor, "rests_at_zero", False)
        self.alive = bool(self.unchanged and (readings != self.unchanged[-1]).any())
        self.alive |= rests and not readings.any()
        self.unchanged.append(readings.copy())
        takes = self.kind in ("seconds", "first")
        if dead and self.alive and self.samples and takes and self.are_moving(readings):
            self.begin_again(time)

    def begin_again(self, time):
        self.__init__(*self.arguments)
        self.last, self.alive, self.provisional_end = time, True, time + 0.5

    def confirm_zero(self, readings, time):
        """Begin again if the samples leave the first one at once, or rise from zero, for 0.5 s."""
        if self.zero == "confirmed" or not self.fits(readings):
            return
        if not self.samples:
            rests = getattr(self.sensor, "rests_at_zero", False) and not readings.any()
            takes = self.kind in ("seconds", "first") and not rests
            self.zero, self.provisional_end = "provisional" if takes else "confirmed", time + 0.5
            return
        last, end = self.samples[-1][1], self.provisional_end
        step = float(np.linalg.norm(readings - last))
        if self.zero == "provisional" and time <= end and not (self.first_step and step):
            if step:
                self.first_step, self.first_size = step, float(np.linalg.norm(last))
            return
        rounding = 1 / math.sqrt(12) if self.sensor.unit == "count" else 1e-6
        least = max(step, rounding * math.sqrt(6 * len(self.used)))
        if self.first_step > 5 * least:
            zero = "provisional"
        elif time <= end and (self.zero == "settles" or self.is_settling(readings, step)):
            zero = "settles"
        else:
            self.zero = "confirmed"
            return
        self.begin_again(time)
        self.zero, self.provisional_end = zero, end

    def is_settling(self, readings, step):
        x, d, size = self.first_size, self.first_step, float(np.linalg.norm(readings))
        shrinks = step <= 1.5 * d and x * step <= 1.5 * d * d
        return shrinks and size >= 0.95 * (x + d + step) and self.are_moving(readings)

    def are_moving(self, readings):
        """Whether at least four taxels in five, and four, changed since the last sample."""
        changed = (self.samples[-1][1] != readings).any(axis=1).sum()
        return len(self.used) >= 4 and changed >= 0.8 * len(self.used)

    def fits(self, readings):
        low, high = self.sensor.range or (-math.inf, math.inf)
        used = readings[self.used]
        return bool(np.isfinite(used).all() and (used >= low).all() and (used <= high).all())

    def take_living(self, time, given):
        readings = np.zeros_like(given)
        readings[self.used] = given[self.used]
        fresh = self.last is not None and time - self.last > 3.0003 * self.period
        if self.last is not None and time - self.last > 0.5:
            self.laws.pauses.append(len(self.laws.lanes))
            self.laws.n_left = 0
        self.last, self.field_speed = time, 0.0
        self.force, self.sigma = (NAN, NAN, NAN), NAN
        low, high = self.sensor.range or (-math.inf, math.inf)
        faults, invalid = set(self.lost_faults), set(self.lost)
        for i in self.lost:
            readings[i] = 0.0 if low < 0 < high else (low + high) / 2
            self.taxels[i].at = self.n_news
        if offsets := self.take_out_offsets(readings):
            faults |= {"invalid"}
        self.confirm_zero(readings, time)
        bad = {i for i in self.used if not np.isfinite(readings[i]).all()}
        outside = {i for i in self.used if ((readings[i] < low) | (readings[i] > high)).any()} - bad
        first = self.zero != "confirmed" and len(self.samples) < 2
        jumps = set() if fresh or first else self.jumps(readings)
        if bad or outside or jumps:
            new = {"invalid"} if jumps else set()
            new |= {"not_finite"} if bad else set()
            new |= {"out_of_range"} if outside else set()
            faults, lost = faults | new, bad | outside | jumps | self.lost
            invalid |= bad | outside | jumps | offsets
            if self.baseline is None:
                self.lose(new | self.lost_faults, lost)
                self.watch_life(readings, time)
                return self.refuse(faults, invalid)
            raw = readings.copy()
            for i in bad | outside | jumps:
                readings[i] = self.samples[-1][1][i]
                self.taxels[i].at = self.n_news
            masked = invalid | self.mask.taxels | self.wrong_taxels
            enough = not self.mask.too_many
            if masked != self.mask.taxels:
                known, enough = self.mask.weigh(readings, masked)
                if not (known or enough):
                    self.mask.unweighed |= masked
            if not enough:
                self.watch_life(raw, time)
                return self.refuse(faults, invalid)
        invalid |= offsets
        self.watch_life(readings, time)
        self.invalid = invalid
        if implausible := self.implausible(readings):
            return self.refuse(faults | implausible, invalid)
        self.n_refused = self.n_refused * (self.baseline is not None)
        if self.samples:
            changed = (self.samples[-1][1] != readings).any()
            if changed and self.frozen >= 0.5 / self.period and not self.is_stuck():
                self.longest_rest = max(self.longest_rest, self.frozen)
            self.changes += bool(changed)
            self.frozen = 0 if changed else self.frozen + 1
            if changed:
                self.watch_taxels(self.samples[-1][1], readings, fresh)
        self.samples.append((time, readings.copy()))
        elapsed = time - self.samples[0][0] + self.period / 2
        self.measure_noise(elapsed)
        was_tared = self.baseline is not None
        if not was_tared and not self.tared(elapsed):
            self.status, self.faulty_taxels = "tare", tuple(sorted(invalid))
            self.faults = tuple(fault for fault in ORDER if fault in faults)
            return None
        return self.process_force(readings, faults, invalid, time, was_tared)

    def take_out_offsets(self, readings):
        """Subtract jumps that stay, until a step undoes them; the taxels that have one."""
        for i in self.used:
            if i in self.offsets:
                jump = self.offsets[i]
                step = readings[i] - jump - self.samples[-1][1][i]
                if step @ step > jump @ jump / 4:
                    self.offsets[i] = jump + step
                    if self.offsets[i] @ self.offsets[i] <= jump @ jump / 4:
                        del self.offsets[i]
            elif i in self.pending:
                jump = self.pending[i]
                step = readings[i] - self.samples[-1][1][i] - jump
                if 100 * (step @ step) <= jump @ jump:
                    self.offsets[i] = jump
            if i in self.offsets:
                readings[i] = readings[i] - self.offsets[i]
        return set(self.offsets)

    def jumps(self, readings):
        """Magnetometers that fall to zero, and taxels that jump alone."""
        if not self.samples:
            return set()
        before, self.jumped, self.pending = self.jumped, set(), {}
        last, n, magnetic = self.samples[-1][1], len(self.used), self.sensor.magnetic
        low, high = self.sensor.range or (-math.inf, math.inf)
        moves = {i: readings[i] - last[i] for i in self.used}
        steps = {i: float(move @ move) for i, move in moves.items()}
        at_zero = {i for i in self.used if magnetic and not readings[i].any()}
        kept = {i: step for i, step in steps.items() if i not in at_zero}
        noise = 0.0 if math.isnan(self.noise) else 6 * self.noise**2 / n
        most, total = max(steps.values()), sum(steps.values())
        alone = most >= 0.9 * total
        if not at_zero and not alone:
            self.show(readings, total - most)
            return set()
        fallen = any(steps[i] > 0 for i in at_zero)
        others = max(0.0, sum(kept.values()) - most)
        each = others / max(len(kept) - 1, 1)
        if math.isnan(self.noise) and not fallen:
            noise = each
        usual = max(noise, sum(kept.values()) / max(len(kept), 1))
        zeros = {i for i in at_zero if 0 < steps[i] > 400 * usual}
        quiet = 9 * noise * (len(kept) - 1)
        loud = magnetic and others <= quiet and len(kept) >= 4 and noise > 0 and most > 2500 * noise
        for i in set(self.used) - zeros - before:
            if not (loud or alone) or not steps[i] > (quiet if loud else most / 2):
                continue
            stays = alone and readings[i].any() and last[i].any() and i not in self.offsets
            stays &= bool((low < readings[i]).all() and (readings[i] < high).all())
            if stays and self.is_offset(moves[i], others, max(noise, each), quiet):
                self.pending[i] = moves[i]
            if loud or i in self.pending:
                self.jumped.add(i)
        if not self.jumped:
            self.show(readings, sum(kept.values()) - most)
        return zeros | self.jumped

    def show(self, readings, others):
        low, high = self.sensor.range or (-math.inf, math.inf)
        used = readings[self.used]
        if math.isfinite(others) and (low <= used).all() and (used <= high).all():
            self.shown = max(self.shown, others)

    def is_offset(self, jump, others, calm, quiet):
        """Whether a jump is 20 times what others have shown, or a byte that is lost."""
        shown = max(self.shown, others)
        if shown <= quiet:
            shown = 25 * quiet if self.sensor.magnetic else math.inf
        if len(self.used) > 4 and jump @ jump > 400 * shown:
            return True
        step = self.sensor.step or (1.0 if self.sensor.unit == "count" else math.nan)
        for axis in range(3):
            size, rest = abs(jump[axis]), jump @ jump - jump[axis] ** 2
            whole = step * (65536 if size > 4096 * step else 256)
            if 900 * calm <= whole**2 and (size - whole) ** 2 + rest <= 9 * calm:
                return True
        return False

    def take_out_field(self, readings, left_out):
        """Subtract what all magnetometers read of a field; whether it may be a load instead."""
        if not self.sensor.magnetic or math.isnan(self.noise):
            return False
        limit = 130.0 if self.sensor.name == "anyskin" else math.inf
        kept = [i for i in self.used if i not in left_out]
        if self.is_deep and self.n_skipped < 3 and not self.another_turns(0, math.inf):
            self.n_skipped += 1
        else:
            unclear = self.follow_field(readings, kept, limit)
            self.n_unclear = self.n_unclear + 1 if unclear else 0
            self.n_skipped = 0
        for i in self.used:
            turn = self.sensor.rotations[i].T if self.is_turned else np.eye(3)
            readings[i] = readings[i] - turn @ self.field
        return self.n_unclear * self.period >= 0.1

    def another_turns(self, low, high):
        """Whether the field of another finger changes at a speed between two."""
        return any(
            other.field_speed > 0 and low <= other.field_speed <= high
            for other in self.others
            if other.last is not None and self.last - other.last <= 0.10001
        )

    def fits_another(self, is_turned):
        own = float(np.linalg.norm(self.speeds[int(is_turned)]))
        return self.another_turns(own / 1.25, own * 1.25)

    def follow_field(self, readings, kept, limit):
        if len(kept) < 4:
            self.is_deep = False
            return False
        plain = readings[kept] - self.baseline[kept]
        turned = np.einsum("ijk,ik->ij", self.sensor.rotations[kept], plain)
        n, means = len(kept), np.array([plain.mean(axis=0), turned.mean(axis=0)])
        frame = int(means[1] @ means[1] > 1.01 * (means[0] @ means[0]))
        mean = means[frame]
        apart = float((((plain, turned)[frame] - mean) ** 2).sum())
        elapsed = self.period * (self.n_skipped + 1)
        motions = means - self.common
        steps = min(1, elapsed / 0.05) * motions
        self.common = self.common + steps
        self.speeds = self.speeds + min(1, elapsed / 0.1) * (steps / elapsed - self.speeds)
        change = mean - self.field if frame == self.is_turned else mean
        first = not self.field.any()
        least = ((16 if first and limit == math.inf else 4) * self.noise / n) ** 2
        moved, size = float(motions[frame] @ motions[frame]), float(change @ change)
        if moved <= least:
            self.still_field = self.field
        speed, noise = float(np.linalg.norm(self.speeds[frame])), 12 * self.noise**2
        squares = n * max(float(mean @ mean), size)
        clear = apart <= 0.01 * squares + noise
        self.is_deep = apart > 16 * (0.01 * squares + noise)
        turning = speed * n > 6 * self.noise * math.sqrt(3 * self.period / (0.01 * 0.15))
        if size <= least:
            self.is_load = False
            self.field_speed = speed if turning and clear else 0.0
            return False
        along = float(change @ self.sensor.normal) if frame else float(change[2])
        fast, strong = moved > (0.15 * limit) ** 2, mean @ mean > limit**2
        press = along**2 >= 0.49 * size and (along > 0 or limit == math.inf)
        small = size < self.field @ self.field / 4
        load = press and not (small or frame)
        if limit < math.inf:
            load = press and (fast or strong or self.is_load)
        alike, followed = clear, False
        self.is_shared = self.is_shared and small
        if not clear or load:
            followed = self.fits_another(self.is_turned)
            small = float(np.linalg.norm(self.field)) <= 16 * self.noise / n
            if not followed and small and self.fits_another(not self.is_turned):
                followed, self.is_turned, self.field = True, not self.is_turned, np.zeros(3)
            self.is_shared = self.is_shared or followed
        if self.is_shared:
            alike, load = apart <= 0.0625 * squares + noise, False
        self.is_load = load and alike
        if not alike:
            if followed:
                self.field = self.field + steps[int(self.is_turned)]
            return not load and not self.is_shared and apart <= n * 0.0625 * size
        if load and limit < math.inf and fast:
            self.field = self.still_field
        if load or strong:
            return not load
        self.field = mean if moved > 2.25 * least else self.common[frame]
        self.is_turned = bool(frame)
        self.field_speed = speed if turning and not self.is_shared else 0.0
        return False

    def implausible(self, readings):
        """Faults of a finger whose readings are valid and cannot be true."""
        low, high = self.sensor.range or (-math.inf, math.inf)
        used, size, faults = readings[self.used], high - low, set()
        last = self.samples[-1][1] if self.samples else np.zeros_like(readings)
        self.laws.update(readings, last, self.taxels, self.n_news)
        faults |= self.laws.faults
        if math.isfinite(size):
            near = (used < low + 0.01 * size) | (used > high - 0.01 * size)
            if 2 * near.any(axis=1).sum() > len(used):
                faults.add("saturated")
        if self.baseline is not None and self.zero == "confirmed":
            if self.rest_readings is None:
                self.rest_readings = used if self.kind == "none" else self.baseline[self.used]
            weights = np.array([1, math.sqrt(2) / 1.5, math.sqrt(3) / 1.6])
            left = ((used - self.rest_readings) * weights).sum() / (len(used) * weights.sum())
            if abs(left) > 0.25 * size:
                faults.add("offset")
        if 0 < np.abs(used).max() < 1e-37:
            faults.add("out_of_range")
        return faults

    def lose(self, faults, taxels):
        """Leave out taxels for good that have no valid reading in the tare for half a second."""
        self.n_refused += 1
        enough = 2 * (len(self.used) - len(taxels)) >= len(self.used)
        if self.n_refused * self.period >= 0.5 and enough:
            self.lost, self.lost_faults = set(taxels), set(faults)

    def process_force(self, readings, faults, invalid, time, was_tared):
        found = self.find_faults(readings)
        faults, taxels = faults | found[0], invalid | found[1]
        if was_tared:
            self.mask.note_saturated(readings)
        left_out = taxels | self.mask.taxels
        enough, unclear = True, self.take_out_field(readings, left_out)
        if faults or self.mask.taxels or self.mask.fades:
            enough = self.mask.update(readings, taxels, time)
        force = naive.force(readings[self.used], self.baseline[self.used], self.rotations)
        self.force = tuple(force)
        serious = set() if enough else set(faults)
        if unclear:
            serious.add("field")
        if self.is_stuck():
            serious.add("stuck")
        faults |= serious
        if serious & {"stuck", "noisy"}:
            self.stretch, self.pulling = [], 0
        else:
            self.stretch.append(force)
            self.largest = max(self.largest, math.hypot(*force))
            if len(self.stretch) >= self.window:
                self.sigma = self.moments(self.window)[1]
            if not self.rezeroed and self.loaded(readings):
                faults.add("tare_loaded")
                serious.add("tare_loaded")
            if self.follow_rezero(readings, time):
                faults.add("rezeroed")
                serious.add("rezeroed")
        self.faults = tuple(fault for fault in ORDER if fault in faults)
        self.faulty_taxels = tuple(sorted(taxels)) if faults else ()
        if serious:
            self.status = "fault"
        elif len(self.stretch) < self.longest:
            self.status = "gap" if self.gapped else "warm_up"
        else:
            self.status, self.gapped = "", False

    def follow_rezero(self, readings, time):
        """Whether all readings of a hold went to rest at once in the last half second."""
        force = np.array(self.force)
        normal = float(force @ self.sensor.normal)
        if self.goes_to_rest(readings):
            self.rezeroed, self.rezeroed_at, self.least = True, time, 0.0
            self.lost_force = np.array(self.stretch[-2])
            self.interrupt()
            return True
        if not self.rezeroed:
            return False
        self.least = min(self.least, normal)
        if time - self.rezeroed_at + self.period / 2 >= 0.5:
            return False
        if math.dist(force, self.lost_force) <= 0.25 * math.hypot(*self.lost_force):
            self.rezeroed, self.stretch = False, []
        return self.rezeroed

    def goes_to_rest(self, readings):
        if len(self.stretch) < self.window:
            return False
        held = np.array(self.stretch[-2])
        others = [self.stretch[-self.window], self.stretch[-3 if self.window > 2 else -2]]
        load, step = math.hypot(*held), self.sensor.step or 0.0
        step = step or float(self.sensor.unit == "count")
        left = float(((readings - self.baseline)[self.used] ** 2).sum())
        return (
            math.hypot(*self.force) <= 0.08 * load
            and load >= 20 * max(self.noise, step)
            and held @ self.sensor.normal > 0
            and all(math.dist(other, held) <= load / 4 for other in others)
            and left <= 12 * self.noise**2
        )

    def watch_taxels(self, before, now, fresh):
        self.n_news += 1
        self.moved |= now != before
        for i, taxel in self.taxels.items():
            taxel.watch(before[i], now[i], self.n_news, fresh, len(self.samples), 0.5 / self.period)
        low, high = self.sensor.range or (-math.inf, math.inf)
        suspects = {
            i for i, taxel in self.taxels.items() if taxel.suspect(self.n_news, self.period)
        }
        silent = {i for i, taxel in self.taxels.items() if not taxel.changed and taxel.zero}
        live = [self.taxels[i] for i in self.taxels if i not in suspects | silent]
        moving = [taxel for taxel in live if self.moves(taxel)]
        dead, stuck = set(), set()
        if not moving or len(moving) < 0.8 * len(live):
            suspects = set()
        for i in suspects:
            taxel = self.taxels[i]
            least = 10 * (max(other.longest for other in moving) + 1)
            if taxel.zero or (len(taxel.changed) < 10 and taxel.still(self.n_news) < least):
                continue
            if not taxel.changed:
                dead.add(i)
            elif not ((now[i] <= low) | (now[i] >= high)).any():
                stuck.add(i)
        every = max(1, round(0.05 / self.period))
        if self.sensor.magnetic and self.n_news % every == 0:
            axis = self.n_news // every % 3
            self.stuck_axes[axis] = self.compare_axis(axis, now, low, high)
        self.laws.compare_levels(self.taxels, self.n_news, fresh, self.invalid)
        stuck |= set().union(*self.stuck_axes, self.laws.fallen)
        noisy = self.noisy_taxels = self.noisy()
        named = {"dead": dead, "stuck": stuck, "noisy": noisy}
        self.wrong = {fault for fault, taxels in named.items() if taxels}
        self.wrong_taxels = dead | stuck | noisy

    def compare_axis(self, axis, now, low, high):
        """Magnetometers of which one axis is the same for long, while those of others move."""
        pasts = {i: self.axes.setdefault((i, axis), [0, 0, 0]) for i in self.used}
        for i, past in pasts.items():
            same, longest, n = past
            if self.moved[i, axis]:
                kept = longest if i in self.stuck_axes[axis] else max(longest, same)
                past[:] = [0, kept, n + 1]
            else:
                past[0] += 1
        self.moved[:, axis] = False
        moving = [past[1] for past in pasts.values() if past[2] >= 10 and 0.15 * past[0] < 1]
        if len(moving) < 0.8 * len(self.used):
            return set()
        found = set()
        for i, (same, longest, n) in pasts.items():
            least = (2 if n >= 10 else 30) / 0.15
            before = longest if n >= 10 else max(longest, *moving)
            if same >= max(least, 5 * (before + 1)) and low < now[i][axis] < high:
                found.add(i)
        return found

    def moves(self, taxel):
        long = 0.5 / self.period
        return 2 * taxel.still(self.n_news) < long and taxel.busy() and taxel.longest < long

    def noisy(self):
        if len(self.used) < 4:
            return set()
        smooth = {i: taxel.smooth(self.n_news) for i, taxel in self.taxels.items()}
        rough, rougher = ({i: pair[k] for i, pair in smooth.items()} for k in range(2))
        i = max(rougher, key=lambda i: rougher[i])
        quiet = 1 / math.sqrt(12)
        if self.sensor.unit == "N":
            quiet = self.noise / math.sqrt(len(self.used))
        alone = rougher[i] >= 0.9 * sum(rougher.values())
        loud = math.sqrt(rougher[i] / 6) > 100 * quiet
        return {i} if alone and loud and rougher[i] > 2.5 * rough[i] else set()

    def measure_noise(self, elapsed):
        enough = self.seconds if self.kind == "seconds" else 0.5
        if not math.isnan(self.noise) or elapsed < enough:
            return
        values = [sample[self.used] for _, sample in self.samples[:-1]]
        zero = np.zeros_like(values[0])
        forces = np.array([naive.force(v, zero, self.rotations) for v in values])
        steps = np.diff(forces, axis=0)
        measured = math.sqrt((steps**2).sum() / (6 * max(len(steps), 1)))
        rounding = 1 / math.sqrt(12) if self.sensor.unit == "count" else 1e-6
        self.noise = max(measured, rounding * math.sqrt(len(self.used)))

    def tared(self, elapsed):
        if self.kind == "first":
            self.baseline = self.samples[0][1]
        elif self.kind == "none":
            self.baseline = np.zeros_like(self.samples[0][1])
        elif elapsed >= self.seconds:
            self.baseline = np.mean([sample for _, sample in self.samples[:-1]], axis=0)
        return self.baseline is not None

    def find_faults(self, readings):
        faults, taxels = set(self.wrong), set(self.wrong_taxels)
        low, high = self.sensor.range or (-math.inf, math.inf)
        at_limit = {i for i in self.used if ((readings[i] <= low) | (readings[i] >= high)).any()}
        if at_limit:
            faults.add("saturated")
        if self.laws.equals:
            faults.add("equal_taxels")
        return faults, taxels | at_limit | self.laws.equals

    def is_stuck(self):
        half_a_second = 0.5 / self.period
        transitions = len(self.samples) - 1 - self.frozen
        lively = 2 * self.changes > transitions and self.changes >= half_a_second
        return lively and self.frozen >= max(half_a_second, 10 * self.longest_rest)

    def loaded(self, readings):
        if self.kind != "seconds":
            return False
        pressing = float((readings - self.baseline)[self.used, 2].sum())
        pulled = pressing < -max(20 * self.noise, 0.1 * self.largest)
        self.pulling = self.pulling + 1 if pulled else 0
        return self.pulling * self.period >= 0.25

    def moments(self, window):
        return naive.features(self.stretch[-window:], window)[-1][4:].tolist()

    @staticmethod
    def spread(values):
        pairs = list(zip(values[::2], values[1::2], strict=True))
        details = [(x0 - x1) / math.sqrt(2) for x0, x1 in pairs]
        return naive.moments(details, details, len(values))[1]

    def feature(self, spec, others):
        values = [self.own(spec)]
        if spec.scope == "hand":
            values += [x.own(spec, self) for x in others if len(x.stretch) >= max(spec.window, 1)]
        return max(values, key=lambda value: -math.inf if math.isnan(value) else value)

    def own(self, spec, asker=None):
        force = self.stretch[-1]
        if spec.kind == "sigma_xyz":
            components = zip(*self.stretch[-spec.window :], strict=True)
            value = math.hypot(*(self.spread(component) for component in components))
        elif spec.kind == "change":
            value = math.dist(force, self.stretch[-spec.window])
        elif spec.kind in ("m", "sigma"):
            value = self.moments(spec.window)[spec.kind == "sigma"]
        else:
            value = dict(zip(("F_x", "F_y", "F_z"), force, strict=True)).get(
                spec.kind, math.hypot(*force)
            )
        if spec.transform == "log":
            return math.log(math.hypot(value, spec.floor))
        if spec.transform == "noise":
            quiet = self.noise * math.sqrt((spec.window - 2) / (2 * spec.window))
            return math.log(max(value, 1e-3 * quiet) / quiet)
        return value

    def decide(self, time, fingers, debounce):
        if self.status == "":
            features = [self.feature(spec, fingers) for spec in self.part.stable.features]
            if any(math.isnan(value) for value in features):
                self.status = "tare"
            elif self.drifted(time):
                self.status = "fault"
                self.faults = (*self.faults, "tare_drift")
            elif not (self.alive or self.empty):
                self.status = "warm_up"
        if self.status != "":
            if self.status == "fault" and not math.isnan(self.force[0]):
                self.debounce("UNKNOWN", time, debounce.min_duration)
            else:
                self.state = self.candidate = "UNKNOWN"
            if self.state == "UNKNOWN":
                self.probability = self.unstable_at = NAN
                self.end_slip(NAN)
            else:
                self.status = ""
            return
        state = self.contact_state(fingers, debounce.hysteresis)
        begins = state != "NO_CONTACT" and self.candidate == "NO_CONTACT"
        if state == "UNSTABLE" or begins:
            self.unstable_at = time
        if state == "STABLE" and time - self.unstable_at + self.period / 2 < debounce.hold:
            state = "UNSTABLE"
        self.debounce(state, time, debounce.min_duration)
        self.decide_slip(fingers, time)
        if state == "NO_CONTACT" and not self.sensor.rests_at_zero:
            self.rest += min(1, self.period / 3) * (np.array(self.force) - self.rest)

    def value(self, head, fingers):
        """The value z of the first output of a head."""
        rule = head.rule
        (weights,), (z,) = rule.weights, rule.intercepts
        (squares,) = rule.squares or ([0.0] * rule.n_features,)
        features = [self.feature(spec, fingers) for spec in head.features]
        for value, mean, scale, weight, square in zip(
            features, rule.mean, rule.scale, weights, squares, strict=True
        ):
            u = (value - mean) / scale
            z += weight * u + square * min(abs(u), 5.0) ** 2
        return rule.slope * z + rule.offset

    def end_slip(self, probability):
        self.speed = self.distance = probability
        self.slid_at = None
        self.slip, self.odds, self.slid, self.slides = probability, None, -math.inf, False

    def decide_slip(self, fingers, time):
        """Smoothed log odds; it slides from the threshold on, and for the hold time after it."""
        head = self.part.slip
        if head is None:
            return
        if self.empty:
            self.end_slip(0.0)
            return
        odds = self.value(head, fingers)
        gain = 1 - math.exp(-self.period / head.smoothing) if head.smoothing else 1
        self.odds = odds if self.odds is None else self.odds + gain * (odds - self.odds)
        self.slip = 1 / (1 + math.exp(min(-self.odds, 700)))
        if head.threshold < 1 and self.slip >= head.threshold:
            self.slid = time
        self.slides = time == self.slid or time - self.slid + self.period / 2 < head.hold
        speed = self.part.head("slip_speed")
        if speed:
            self.follow_slip(speed.highest, self.value(speed, fingers), time)

    def follow_slip(self, highest, z, time):
        """Speed, and its sum over time since the slip began."""
        if not self.slides:
            self.speed, self.distance, self.slid_at = 0.0, 0.0, None
            return
        self.speed = min(max(z, 0.0) ** 2, highest)
        before, step = self.distance, self.period
        if self.slid_at is None:
            before = 0.0
        else:
            step = time - self.slid_at
        self.distance, self.slid_at = before + self.speed * step, time

    def debounce(self, state, time, min_duration):
        if state != self.candidate:
            self.candidate, self.since = state, time
        lasted = time - self.since + self.period / 2
        if self.state == "UNKNOWN" or lasted >= min_duration:
            self.state = state

    def reason(self):
        """Why the state is as it is, if the probability does not say it."""
        if self.status == "" and self.state == "UNSTABLE":
            if self.leaving:
                return "load"
            return "hold" if self.probability >= self.part.stable.threshold else ""
        return self.status

    def is_empty(self, time):
        """Whether nothing touches; with hysteresis, and a share of the peak once it is still."""
        touching = self.candidate in ("STABLE", "UNSTABLE")
        least = self.contact() * (0.7 if touching else 1)
        share = (0.08 if touching else 0.12) if time - self.shaken > 0.2 else 0
        return self.load < least or (least > 0 and self.load < share * self.peak)

    def is_leaving(self):
        """Whether what is left of the load is as little as a skin shows that was released."""
        touching = self.candidate in ("STABLE", "UNSTABLE")
        small = self.load < (0.08 if touching else 0.12) * self.peak
        return self.contact() > 0 and small and not self.empty

    def contact(self):
        if self.part.contact_threshold is not None:
            return self.part.contact_threshold
        return NAN if self.part.contact_noise is None else self.part.contact_noise * self.noise

    def drifted(self, time):
        amplitude, threshold = math.hypot(*self.force), self.contact()
        normal = self.sensor.normal
        if self.rezeroed and np.array(self.force) @ normal < self.rest @ normal:
            self.rest = np.array(self.force)
        self.load = math.dist(self.force, self.rest)
        self.peak = max(self.load, self.peak * (1 - min(1, self.period / 5)))
        mean = sum(math.hypot(*force) for force in self.stretch[-self.window :]) / self.window
        if math.isnan(self.slow):
            self.slow, self.roused = amplitude, time
        away, jump = abs(mean - self.slow), abs(amplitude - self.slow)
        self.slow += min(1, self.period) * (amplitude - self.slow)
        quiet = self.noise * math.sqrt((self.window - 2) / (2 * self.window))
        if not (self.window > 2 and self.sigma <= 3 * quiet):
            self.shaken = time
        self.empty = self.is_empty(time)
        if self.rezeroed:
            risen = float(np.array(self.force) @ normal) - self.least
            self.rezeroed = self.empty or risen <= 0.08 * math.hypot(*self.lost_force)
            self.empty = self.rezeroed
            self.faults += ("rezeroed",) * self.rezeroed
        self.leaving = self.is_leaving()
        calm = self.window > 2 and self.sigma <= 3 * quiet and away <= threshold / 2
        if not calm:
            self.roused = time
        if self.load < threshold:
            self.above = "under"
        elif not calm:
            self.above = "touch"
        elif self.above == "under":
            long = time - self.roused + self.period / 2 >= 1
            self.above = "drift" if long and jump <= threshold / 2 else "touch"
        return self.above == "drift"

    def contact_state(self, fingers, hysteresis):
        if self.empty:
            self.probability = 0.0
            return "NO_CONTACT"
        head = self.part.stable
        self.probability = 1 / (1 + math.exp(min(-self.value(head, fingers), 700)))
        if self.leaving:
            return "UNSTABLE"
        limit = head.threshold
        if self.state == "STABLE":
            limit -= hysteresis
        elif self.state != "UNKNOWN":
            limit += hysteresis
        return "STABLE" if self.probability >= limit else "UNSTABLE"


class Hand:
    """Detector with the same samples as `Detector`; it returns (time, state, {finger: row})."""

    def __init__(self, model, sensors, tare, rate, ignore=None):
        self.model = model
        bad = ignore or {}
        self.fingers = {
            name: Finger(which, model.finger(name), model.window, tare, 1 / rate, bad.get(name, ()))
            for name, which in sensors.items()
        }
        for finger in self.fingers.values():
            finger.others = [x for x in self.fingers.values() if x is not finger]
        self.copies = [(0, 0)] * len(self.fingers)

    def update(self, samples, time):
        for name, finger in self.fingers.items():
            finger.wait(time)
            if name in samples:
                finger.take(time, np.asarray(samples[name], dtype=np.float64))
        self.find_copies([name in samples for name in self.fingers])
        for name, finger in self.fingers.items():
            if name in samples or finger.status == "gap":
                finger.decide(time, self.fingers.values(), self.model.debounce)
        rows = {name: self.row(finger) for name, finger in self.fingers.items()}
        return time, self.state(), rows

    def find_copies(self, present):
        """Name two fingers that have been equal for 20 changes."""
        fingers = list(self.fingers.values())
        for i, finger in enumerate(fingers[1:], 1):
            total = finger.laws.total
            equal = [j for j in range(i) if present[j] and fingers[j].laws.total == total]
            other = equal[0] if present[i] and equal else i
            known = other < i and self.copies[i][0] == other
            n = self.copies[i][1] + finger.laws.is_new if known else 0
            self.copies[i] = other if present[i] else self.copies[i][0], n
            finger.laws.is_new = False
            for copy in (finger, fingers[other]) if n >= 20 else ():
                copy.status, copy.stretch = "fault", []
                copy.faults = tuple(x for x in ORDER if x in {*copy.faults, "copied"})

    @staticmethod
    def row(finger):
        last = NAN if finger.last is None else finger.last
        names = (finger.state, finger.reason(), finger.faults, finger.faulty_taxels)
        head = finger.part.slip
        speed = (None, None)
        if finger.part.head("slip_speed"):
            speed = (finger.speed, finger.distance)
        slip = None if head is None else (finger.slip, finger.slides, *speed)
        return names, (last, finger.probability, finger.sigma, *finger.force), slip

    def state(self):
        fingers = self.fingers.values()
        alive = [f for f in fingers if "dead" not in f.faults or f.faulty_taxels]
        states = [finger.state for finger in alive]
        if "UNSTABLE" in states:
            return "UNSTABLE"
        if "UNKNOWN" in states or not states:
            return "UNKNOWN"
        needed = 2 if len(states) > 1 else 1
        return "STABLE" if states.count("STABLE") >= needed else "NO_CONTACT"
