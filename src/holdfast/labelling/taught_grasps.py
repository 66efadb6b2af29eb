"""Labels and pictures of the grasps of `holdfast teach`: what slid, and how it is known."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from holdfast.contact import MERGE_GAP, UNSTABLE_MARGIN, Cause
from holdfast.errors import RecordingError
from holdfast.files import write_whole
from holdfast.io import load_recording
from holdfast.io.label_files import save_labels
from holdfast.labelling.rules import propose
from holdfast.labelling.rules.forces import HandForce, hand_force
from holdfast.live.teaching.steps import Step
from holdfast.plots import COLOURS
from holdfast.recordings import Label, Recording

TEACH_AUTHOR = "rule:teach"
"""Author of the labels that a step of the protocol gives, and of the label files."""
PICTURES = "pulls.html"
"""Name of the page with the pictures of a folder."""
SHOWN_MARGIN = 0.6
"""Time before and after a slide that its picture shows [s]."""
PICTURE_WIDTH, PICTURE_HEIGHT = 300, 110
"""Size of a picture [pixels]."""
STYLE = (
    "body{font:16px sans-serif;margin:1em}svg{background:#f6f6f6}figcaption{font-size:13px}"
    "figure{display:inline-block;margin:.5em;width:300px;vertical-align:top}"
)


class Slide(NamedTuple):
    """A pull or push that slid: slips of fingers that follow each other closely.

    Attributes:
        start: onset of the first [s].
        end: end of the last [s].
        slips: label of the first slip of each finger.
    """

    start: float
    end: float
    slips: Mapping[str, Label]


def label_grasp(path: Path, step: Step) -> tuple[list[Slide] | None, str]:
    """Label a grasp by its video, or by the rule of its step, and save the labels.

    A step in which nothing slides needs no video: its held samples teach what is no slip. Slips
    come from a camera only.

    Args:
        path: of the recording; its video is beside it.
        step: of the protocol.

    Returns:
        The slides, or None and why no slip could be seen.

    Raises:
        OutputError: the labels cannot be written.
    """
    recording = load_recording(path, labels=False)
    video = path.with_suffix(".mp4")
    try:
        if step.in_view:
            labels = propose("tracking", recording, video=video)
        else:
            labels = {
                name: tuple(_by_step(label, step) for label in spans)
                for name, spans in propose("signal", recording).items()
            }
    except RecordingError as failure:
        return None, str(failure)
    _save(recording, labels, path)
    return slides_of(labels) if step.in_view else None, ""


def slides_of(labels: Mapping[str, Sequence[Label]]) -> list[Slide]:
    """Return the slides of a hand from the labels of its fingers, in order of time."""
    slips = sorted(
        ((x.start, x.end, name, x) for name, spans in labels.items() for x in spans if _is_slip(x)),
        key=lambda slip: slip[0],
    )
    slides: list[Slide] = []
    for start, end, name, label in slips:
        if slides and start - slides[-1].end < MERGE_GAP:
            last = slides[-1]
            slides[-1] = Slide(last.start, max(last.end, end), {name: label, **last.slips})
        else:
            slides.append(Slide(start, end, {name: label}))
    return slides


def throw_away(path: Path, number: int) -> list[Slide]:
    """Take a slide out of what teaches, and return the slides that are left.

    Its samples have no label afterwards: they are neither a slip nor none.

    Args:
        path: of the recording, with labels.
        number: of the slide, from 1.

    Raises:
        ValueError: there is no such slide.
        OutputError: the labels cannot be written.
    """
    recording = load_recording(path)
    labels = {name: module.labels for name, module in recording.modules.items()}
    slides = slides_of(labels)
    if not 1 <= number <= len(slides):
        raise ValueError(f"slide {number} given; this grasp has {len(slides)}")
    start, end = slides[number - 1].start - UNSTABLE_MARGIN, slides[number - 1].end
    end += UNSTABLE_MARGIN
    kept = {}
    for name, spans in labels.items():
        parts = [(x, x.start, min(x.end, start)) for x in spans]
        parts += [(x, max(x.start, end), x.end) for x in spans]
        cut = [replace(x, start=low, end=high) for x, low, high in parts if low < high]
        kept[name] = tuple(sorted(cut, key=lambda label: label.start))
    _save(recording, kept, path)
    return slides_of(kept)


def write_pictures(folder: Path, names: Sequence[str]) -> Path:
    """Write a page with a picture of each slide: how the force changes, onsets, how they are known.

    Args:
        folder: of the recordings.
        names: of those that are shown.

    Raises:
        OutputError: the page cannot be written.
    """
    figures = []
    for name in names:
        recording = load_recording(folder / f"{name}.mcap")
        labels = {finger: module.labels for finger, module in recording.modules.items()}
        hand = hand_force(recording)
        for k, slide in enumerate(slides_of(labels)):
            figures.append(_figure(hand, slide, f"{name}, slide {k + 1}"))
    page = f"<!doctype html><meta charset=utf-8><title>Slides</title><style>{STYLE}</style>"
    page += "<p>How the force of each finger changes; a line is the onset of its slip.</p>"
    page += "".join(figures) or "<p>No slide was seen.</p>"
    write_whole(folder / PICTURES, page.encode(), force=True)
    return folder / PICTURES


def _figure(hand: HandForce, slide: Slide, title: str) -> str:
    start, end = slide.start - SHOWN_MARGIN, slide.end + SHOWN_MARGIN
    rows = slice(*np.searchsorted(hand.times, (start, end)).tolist())
    changes = {}
    for name, finger in hand.fingers.items():
        changes[name] = np.linalg.norm(finger.force[rows] - finger.force[rows.start], axis=1)
    largest = max(float(change.max()) for change in changes.values()) or 1.0
    drawn, lines = [], []
    for (name, change), colour in zip(changes.items(), COLOURS, strict=False):
        x = PICTURE_WIDTH * (hand.times[rows] - start) / (end - start)
        y = PICTURE_HEIGHT * (1 - 0.95 * change / largest)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        drawn.append(f"<polyline fill=none stroke='{colour}' points='{points}'/>")
        label = slide.slips.get(name)
        if label is None:
            continue
        at = PICTURE_WIDTH * (label.start - start) / (end - start)
        drawn.append(f"<path stroke='{colour}' stroke-dasharray=4 d='M{at:.1f} 0V200'/>")
        why = escape(label.evidence.partition(";")[0])
        lines.append(f"<br><b style='color:{colour}'>{escape(name)}</b> {label.start:.2f} s: {why}")
    size = f"width={PICTURE_WIDTH} height={PICTURE_HEIGHT}"
    text = f"{escape(title)}{''.join(lines)}"
    return f"<figure><svg {size}>{''.join(drawn)}</svg><figcaption>{text}</figcaption></figure>"


def _is_slip(label: Label) -> bool:
    return label.cause is Cause.SLIP


def _by_step(label: Label, step: Step) -> Label:
    """Return a label of the force alone, for a step in which nothing slides."""
    evidence = f"{label.evidence}; step {step.name} of the protocol: nothing slides"
    return replace(label, evidence=evidence, author=TEACH_AUTHOR)


def _save(recording: Recording, labels: Mapping[str, Sequence[Label]], path: Path) -> None:
    modules = {
        name: replace(module, labels=tuple(labels.get(name, ())))
        for name, module in recording.modules.items()
    }
    labelled = replace(recording, modules=modules)
    save_labels(labelled, path, author=TEACH_AUTHOR, force=True)
