"""A behavior at work, on a bus of lists."""

import json
import unittest
from unittest.mock import Mock

from yamabico import PLANAR, Behavior, Number, Slot, drive
from yamabico.messages import DECISION_TOPIC, DecisionHeader, Odometry, Outcome, PluginState, Verdict
from yamabico.seat import Seat


class Counter(Behavior):
    """Counts its calls."""

    name = "counter"
    claims = PLANAR
    wheels = Slot(Odometry, "where it is")
    speed_mps = Number("Speed.", 0.0, 2.0, default=0.4)
    calls = 0

    def remember(self):
        if self.calls == 13:
            raise RuntimeError("no memory of this")
        return {"calls": self.calls}

    def recall(self, memory):
        self.calls = memory["calls"] + 0

    def propose(self, inputs):
        self.calls += 1
        return drive(self.speed_mps, note=f"call {self.calls}")


class Bus:
    """Topics are lists of what was published on them."""

    def __init__(self):
        self.told, self.waiting = {}, {}

    def publisher(self, topic, message):
        told = self.told.setdefault(topic, [])
        return Mock(publish=lambda header, items=b"": told.append(header))

    def subscriber(self, topic, message):
        waiting = self.waiting.setdefault(topic, [])
        return Mock(message=message, receive=lambda: waiting.pop(0) if waiting else None)


def seated(memory="", **keys):
    bus = Bus()
    told = {"plugin": "counter", "priority": 5, "proposal": "p", "folder": ".", "parameters": {}, "robot": {}, "period_ms": 10, **keys}
    told |= {"inputs": [{"name": "wheels", "topic": "w", "message": Odometry.NAME}], "outputs": []}
    pulse = Mock()
    return Seat(Counter, {"name": "me", "memory": memory, "part": {"behavior": told}}, bus, pulse), bus, pulse


class Seats(unittest.TestCase):
    def test_a_successor_goes_on_and_begins_anew_where_the_memory_is_of_no_use(self):
        seat, bus, _ = seated(json.dumps({"calls": 4}))
        seat.propose(1, lambda: 2)
        self.assertEqual((bus.told["p"][0].note, seat.memory), ("call 5", b'{"calls": 5}'))
        seat, bus, pulse = seated(json.dumps({"calls": "many"}))
        seat.propose(1, lambda: 2)
        self.assertEqual(bus.told["p"][0].note, "call 1")
        self.assertIn("of no use", pulse.fail.call_args[0][1])

    def test_new_parameters_keep_the_memory(self):
        seat, bus, _ = seated()
        seat.propose(1, lambda: 2)
        seat.replace(seat.build({"speed_mps": 0.1}))
        self.assertTrue(seat.has({"speed_mps": 0.1}))
        seat.propose(20_000_000, lambda: 2)
        self.assertEqual((bus.told["p"][1].note, bus.told["p"][1].twist.linear), ("call 2", 0.1))
        # Where it cannot say now what it remembers, what it remembered last will do.
        seat.behavior.calls = 13
        seat.replace(seat.build({"speed_mps": 0.2}))
        self.assertEqual((seat.behavior.calls, seat.behavior.speed_mps), (2, 0.2))

    def test_it_sleeps_while_it_is_inhibited(self):
        seat, bus, _ = seated(sleeps_while_inhibited=True)
        for outcome, calls in [(Outcome.INHIBITED, 0), (Outcome.INHIBITED, 0), (Outcome.WON, 1)]:
            verdict = Verdict(outcome=outcome)
            verdict.behavior = "me"
            data = bytes(verdict)
            sample = Mock(payload_ptr=data)
            sample.payload().len.return_value = len(data)
            bus.waiting[DECISION_TOPIC].append((DecisionHeader(), sample))
            seat.collect()
            self.assertEqual(seat.state(), PluginState.RUNNING if calls else PluginState.SLEEPING)
            seat.propose(1, lambda: 2)
            self.assertEqual(len(bus.told["p"]), calls)


if __name__ == "__main__":
    unittest.main()
