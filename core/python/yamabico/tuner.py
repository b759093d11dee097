"""Changes a behavior's parameters between two of its calls, in two steps, so that several behaviors change together or not at all."""

import time
import tomllib
import traceback

from .bus import items_of
from .messages import RETUNE_TOPIC, RETUNED_TOPIC, RetunedHeader, RetuneHeader, RetuneStep, Retuning
from .pulse import words_of


class Tuner:
    """Hears what parameters the behavior on `seat` is to get, and answers."""

    def __init__(self, seat, bus):
        self._seat, self._bus = seat, bus
        self._requests, self._answers = bus.subscriber(RETUNE_TOPIC, RetuneHeader), None
        self._request = self._candidate = None
        self._answered = 0

    def step(self):
        """Does what was asked of the behavior since the last call."""
        while (received := self._requests.receive()) is not None:
            header, sample = received
            if header.behavior != self._seat.name:
                continue
            steps = {RetuneStep.PREPARE: self._prepare, RetuneStep.APPLY: self._apply}
            if header.step not in steps:
                self._request = self._candidate = None
                continue
            try:
                outcome, key, words = steps[header.step](header.request, items_of(RetuneHeader, sample).decode()), "", ""
            except Exception as error:
                traceback.print_exc()
                outcome, key, words = Retuning.REFUSED, getattr(error, "key", ""), str(error) or type(error).__name__
            self._tell(header.request, outcome, key, words)

    def _prepare(self, request, text):
        self._request = self._candidate = None
        self._candidate = self._seat.build(tomllib.loads(text))
        self._request = request
        return Retuning.READY

    def _apply(self, request, text):
        candidate = self._candidate if self._request == request else None
        self._request = self._candidate = None
        if candidate is None:
            parameters = tomllib.loads(text)
            if self._seat.has(parameters):
                return Retuning.APPLIED
            candidate = self._seat.build(parameters)
        self._seat.replace(candidate)
        return Retuning.APPLIED

    def _tell(self, request, outcome, key, words):
        self._answers = self._answers or self._bus.publisher(RETUNED_TOPIC, RetunedHeader)
        self._answered += 1
        header = RetunedHeader(stamp_ns=time.monotonic_ns(), sequence=self._answered, request=request, outcome=outcome)
        header.behavior, header.key = self._seat.name, key
        self._answers.publish(header, words_of(words))
