"""Tests of the behavior without a robot: python -m unittest"""

import unittest

from behavior import MyBehavior
from yamabico import Kind, Setup
from yamabico.behavior import Input, Inputs, View
from yamabico.messages import Beam, RangeScanHeader


def proposal_at(*ranges_m):
    """The proposal with echoes at these ranges."""
    behavior = MyBehavior(Setup(parameters={"speed_mps": 0.4}))
    scan = View(RangeScanHeader(max_m=3.0), [Beam(range_m=range_m) for range_m in ranges_m])
    return behavior.propose(Inputs(0, {"sonar": Input([scan], fresh=1)}))


class MyBehaviorTest(unittest.TestCase):
    def test_it_slows_down_and_stops_in_front_of_an_obstacle(self):
        self.assertEqual(proposal_at(2.0).twist.linear, 0.4)
        self.assertAlmostEqual(proposal_at(2.0, 0.9).twist.linear, 0.2)
        self.assertEqual(proposal_at(0.5).twist.linear, 0.0)
        self.assertEqual(proposal_at(float("nan")).twist.linear, 0.4)

    def test_without_a_sonar_it_abstains(self):
        self.assertEqual(MyBehavior(Setup()).propose(Inputs(0, {})).kind, Kind.ABSTAIN)


if __name__ == "__main__":
    unittest.main()
