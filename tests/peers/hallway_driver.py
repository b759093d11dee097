"""Drives down a hallway around boxes and people with OpenCV, written in a day: a peer for behaviors of Yamabico.

A line detector votes for the heading, floor lines and the boundary of the floor for the offset, a color for free floor; an occupancy grid
collects both and the sonars; the robot follows the best of 25 lanes, stops for the sonars, waits and turns out. sensors/mujoco/compare.py
runs it.
"""

from math import cos, hypot, pi, radians, sin

import numpy as np
from hallway_grid import Grid, OffsetFilter
from hallway_image import FloorBoundary, HallLines
from hallway_view import FloorView, HallPose

#: Lanes, to the left of the hallway's middle, m.
LANES_M = np.linspace(-0.60, 0.60, 25)
#: Range of a silent sonar.
SILENT_M = 4.0
FADE_PERIOD_S = 0.5
#: Clearance of a lane, look-ahead of the pursuit, and maximum turn rate.
CLEARANCE_M, LOOK_AHEAD_M, MAX_TURN_RADPS = 0.29, 0.60, 1.2


class Controller:
    """Maps images, ranges and odometry to a speed and a turn rate. `mode` is "go", "wait", "turn" or "out"."""

    def __init__(self, setup: dict):
        self.speed_mps = setup["speed_mps"]
        self.pose = HallPose(setup["hall_width_m"] / 2)
        self.view = FloorView(setup["camera"])
        self.boundary, self.lines = FloorBoundary(self.view), HallLines(self.view)
        self.grid, self.offset = Grid(self.view, self.pose), OffsetFilter()
        self.lane_m, self.moved_m = 0.0, 0.0
        self.scans = [(SILENT_M,) * 3] * 3
        self.ranges = (SILENT_M,) * 3
        self.history: list[tuple[float, tuple[float, ...]]] = []
        self.alarm_s = -9.0
        self.mode, self.mode_s, self.side = "go", 0.0, 1
        self.left_at = (0.0, 0.0, 0.0)
        self.command, self.faded_s = (0.0, 0.0), 0.0

    def step(self, time_s, image, ranges, odometry):
        """Returns the speed (m/s) and turn rate (rad/s) at a time. `image` and `ranges` are `None` while there is no new one."""
        self._move(odometry)
        if ranges is not None:
            self.scans = (self.scans + [ranges])[-3:]
            self.ranges = tuple(sorted(beam)[1] for beam in zip(*self.scans, strict=True))
            self.grid.listen(*self.ranges)
            self._watch(time_s)
        if image is not None:
            self._look(image)
        if time_s - self.faded_s > FADE_PERIOD_S:
            self.faded_s = time_s
            self.grid.fade()
        if image is not None or ranges is not None:
            self.command = self._drive(time_s)
        return self.command

    def _move(self, odometry):
        x0, y0, heading = self.grid.odometry
        ahead = (odometry[0] - x0) * cos(heading) + (odometry[1] - y0) * sin(heading)
        self.grid.odometry = tuple(odometry)
        self.pose.heading += (odometry[2] - heading + pi) % (2 * pi) - pi
        left = ahead * sin(self.pose.heading)
        self.pose.offset_m += left
        self.moved_m += left

    def _look(self, image):
        learns = not self.grid.is_occupied_near() and self.ranges[1] > 0.9
        boundary = self.boundary.rows(image, learns)
        lines, boundary = self.lines.update(image, self.pose, boundary)
        self.grid.see(boundary, self.ranges[1])
        self.offset.update(self.moved_m, self.view, self.pose, boundary, lines)
        self.moved_m = 0.0

    def _watch(self, time_s):
        """Raises an alarm if a sonar's range shrinks faster than the robot drives: someone walks in."""
        self.history = [*self.history, (time_s, self.ranges)][-8:]
        since_s, before = self.history[0]
        if time_s - since_s < 0.25:
            return
        rates = [(old - new) / (time_s - since_s) for old, new in zip(before, self.ranges, strict=True)]
        for beam, side in ((0, 1), (2, -1)):
            wall = (self.pose.half_m - side * self.pose.offset_m) / sin(radians(46)) - 0.2
            comes = self.ranges[beam] < min(1.1, wall - 0.2) and 0.5 < rates[beam] < 3.0
            if comes and abs(self.pose.heading) < 0.25:
                self.alarm_s = time_s
        if self.ranges[1] < 1.0 and 0.75 < rates[1] < 3.0:
            self.alarm_s = time_s

    def _drive(self, time_s):
        along, left = self.grid.obstacles()
        self.lane_m, free_m = self._best_lane(along, left)
        if self.mode == "go":
            return self._go(time_s, free_m)
        if self.mode == "wait":
            return self._wait(time_s, free_m, along, left)
        return self._turn(time_s) if self.mode == "turn" else self._leave(time_s)

    def _enter(self, mode, time_s):
        self.mode, self.mode_s = mode, time_s
        return 0.0, 0.0

    def _best_lane(self, along, left):
        """Returns the lane (m) with the lowest cost, and its free length (m)."""
        offset = self.pose.offset_m
        best = (self.lane_m, 1e9, 0.0)
        ahead = np.arange(0.05, 2.3, 0.08)
        share = np.clip(ahead / 0.8, 0, 1)
        share = share * share * (3 - 2 * share)
        for lane in LANES_M:
            free, gap = 2.4, 1.0
            if len(along):
                across = offset + share * (lane - offset)
                distance = np.hypot(ahead[:, None] - along[None], across[:, None] - left[None]).min(1)
                bad = distance < CLEARANCE_M
                free, gap = ahead[np.argmax(bad)] if bad.any() else 2.4, distance.min()
            cost = 0.5 * abs(lane) + 0.35 * abs(lane - self.lane_m) + 2.5 * max(0.0, 0.45 - gap) + 3.0 * max(0.0, 2.2 - free)
            if cost < best[1]:
                best = (lane, cost, free)
        return best[0], best[2]

    def _go(self, time_s, free_m):
        left_m, ahead_m, right_m = self.ranges
        if ahead_m < 0.5 or time_s - self.alarm_s < 0.1:
            return self._enter("wait", time_s)
        heading, across = self.pose.heading, self.lane_m - self.pose.offset_m
        x = cos(heading) * LOOK_AHEAD_M + sin(heading) * across
        y = -sin(heading) * LOOK_AHEAD_M + cos(heading) * across
        curvature = 2 * y / (x * x + y * y)
        speed = self.speed_mps * float(np.clip((free_m - 0.35) / 0.7, 0.0, 1.0))
        speed *= 1.0 if ahead_m > 1.0 else max(0.35, ahead_m)
        if min(left_m, right_m) < 0.25:
            curvature += 1.5 * (1 if right_m < left_m else -1)
            speed = min(speed, 0.15)
        if speed < 0.03:
            return self._enter("wait", time_s)
        return speed, float(np.clip(speed * curvature, -MAX_TURN_RADPS, MAX_TURN_RADPS))

    def _wait(self, time_s, free_m, along, left):
        left_m, ahead_m, right_m = self.ranges
        clear = ahead_m > 0.62 and free_m > 0.8 and min(left_m, right_m) > 0.3 and time_s - self.alarm_s > 1.0
        if clear and time_s - self.mode_s > 0.3:
            self.mode = "go"
        elif time_s - self.mode_s > 5.0:
            half, offset = self.pose.half_m, self.pose.offset_m
            room_left = min(half - offset, 4.0) + 0.5 * (min(left_m, 1.5) - min(right_m, 1.5))
            room_right = half + offset
            near = (along > 0) & (along < 1.2) & (np.abs(left) < 0.75)
            if near.any():
                room_left, room_right = half - left[near].max(), half + left[near].min()
            self.side = 1 if room_left >= room_right else -1
            self.left_at = self.grid.odometry
            self._enter("turn", time_s)
        return 0.0, 0.0

    def _turn(self, time_s):
        turned = self.side * self.pose.heading
        if turned > radians(60) or (turned > radians(25) and self.ranges[1] > 0.9) or time_s - self.mode_s > 5:
            self.left_at = self.grid.odometry
            return self._enter("out", time_s)
        return 0.0, 0.6 * self.side

    def _leave(self, time_s):
        """Drives a short straight leg."""
        x, y, _ = self.grid.odometry
        gone = hypot(x - self.left_at[0], y - self.left_at[1])
        room = self.pose.half_m - self.side * self.pose.offset_m
        if self.ranges[1] < 0.3:
            return self._enter("wait", time_s)
        if gone > 0.35 or room < 0.36 or time_s - self.mode_s > 5:
            self.mode = "go"
        return 0.15, 0.0
