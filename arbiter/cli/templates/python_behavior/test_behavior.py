"""python -m unittest"""

import unittest

from behavior import Creeper
from yamabico import Kind, Setup
from yamabico.behavior import Input, Inputs, View
from yamabico.messages import Beam, RangeScanHeader


def proposal_before(*ranges_m):
    creeper = Creeper(Setup(parameters={"speed_mps": 0.4}))
    scan = View(RangeScanHeader(max_m=3.0), [Beam(range_m=range_m) for range_m in ranges_m])
    return creeper.propose(Inputs(0, {"sonar": Input([scan], fresh=1)}))


class Creeping(unittest.TestCase):
    def test_it_slows_down_and_stands_before_what_is_near(self):
        self.assertEqual(proposal_before(2.0).twist.linear, 0.4)
        self.assertAlmostEqual(proposal_before(2.0, 0.9).twist.linear, 0.2)
        self.assertEqual(proposal_before(0.5).twist.linear, 0.0)
        self.assertEqual(proposal_before(float("nan")).twist.linear, 0.4)

    def test_without_a_sonar_it_says_so(self):
        self.assertEqual(Creeper(Setup()).propose(Inputs(0, {})).kind, Kind.ABSTAIN)


if __name__ == "__main__":
    unittest.main()
