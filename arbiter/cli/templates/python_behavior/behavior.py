"""Drives ahead and slows down in front of obstacles."""

from yamabico import PLANAR, Behavior, Number, Reason, Slot, abstain, drive, main
from yamabico.messages import NO_ECHO, RangeScanHeader


class MyBehavior(Behavior):
    """Drives ahead and slows down in front of obstacles."""

    name = "@name@"
    claims = PLANAR

    # The input: wired to a sensor of the robot by `inputs = { sonar = "..." }` in the task file.
    sonar = Slot(RangeScanHeader, "ranges ahead of the robot")

    # The parameters: keys of its table in the task file, with minimum and maximum. `yamabico check` refuses values out of range.
    speed_mps = Number("Speed while the path ahead is clear.", 0.02, 2.0, default=0.3)
    stop_m = Number("Distance from an obstacle at which the robot stops.", 0.1, 5.0, default=0.6)

    def propose(self, inputs):
        """Called on every new scan. Without an input it abstains, and the next behavior by priority drives."""
        scan = inputs[self.sonar].latest
        if scan is None:
            return abstain(Reason.NO_INPUT)
        # A range that is not a number is ignored.
        echoes = [beam.range_m for beam in scan.items if not beam.flags & NO_ECHO and beam.range_m == beam.range_m]
        nearest_m = min(echoes, default=scan.header.max_m)
        # Full speed from twice the stopping distance on.
        share = min(max(nearest_m / self.stop_m - 1.0, 0.0), 1.0)
        return drive(share * self.speed_mps)


if __name__ == "__main__":
    main(MyBehavior)
