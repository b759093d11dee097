"""Input messages of one behavior, slot by slot."""

from collections import deque

from .behavior import Input, View
from .bus import STREAM_DEPTH, items_of
from .messages import DecisionHeader, FrameHeader, Goal


class Inbox:
    """Messages of one slot: those of the last `collect`, or the newest one if none has arrived since."""

    def __init__(self, slot, subscriber):
        self.slot = slot
        self._subscriber = subscriber
        self.message = subscriber.message
        self._latest = subscriber.message.CHANNEL == "latest"
        self._held = deque(maxlen=1 if self._latest else STREAM_DEPTH)
        self._fresh = 0
        self._lost = 0
        self._last = None

    def collect(self):
        """Receives new messages, which replace the old ones. Returns true if any arrived."""
        self._fresh = 0
        while (received := self._subscriber.receive()) is not None:
            if self._fresh == 0:
                self._held.clear()
            header, sample = received
            # Frames stay in shared memory; other messages are small and copied.
            is_frame = type(header) is FrameHeader
            self._held.append((header, sample if is_frame else items_of(type(header), sample)))
            self._fresh = min(self._fresh + 1, self._held.maxlen)
            self._count(header)
            del sample, received
        return self._fresh > 0

    @property
    def fresh(self):
        """Number of messages of the last `collect`."""
        return self._fresh

    def keys(self):
        """Returns sequence number and stamp of each message at hand, oldest first."""
        return [(sequence_of(header), getattr(header, "stamp_ns", 0)) for header, _ in self._held]

    def newest(self):
        """Returns the newest header, or None if no message has arrived."""
        return self._held[-1][0] if self._held else None

    def input(self, lease):
        """Returns the `Input` for the behavior; `lease` guards the pixels of frames."""
        lost, self._lost = self._lost, 0
        return Input([self._view(header, rest, lease) for header, rest in self._held], self._fresh, lost)

    def _view(self, header, rest, lease):
        if type(header) is FrameHeader:
            from .lent import lend, pixels_of

            def pixels():
                lease.check()
                data = lend(rest.payload_ptr, rest.payload().len(), rest, lease)
                return pixels_of(header, data)

            return View(header, pixels=pixels)
        return View(header, rest)

    def _count(self, header):
        sequence = sequence_of(header)
        if not self._latest and self._last is not None:
            self._lost += max(sequence - self._last - 1, 0)
        self._last = sequence


def sequence_of(header):
    """Returns the sequence number of a message; zero if it has none."""
    return getattr(header, "sequence", 0)


class Feed:
    """Slots of one behavior."""

    def __init__(self, bus, slots):
        """Subscribes to `slots`: name, topic and message class of each."""
        self._inboxes = [Inbox(name, bus.subscriber(topic, message)) for name, topic, message in slots]

    def collect(self):
        """Receives new messages. Returns true if any arrived other than a decision of the arbiter, which calls no behavior."""
        return any([inbox.collect() and inbox.message is not DecisionHeader for inbox in self._inboxes])

    def inputs(self, lease_of):
        """Returns the `Input` of each slot by name; `lease_of(slot)` guards the pixels of frames."""
        return {inbox.slot: inbox.input(lease_of(inbox.slot)) for inbox in self._inboxes}

    @property
    def inboxes(self):
        """Inboxes in the order of the connected slots."""
        return self._inboxes

    def evidence_ns(self):
        """Returns the oldest evidence stamp among the newest messages of all slots, or None if none has arrived."""
        newest = [header for header in (inbox.newest() for inbox in self._inboxes) if header is not None]
        stamps = [getattr(header, "evidence_ns", header.stamp_ns) for header in newest if type(header) not in (Goal, DecisionHeader)]
        return min(stamps, default=None)
