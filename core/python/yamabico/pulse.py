"""How a plugin tells the supervisor that it is alive, how it fares, and what is wrong."""

import ctypes
import time
from collections import Counter

from .messages import (
    CALLS_TOPIC,
    FAILURES_TOPIC,
    HEARTBEATS_TOPIC,
    MEMORIES_TOPIC,
    CallBucket,
    CallsHeader,
    FailureHeader,
    Heartbeat,
    MemoryHeader,
)

CALLS_EVERY_NS = 500_000_000
#: Longest reason of a failure, bytes.
MAX_WORDS = 2048
#: Longest memory of a behavior, bytes.
MAX_MEMORY = 16 * 1024
MAX_BUCKETS = 32 * 40


class Calls:
    """How the calls of a behavior went."""

    def __init__(self):
        self.buckets = Counter()
        self.longest_ns = self.overruns = self.abstentions = self.panics = 0

    def add(self, took_ns, budget_ns):
        """Takes one call in."""
        self.buckets[bucket_of(took_ns)] += 1
        self.longest_ns = max(self.longest_ns, took_ns)
        self.overruns += budget_ns is not None and took_ns > budget_ns


class Pulse:
    """The pulse of one plugin."""

    def __init__(self, bus, name, restarts, every_ms):
        self._bus = bus
        self._name = name
        self._restarts = restarts
        self.every_s = every_ms * 1e-3
        self._beats = bus.publisher(HEARTBEATS_TOPIC, Heartbeat)
        self._calls = self._failures = self._memories = None
        self._memory = b""
        self._beat_at, self._state = 0, None
        self._sequences = Counter()
        self._calls_at = time.monotonic_ns()

    def beat(self, state):
        """Beats where it is time to, or where `state` is another one than before."""
        now = time.monotonic_ns()
        if state == self._state and now - self._beat_at < self.every_s * 1e9:
            return
        self._beat_at, self._state = now, state
        beat = Heartbeat(stamp_ns=now, sequence=self._next(Heartbeat), state=state, restarts=self._restarts)
        beat.plugin = self._name
        self._beats.publish(beat)

    def fail(self, key, words):
        """Tells that the plugin failed, and why; `key` is that of its table to change."""
        self._failures = self._failures or self._bus.publisher(FAILURES_TOPIC, FailureHeader)
        header = FailureHeader(stamp_ns=time.monotonic_ns(), sequence=self._next(FailureHeader))
        header.plugin, header.key = self._name, key
        self._failures.publish(header, words_of(words))

    def tell_calls(self, calls):
        """Tells how the calls went, where it is time to."""
        if time.monotonic_ns() - self._calls_at >= CALLS_EVERY_NS:
            self.tell_last_calls(calls)

    def tell_last_calls(self, calls):
        """Tells how the calls went."""
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

    def tell_memory(self, memory):
        """Tells what a successor must know, where that is something new; what is longer than `MAX_MEMORY` is not told."""
        if memory == self._memory or len(memory) > MAX_MEMORY:
            return
        self._memory = memory
        self._memories = self._memories or self._bus.publisher(MEMORIES_TOPIC, MemoryHeader)
        header = MemoryHeader(stamp_ns=time.monotonic_ns(), sequence=self._next(MemoryHeader))
        header.plugin = self._name
        self._memories.publish(header, memory)

    def _next(self, message):
        self._sequences[message] += 1
        return self._sequences[message]


def words_of(text):
    """A text as bytes, cut to what a message takes."""
    return text.encode()[:MAX_WORDS].decode(errors="ignore").encode()


def bucket_of(nanos):
    """Which bucket of the scale: below 32 so many ns; above, 32 equal steps to each doubling."""
    if nanos < 32:
        return nanos
    octave = nanos.bit_length() - 6
    return min((octave + 1) * 32 + ((nanos >> octave) - 32), MAX_BUCKETS - 1)


assert ctypes.sizeof(CallBucket) == 8
