"""The life of a plugin's process: `main(MyBehavior)` is all that a program has to say.

The supervisor starts it, tells it on standard input what it is, watches its heartbeat and starts it again. With the single
argument `--describe` the program says what it is, as JSON, and ends.
"""

import importlib
import json
import os
import signal
import sys
import time
import tomllib
import traceback

from .messages import (
    COMMAND_TOPIC,
    PROTOCOL,
    TAKEN_TOPIC,
    TURNS_TOPIC,
    Command,
    Kind,
    PluginState,
    Proposal,
    Turn,
    TurnPhase,
)

#: Exit code of a plugin that cannot begin.
CANNOT_BEGIN = 2
#: After so many exceptions a behaviour stays out.
MOST_EXCEPTIONS = 5
#: Longest sleep: how late the end of the run is noticed, seconds.
NAP_S = 0.05


def main(part):
    """Is the behaviour or the driver `part`, a class. Ends the process."""
    if sys.argv[1:2] == ["--describe"]:
        print(json.dumps(part.description(PROTOCOL), indent=2))
        sys.exit(0)
    if sys.argv[1:2] == ["--sensor"]:
        print(json.dumps(part.answer(json.load(sys.stdin)), indent=2))
        sys.exit(0)
    serve(part)


class Refusal(Exception):
    """Why a plugin cannot begin; `key` is that of its table to change."""

    def __init__(self, problem, key=""):
        super().__init__(problem)
        self.key = key


class Life:
    """Whether the process goes on."""

    def __init__(self):
        self.is_over = self.is_orphan = False
        self._parent = os.getppid()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, self._end)
        signal.signal(signal.SIGHUP, self._orphan)

    def goes_on(self):
        """Whether nobody has told it to end, and its supervisor lives."""
        if os.getppid() != self._parent:
            self._orphan()
        return not self.is_over

    def _end(self, *_):
        self.is_over = True

    def _orphan(self, *_):
        self.is_over = self.is_orphan = True


def serve(part):
    """Serves as the plugin that standard input charges this process with, until SIGTERM. Ends the process."""
    life = Life()
    pulse = None
    try:
        # Before anything is told: a successor comes up while its predecessor is cleaned up after.
        for module in ("bus", "feed", "lent", "pulse"):
            importlib.import_module(f".{module}", __package__)
        charge = tomllib.loads(sys.stdin.read())
        if charge["protocol"] != PROTOCOL:
            raise Refusal(f"the charge is of protocol {charge['protocol']}, this package knows {PROTOCOL}: install that of the robot")
        from .bus import Bus
        from .pulse import Pulse

        bus = Bus(charge["bus_root"], charge["bus_prefix"])
        pulse = Pulse(bus, charge["name"], charge["restarts"], charge["beat_ms"])
        work = _behave if "behavior" in charge["part"] else _operate
        work(part, charge, bus, pulse, life)
    except Exception as error:
        traceback.print_exc()
        if pulse is not None:
            pulse.fail(getattr(error, "key", ""), str(error) or type(error).__name__)
        _end(CANNOT_BEGIN)
    _end(0)


def wait_to_begin(charge, bus, pulse, life):
    """Says that everything is open, and waits for the first command where that is the beginning."""
    if charge["begin"] == "at-once":
        pulse.beat(PluginState.STARTING)
        return
    commands, waiter = bus.subscriber(COMMAND_TOPIC, Command), bus.waiter([COMMAND_TOPIC])
    while commands.receive() is None and life.goes_on():
        pulse.beat(PluginState.STARTING)
        waiter.wait(pulse.every_s)


def _end(code):
    # Nothing is taken down: whoever is about to read what was said last can do so until the supervisor cleans up.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _behave(part, charge, bus, pulse, life):
    seat = Seat(part, charge, bus, pulse)
    longest_s = min(NAP_S, pulse.every_s)
    if charge.get("clock") == "driver":
        _behave_in_turn(seat, charge, bus, pulse, life, longest_s)
        return
    waiter = bus.waiter([topic for _, topic, _ in seat.slots])
    wait_to_begin(charge, bus, pulse, life)
    while life.goes_on():
        pulse.beat(PluginState.FAILED if seat.behavior is None else PluginState.RUNNING)
        seat.collect()
        seat.propose(time.monotonic_ns(), time.monotonic_ns)
        pulse.tell_calls(seat.calls)
        due = seat.next_call_ns()
        wait_s = longest_s if due is None else min((due - time.monotonic_ns()) * 1e-9, longest_s)
        if wait_s > 0:
            waiter.wait(wait_s)
    pulse.tell_last_calls(seat.calls)


