"""Tests of the driver without a robot: python -m unittest"""

import time
import unittest

from driver import Encoders, MyDriver, Sonar, Wheels
from yamabico.device import DeviceSetup
from yamabico.messages import Command, Twist


class MyDriverTest(unittest.TestCase):
    def setUp(self):
        self.published = {}
        sensors = [Encoders("wheels", {}), Sonar("sonar", {})]
        keep = lambda name, header, items: self.published.__setitem__(name, (header, items))
        self.driver = MyDriver(DeviceSetup(sensors=sensors, drive=Wheels({}), publish=keep))
        self.now_ns = time.monotonic_ns()

    def after(self, milliseconds):
        """Polls and applies no command after this time."""
        self.now_ns += milliseconds * 1_000_000
        self.driver.poll(self.now_ns)
        self.driver.apply(None, self.now_ns)

    def test_it_drives_and_stops_when_commands_stop(self):
        self.after(0)
        self.driver.apply(Command(twist=Twist(linear=0.5)), self.now_ns)
        self.after(100)
        self.assertAlmostEqual(self.published["wheels"][0].x, 0.05, places=2)
        self.assertEqual(self.driver.base.v, 0.5)
        self.after(150)
        self.assertEqual(self.driver.base.v, 0.0)

    def test_an_emergency_stops(self):
        self.driver.apply(Command(twist=Twist(linear=0.5), emergency=1), self.now_ns)
        self.assertEqual(self.driver.base.v, 0.0)


if __name__ == "__main__":
    unittest.main()
