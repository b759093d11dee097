"""Reports of a plugin to the supervisor: heartbeats, call statistics, failures and saved state."""

import ctypes
import time
from collections import Counter

from .messages import (
    CALLS_TOPIC,
    FAILURES_TOPIC,
    HEARTBEATS_TOPIC,
    SAVED_STATES_TOPIC,
    CallBucket,
    CallsHeader,
    FailureHeader,
    Heartbeat,
    SavedStateHeader,
)

#: Time between two reports of call statistics, ns.
CALLS_PERIOD_NS = 500_000_000
#: Maximum size of an error text, bytes.
MAX_FAILURE_TEXT_BYTES = 2048
#: Maximum size of a saved state, bytes.
MAX_SAVED_STATE_BYTES = 16 * 1024
#: Number of buckets of the histogram of call durations.
MAX_BUCKETS = 32 * 40


class Calls:
    """Statistics of the calls of a behavior."""

    def __init__(self):
        self.buckets = Counter()
        self.longest_ns = self.overruns = self.abstentions = self.panics = 0

    def add(self, duration_ns, budget_ns):
        """Adds one call."""
        self.buckets[bucket_of(duration_ns)] += 1
        self.longest_ns = max(self.longest_ns, duration_ns)
        self.overruns += budget_ns is not None and duration_ns > budget_ns


class PluginReporter:
    """Publishes the reports of one plugin."""

    def __init__(self, bus, name, restarts, period_ms):
        self._bus = bus
        self._name = name
        self._restarts = restarts
        #: Time between two heartbeats, s.
        self.period_s = period_ms * 1e-3
        self._heartbeats = bus.publisher(HEARTBEATS_TOPIC, Heartbeat)
        self._calls = self._failures = self._saved_states = None
        self._saved_state = b""
        self._heartbeat_at, self._state = 0, None
        self._sequences = Counter()
        self._calls_at = time.monotonic_ns()

    def heartbeat(self, state):
        """Publishes a heartbeat if one is due or if `state` has changed."""
        now = time.monotonic_ns()
        if state == self._state and now - self._heartbeat_at < self.period_s * 1e9:
            return
        self._heartbeat_at, self._state = now, state
        header = Heartbeat(stamp_ns=now, sequence=self._next(Heartbeat), state=state, restarts=self._restarts)
        header.plugin = self._name
        self._heartbeats.publish(header)

    def report_failure(self, key, problem):
        """Publishes a failure; `key` is the parameter to change, if any."""
        self._failures = self._failures or self._bus.publisher(FAILURES_TOPIC, FailureHeader)
        header = FailureHeader(stamp_ns=time.monotonic_ns(), sequence=self._next(FailureHeader))
        header.plugin, header.key = self._name, key
        self._failures.publish(header, text_bytes(problem))

    def report_calls(self, calls):
        """Publishes the call statistics if they are due."""
        if time.monotonic_ns() - self._calls_at >= CALLS_PERIOD_NS:
            self.report_final_calls(calls)

    def report_final_calls(self, calls):
        """Publishes the call statistics."""
        self._calls_at = time.monotonic_ns()
        self._calls = self._calls or self._bus.publisher(CALLS_TOPIC, CallsHeader)
        header = CallsHeader(
            stamp_ns=self._calls_at,
            sequence=self._next(CallsHeader),
            longest_ns=calls.longest_ns,
            overruns=calls.overruns,
            abstentions=calls.abstentions,
            panics=calls.panics,
            restarts=self._restarts,
        )
        header.plugin = self._name
        buckets = [CallBucket(index=index, calls=count) for index, count in sorted(calls.buckets.items())]
        self._calls.publish(header, (CallBucket * len(buckets))(*buckets) if buckets else b"")

    def report_saved_state(self, state):
        """Publishes the saved state of a behavior if it has changed and is not longer than `MAX_SAVED_STATE_BYTES`."""
        if state == self._saved_state or len(state) > MAX_SAVED_STATE_BYTES:
            return
        self._saved_state = state
        self._saved_states = self._saved_states or self._bus.publisher(SAVED_STATES_TOPIC, SavedStateHeader)
        header = SavedStateHeader(stamp_ns=time.monotonic_ns(), sequence=self._next(SavedStateHeader))
        header.plugin = self._name
        self._saved_states.publish(header, state)

    def _next(self, message):
        self._sequences[message] += 1
        return self._sequences[message]


def text_bytes(text):
    """Returns a text as UTF-8, truncated to the maximum size of an error text."""
    return text.encode()[:MAX_FAILURE_TEXT_BYTES].decode(errors="ignore").encode()


def bucket_of(duration_ns):
    """Returns the index of a call's histogram bucket: below 32, the duration in ns; above, 32 equal steps per doubling."""
    if duration_ns < 32:
        return duration_ns
    octave = duration_ns.bit_length() - 6
    return min((octave + 1) * 32 + ((duration_ns >> octave) - 32), MAX_BUCKETS - 1)


assert ctypes.sizeof(CallBucket) == 8
