"""Descriptions of behaviors, and their proposals."""

import json
import math
import unittest

import numpy as np

from yamabico import Axes, Behavior, Group, Integer, Kind, Number, Output, Reason, Setup, SetupError, Slot, abstain, drive, halt, limit
from yamabico.behavior import Input, Inputs, View
from yamabico.bus import BusError, message_class
from yamabico.examples.wall_follower import WallFollower
from yamabico.messages import Encoding, FrameHeader, Odometry, Pose
from yamabico.reporter import bucket_of

CAMERA = {
    "Camera": {
        "intrinsics": {"fx": 221.7, "fy": 221.7, "cx": 127.5, "cy": 119.5, "width": 256, "height": 240},
        "mount": {"x": 0.0, "y": 0.0, "z": 0.6, "pan": 0.0, "tilt": math.radians(6), "roll": 0.0},
    }
}


class Inner:
    gap_m = Number("A gap.", 0.1, 5.0, default=0.5)


class Example(Behavior):
    """Does something.

    And more.
    """

    name = "example"
    claims = Axes.LINEAR
    wheels = Slot(Odometry, "wheel odometry", required=False)
    own_pose = Output(Pose, "pose estimate")
    speed_mps = Number("Speed.", 0.0, 2.0, default=0.4)
    count = Integer("Count.", 1, 9)
    inner = Group("A table.", Inner)


def corridor(heading, side_m, width_m=2.0):
    """Renders a corridor with a dark floor, for a robot `side_m` left of its middle, turned left by `heading`."""
    k, mount = CAMERA["Camera"]["intrinsics"], CAMERA["Camera"]["mount"]
    # 4 x 4 rays per pixel.
    columns, rows = np.meshgrid(np.arange(-0.375, k["width"] - 0.5, 0.25), np.arange(-0.375, k["height"] - 0.5, 0.25))
    x, y = (columns - k["cx"]) / k["fx"], (rows - k["cy"]) / k["fy"]
    ahead = math.cos(mount["tilt"]) - y * math.sin(mount["tilt"])
    down = y * math.cos(mount["tilt"]) + math.sin(mount["tilt"])
    forward = ahead * math.cos(heading) + x * math.sin(heading)
    right = x * math.cos(heading) - ahead * math.sin(heading)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = right / down * mount["z"] - side_m
    floor = (down > 0) & (np.abs(at) < width_m / 2) & (forward > 0)
    gray = np.where(floor, 60.0, 190.0).reshape(k["height"], 4, k["width"], 4)
    return gray.mean(axis=(1, 3)).astype(np.uint8)


def proposal_for(image):
    follower = WallFollower(Setup(sensors={"camera": {"kind": CAMERA}}))
    header = FrameHeader(width=256, height=240, stride=256, encoding=Encoding.GRAY8)
    for _ in range(20):
        proposal = follower.propose(Inputs(0, {"camera": Input([View(header, pixels=lambda: image)], 1)}))
    return proposal


class Descriptions(unittest.TestCase):
    def test_slots_outputs_and_parameters_are_described(self):
        described = Example.description(1)
        self.assertEqual((described["summary"], described["claims"]), ("Does something.", "linear"))
        self.assertEqual(described["inputs"][0]["message"], "yamabico.Odometry.v1")
        self.assertFalse(described["inputs"][0]["required"])
        self.assertEqual(described["outputs"][0]["name"], "own-pose")
        keys = described["parameters"]
        self.assertEqual(keys["required"], ["count"])
        self.assertEqual(keys["properties"]["speed_mps"]["maximum"], 2.0)
        self.assertEqual(keys["properties"]["inner"]["properties"]["gap_m"]["default"], 0.5)

    def test_values_are_those_of_the_file_or_the_defaults(self):
        example = Example(Setup(parameters={"count": 3, "inner": {"gap_m": 1.5}}))
        self.assertEqual((example.speed_mps, example.count, example.inner.gap_m), (0.4, 3, 1.5))
        self.assertEqual(Example(Setup(parameters={"count": 3})).inner.gap_m, 0.5)

    def test_another_version_of_a_message_is_refused_and_both_are_named(self):
        with self.assertRaisesRegex(BusError, r"Odometry\.v9.*Odometry\.v1"):
            message_class("yamabico.Odometry.v9")
        with self.assertRaisesRegex(BusError, "unknown"):
            message_class("yamabico.Smell.v1")


class Proposals(unittest.TestCase):
    def test_each_kind_has_its_fields(self):
        described = drive(0.3, -0.2, note="é" * 40)
        self.assertEqual((described.kind, described.axes, described.twist.angular), (Kind.DRIVE, 5, -0.2))
        self.assertEqual(described.note, "é" * 32)
        self.assertEqual(limit(linear_mps=0.1, sector=(0.0, 0.5)).sector.half_width_rad, 0.5)
        self.assertEqual(limit(linear_mps=0.1).axes, 1)
        self.assertEqual((halt().axes, abstain(Reason.NO_INPUT).reason), (7, 4))

    def test_durations_are_counted_on_a_logarithmic_scale(self):
        self.assertEqual([bucket_of(nanos) for nanos in (0, 31, 32, 63, 64, 66, 1_000_000)], [0, 31, 32, 63, 64, 65, 509])


class WallFollowing(unittest.TestCase):
    def test_it_turns_back_into_the_corridor_and_to_its_middle(self):
        straight = proposal_for(corridor(0.0, 0.0))
        self.assertEqual(straight.kind, Kind.DRIVE)
        self.assertLess(abs(straight.twist.angular), 0.03)
        self.assertGreater(straight.twist.linear, 0.35)
        self.assertLess(proposal_for(corridor(0.2, 0.0)).twist.angular, -0.15)
        self.assertGreater(proposal_for(corridor(-0.2, 0.0)).twist.angular, 0.15)
        self.assertLess(proposal_for(corridor(0.0, 0.3)).twist.angular, -0.08)
        self.assertGreater(proposal_for(corridor(0.0, -0.3)).twist.angular, 0.08)

    def test_a_new_instance_continues_from_the_saved_state(self):
        setup = Setup(sensors={"camera": {"kind": CAMERA}})
        first, second = WallFollower(setup), WallFollower(setup.with_parameters({"speed_mps": 0.1}))
        first.side_m = 0.3
        second.restore_state(json.loads(json.dumps(first.save_state())))
        self.assertEqual((second.side_m, second.speed_mps, first.speed_mps), (0.3, 0.1, 0.4))
        self.assertIsNone(Example(Setup(parameters={"count": 3})).save_state())

    def test_it_abstains_on_an_image_without_edges(self):
        self.assertEqual(proposal_for(np.full((240, 256), 90, dtype=np.uint8)).kind, Kind.ABSTAIN)

    def test_it_needs_a_camera(self):
        with self.assertRaises(SetupError):
            WallFollower(Setup(sensors={"camera": {"kind": "Other"}}))


if __name__ == "__main__":
    unittest.main()
