"""Hosts a driver: publishes the measurements of its sensors and passes commands to its drive."""

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
    STEP_ANNOUNCEMENTS_TOPIC,
    Clock,
    Command,
    PluginState,
    Truth,
    StepSignal,
    StepPhase,
)

#: Maximum waiting time, and so the maximum delay with which a drive notices missing commands, s.
MAX_WAIT_S = 0.01
#: Margin added to the stopping time of the drive, s.
STOP_MARGIN_S = 0.2


class DeviceHost:
    """A running driver with its inputs and outputs."""

    def __init__(self, plugin_class, launch, bus):
        settings = launch["role"]["device"]
        spec = settings["spec"]
        if settings["driver"] != plugin_class.name:
            raise ValueError(f"this program has no driver `{settings['driver']}`")
        self.stopping_time_s = settings["stopping_time_s"]
        own = [kind.message for kind in plugin_class.sensors]
        self._ports = {port["name"]: bus.publisher(port["topic"], message_class(port["message"], own)) for port in settings["outputs"]}
        self._ports[TRUTH_TOPIC] = bus.publisher(TRUTH_TOPIC, Truth)
        self._sequences = dict.fromkeys(self._ports, 0)
        drive = spec.get("drive")
        drives = {kind.kind: kind for kind in plugin_class.drives}
        self.driver = plugin_class(
            DeviceSetup(
                name=spec["name"],
                parameters=spec["table"],
                sensors=[plugin_class.sensor(sensor["name"], sensor["kind"], sensor["table"]) for sensor in spec["sensors"]],
                drive=drives[drive["kind"]](drive["table"]) if drive else None,
                robot=spec["robot"],
                folder=spec["folder"],
                seed=int(spec["seed"]),
                step_ns=round(settings["step_ms"] * 1e6),
                publish=self._publish,
            )
        )
        self._commands = bus.subscriber(COMMAND_TOPIC, Command)

    def run(self, wait_set, reporter, is_running):
        """Runs on the machine's clock until the end."""
        while is_running():
            reporter.heartbeat(PluginState.RUNNING)
            now = time.monotonic_ns()
            due = self.driver.poll(now)
            self.drive(now)
            wait_s = MAX_WAIT_S if due is None else min((due - time.monotonic_ns()) * 1e-9, MAX_WAIT_S)
            if wait_s > 0:
                wait_set.wait(wait_s)

    def open_clock(self, bus):
        """Opens the topics that a driver with its own clock needs."""
        self._clock, self._announced = bus.publisher(CLOCK_TOPIC, Clock), bus.subscriber(STEP_ANNOUNCEMENTS_TOPIC, StepSignal)
        self._wait_set = bus.wait_set([STEP_ANNOUNCEMENTS_TOPIC])

    def run_in_steps(self, reporter, is_running):
        """Runs on the driver's own clock, at the driver's pace, until the end."""
        step, step_ns, pace = 0, self.driver.setup.step_ns, self.driver.pace
        begun = time.monotonic_ns()
        while is_running():
            now = step * step_ns
            self.driver.poll(now)
            self._clock.publish(Clock(stamp_ns=now, step=step))
            while not _is_done(self._announced, step) and is_running():
                reporter.heartbeat(PluginState.RUNNING)
                self._wait_set.wait(min(0.05, reporter.period_s))
            self.drive(now)
            step += 1
            while pace and is_running() and (ahead_s := (step * step_ns / pace - (time.monotonic_ns() - begun)) * 1e-9) > 0:
                reporter.heartbeat(PluginState.RUNNING)
                time.sleep(min(ahead_s, reporter.period_s))

    def drive(self, now_ns):
        """Passes the newest command since the last call, or None, to the drive."""
        newest = None
        while (received := self._commands.receive()) is not None:
            newest = received[0]
        self.driver.apply(newest, now_ns)

    def brake(self):
        """Stops the robot after its arbiter has died."""
        begun = time.monotonic()
        while time.monotonic() - begun < min(self.stopping_time_s + STOP_MARGIN_S, 3.0):
            now = time.monotonic_ns()
            self.driver.apply(Command(stamp_ns=now, evidence_ns=now, emergency=1), now)
            self.driver.poll(now)
            time.sleep(0.005)

    def _publish(self, name, header, items):
        self._sequences[name] += 1
        header.sequence = self._sequences[name]
        self._ports[name].publish(header, items)


def remove_shared_memory(root, prefix):
    """Removes the files and shared memory of a robot whose supervisor has died, unless the robot is running again."""
    try:
        with open(root + ".lock", "r+b") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(root, ignore_errors=True)
            for segment in glob.glob(f"/dev/shm/{glob.escape(prefix)}*"):
                os.remove(segment)
            os.remove(lock.name)
    except OSError:
        pass  # The robot is running again, or its files are gone already.


def _is_done(announced, step):
    while (received := announced.receive()) is not None:
        if received[0].step == step and received[0].phase == StepPhase.DONE:
            return True
    return False
