"""A wall-follower that fails when it is told to: by a word in a file, which it takes away."""

import os

from yamabico import Word, main
from yamabico.examples.wall_follower import WallFollower


class Fragile(WallFollower):
    """Follows walls, and fails when it is told to."""

    name = "fragile"

    orders = Word("The file that tells how to fail: raise, exit, loop, keep.", default="")
    kept = None

    def propose(self, inputs):
        order = self.taken()
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
        return super().propose(inputs)

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