def _operate(part, charge, bus, pulse, life):
    from .device_seat import DeviceSeat, bury

    seat = DeviceSeat(part, charge, bus)
    waiter = bus.waiter([COMMAND_TOPIC])
    owns_the_clock = charge.get("clock") == "driver"
    if owns_the_clock:
        seat.open_the_clock(bus)
    wait_to_begin(charge, bus, pulse, life)
    if owns_the_clock:
        seat.keep_the_clock(pulse, life.goes_on)
    else:
        seat.operate(waiter, pulse, life.goes_on)
    if life.is_orphan:
        seat.brake()
        bury(charge["bus_root"], charge["bus_prefix"])


def _behave_in_turn(seat, charge, bus, pulse, life, longest_s):
    turns, taken = bus.subscriber(TURNS_TOPIC, Turn), bus.publisher(TAKEN_TOPIC, Turn)
    waiter, sequence = bus.waiter([TURNS_TOPIC]), 0
    wait_to_begin(charge, bus, pulse, life)
    while life.goes_on():
        pulse.beat(PluginState.FAILED if seat.behavior is None else PluginState.RUNNING)
        while (received := turns.receive()) is not None:
            turn = received[0]
            if turn.phase == TurnPhase.COLLECT:
                seat.collect()
            elif turn.phase == TurnPhase.PROPOSE:
                seat.propose(turn.stamp_ns, lambda: turn.stamp_ns)
            else:
                continue
            sequence += 1
            turn.plugin, turn.sequence = charge["name"], sequence
            taken.publish(turn)
        pulse.tell_calls(seat.calls)
        waiter.wait(longest_s)
    pulse.tell_last_calls(seat.calls)


class Seat:
    """A behaviour between its feed and its proposals."""

    def __init__(self, part, charge, bus, pulse):
        from .behavior import Setup
        from .bus import message_class
        from .feed import Feed
        from .pulse import Calls

        told = charge["part"]["behavior"]
        if told["plugin"] != part.name:
            raise Refusal(f"this program has no behaviour `{told['plugin']}`")
        self.calls = Calls()
        self._part, self._pulse = part, pulse
        self._name, self._priority = charge["name"], told["priority"]
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
        self._feed = Feed(bus, self.slots)
        self._proposals = bus.publisher(told["proposal"], Proposal)
        self._sequence, self._fresh, self._last_ns = 0, False, None

    def collect(self):
        """Takes in what has arrived."""
        self._fresh |= self._feed.collect()

    def next_call_ns(self):
        """When it wants to be asked though nothing is new; None where never, or where it stays out."""
        if self._period_ns is None or self.behavior is None:
            return None
        return 0 if self._last_ns is None else self._last_ns + self._period_ns

    def propose(self, now_ns, clock):
        """Asks the behaviour where something is new or its period is over, and publishes its proposal, sent at `clock()`.

        After an exception it falls silent for this call and is built anew; after five it stays out.
        """
        due = self.next_call_ns()
        if self.behavior is None or not (self._fresh or (due is not None and due <= now_ns)):
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
            self._publish(proposal, now_ns, now_ns if evidence_ns is None else evidence_ns, clock)

    def _ask(self, now_ns, leases):
        from .behavior import Inputs

        proposal = self.behavior.propose(Inputs(now_ns, self._feed.inputs(lambda slot: _lease(slot, leases))))
        if type(proposal) is not Proposal:
            raise TypeError(f"`propose` returned {type(proposal).__name__}, not drive, limit, halt or abstain")
        return proposal

    def _publish(self, proposal, now_ns, evidence_ns, clock):
        self.calls.abstentions += proposal.kind == Kind.ABSTAIN
        self._sequence += 1
        proposal.behaviour, proposal.sequence, proposal.priority = self._name, self._sequence, self._priority
        proposal.stamp_ns = proposal.stamp_ns or now_ns
        proposal.evidence_ns = proposal.evidence_ns or evidence_ns
        proposal.received_ns, proposal.proposed_ns = now_ns, clock()
        self._proposals.publish(proposal)

    def _start_anew(self, error):
        traceback.print_exc()
        self.calls.panics += 1
        self.behavior = None
        fate = "stays out"
        if self.calls.panics < MOST_EXCEPTIONS:
            try:
                self.behavior = self._part(self._setup)
                fate = "is built anew"
            except Exception:
                traceback.print_exc()
        where = traceback.extract_tb(error.__traceback__)[-1:]
        where = "".join(f" ({frame.name}, line {frame.lineno})" for frame in where)
        self._pulse.fail("", f"{type(error).__name__}: {error}{where}; it {fate}")


def _lease(slot, leases):
    from .lent import Lease

    lease = Lease(slot)
    leases.append(lease)
    return lease


def _nanos(milliseconds):
    return None if milliseconds is None else int(milliseconds * 1e6)
