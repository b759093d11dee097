"""A driver between its sensors' topics and the commands."""

import fcntl
import glob
import os
import shutil
import time

from .bus import message_class
from .device import DeviceSetup
from .messages import (
    CLOCK_TOPIC,
    COMMAND_TOPIC,
    TRUTH_TOPIC,
    TURNS_TOPIC,
    Clock,
    Command,
    PluginState,
    Truth,
    Turn,
    TurnPhase,
)

#: Longest sleep: how late a drive notices missing commands, seconds.
NAP_S = 0.01
#: Added to the time that a drive needs to stand, seconds.
MARGIN_S = 0.2


class DeviceSeat:
    """A driver at work."""

    def __init__(self, part, charge, bus):
        told = charge["part"]["device"]
        spec = told["spec"]
        if told["driver"] != part.name:
            raise ValueError(f"this program has no driver `{told['driver']}`")
        self.stops_in_s = told["stops_in_s"]
        self._ports = {port["name"]: bus.publisher(port["topic"], message_class(port["message"])) for port in told["outputs"]}
        self._ports[TRUTH_TOPIC] = bus.publisher(TRUTH_TOPIC, Truth)
        self._sequences = dict.fromkeys(self._ports, 0)
        drive = spec.get("drive")
        drives = {kind.kind: kind for kind in part.drives}
        self.driver = part(
            DeviceSetup(
                name=spec["name"],
                parameters=spec["table"],
                sensors=[part.sensor(sensor["name"], sensor["kind"], sensor["table"]) for sensor in spec["sensors"]],
                drive=drives[drive["kind"]](drive["table"]) if drive else None,
                robot=spec["robot"],
                folder=spec["folder"],
                seed=int(spec["seed"]),
                step_ns=round(told["step_ms"] * 1e6),
                publish=self._publish,
            )
        )
        self._commands = bus.subscriber(COMMAND_TOPIC, Command)

    def operate(self, waiter, pulse, goes_on):
        """By the machine's clock, until the end."""
        while goes_on():
            pulse.beat(PluginState.RUNNING)
            now = time.monotonic_ns()
            due = self.driver.poll(now)
            self.drive(now)
            wait_s = NAP_S if due is None else min((due - time.monotonic_ns()) * 1e-9, NAP_S)
            if wait_s > 0:
                waiter.wait(wait_s)

    def open_the_clock(self, bus):
        """Opens what its own clock needs."""
        self._clock, self._turns = bus.publisher(CLOCK_TOPIC, Clock), bus.subscriber(TURNS_TOPIC, Turn)
        self._called = bus.waiter([TURNS_TOPIC])

    def keep_the_clock(self, pulse, goes_on):
        """By its own clock, at the driver's pace, until the end."""
        step, step_ns, pace = 0, self.driver.setup.step_ns, self.driver.pace
        begun = time.monotonic_ns()
        while goes_on():
            now = step * step_ns
            self.driver.poll(now)
            self._clock.publish(Clock(stamp_ns=now, step=step))
            while not _is_done(self._turns, step) and goes_on():
                pulse.beat(PluginState.RUNNING)
                self._called.wait(min(0.05, pulse.every_s))
            self.drive(now)
            step += 1
            while pace and goes_on() and (ahead_s := (step * step_ns / pace - (time.monotonic_ns() - begun)) * 1e-9) > 0:
                pulse.beat(PluginState.RUNNING)
                time.sleep(min(ahead_s, pulse.every_s))

    def drive(self, now_ns):
        """Gives the drive what has been commanded since the last call, or nothing."""
        newest = None
        while (received := self._commands.receive()) is not None:
            newest = received[0]
        self.driver.apply(newest, now_ns)

    def brake(self):
        """Brings a robot to rest whose arbiter is gone."""
        begun = time.monotonic()
        while time.monotonic() - begun < min(self.stops_in_s + MARGIN_S, 3.0):
            now = time.monotonic_ns()
            self.driver.apply(Command(stamp_ns=now, evidence_ns=now, emergency=1), now)
            self.driver.poll(now)
            time.sleep(0.005)

    def _publish(self, name, header, items):
        self._sequences[name] += 1
        header.sequence = self._sequences[name]
        self._ports[name].publish(header, items)


def bury(root, prefix):
    """Leaves nothing of a robot whose supervisor is gone, unless somebody runs it again."""
    try:
        with open(root + ".lock", "r+b") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(root, ignore_errors=True)
            for segment in glob.glob(f"/dev/shm/{glob.escape(prefix)}*"):
                os.remove(segment)
            os.remove(lock.name)
    except OSError:
        pass  # Somebody has it, or it is gone already.


def _is_done(turns, step):
    while (received := turns.receive()) is not None:
        if received[0].step == step and received[0].phase == TurnPhase.DONE:
            return True
    return False
