"""A method fitted to some recordings of a corpus, and what it says of others."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from holdfast.classifiers import Classifier, Samples
from holdfast.contact import NO_CONTACT, STABLE, UNKNOWN, UNSTABLE
from holdfast.features import Tare
from holdfast.methods import HAND, Method, signal_of
from holdfast.metrics import Decisions, FingerDecisions, hand_decisions
from holdfast.metrics.decisions import Codes
from holdfast.recordings import Recording, Truth, label_states
from holdfast.sensors.values import Array
from holdfast.study.changes import Change, relabelled
from holdfast.study.corpus import Corpus
from holdfast.training.design import contact_threshold, rest_moments

MAX_ROWS = 20_000
"""Samples of a finger that a classifier is fitted to, evenly spread; judged is every sample."""

SURE = 1e-12
"""Probabilities are kept so far from 0 and 1."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Seen:
    """One recording as a method sees it.

    Attributes:
        name: of the recording.
        object: that was held.
        truth: of the recording.
        times: of each finger [s].
        amplitude: F_a of each finger; NaN where there is no force [unit of the readings].
        labels: codes of each finger.
        exact: codes of each finger by labels without margin, where the truth is known.
        at_rest: of each finger, the moments of F_a in the tare stretch.
        features: of each unit: of the fingers, or of `HAND` at the times of the first finger.
    """

    name: str
    object: str
    truth: Truth | None
    times: Mapping[str, Array]
    amplitude: Mapping[str, Array]
    labels: Mapping[str, Codes]
    exact: Mapping[str, Codes]
    at_rest: Mapping[str, tuple[int, float, float]]
    features: Mapping[str, Array]

    def undecided(self, labels: Mapping[str, Codes]) -> dict[str, FingerDecisions]:
        """The fingers with those labels, and nothing decided."""
        return {
            name: FingerDecisions(
                times,
                labels[name],
                np.zeros(len(times), dtype=np.int8),
                np.full(len(times), np.nan),
            )
            for name, times in self.times.items()
        }

    def unit_labels(self, unit: str) -> Codes:
        """The labels that a unit learns from; those of the hand at its first finger's times."""
        if unit != HAND:
            return self.labels[unit]
        hand = hand_decisions(self.undecided(self.labels), len(self.labels))
        times = next(iter(self.times.values()))
        return hand.labels[np.searchsorted(hand.times, times)]


def look(method: Method, corpus: Corpus, change: Change) -> list[Seen]:
    """The recordings of a corpus as a method sees them: features of all, readings of none."""
    return [_look(method, corpus, change.of(given)) for given in corpus.load()]


def _look(method: Method, corpus: Corpus, recording: Recording) -> Seen:
    fingers = tuple(name for name in corpus.fingers if name in recording.modules)
    hand = signal_of(recording, Tare.parse(corpus.tare), fingers)
    rested = fingers if hand.tare.without_contact else ()
    return Seen(
        name=recording.name,
        object=str(recording.metadata.get("object")),
        truth=recording.truth,
        times={name: finger.times for name, finger in hand.fingers.items()},
        amplitude={name: finger.amplitude for name, finger in hand.fingers.items()},
        labels=_codes(recording, fingers),
        exact=_codes(relabelled(recording, 0.0), fingers),
        at_rest={
            name: rest_moments(recording.modules[name], hand.tare, hand.rate) for name in rested
        },
        features={u: np.asarray(x, dtype=np.float32) for u, x in method.features(hand).items()},
    )


def _codes(recording: Recording, fingers: Sequence[str]) -> dict[str, Codes]:
    modules = {name: recording.modules[name] for name in fingers}
    return {name: label_states(module.labels, module.times) for name, module in modules.items()}


