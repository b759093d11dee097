"""Hosts a behavior: feeds it from the bus, calls it on new input, and publishes its proposals."""

import json
import time
import traceback

from .behavior import Inputs, LaunchError, Setup
from .bus import items_of, message_class
from .call_log import CallLog
from .feed import Feed
from .lent import Lease
from .messages import DECISION_TOPIC, DecisionHeader, Kind, Outcome, OverlayHeader, PluginState, Proposal
from .overlay import Overlay
from .reporter import Calls

#: Number of exceptions after which a behavior is disabled.
MAX_EXCEPTIONS = 5


class BehaviorHost:
    """A running behavior with its inputs and outputs."""

    def __init__(self, plugin_class, launch, bus, reporter):
        settings = launch["role"]["behavior"]
        if settings["plugin"] != plugin_class.name:
            raise LaunchError(f"this program has no behavior `{settings['plugin']}`")
        self.calls = Calls()
        self.name = launch["name"]
        #: State from which a restarted instance continues: JSON, as bytes.
        self.saved_state = b""
        self._plugin_class, self._bus, self._reporter = plugin_class, bus, reporter
        self._priority = settings["priority"]
        self._period_ns, self._budget_ns = _to_ns(settings.get("period_ms")), _to_ns(settings.get("budget_ms"))
        own = [port.message for port in plugin_class.slots() + plugin_class.outputs()]
        self.slots = [(port["name"], port["topic"], message_class(port["message"], own)) for port in settings["inputs"]]
        for slot in plugin_class.slots():
            for name, _, message in self.slots:
                if name == slot.name and message is not slot.message:
                    raise LaunchError(f"input `{name}` carries `{message.NAME}`, but this program takes `{slot.message.NAME}`")
        ports = {port["name"]: bus.publisher(port["topic"], message_class(port["message"], own)) for port in settings["outputs"]}
        self._setup = Setup(
            name=launch["name"],
            parameters=settings["parameters"],
            robot=settings["robot"],
            sensors={port["name"]: port["sensor"] for port in settings["inputs"] if "sensor" in port},
            folder=settings["folder"],
            publish=lambda output, header, items: ports[output.name].publish(header, items),
            draw=self._draw,
        )
        #: What the behavior draws in this call: overlay, stamp and topic of the message.
        self._drawn = None
        self._overlays, self._overlay_sequence = bus.publisher(f"behaviors/{self.name}/overlay", OverlayHeader), 0
        self._is_watched = False
        self.behavior = plugin_class(self._setup)
        restored = launch.get("saved_state", "").encode()
        self._restore(restored)
        #: Log of the calls, from which a live run can be replayed.
        self.call_log = CallLog(bus, self.name, restored, launch.get("request", 0))
        self._feed = Feed(bus, self.slots)
        #: True if the behavior is not called while inhibited, and true if it is inhibited now.
        self.may_sleep, self.sleeps = settings.get("sleeps_while_inhibited", False), False
        self._decisions = bus.subscriber(DECISION_TOPIC, DecisionHeader) if self.may_sleep else None
        self._proposals = bus.publisher(settings["proposal"], Proposal)
        self._sequence, self._fresh, self._last_ns, self._survived = 0, False, None, False

    def state(self):
        """Returns the state of the plugin."""
        if self.behavior is None:
            return PluginState.FAILED
        return PluginState.SLEEPING if self.sleeps else PluginState.RUNNING

    def collect(self):
        """Receives new messages."""
        self._fresh |= self._feed.collect()
        while self._decisions and (received := self._decisions.receive()) is not None:
            verdicts = items_of(DecisionHeader, received[1])
            own = [verdict.outcome for verdict in verdicts if verdict.behavior == self.name]
            self.sleeps = own == [Outcome.INHIBITED]

    def next_call_ns(self):
        """Returns the time of the next periodic call; None if there is no period, while it sleeps, or if it is disabled."""
        if self._period_ns is None or self.behavior is None or self.sleeps:
            return None
        return 0 if self._last_ns is None else self._last_ns + self._period_ns

    def propose(self, now_ns, clock):
        """Calls the behavior if input is new or its period has passed, and publishes its proposal with the sending time `clock()`.

        After an exception nothing is published and the behavior is rebuilt; after five exceptions it is disabled.
        """
        due = self.next_call_ns()
        if self.behavior is None or self.sleeps or not (self._fresh or (due is not None and due <= now_ns)):
            return
        self._fresh, self._last_ns = False, now_ns
        evidence_ns = self._feed.evidence_ns()
        leases = []
        self._drawn, self._is_watched = None, self._overlays.is_watched()
        started = time.monotonic_ns()
        try:
            proposal = self._call(now_ns, leases)
        except Exception as error:
            proposal = None
            self._rebuild(error)
        finally:
            for lease in leases:
                lease.is_over = True
        self.calls.add(time.monotonic_ns() - started, self._budget_ns)
        if proposal is not None:
            self._survived = True
            self._publish(proposal, now_ns, now_ns if evidence_ns is None else evidence_ns, clock)
            self._publish_overlay()
        self.call_log.called(self._feed.inboxes, now_ns, 0 if proposal is None else self._sequence)

    def build(self, parameters):
        """Builds the behavior with other parameters while the current one keeps running. Raises the errors of its constructor."""
        setup = self._setup.with_parameters(parameters)
        return setup, self._plugin_class(setup)

    def has(self, parameters):
        """Returns true if the behavior runs with exactly these parameters."""
        return self.behavior is not None and self._setup.parameters == parameters

    def replace(self, candidate):
        """Replaces the behavior by a candidate of `build`, which continues from the saved state and receives the latest messages again."""
        try:
            self.saved_state = _saved_state(self.behavior) if self.behavior is not None else self.saved_state
        except Exception:
            # Keep the state saved after the last call.
            traceback.print_exc()
        self._setup, self.behavior = candidate
        self._restore(self.saved_state)
        self._feed = Feed(self._bus, self.slots)

    def _call(self, now_ns, leases):
        proposal = self.behavior.propose(Inputs(now_ns, self._feed.inputs(lambda slot: _lease(slot, leases))))
        if type(proposal) is not Proposal:
            raise TypeError(f"`propose` returned {type(proposal).__name__}, not drive, limit, halt or abstain")
        self.saved_state = _saved_state(self.behavior)
        return proposal

    def _publish(self, proposal, now_ns, evidence_ns, clock):
        self.calls.abstentions += proposal.kind == Kind.ABSTAIN
        self._sequence += 1
        proposal.behavior, proposal.sequence, proposal.priority = self.name, self._sequence, self._priority
        proposal.stamp_ns = proposal.stamp_ns or now_ns
        proposal.evidence_ns = proposal.evidence_ns or evidence_ns
        proposal.received_ns, proposal.proposed_ns = now_ns, clock()
        self._proposals.publish(proposal)

    def _draw(self, slot, header, function):
        if not self._is_watched:
            return
        topic = next((topic for name, topic, _ in self.slots if name == slot.name), "")
        message = (header.stamp_ns, topic)
        if self._drawn is None or self._drawn[1] != message:
            self._drawn = Overlay(), message
        function(self._drawn[0])

    def _publish_overlay(self):
        if self._drawn is not None:
            overlay, (stamp_ns, topic) = self._drawn
            self._overlay_sequence += 1
            self._overlays.publish(*overlay.message(stamp_ns, self._overlay_sequence, topic))

    def _rebuild(self, error):
        traceback.print_exc()
        self.calls.panics += 1
        self.behavior = None
        fate = f"is disabled after {MAX_EXCEPTIONS} exceptions"
        # If the first call failed, the saved state may be the cause: discard it.
        keeps_state, self._survived = self._survived, False
        if self.calls.panics < MAX_EXCEPTIONS:
            try:
                self.behavior = self._plugin_class(self._setup)
                self._restore(self.saved_state if keeps_state else b"")
                fate = "is rebuilt"
            except Exception:
                traceback.print_exc()
        where = traceback.extract_tb(error.__traceback__)[-1:]
        where = "".join(f" ({frame.name}, line {frame.lineno})" for frame in where)
        self._reporter.report_failure("", f"{type(error).__name__}: {error}{where}; the behavior {fate}")

    def _restore(self, state):
        """Restores the saved state of a new behavior, or discards the state if that fails."""
        if not state:
            return
        try:
            self.behavior.restore_state(json.loads(state))
        except Exception as error:
            traceback.print_exc()
            self._reporter.report_failure("", f"the saved state could not be restored ({type(error).__name__}: {error}) and is discarded")
            self.behavior = self._plugin_class(self._setup)


def _saved_state(behavior):
    state = behavior.save_state()
    return b"" if state is None else json.dumps(state, allow_nan=False).encode()


def _lease(slot, leases):
    lease = Lease(slot)
    leases.append(lease)
    return lease


def _to_ns(milliseconds):
    return None if milliseconds is None else int(milliseconds * 1e6)
