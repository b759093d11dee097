"""A behavior host on a bus made of lists."""

import json
import unittest
from unittest.mock import Mock

from yamabico import PLANAR, Behavior, Number, Slot, drive
from yamabico.call_log import state_hash
from yamabico.messages import CallEvent, DECISION_TOPIC, DecisionHeader, Odometry, Outcome, PluginState, Verdict
from yamabico.behavior_host import BehaviorHost


class Counter(Behavior):
    """Counts its calls."""

    name = "counter"
    claims = PLANAR
    wheels = Slot(Odometry, "wheel odometry")
    speed_mps = Number("Speed.", 0.0, 2.0, default=0.4)
    calls = 0

    def save_state(self):
        if self.calls == 13:
            raise RuntimeError("cannot save this state")
        return {"calls": self.calls}

    def restore_state(self, state):
        self.calls = state["calls"] + 0

    def propose(self, inputs):
        self.calls += 1
        return drive(self.speed_mps, note=f"call {self.calls}")


class Bus:
    """A bus whose topics are lists of messages."""

    def __init__(self, is_watched=False):
        self.published, self.pending, self.is_watched = {}, {}, is_watched

    def publisher(self, topic, message):
        published = self.published.setdefault(topic, [])
        return Mock(publish=lambda header, items=b"": published.append(header), is_watched=lambda: self.is_watched)

    def subscriber(self, topic, message):
        pending = self.pending.setdefault(topic, [])
        return Mock(message=message, receive=lambda: pending.pop(0) if pending else None)


def hosted(memory="", plugin_class=Counter, is_watched=False, **keys):
    bus = Bus(is_watched)
    settings = {"plugin": "counter", "priority": 5, "proposal": "p", "folder": ".", "parameters": {}, "robot": {}, "period_ms": 10, **keys}
    settings |= {"inputs": [{"name": "wheels", "topic": "w", "message": Odometry.NAME}], "outputs": []}
    reporter = Mock()
    launch = {"name": "me", "saved_state": memory, "role": {"behavior": settings}}
    return BehaviorHost(plugin_class, launch, bus, reporter), bus, reporter


class Hosts(unittest.TestCase):
    def test_a_new_instance_continues_and_discards_an_invalid_state(self):
        host, bus, _ = hosted(json.dumps({"calls": 4}))
        host.propose(1, lambda: 2)
        self.assertEqual((bus.published["p"][0].note, host.saved_state), ("call 5", b'{"calls": 5}'))
        host, bus, reporter = hosted(json.dumps({"calls": "many"}))
        host.propose(1, lambda: 2)
        self.assertEqual(bus.published["p"][0].note, "call 1")
        self.assertIn("discarded", reporter.report_failure.call_args[0][1])

    def test_new_parameters_keep_the_saved_state(self):
        host, bus, _ = hosted()
        host.propose(1, lambda: 2)
        host.replace(host.build({"speed_mps": 0.1}))
        self.assertTrue(host.has({"speed_mps": 0.1}))
        host.propose(20_000_000, lambda: 2)
        self.assertEqual((bus.published["p"][1].note, bus.published["p"][1].twist.linear), ("call 2", 0.1))
        # If saving fails, the last saved state is restored.
        host.behavior.calls = 13
        host.replace(host.build({"speed_mps": 0.2}))
        self.assertEqual((host.behavior.calls, host.behavior.speed_mps), (2, 0.2))

    def test_a_shorter_text_leaves_nothing_of_a_longer_one(self):
        proposal = drive(0.1, note="a long note")
        proposal.note = "short"
        self.assertEqual(bytes(proposal), bytes(drive(0.1, note="short")))

    def test_calls_are_logged_with_what_they_were_handed(self):
        host, bus, _ = hosted(json.dumps({"calls": 4}))
        log = bus.published["replay/behaviors/me"]
        sample = Mock(payload_ptr=b"")
        sample.payload().len.return_value = 0
        for number in (7, 8):
            bus.pending["w"].append((Odometry(sequence=number, stamp_ns=10 * number), sample))
        host.collect()
        host.propose(1, lambda: 2)
        host.propose(20_000_000, lambda: 2)
        self.assertEqual([entry.event for entry in log], [CallEvent.START, CallEvent.CALL, CallEvent.CALL])
        self.assertEqual([entry.proposal for entry in log], [0, 1, 2])
        # The hash of the restored state is 64-bit FNV-1a.
        self.assertEqual((log[0].state, state_hash(b"foobar")), (state_hash(b'{"calls": 4}'), 0x85944171F73967E8))

    def test_it_sleeps_while_inhibited(self):
        host, bus, _ = hosted(sleeps_while_inhibited=True)
        for outcome, calls in [(Outcome.INHIBITED, 0), (Outcome.INHIBITED, 0), (Outcome.WON, 1)]:
            verdict = Verdict(outcome=outcome)
            verdict.behavior = "me"
            data = bytes(verdict)
            sample = Mock(payload_ptr=data)
            sample.payload().len.return_value = len(data)
            bus.pending[DECISION_TOPIC].append((DecisionHeader(), sample))
            host.collect()
            self.assertEqual(host.state(), PluginState.RUNNING if calls else PluginState.SLEEPING)
            host.propose(1, lambda: 2)
            self.assertEqual(len(bus.published["p"]), calls)


if __name__ == "__main__":
    unittest.main()
