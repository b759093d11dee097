"""Runs to compare: who drives, in which task, on which floor, from which seed; and the file of their results."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from .scenario import FLOORS

#: What drives: Yamabico with a map and without one, the script with OpenCV, and a script that sees the truth.
CONTROLLERS = ("map", "unmapped", "opencv", "truth")


@dataclass(frozen=True)
class Job:
    """One run. `style` is the seed of the textures."""

    controller: str
    task: str
    floor: str
    seed: int
    style: int

    def __str__(self) -> str:
        return f"{self.controller}-{self.task}-{self.floor}-{self.seed}"

    def result(self, outcome: str, problem: str = "") -> dict:
        """Returns the result of a run that ended without a score."""
        return {**asdict(self), "outcome": outcome, "contact": None, "passive": False, "problem": problem}


def jobs(controllers: list[str], tasks: list[str], floors: list[str], seeds: list[int], styles: list[int]) -> list[Job]:
    """Returns a job for each combination, seed by seed. Each seed sees every floor in another style."""
    return [
        Job(controller, task, floor, seed, styles[(seed + FLOORS.index(floor)) % len(styles)])
        for seed in seeds
        for task in tasks
        for floor in floors
        for controller in controllers
    ]


class Results:
    """Results in a file, one JSON object per line, to which each run is appended when it has ended."""

    def __init__(self, path: Path):
        self.path = path
        self.runs: list[dict] = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
        self._done = {self._key(run) for run in self.runs}

    def has(self, job: Job) -> bool:
        """Returns true if the job has run."""
        return self._key(asdict(job)) in self._done

    def add(self, run: dict) -> None:
        """Appends the result of a run."""
        self.runs.append(run)
        self._done.add(self._key(run))
        with self.path.open("a") as file:
            file.write(json.dumps(run) + "\n")

    @staticmethod
    def _key(run: dict) -> tuple:
        return tuple(run[key] for key in ("controller", "task", "floor", "seed", "style"))
