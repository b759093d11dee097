"""Log of the calls of one behavior in a live run, from which the run can be replayed."""

from .messages import CallEvent, CallHeader, CallInput

#: Maximum number of inputs in one record; a call with more cannot be replayed.
MAX_CALL_INPUTS = 256


class CallLog:
    """Publishes what each call was handed, after the call."""

    def __init__(self, bus, name, saved_state, request):
        self._publisher = bus.publisher(f"replay/behaviors/{name}", CallHeader)
        self._name = name
        self._sequence = 0
        #: Key of the newest message of each slot that has been logged.
        self._newest = {}
        #: Events since the last call.
        self._pending = [CallHeader(event=CallEvent.START, state=state_hash(saved_state), request=request)]

    def retuned(self, request):
        """Notes that the behavior was replaced by one with the parameters of `request`; its slots are open anew."""
        self._newest = {}
        self._pending.append(CallHeader(event=CallEvent.RETUNE, request=request))

    def called(self, inboxes, now_ns, proposal):
        """Logs a call at `now_ns` that led to the proposal with this sequence number."""
        for event in self._pending:
            self._publish(event, now_ns, [])
        self._pending = []
        inputs = [entry for slot, inbox in enumerate(inboxes) for entry in self._handed(slot, inbox)]
        left_out = max(len(inputs) - MAX_CALL_INPUTS, 0)
        self._publish(CallHeader(event=CallEvent.CALL, proposal=proposal, left_out=left_out), now_ns, inputs[:MAX_CALL_INPUTS])

    def _handed(self, slot, inbox):
        """Returns the messages of an inbox that the call was handed for the first time."""
        keys, fresh = inbox.keys(), inbox.fresh
        newest = keys[-1] if keys else None
        # Without a fresh message, the newest may still have arrived since the last call.
        count = fresh if fresh else int(newest != self._newest.get(slot))
        self._newest[slot] = newest
        return [
            CallInput(slot=slot, fresh=int(fresh > 0), sequence=sequence, stamp_ns=stamp_ns)
            for sequence, stamp_ns in keys[len(keys) - count :]
        ]

    def _publish(self, header, now_ns, inputs):
        self._sequence += 1
        header.stamp_ns, header.sequence, header.behavior = now_ns, self._sequence, self._name
        self._publisher.publish(header, (CallInput * len(inputs))(*inputs) if inputs else b"")


def state_hash(state):
    """Returns the hash of a saved state, bytes: 64-bit FNV-1a, zero for an empty state."""
    if not state:
        return 0
    value = 0xCBF29CE484222325
    for byte in state:
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value
