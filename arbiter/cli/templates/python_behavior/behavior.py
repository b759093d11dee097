"""Drives ahead, the slower the nearer something is."""

from yamabico import PLANAR, Behavior, Number, Reason, Slot, abstain, drive, main
from yamabico.messages import NO_ECHO, RangeScanHeader


class Creeper(Behavior):
    """Drives ahead, the slower the nearer something is."""

    name = "@name@"
    claims = PLANAR

    # Its inputs, and the keys of its table in a task file; both are told to `check` and `describe`.
    sonar = Slot(RangeScanHeader, "ranges ahead of the robot")
    speed_mps = Number("Speed where nothing is near.", 0.02, 2.0, default=0.3)
    stop_m = Number("It stands before anything nearer than this.", 0.1, 5.0, default=0.6)

    def propose(self, inputs):
        scan = inputs[self.sonar].latest
        if scan is None:
            return abstain(Reason.NO_INPUT)
        # What is no number is none that is near.
        echoes = [beam.range_m for beam in scan.items if not beam.flags & NO_ECHO and beam.range_m == beam.range_m]
        nearest_m = min(echoes, default=scan.header.max_m)
        # Full speed from twice the distance at which it stands.
        share = min(max(nearest_m / self.stop_m - 1.0, 0.0), 1.0)
        return drive(share * self.speed_mps)


if __name__ == "__main__":
    main(Creeper)
