"""A wall-follower that fails when it is told to, by a word in a file, which it takes away; and that counts its calls."""

import os

from yamabico import SetupError, Word, main
from yamabico.examples.wall_follower import WallFollower


class Fragile(WallFollower):
    """Follows walls, and fails when it is told to."""

    name = "fragile"

    orders = Word("The file that tells how to fail: raise, exit, loop, keep, poison.", default="")
    kept = None
    calls = 0
    poison = False

    def __init__(self, setup):
        super().__init__(setup)
        if self.speed_mps == 1.0:
            raise SetupError("speed_mps", "too fast for one so fragile")

    def remember(self):
        return {"calls": self.calls, "poison": self.poison, **super().remember()}

    def recall(self, memory):
        super().recall(memory)
        self.calls = memory["calls"]
        if memory["poison"]:
            os._exit(7)

    def propose(self, inputs):
        self.calls += 1
        if self.poison:
            os._exit(7)
        order = self.taken()
        self.poison = order == "poison"
        if order == "raise":
            raise RuntimeError("as it was told")
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
        """The word in the file; empty where there is none."""
        try:
            with open(self.orders, encoding="utf-8") as file:
                word = file.read()
            os.remove(self.orders)
            return word
        except OSError:
            return ""


if __name__ == "__main__":
    main(Fragile)