@dataclass(frozen=True, eq=False)
class Material:
    """What a method can be fitted to.

    Attributes:
        samples: of each unit; groups are places of recordings in the corpus.
        at_rest: of each finger, (n_recordings, 3) moments of F_a in the tare stretches.
        objects: of each recording.
    """

    samples: Mapping[str, Samples]
    at_rest: Mapping[str, Array]
    objects: tuple[str, ...]


def material_of(recordings: Sequence[Seen]) -> Material:
    """What can be learned from those recordings: a bounded number of their samples."""
    piles: dict[str, list[Samples]] = {}
    fingers = dict.fromkeys(finger for seen in recordings for finger in seen.at_rest)
    at_rest = {finger: np.zeros((len(recordings), 3)) for finger in fingers}
    n_rows = -(-MAX_ROWS // len(recordings))
    for place, seen in enumerate(recordings):
        for unit, features in seen.features.items():
            labels = seen.unit_labels(unit)
            usable = np.flatnonzero((labels != UNKNOWN) & np.isfinite(features).all(axis=1))
            rows = usable[:: max(1, -(-len(usable) // n_rows))]
            samples = Samples(features[rows], labels[rows] == STABLE, np.full(len(rows), place))
            piles.setdefault(unit, []).append(samples)
        for finger, moments in seen.at_rest.items():
            at_rest[finger][place] = moments
    return Material(
        {u: _stack(pile) for u, pile in piles.items()},
        at_rest,
        tuple(seen.object for seen in recordings),
    )


def _stack(pile: Sequence[Samples]) -> Samples:
    return Samples(
        np.concatenate([each.features for each in pile]),
        np.concatenate([each.stable for each in pile]),
        np.concatenate([each.groups for each in pile]),
    )


@dataclass(frozen=True, eq=False)
class Expert:
    """A method fitted to some recordings.

    Attributes:
        classifiers: of each unit that had both classes.
        contact: of each finger, F_a below which there is no contact; None for none.
    """

    classifiers: Mapping[str, Classifier]
    contact: Mapping[str, float | None]

    @classmethod
    def fit(
        cls, method: Method, material: Material, recordings: Collection[int], seed: int
    ) -> "Expert":
        """The expert that those recordings make."""
        places = sorted(recordings)
        classifiers = {}
        for unit, samples in material.samples.items():
            own = samples.take(np.isin(samples.groups, places))
            if not own.one_class:
                classifiers[unit] = method.recipe.fit(own, method.reference, seed)
        contact = {f: contact_threshold(rows[places]) for f, rows in material.at_rest.items()}
        return cls(classifiers, contact)

    def opinion(self, seen: Seen) -> "Opinion":
        """What it thinks of a recording."""
        known = {unit: rows for unit, rows in seen.features.items() if unit in self.classifiers}
        own = {unit: float(_log_odds(self.classifiers[unit].threshold)) for unit in known}
        margins = {
            unit: _log_odds(self.classifiers[unit].probability(rows)) - own[unit]
            for unit, rows in known.items()
        }
        with np.errstate(invalid="ignore"):
            touching = {
                name: ~(amplitude < (self.contact.get(name) or 0.0))
                for name, amplitude in seen.amplitude.items()
            }
        return Opinion(margins, own, touching)


@dataclass(frozen=True, eq=False)
class Opinion:
    """What an expert thinks of one recording.

    Attributes:
        margins: of each unit, (n,) log odds of stability over its own threshold; NaN where
            there is none.
        thresholds: of each unit [log odds].
        touching: of each finger, (n,) whether it is in contact.
    """

    margins: Mapping[str, Array]
    thresholds: Mapping[str, float]
    touching: Mapping[str, Mask]

    def decisions(self, seen: Seen, labels: Mapping[str, Codes], shift: float = 0.0) -> Decisions:
        """The decisions beside those labels, with every threshold moved by so many log odds.

        A method that judges the hand as a whole has no fingers there.
        """
        given = seen.undecided(labels)
        if HAND in self.margins:
            return Decisions(seen.name, {}, self._whole(seen, given, shift))
        return Decisions.of(seen.name, self._fingers(seen, given, shift), len(given))

    def hand(self, seen: Seen, labels: Mapping[str, Codes], shift: float) -> FingerDecisions:
        """The hand alone; its probability is the least of its fingers'."""
        given = seen.undecided(labels)
        hand = hand_decisions(self._fingers(seen, given, shift), len(given))
        if HAND in self.margins:
            hand = self._whole(seen, given, shift)
        scores = self.scores(seen, hand.times)
        probability = 1.0 / (1.0 + np.exp(-np.clip(np.nan_to_num(scores, nan=-50.0), -50, 50)))
        return replace(hand, stable_probability=probability)

    def scores(self, seen: Seen, times: Array) -> Array:
        """(n,) the least margin of the fingers in contact at those times of the hand.

        NaN where one of them is not known, -inf where too few are in contact.
        """
        held = {f: np.searchsorted(own, times, side="right") - 1 for f, own in seen.times.items()}
        touching = np.array([(at >= 0) & self.touching[f][at] for f, at in held.items()])
        if HAND in self.margins:
            scores = _hold(self.margins[HAND], next(iter(held.values())))
        else:
            margins = np.array([_hold(self._margin(seen, f), at) for f, at in held.items()])
            unknown = np.isnan(margins).any(axis=0)
            scores = np.where(unknown, np.nan, np.where(touching, margins, np.inf).min(axis=0))
        alone = touching.sum(axis=0) < min(2, len(held))
        return np.where(~np.isnan(scores) & alone, -np.inf, scores)

    def _fingers(
        self, seen: Seen, given: Mapping[str, FingerDecisions], shift: float
    ) -> dict[str, FingerDecisions]:
        return {
            name: _decide(
                finger, self._margin(seen, name), ~self.touching[name], shift, self._own(name)
            )
            for name, finger in given.items()
        }

    def _margin(self, seen: Seen, finger: str) -> Array:
        nothing = np.full(len(seen.times[finger]), np.nan)
        return self.margins.get(finger, nothing)

    def _own(self, unit: str) -> float:
        return self.thresholds.get(unit, 0.0)

    def _whole(
        self, seen: Seen, given: Mapping[str, FingerDecisions], shift: float
    ) -> FingerDecisions:
        hand = hand_decisions(given, len(given))
        scores = self.scores(seen, hand.times)
        return _decide(hand, scores, np.isneginf(scores), shift, self._own(HAND))


def _hold(values: Array, at: npt.NDArray[np.intp]) -> Array:
    return np.where(at >= 0, values[at], np.nan)


def _log_odds(probability: npt.ArrayLike) -> Any:  # noqa: ANN401 (an array or a number, as given)
    p = np.clip(probability, SURE, 1 - SURE)
    return np.log(p / (1 - p))


def _decide(
    given: FingerDecisions, margin: Array, free: Mask, shift: float, own: float
) -> FingerDecisions:
    """States at a threshold moved by `shift`, and probabilities, which are not moved."""
    known = ~np.isnan(margin)
    stable = np.where(margin >= shift, STABLE, UNSTABLE)
    states = np.select([~known, free], [UNKNOWN, NO_CONTACT], default=stable)
    probability = np.where(free, 0.0, 1.0 / (1.0 + np.exp(-np.clip(margin + own, -50, 50))))
    probability[~known] = np.nan
    return FingerDecisions(given.times, given.labels, states.astype(np.int8), probability)


def groups_of(objects: Sequence[str], n_groups: int, seed: int) -> npt.NDArray[np.int64]:
    """(n_recordings,) groups of about equal size, the recordings of each object spread evenly."""
    order = np.random.default_rng(seed).permutation(len(objects))
    order = order[np.argsort(np.array(objects)[order], kind="stable")]
    groups = np.empty(len(objects), dtype=np.int64)
    groups[order] = np.arange(len(objects)) % n_groups
    return groups
