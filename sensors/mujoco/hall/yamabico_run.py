"""One run of Yamabico in the hallway, as processes of its own."""

import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

from .job import Job
from .scenario import DURATION_S

#: Folder of the repository.
REPOSITORY = Path(__file__).resolve().parents[3]
TASK_FILES = {"map": "mujoco-hall.toml", "unmapped": "mujoco-hall-unmapped.toml"}
#: Tasks with a person, who comes from a crossing.
CROSSING_TASKS = ("person", "full")
#: Behaviors with a map, and those of each task.
MAPPED = ("stationary-obstacle-avoider", "map-localizer")
UNMAPPED = ("sonar-halt", "stuck-recovery", "stationary-obstacle-avoider", "wall-follower")
BEHAVIORS = {"map": (*UNMAPPED, "map-localizer"), "unmapped": UNMAPPED}
#: Time after which a run is given up: a busy machine takes its time.
TIMEOUT_S = 1800.0
#: Time that a run has to stop.
STOP_S = 20.0
POLL_S = 0.05


def settings(job: Job, result: Path) -> list[str]:
    """Returns the changes of the task for a job that writes its score to `result`."""
    device = {"task": job.task, "floor": job.floor, "result": str(result)}
    changes = [f"robot.devices.hall.{key}={json.dumps(value)}" for key, value in device.items()]
    changes.append(f"robot.devices.hall.style={job.style}")
    # The world ends the run, not the task.
    changes.append(f"run.duration_s={DURATION_S + 10}")
    # Each step waits for every behavior, however busy the machine is.
    changes += [f"behaviors.{behavior}.deadline_ms=60000" for behavior in BEHAVIORS[job.controller]]
    # A name of its own lets several robots drive on one machine.
    changes.append(f'robot.name="hall-{os.getpid()}-{abs(hash(job)) % 10**6}"')
    if job.controller == "map" and job.task in CROSSING_TASKS:
        map_file = json.dumps(str(REPOSITORY / "configs/maps/mujoco-crossing.toml"))
        changes += [f"behaviors.{behavior}.map={map_file}" for behavior in MAPPED]
    return changes


def run(job: Job, program: str, folder: Path, changes: list[str]) -> dict:
    """Runs a job with the program `yamabico` and `changes` of the task, such as `behaviors.stuck-recovery.enabled=false`. Returns its result;
    the recording in `folder` stays if it did not arrive."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    result = folder.resolve() / "result.json"
    task = REPOSITORY / "configs" / TASK_FILES[job.controller]
    command = [program, "run", str(task), "--live", "--json", "--no-report", "--no-overlays", "--seed", str(job.seed), "--out", str(folder)]
    command += [word for change in settings(job, result) + changes for word in ("--set", change)]
    with (folder / "out.json").open("w") as out, (folder / "errors.txt").open("w") as errors:
        process = subprocess.Popen(command, stdout=out, stderr=errors, stdin=subprocess.DEVNULL)
        begun = time.monotonic()
        while process.poll() is None and not result.exists() and time.monotonic() - begun < TIMEOUT_S:
            time.sleep(POLL_S)
        _stop(process)
    if not result.exists():
        return job.result("error", (folder / "errors.txt").read_text()[-400:])
    score = json.loads(result.read_text())
    if score["outcome"] == "arrived":
        shutil.rmtree(folder)
    return {"controller": job.controller, **score}


def _stop(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
