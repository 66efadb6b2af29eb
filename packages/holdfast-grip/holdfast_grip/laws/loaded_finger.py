"""Forces and doubt of one finger, as the law `holdfast` follows them."""

from holdfast_grip.laws.base import Touch

SLIDING_DOUBT = 0.7
"""Least doubt in a finger that is decided to slide."""


class LoadedFinger:
    """Forces and doubt of a finger, from sample to sample.

    Attributes:
        load: tangential force, filtered.
        press: normal force, filtered.
        share: normal force in the calm grip, its weight in the hand.
        doubt: doubt in this sample.
        base: doubt of the calm grip, which says nothing about a slip.
        slides: whether the finger is decided to slide.
    """

    __slots__ = ("base", "doubt", "drag", "last", "load", "press", "rise", "share", "slides")

    def __init__(self, touch: Touch) -> None:
        self.load = touch.tangential
        self.press = self.share = touch.normal
        # Newest forces, not filtered, and how they changed in the last sample.
        self.last = touch.normal, touch.tangential
        self.rise = self.drag = 0.0
        self.doubt, self.slides = 0.0, False
        self.base = 1.0 - touch.probability if touch.touching else 1.0

    def follow(self, touch: Touch, part: float) -> float:
        """Take a part of the difference to the present forces, and the present doubt.

        Returns:
            How much the change of the forces differs from that of the last sample.
        """
        self.load += part * (touch.tangential - self.load)
        self.press += part * (touch.normal - self.press)
        rise, drag = touch.normal - self.last[0], touch.tangential - self.last[1]
        shock = abs(rise - self.rise) + abs(drag - self.drag)
        self.last, self.rise, self.drag = (touch.normal, touch.tangential), rise, drag
        self.slides = touch.slides
        self.doubt = 1.0 - touch.probability if touch.touching else 1.0
        if touch.slides:
            sliding = SLIDING_DOUBT + (1.0 - SLIDING_DOUBT) * touch.slip_probability
            self.doubt = max(self.doubt, sliding)
        return shock
