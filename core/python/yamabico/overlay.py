"""Overlays: what a behavior saw, drawn over the message in which it saw it."""

import math

from .messages import OverlayHeader, OverlayMark

#: Maximum number of marks of one overlay; further marks are counted and left out.
MAX_MARKS = 2048

#: What a behavior uses or accepts.
GREEN = (60, 220, 90)
#: An obstacle, or something that forbids a motion.
RED = (255, 60, 50)
#: A measurement before it is judged.
YELLOW = (255, 210, 0)
#: What a map or a model lets expect.
BLUE = (70, 150, 255)
#: The result: a direction, an aim or a target.
MAGENTA = (255, 70, 230)
#: A limit or a gate.
ORANGE = (255, 150, 30)
#: A second result.
CYAN = (40, 215, 230)
#: What is seen and has no effect.
GRAY = (165, 165, 165)

_IMAGE_LAYER, _ROBOT_LAYER, _POINT, _LINE, _CIRCLE, _TEXT = range(6)


class Overlay:
    """Named layers of one color, in pixels of the frame (right, down) or in the robot frame (forward, left; m)."""

    def __init__(self):
        self.marks, self.omitted = [], 0

    def image(self, name, color):
        """Begins a layer in pixels of the frame."""
        return self._layer(_IMAGE_LAYER, name, color, 1)

    def robot(self, name, color):
        """Begins a layer in the robot frame."""
        return self._layer(_ROBOT_LAYER, name, color, 3)

    def message(self, stamp_ns, sequence, topic):
        """Returns header and items of the overlay of a message with this stamp on `topic`."""
        header = OverlayHeader(stamp_ns=stamp_ns, sequence=sequence, omitted=self.omitted)
        header.topic = topic
        return header, (OverlayMark * len(self.marks))(*self.marks)

    def _layer(self, kind, name, color, digits):
        red, green, blue = color
        color = red << 16 | green << 8 | blue
        self._add(kind, color, (0.0,) * 4, name)
        return Layer(lambda kind, numbers, text="": self._add(kind, color, [round(float(x), digits) for x in numbers], text))

    def _add(self, kind, color, numbers, text):
        if len(self.marks) >= MAX_MARKS:
            self.omitted += 1
            return
        mark = OverlayMark(kind, color, *numbers)
        mark.text = text
        self.marks.append(mark)


class Layer:
    """A layer that is being drawn. Points are pairs; marks that are not finite are left out."""

    def __init__(self, add):
        self._add = add

    def point(self, at):
        """Draws a point."""
        return self._mark(_POINT, (*at, 0.0, 0.0))

    def line(self, start, end):
        """Draws a line."""
        return self._mark(_LINE, (*start, *end))

    def path(self, points):
        """Draws lines between consecutive points."""
        points = list(points)
        for start, end in zip(points, points[1:]):
            self.line(start, end)
        return self

    def polygon(self, corners):
        """Draws a closed polygon."""
        corners = list(corners)
        return self.path(corners + corners[:1])

    def circle(self, center, radius):
        """Draws a circle."""
        return self._mark(_CIRCLE, (*center, radius, 0.0))

    def text(self, at, text):
        """Draws a text that begins at `at`, truncated to 32 bytes."""
        return self._mark(_TEXT, (*at, 0.0, 0.0), text)

    def _mark(self, kind, numbers, text=""):
        if all(math.isfinite(number) for number in numbers):
            self._add(kind, numbers, text)
        return self
