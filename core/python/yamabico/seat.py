"""A behavior at work: fed from the bus, asked when something is new, its proposal signed and sent."""

import json
import time
import traceback

from .behavior import Inputs, Refusal, Setup
from .bus import items_of, message_class
from .feed import Feed
from .lent import Lease
from .messages import DECISION_TOPIC, DecisionHeader, Kind, Outcome, PluginState, Proposal
from .pulse import Calls

#: After so many exceptions a behavior stays out.
MAX_EXCEPTIONS = 5


class Seat:
    """A behavior between its feed and its proposals."""

    def __init__(self, part, charge, bus, pulse):
        told = charge["part"]["behavior"]
        if told["plugin"] != part.name:
            raise Refusal(f"this program has no behavior `{told['plugin']}`")
        self.calls = Calls()
        self.name = charge["name"]
        #: What its successor must know: JSON, in bytes.
        self.memory = b""
        self._part, self._bus, self._pulse = part, bus, pulse
        self._priority = told["priority"]
        self._period_ns, self._budget_ns = _nanos(told.get("period_ms")), _nanos(told.get("budget_ms"))
        self.slots = [(port["name"], port["topic"], message_class(port["message"])) for port in told["inputs"]]
        for slot in part.slots():
            for name, _, message in self.slots:
                if name == slot.name and message is not slot.message:
                    raise Refusal(f"`{name}` carries `{message.NAME}`, and this program takes `{slot.message.NAME}`")
        ports = {port["name"]: bus.publisher(port["topic"], message_class(port["message"])) for port in told["outputs"]}
        self._setup = Setup(
            name=charge["name"],
            parameters=told["parameters"],
            robot=told["robot"],
            sensors={port["name"]: port["sensor"] for port in told["inputs"] if "sensor" in port},
            folder=told["folder"],
            publish=lambda output, header, items: ports[output.name].publish(header, items),
        )
        self.behavior = part(self._setup)
        self._recall(charge.get("memory", "").encode())
        self._feed = Feed(bus, self.slots)
        #: Whether it is not asked while it is inhibited, and whether it is so now.
        self.may_sleep, self.sleeps = told.get("sleeps_while_inhibited", False), False
        self._decisions = bus.subscriber(DECISION_TOPIC, DecisionHeader) if self.may_sleep else None
        self._proposals = bus.publisher(told["proposal"], Proposal)
        self._sequence, self._fresh, self._last_ns, self._survived = 0, False, None, False

    def state(self):
        """How it fares."""
        if self.behavior is None:
            return PluginState.FAILED
        return PluginState.SLEEPING if self.sleeps else PluginState.RUNNING

    def collect(self):
        """Takes in what has arrived."""
        self._fresh |= self._feed.collect()
        while self._decisions and (received := self._decisions.receive()) is not None:
            verdicts = items_of(DecisionHeader, received[1])
            own = [verdict.outcome for verdict in verdicts if verdict.behavior == self.name]
            self.sleeps = own == [Outcome.INHIBITED]

    def next_call_ns(self):
        """When it wants to be asked though nothing is new; None where never, while it sleeps, or where it stays out."""
        if self._period_ns is None or self.behavior is None or self.sleeps:
            return None
        return 0 if self._last_ns is None else self._last_ns + self._period_ns

    def propose(self, now_ns, clock):
        """Asks the behavior where something is new or its period is over, and publishes its proposal, sent at `clock()`.

        After an exception it falls silent for this call and is built anew; after five it stays out.
        """
        due = self.next_call_ns()
        if self.behavior is None or self.sleeps or not (self._fresh or (due is not None and due <= now_ns)):
            return
        self._fresh, self._last_ns = False, now_ns
        evidence_ns = self._feed.evidence_ns()
        leases = []
        started = time.monotonic_ns()
        try:
            proposal = self._ask(now_ns, leases)
        except Exception as error:
            proposal = None
            self._start_anew(error)
        finally:
            for lease in leases:
                lease.is_over = True
        self.calls.add(time.monotonic_ns() - started, self._budget_ns)
        if proposal is not None:
            self._survived = True
            self._publish(proposal, now_ns, now_ns if evidence_ns is None else evidence_ns, clock)

    def build(self, parameters):
        """What other parameters make of the behavior; the one that works goes on. Raises what the constructor does."""
        setup = self._setup.with_parameters(parameters)
        return setup, self._part(setup)

    def has(self, parameters):
        """Whether it works with exactly these parameters."""
        return self.behavior is not None and self._setup.parameters == parameters

    def replace(self, candidate):
        """Lets what `build` made work from now on. It goes on where its predecessor stops, and is told again what is kept on the bus."""
        try:
            self.memory = _remembered(self.behavior) if self.behavior is not None else self.memory
        except Exception:
            # What it remembered after its last call will do.
            traceback.print_exc()
        self._setup, self.behavior = candidate
        self._recall(self.memory)
        self._feed = Feed(self._bus, self.slots)

    def _ask(self, now_ns, leases):
        proposal = self.behavior.propose(Inputs(now_ns, self._feed.inputs(lambda slot: _lease(slot, leases))))
        if type(proposal) is not Proposal:
            raise TypeError(f"`propose` returned {type(proposal).__name__}, not drive, limit, halt or abstain")
        self.memory = _remembered(self.behavior)
        return proposal

    def _publish(self, proposal, now_ns, evidence_ns, clock):
        self.calls.abstentions += proposal.kind == Kind.ABSTAIN
        self._sequence += 1
        proposal.behavior, proposal.sequence, proposal.priority = self.name, self._sequence, self._priority
        proposal.stamp_ns = proposal.stamp_ns or now_ns
        proposal.evidence_ns = proposal.evidence_ns or evidence_ns
        proposal.received_ns, proposal.proposed_ns = now_ns, clock()
        self._proposals.publish(proposal)

    def _start_anew(self, error):
        traceback.print_exc()
        self.calls.panics += 1
        self.behavior = None
        fate = "stays out"
        # What it remembers may be what it cannot bear, where it fails on its first call already.
        recalls, self._survived = self._survived, False
        if self.calls.panics < MAX_EXCEPTIONS:
            try:
                self.behavior = self._part(self._setup)
                self._recall(self.memory if recalls else b"")
                fate = "is built anew"
            except Exception:
                traceback.print_exc()
        where = traceback.extract_tb(error.__traceback__)[-1:]
        where = "".join(f" ({frame.name}, line {frame.lineno})" for frame in where)
        self._pulse.fail("", f"{type(error).__name__}: {error}{where}; it {fate}")

    def _recall(self, memory):
        """Lets a behavior that was just built go on; what it cannot make sense of, it begins without."""
        if not memory:
            return
        try:
            self.behavior.recall(json.loads(memory))
        except Exception as error:
            traceback.print_exc()
            self._pulse.fail("", f"what was remembered is of no use to it ({type(error).__name__}: {error}); it begins without")
            self.behavior = self._part(self._setup)


def _remembered(behavior):
    memory = behavior.remember()
    return b"" if memory is None else json.dumps(memory, allow_nan=False).encode()


def _lease(slot, leases):
    lease = Lease(slot)
    leases.append(lease)
    return lease


def _nanos(milliseconds):
    return None if milliseconds is None else int(milliseconds * 1e6)
