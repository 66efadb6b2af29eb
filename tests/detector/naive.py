"""A slow obvious twin of the detector: lists, dictionaries and one rule after the other."""

import math

import numpy as np

from features import naive

NAN = math.nan


class Finger:
    def __init__(self, sensor, part, window, tare, period):
        self.sensor, self.part, self.window, self.period = sensor, part, window, period
        self.kind, self.seconds = tare.kind, tare.seconds
        self.longest = max([window, *(spec.window for spec in part.features)])
        self.samples = []  # every finite sample: (time, readings)
        self.stretch = []  # forces since the last interruption
        self.last = None
        self.gapped = False
        self.frozen = self.changes = self.pulling = 0
        self.largest = 0.0
        self.noise = NAN
        self.baseline = None
        self.status = "tare" if self.kind == "seconds" else "warm_up"
        self.faults = ()
        self.force = (NAN, NAN, NAN)
        self.sigma = self.probability = NAN
        self.state = self.candidate = "UNKNOWN"
        self.since = self.unstable_at = NAN

    def wait(self, time):
        if self.last is not None and time - self.last > 3.0003 * self.period:
            self.interrupt()
            self.gapped, self.status, self.faults = True, "gap", ()
            self.frozen = self.pulling = 0

    def interrupt(self):
        self.stretch = []
        self.force, self.sigma = (NAN, NAN, NAN), NAN

    def take(self, time, readings):
        self.last = time
        self.force, self.sigma = (NAN, NAN, NAN), NAN
        if not np.isfinite(readings).all():
            self.stretch = []
            self.status, self.faults = "fault", ("not_finite",)
            return
        if self.samples:
            changed = (self.samples[-1][1] != readings).any()
            self.changes += bool(changed)
            self.frozen = 0 if changed else self.frozen + 1
        self.samples.append((time, readings))
        elapsed = time - self.samples[0][0] + self.period / 2
        self.listen(elapsed)
        if self.baseline is None and not self.tared(elapsed):
            self.status, self.faults = "tare", ()
            return
        force = naive.force(readings, self.baseline, self.sensor.rotations)
        self.force = tuple(force)
        self.stretch.append(force)
        self.largest = max(self.largest, math.hypot(*force))
        if len(self.stretch) >= self.window:
            self.sigma = self.moments(self.window)[1]
        self.faults = tuple(self.find_faults(readings))
        if self.faults:
            self.status = "fault"
        elif len(self.stretch) < self.longest:
            self.status = "gap" if self.gapped else "warm_up"
        else:
            self.status, self.gapped = "", False

    def listen(self, elapsed):
        enough = self.seconds if self.kind == "seconds" else 0.5
        if not math.isnan(self.noise) or elapsed < enough:
            return
        values = [sample for _, sample in self.samples[:-1]]
        zero = np.zeros_like(values[0])
        forces = np.array([naive.force(v, zero, self.sensor.rotations) for v in values])
        steps = np.diff(forces, axis=0)
        heard = math.sqrt((steps**2).sum() / (6 * max(len(steps), 1)))
        rounding = 1 / math.sqrt(12) if self.sensor.unit == "count" else 1e-6
        self.noise = max(heard, rounding * math.sqrt(self.sensor.n_taxels))

    def tared(self, elapsed):
        if self.kind == "first":
            self.baseline = self.samples[0][1]
        elif self.kind == "none":
            self.baseline = np.zeros_like(self.samples[0][1])
        elif elapsed >= self.seconds:
            self.baseline = np.mean([sample for _, sample in self.samples[:-1]], axis=0)
        return self.baseline is not None

    def find_faults(self, readings):
        half_a_second = 0.5 / self.period
        transitions = len(self.samples) - 1 - self.frozen
        lively = 2 * self.changes > transitions and self.changes >= half_a_second
        if lively and self.frozen >= half_a_second:
            yield "stuck"
        low, high = self.sensor.limits or (-math.inf, math.inf)
        if (readings <= low).any() or (readings >= high).any():
            yield "saturated"
        if self.kind == "seconds":
            pressing = float((readings - self.baseline)[:, 2].sum())
            pulled = pressing < -max(20 * self.noise, 0.1 * self.largest)
            self.pulling = self.pulling + 1 if pulled else 0
            if self.pulling * self.period >= 0.25:
                yield "tare_loaded"

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
            features = [self.feature(spec, fingers) for spec in self.part.features]
            if any(math.isnan(value) for value in features):
                self.status = "tare"
        if self.status != "":
            self.state = self.candidate = "UNKNOWN"
            self.probability = self.unstable_at = NAN
            return
        state = self.judge(features, debounce.hysteresis)
        if state == "UNSTABLE":
            self.unstable_at = time
        elif state == "STABLE" and time - self.unstable_at + self.period / 2 < debounce.hold:
            state = "UNSTABLE"
        if state != self.candidate:
            self.candidate, self.since = state, time
        held = time - self.since + self.period / 2
        if self.state == "UNKNOWN" or held >= debounce.min_duration:
            self.state = state

    def judge(self, features, hysteresis):
        threshold = self.part.contact_threshold
        if threshold is None and self.part.contact_noise is not None:
            threshold = self.part.contact_noise * self.noise
        if threshold is not None and math.hypot(*self.force) < threshold:
            self.probability = 0.0
            return "NO_CONTACT"
        rule = self.part.classifier
        z = rule.intercept
        for value, c, mean, scale in zip(
            features, rule.coefficients, rule.mean, rule.scale, strict=True
        ):
            z += c * (value - mean) / scale
        self.probability = 1 / (1 + math.exp(-(rule.slope * z + rule.offset)))
        limit = rule.threshold
        if self.state == "STABLE":
            limit -= hysteresis
        elif self.state != "UNKNOWN":
            limit += hysteresis
        return "STABLE" if self.probability >= limit else "UNSTABLE"


class Hand:
    """Takes what `Detector` takes; tells (time, state, {finger: row})."""

    def __init__(self, model, sensors, tare, rate):
        self.model = model
        self.fingers = {
            name: Finger(which, model.finger(name), model.window, tare, 1 / rate)
            for name, which in sensors.items()
        }

    def update(self, samples, time):
        for name, finger in self.fingers.items():
            finger.wait(time)
            if name in samples:
                finger.take(time, np.asarray(samples[name], dtype=np.float64))
        for name, finger in self.fingers.items():
            if name in samples or finger.status == "gap":
                finger.decide(time, self.fingers.values(), self.model.debounce)
        rows = {name: self.row(finger) for name, finger in self.fingers.items()}
        return time, self.state(), rows

    @staticmethod
    def row(finger):
        last = NAN if finger.last is None else finger.last
        told = (finger.state, finger.status, finger.faults)
        return told, (last, finger.probability, finger.sigma, *finger.force)

    def state(self):
        states = [finger.state for finger in self.fingers.values()]
        if "UNSTABLE" in states:
            return "UNSTABLE"
        if "UNKNOWN" in states:
            return "UNKNOWN"
        needed = 2 if len(self.fingers) > 1 else 1
        return "STABLE" if states.count("STABLE") >= needed else "NO_CONTACT"
