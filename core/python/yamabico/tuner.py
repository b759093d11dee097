"""Changes a behavior's parameters between two of its calls, in two phases, so that several behaviors change together or not at all."""

import time
import tomllib
import traceback

from .bus import items_of
from .messages import RETUNE_TOPIC, RETUNED_TOPIC, RetunedHeader, RetuneHeader, RetuneOutcome, RetuneStep
from .reporter import text_bytes


class Tuner:
    """Serves parameter changes of the behavior in `host`."""

    def __init__(self, host, bus):
        self._host, self._bus = host, bus
        self._requests, self._responses = bus.subscriber(RETUNE_TOPIC, RetuneHeader), None
        self._request = self._candidate = None
        self._sequence = 0

    def step(self):
        """Executes the requests received since the last call."""
        while (received := self._requests.receive()) is not None:
            header, sample = received
            if header.behavior != self._host.name:
                continue
            steps = {RetuneStep.PREPARE: self._prepare, RetuneStep.APPLY: self._apply}
            if header.step not in steps:
                self._request = self._candidate = None
                continue
            try:
                outcome, key, problem = steps[header.step](header.request, items_of(RetuneHeader, sample).decode()), "", ""
            except Exception as error:
                traceback.print_exc()
                outcome, key, problem = RetuneOutcome.REFUSED, getattr(error, "key", ""), str(error) or type(error).__name__
            self._respond(header.request, outcome, key, problem)

    def _prepare(self, request, text):
        self._request = self._candidate = None
        self._candidate = self._host.build(tomllib.loads(text))
        self._request = request
        return RetuneOutcome.READY

    def _apply(self, request, text):
        candidate = self._candidate if self._request == request else None
        self._request = self._candidate = None
        if candidate is None:
            parameters = tomllib.loads(text)
            if self._host.has(parameters):
                return RetuneOutcome.APPLIED
            candidate = self._host.build(parameters)
        self._host.replace(candidate)
        self._host.call_log.retuned(request)
        return RetuneOutcome.APPLIED

    def _respond(self, request, outcome, key, problem):
        self._responses = self._responses or self._bus.publisher(RETUNED_TOPIC, RetunedHeader)
        self._sequence += 1
        header = RetunedHeader(stamp_ns=time.monotonic_ns(), sequence=self._sequence, request=request, outcome=outcome)
        header.behavior, header.key = self._host.name, key
        self._responses.publish(header, text_bytes(problem))
