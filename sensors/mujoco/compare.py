"""Compares controllers in the hallway: Yamabico with a map and without one, a script with OpenCV, and one that sees the truth.

    python sensors/mujoco/compare.py --seeds 1-4 --controllers map,unmapped,opencv --jobs 2

Each run is appended to OUT/results.jsonl; the same command later makes only the runs that are missing. Prints one table at the end.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from pathlib import Path

# Yamabico starts the driver with the `python3` that comes first: this one.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])

from hall import table, yamabico_run  # noqa: E402
from hall.job import CONTROLLERS, Job, Results, jobs  # noqa: E402
from hall.scenario import FLOORS, TASKS  # noqa: E402

HERE = Path(__file__).resolve().parent
SCRIPTS = {"opencv": yamabico_run.REPOSITORY / "tests/peers/hallway_driver.py", "truth": HERE / "hall/truth_driver.py"}


def numbers(text: str) -> list[int]:
    """Parses numbers and ranges, such as `1-4,7`."""
    found: list[int] = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def choice(known: tuple[str, ...]):
    """Returns a parser of a list of `known` words."""

    def words(text: str) -> list[str]:
        found = text.split(",")
        if unknown := [word for word in found if word not in known]:
            raise argparse.ArgumentTypeError(f"`{unknown[0]}` is none of {', '.join(known)}")
        return found

    return words


def arguments() -> argparse.Namespace:
    """Parses the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--controllers", type=choice(CONTROLLERS), default=["map", "unmapped", "opencv"], help=", ".join(CONTROLLERS))
    parser.add_argument("--tasks", type=choice(TASKS), default=list(TASKS), help=", ".join(TASKS))
    parser.add_argument("--floors", type=choice(FLOORS), default=list(FLOORS), help=", ".join(FLOORS))
    parser.add_argument("--seeds", type=numbers, default=numbers("1-4"), help="such as 1-4,7: boxes, person, start, noise")
    parser.add_argument("--styles", type=numbers, default=numbers("1-4"), help="seeds of the textures")
    parser.add_argument("--out", type=Path, default=Path("out/mujoco"), help="folder of results, and of recordings of failed runs")
    parser.add_argument("--bin", default="target/release/yamabico", help="the program `yamabico`")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="change a key of Yamabico's tasks; results go to a folder of their own (--out)"
    )
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time; a run of Yamabico takes two cores")
    parser.add_argument("--until", type=float, default=float("inf"), metavar="MINUTES", help="time after which no run begins")
    return parser.parse_args()


def run(job: Job, options: argparse.Namespace) -> dict:
    """Runs a job and returns its result."""
    if job.controller in yamabico_run.TASK_FILES:
        return yamabico_run.run(job, options.bin, options.out / "runs" / str(job), options.set)
    command = [sys.executable, "-m", "hall.script_run", json.dumps(asdict(job)), str(SCRIPTS[job.controller])]
    ran = subprocess.run(command, cwd=HERE, capture_output=True, text=True, check=False)
    return json.loads(ran.stdout.splitlines()[-1]) if ran.returncode == 0 else job.result("error", ran.stderr[-400:])


def main() -> None:
    """Makes the runs that are missing and prints the table of those that were asked for."""
    options = arguments()
    if shutil.which(options.bin) is None and any(name in yamabico_run.TASK_FILES for name in options.controllers):
        sys.exit(f"there is no program `{options.bin}`: cargo build --release, or name it with --bin")
    options.out.mkdir(parents=True, exist_ok=True)
    results, begun = Results(options.out / "results.jsonl"), time.monotonic()
    wanted = jobs(options.controllers, options.tasks, options.floors, options.seeds, options.styles)

    def run_in_time(job: Job) -> dict | None:
        return run(job, options) if time.monotonic() - begun < 60 * options.until else None

    with ThreadPoolExecutor(options.jobs) as pool:
        runs = [pool.submit(run_in_time, job) for job in wanted if not results.has(job)]
        for ran in (future.result() for future in as_completed(runs)):
            if ran is not None:
                results.add(ran)
                print(table.line(ran), flush=True)
    keys = {(job.controller, job.task, job.floor, job.seed, job.style) for job in wanted}
    made = [run for run in results.runs if (run["controller"], run["task"], run["floor"], run["seed"], run["style"]) in keys]
    print(f"\n{len(made)} of {len(wanted)} runs\n\n{table.markdown(made)}")


if __name__ == "__main__":
    main()
