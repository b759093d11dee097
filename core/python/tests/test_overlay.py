"""Overlays of behaviors."""

import unittest

from test_behavior_host import Counter, hosted
from yamabico import Overlay, drive
from yamabico.messages import Odometry, OverlayHeader
from yamabico.overlay import BLUE, MAX_MARKS, RED


class Drawer(Counter):
    """Draws over its odometry."""

    def propose(self, inputs):
        self.draw(self.wheels, Odometry(stamp_ns=77), lambda overlay: overlay.robot("gate", RED).line((0.5, -0.2), (0.5, 0.2)))
        return drive(0.1)


class Overlays(unittest.TestCase):
    def test_layers_become_marks(self):
        overlay = Overlay()
        overlay.image("edges", BLUE).polygon([(0, 0), (4.04, 0), (4, 3)]).point((float("nan"), 1))
        overlay.robot("gate", RED).circle((0.12345, 0), 0.3).text((1, 0), "0.5 m")
        header, marks = overlay.message(7, 3, "sensors/front")
        self.assertEqual((header.stamp_ns, header.sequence, header.topic, header.omitted), (7, 3, "sensors/front", 0))
        self.assertEqual([mark.kind for mark in marks], [0, 3, 3, 3, 1, 4, 5])
        self.assertEqual((marks[0].text, marks[0].color, marks[1].x2), ("edges", 0x4696FF, 4.0))
        self.assertEqual((marks[5].x, marks[5].x2, marks[6].text), (0.123, 0.3, "0.5 m"))

    def test_memory_is_bounded(self):
        overlay = Overlay()
        overlay.image("many", BLUE).path((i, 0) for i in range(3000))
        self.assertEqual((len(overlay.marks), overlay.omitted), (MAX_MARKS, 3000 - MAX_MARKS))

    def test_nobody_draws_unless_somebody_looks(self):
        for is_watched in [False, True]:
            host, bus, _ = hosted(plugin_class=Drawer, is_watched=is_watched)
            host.propose(1, lambda: 2)
            drawn = bus.published["behaviors/me/overlay"]
            self.assertEqual(len(bus.published["p"]), 1)
            self.assertEqual([(type(header), header.stamp_ns, header.topic) for header in drawn], [(OverlayHeader, 77, "w")] * is_watched)


if __name__ == "__main__":
    unittest.main()
