"""Drives a base with two wheels, encoders and a sonar ahead."""

import math
import time

from yamabico import Drive, Driver, Number, Sensor, main
from yamabico.messages import NO_ECHO, Beam, Odometry, RangeScanHeader

MAX_M = 3.0


class Base:
    """The hardware: here, a point that moves toward a wall 4 m ahead.

    Replace its body by reads and writes of your serial port, CAN bus or vendor library.
    """

    def __init__(self):
        self.x = self.y = self.theta = self.v = self.w = 0.0
        self.moved = time.monotonic()

    def drive(self, v, w):
        self.v, self.w = v, w

    def read(self, now):
        step, self.moved = now - self.moved, now
        self.x += self.v * math.cos(self.theta) * step
        self.y += self.v * math.sin(self.theta) * step
        self.theta += self.w * step
        return self.x, self.y, self.theta, 4.0 - self.x


class Encoders(Sensor):
    """Wheel odometry."""

    kind, message = "encoders", Odometry


class Sonar(Sensor):
    """One sonar that looks ahead."""

    kind, message = "sonar", RangeScanHeader

    def describe(self):
        return {"Range": {"min_m": 0.02, "max_m": MAX_M}}

    def max_item_bytes(self):
        return 48


class Wheels(Drive):
    """Two driven wheels."""

    watchdog_ms = Number("Time without a command after which the drive stops.", 20, 5000, default=200)


class MyDriver(Driver):
    """A base with two wheels, encoders and a sonar ahead."""

    name = "@name@"
    sensors, drives = (Encoders, Sonar), (Wheels,)

    def __init__(self, setup):
        super().__init__(setup)
        self.base, self.commanded_ns = Base(), None

    def poll(self, now_ns):
        """Publishes what is due, stamped with its capture, and returns when to be called again."""
        x, y, theta, ahead_m = self.base.read(now_ns * 1e-9)
        for sensor in self.setup.sensors:
            if not sensor.is_due(now_ns):
                continue
            if isinstance(sensor, Encoders):
                self.publish(sensor, Odometry(stamp_ns=now_ns, x=x, y=y, theta=theta, vx=self.base.v, omega=self.base.w))
            else:
                silent = NO_ECHO if ahead_m > MAX_M else 0
                beam = Beam(cone_rad=0.4, range_m=min(ahead_m, MAX_M), flags=silent)
                self.publish(sensor, RangeScanHeader(stamp_ns=now_ns, min_m=0.02, max_m=MAX_M), (Beam * 1)(beam))
        return now_ns + 10_000_000

    def apply(self, command, now_ns):
        """Called with each command, and with None in between: the last line of defense when everything else died."""
        if command is not None:
            self.commanded_ns = now_ns
            speeds = command.twist.linear, command.twist.angular
            # An emergency and a speed that is not finite stop.
            drives = not command.emergency and all(map(math.isfinite, speeds))
            self.base.drive(*(speeds if drives else (0.0, 0.0)))
        elif self.commanded_ns is None or now_ns - self.commanded_ns > self.setup.drive.watchdog_ms * 1e6:
            self.base.drive(0.0, 0.0)


if __name__ == "__main__":
    main(MyDriver)
