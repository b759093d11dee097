"""A wall-follower that fails on request, by a word in a file, which it removes; it also counts its calls."""

import os

from yamabico import SetupError, Word, main
from yamabico.examples.wall_follower import WallFollower


class Fragile(WallFollower):
    """Follows walls, and fails on request."""

    name = "fragile"

    orders = Word("File with the kind of failure: raise, exit, loop, keep, poison.", default="")
    kept = None
    calls = 0
    poison = False

    def __init__(self, setup):
        super().__init__(setup)
        if self.speed_mps == 1.0:
            raise SetupError("speed_mps", "must be below 1 m/s")

    def save_state(self):
        return {"calls": self.calls, "poison": self.poison, **super().save_state()}

    def restore_state(self, state):
        super().restore_state(state)
        self.calls = state["calls"]
        if state["poison"]:
            os._exit(7)

    def propose(self, inputs):
        self.calls += 1
        if self.poison:
            os._exit(7)
        order = self.taken()
        self.poison = order == "poison"
        if order == "raise":
            raise RuntimeError("as requested")
        if order == "exit":
            os._exit(7)
        while order == "loop":
            pass
        if self.kept is not None:
            self.kept.sum()
        if order == "keep":
            self.kept = inputs[self.camera].latest.pixels[10:20]
        proposal = super().propose(inputs)
        proposal.note = f"call {self.calls}"
        return proposal

    def taken(self):
        """Returns the word in the file, and removes it; empty if there is no file."""
        try:
            with open(self.orders, encoding="utf-8") as file:
                word = file.read()
            os.remove(self.orders)
            return word
        except OSError:
            return ""


if __name__ == "__main__":
    main(Fragile)
