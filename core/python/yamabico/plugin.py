"""The main function of a plugin's process: a program calls `main(MyBehavior)`.

The supervisor starts the process, sends it the launch configuration on standard input, monitors its heartbeat and restarts it.
With the single argument `--describe` the program prints its description as JSON and exits.
"""

import importlib
import json
import os
import signal
import sys
import time
import tomllib
import traceback

from .behavior import LaunchError
from .messages import (
    COMMAND_TOPIC,
    DECISION_TOPIC,
    PROTOCOL,
    STEP_ACKNOWLEDGMENTS_TOPIC,
    STEP_ANNOUNCEMENTS_TOPIC,
    Command,
    PluginState,
    StepSignal,
    StepPhase,
)

#: Exit code of a plugin that cannot start.
EXIT_CANNOT_START = 2
#: Maximum waiting time, and so the maximum delay at the end of the run, s.
MAX_WAIT_S = 0.05


def main(plugin_class):
    """Runs the program of the behavior or driver class `plugin_class`. Does not return."""
    if sys.argv[1:2] == ["--describe"]:
        print(json.dumps(plugin_class.description(PROTOCOL), indent=2))
        sys.exit(0)
    if sys.argv[1:2] == ["--sensor"]:
        print(json.dumps(plugin_class.answer(json.load(sys.stdin)), indent=2))
        sys.exit(0)
    serve(plugin_class)


class Lifetime:
    """Decides when the process ends: on SIGTERM, or when its supervisor dies."""

    def __init__(self):
        self.is_over = self.is_orphan = False
        self._parent = os.getppid()
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, self._end)
        signal.signal(signal.SIGHUP, self._orphan)

    def is_running(self):
        """Returns true until SIGTERM arrives or the supervisor dies."""
        if os.getppid() != self._parent:
            self._orphan()
        return not self.is_over

    def _end(self, *_):
        self.is_over = True

    def _orphan(self, *_):
        self.is_over = self.is_orphan = True


def serve(plugin_class):
    """Runs the plugin of the launch configuration on standard input until SIGTERM. Does not return."""
    lifetime = Lifetime()
    reporter = None
    try:
        # Import before reading: a restarted plugin starts up while the supervisor still cleans up after the old one.
        for module in ("behavior_host", "bus", "feed", "lent", "reporter", "tuner"):
            importlib.import_module(f".{module}", __package__)
        launch = tomllib.loads(sys.stdin.read())
        if launch["protocol"] != PROTOCOL:
            raise LaunchError(
                f"the launch configuration has protocol {launch['protocol']}, but this package has {PROTOCOL}: "
                "install the version of this package that belongs to the robot"
            )
        from .bus import Bus
        from .reporter import PluginReporter

        bus = Bus(launch["bus_root"], launch["bus_prefix"])
        reporter = PluginReporter(bus, launch["name"], launch["restarts"], launch["heartbeat_ms"])
        run = _run_behavior if "behavior" in launch["role"] else _run_device
        run(plugin_class, launch, bus, reporter, lifetime)
    except Exception as error:
        traceback.print_exc()
        if reporter is not None:
            reporter.report_failure(getattr(error, "key", ""), str(error) or type(error).__name__)
        _end(EXIT_CANNOT_START)
    _end(0)


def wait_to_begin(launch, bus, reporter, lifetime):
    """Reports that all ports are open, and waits for the first command if the launch configuration requires it."""
    if launch["start"] == "immediately":
        reporter.heartbeat(PluginState.STARTING)
        return
    commands, wait_set = bus.subscriber(COMMAND_TOPIC, Command), bus.wait_set([COMMAND_TOPIC])
    while commands.receive() is None and lifetime.is_running():
        reporter.heartbeat(PluginState.STARTING)
        wait_set.wait(reporter.period_s)


def _end(code):
    # Exit without closing ports: other processes can read the last messages until the supervisor cleans up.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _run_behavior(plugin_class, launch, bus, reporter, lifetime):
    from .behavior_host import BehaviorHost
    from .tuner import Tuner

    host = BehaviorHost(plugin_class, launch, bus, reporter)
    tuner = Tuner(host, bus)
    max_wait_s = min(MAX_WAIT_S, reporter.period_s)
    if launch.get("clock") == "driver":
        _run_in_steps(host, tuner, launch, bus, reporter, lifetime, max_wait_s)
        return
    wait_set = bus.wait_set([topic for _, topic, _ in host.slots if topic != DECISION_TOPIC] + ([DECISION_TOPIC] if host.may_sleep else []))
    wait_to_begin(launch, bus, reporter, lifetime)
    while lifetime.is_running():
        tuner.step()
        reporter.heartbeat(host.state())
        host.collect()
        host.propose(time.monotonic_ns(), time.monotonic_ns)
        reporter.report_saved_state(host.saved_state)
        reporter.report_calls(host.calls)
        due = host.next_call_ns()
        wait_s = max_wait_s if due is None else min((due - time.monotonic_ns()) * 1e-9, max_wait_s)
        if wait_s > 0:
            wait_set.wait(wait_s)
    reporter.report_final_calls(host.calls)


def _run_in_steps(host, tuner, launch, bus, reporter, lifetime, max_wait_s):
    announced = bus.subscriber(STEP_ANNOUNCEMENTS_TOPIC, StepSignal)
    acknowledged = bus.publisher(STEP_ACKNOWLEDGMENTS_TOPIC, StepSignal)
    wait_set, sequence = bus.wait_set([STEP_ANNOUNCEMENTS_TOPIC]), 0
    wait_to_begin(launch, bus, reporter, lifetime)
    while lifetime.is_running():
        tuner.step()
        reporter.heartbeat(host.state())
        while (received := announced.receive()) is not None:
            step = received[0]
            if step.phase == StepPhase.COLLECT:
                host.collect()
            elif step.phase == StepPhase.PROPOSE:
                host.propose(step.stamp_ns, lambda: step.stamp_ns)
                # Before the acknowledgment, so that the state of a step is known at its end.
                reporter.report_saved_state(host.saved_state)
            else:
                continue
            sequence += 1
            step.plugin, step.sequence = launch["name"], sequence
            acknowledged.publish(step)
        reporter.report_calls(host.calls)
        wait_set.wait(max_wait_s)
    reporter.report_final_calls(host.calls)


def _run_device(plugin_class, launch, bus, reporter, lifetime):
    from .device_host import DeviceHost, remove_shared_memory

    host = DeviceHost(plugin_class, launch, bus)
    wait_set = bus.wait_set([COMMAND_TOPIC])
    owns_clock = launch.get("clock") == "driver"
    if owns_clock:
        host.open_clock(bus)
    wait_to_begin(launch, bus, reporter, lifetime)
    if owns_clock:
        host.run_in_steps(reporter, lifetime.is_running)
    else:
        host.run(wait_set, reporter, lifetime.is_running)
    if lifetime.is_orphan:
        host.brake()
        remove_shared_memory(launch["bus_root"], launch["bus_prefix"])
