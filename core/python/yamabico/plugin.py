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

from .behavior import Refusal
from .messages import (
    COMMAND_TOPIC,
    DECISION_TOPIC,
    PROTOCOL,
    TAKEN_TOPIC,
    TURNS_TOPIC,
    Command,
    PluginState,
    Turn,
    TurnPhase,
)

#: Exit code of a plugin that cannot begin.
CANNOT_BEGIN = 2
#: Longest sleep: how late the end of the run is noticed, seconds.
NAP_S = 0.05


def main(part):
    """Is the behavior or the driver `part`, a class. Ends the process."""
    if sys.argv[1:2] == ["--describe"]:
        print(json.dumps(part.description(PROTOCOL), indent=2))
        sys.exit(0)
    if sys.argv[1:2] == ["--sensor"]:
        print(json.dumps(part.answer(json.load(sys.stdin)), indent=2))
        sys.exit(0)
    serve(part)


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
        for module in ("bus", "feed", "lent", "pulse", "seat", "tuner"):
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
    from .seat import Seat
    from .tuner import Tuner

    seat = Seat(part, charge, bus, pulse)
    tuner = Tuner(seat, bus)
    longest_s = min(NAP_S, pulse.every_s)
    if charge.get("clock") == "driver":
        _behave_in_turn(seat, tuner, charge, bus, pulse, life, longest_s)
        return
    waiter = bus.waiter([topic for _, topic, _ in seat.slots] + ([DECISION_TOPIC] if seat.may_sleep else []))
    wait_to_begin(charge, bus, pulse, life)
    while life.goes_on():
        tuner.step()
        pulse.beat(seat.state())
        seat.collect()
        seat.propose(time.monotonic_ns(), time.monotonic_ns)
        pulse.tell_memory(seat.memory)
        pulse.tell_calls(seat.calls)
        due = seat.next_call_ns()
        wait_s = longest_s if due is None else min((due - time.monotonic_ns()) * 1e-9, longest_s)
        if wait_s > 0:
            waiter.wait(wait_s)
    pulse.tell_last_calls(seat.calls)


def _behave_in_turn(seat, tuner, charge, bus, pulse, life, longest_s):
    turns, taken = bus.subscriber(TURNS_TOPIC, Turn), bus.publisher(TAKEN_TOPIC, Turn)
    waiter, sequence = bus.waiter([TURNS_TOPIC]), 0
    wait_to_begin(charge, bus, pulse, life)
    while life.goes_on():
        tuner.step()
        pulse.beat(seat.state())
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
        pulse.tell_memory(seat.memory)
        pulse.tell_calls(seat.calls)
        waiter.wait(longest_s)
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
