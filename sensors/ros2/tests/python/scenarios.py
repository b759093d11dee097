"""A robot and its operators on ROS 2, played with rclpy around a live run. Prints what was measured as JSON; fails by assertion.

    python scenarios.py SCENARIO YAMABICO FOLDER    # the program `yamabico`, and a folder for files
"""

import json
import os
import signal
import subprocess
import sys
import time
import traceback

from rclpy.qos import DurabilityPolicy

import measurements
import zenoh_scenarios
from delays import delays
from live_run import Base, Program, play, with_me
from middleware import IS_ZENOH, init


def robot(program, folder):
    """Sensors arrive, commands follow, and the last one is zero."""
    base, run = Base(), Program(program, folder)
    nav = play("/cmd_vel_nav", 0.2)
    first = base.wait_for(0.2, 20.0)
    time.sleep(2.0)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    assert len(base.decisions) > 5 and base.decisions[-1]["behaviors"], "decisions"
    return {"first_command_s": first, "commands": len(base.commands), "decisions": len(base.decisions)}


def stamped(program, folder):
    """The drive sends the type that the base subscribes."""
    base, run = Base(stamped=True), Program(program, folder)
    nav = play("/cmd_vel_nav", 0.2)
    base.wait_for(0.2, 20.0)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    return {"logged": run.wait_for_text("/cmd_vel", "TwistStamped")}


def qos(program, folder):
    """Mismatches are logged with the topic, in both directions."""
    base = Base(durability=DurabilityPolicy.TRANSIENT_LOCAL)
    run = Program(program, folder, sonar='reliability = "reliable"')
    logged = [
        run.wait_for_text("`/scan`", "reliability"),
        run.wait_for_text("`/cmd_vel`", "durability"),
    ]
    run.end()
    assert not base.commands
    return {"logged": logged}


def domains(program, folder):
    """A run in another domain says so; in the same one it drives."""
    base, result = Base(), {}
    own = os.environ["ROS_DOMAIN_ID"]
    os.environ["ROS_DOMAIN_ID"] = "7"
    run = Program(program, folder)
    result["other"] = run.wait_for_text("`/scan`", "domain 7", timeout=20.0)
    run.end()
    assert not base.commands
    os.environ["ROS_DOMAIN_ID"] = own
    run, nav = Program(program, folder), play("/cmd_vel_nav", 0.2)
    result[f"first_command_in_{own}_s"] = base.wait_for(0.2, 20.0)
    run.end()
    nav.kill()
    return result


# Priority of each velocity topic of the task, and of its lock.
VELOCITIES = {"joy": 100, "web": 50, "nav": 10}
LOCK = 60


def documented(velocities, lock):
    """What twist_mux forwards, by its documentation: the velocity with the highest priority among those that are younger than their
    timeout and not below a closed lock, at each of its messages. None: it publishes nothing. `velocities` are those that are
    published, `lock` is "true", "false" or "silent"; a lock with a timeout is closed while it is silent.
    """
    floor = 0 if lock == "false" else LOCK
    free = [name for name in velocities if VELOCITIES[name] >= floor]
    return velocities[max(free, key=VELOCITIES.get)] if free else None


def mux(program, folder):
    """Three velocities and a lock; every publisher is killed. The commands are those of twist_mux, and zero where it is silent."""
    base, run = Base(), Program(program, folder, lock_timeout_ms=500.0)
    speeds = {"joy": 0.1, "web": 0.15, "nav": 0.3}
    players = {name: play(f"/cmd_vel_{name}", speed) for name, speed in speeds.items()}
    players["lock"] = play("/pause", False)
    steps, state = [], {"lock": "false"}
    time.sleep(1.0)

    def step(what, timeout=30.0):
        velocities = {name: speeds[name] for name in speeds if name in players}
        expected = documented(velocities, state["lock"])
        begin = time.monotonic()
        seconds = base.wait_for(expected or 0.0, timeout)
        time.sleep(1.0)
        rate, gap = base.gaps(begin)
        held = [linear for at, linear, _ in base.commands if at > begin + seconds]
        assert all(abs(linear - (expected or 0.0)) < 0.005 for linear in held), (what, expected, held)
        steps.append({"step": what, "publish": sorted(velocities), "lock": state["lock"], "twist_mux": expected,
                      "command": held[-1], "after_s": round(seconds, 2), "rate_hz": round(rate), "gap_s": round(gap, 3)})

    def kill(name):
        players.pop(name).kill()

    def lock(value):
        if "lock" in players:
            kill("lock")
        players["lock"], state["lock"] = play("/pause", value), str(value).lower()

    step("all publish")
    begin = time.monotonic()
    kill("joy")
    step("joystick killed")
    kill("web")
    step("web killed")
    kill("lock")
    state["lock"] = "silent"
    step("lock killed")
    lock(True)
    step("lock says true")
    players["joy"] = play("/cmd_vel_joy", speeds["joy"])
    step("joystick back, above the lock")
    kill("joy")
    step("joystick killed")
    players["web"] = play("/cmd_vel_web", speeds["web"])
    step("web back, below the lock")
    lock(False)
    step("lock says false")
    kill("web")
    step("web killed")
    kill("nav")
    step("navigation killed")
    _, gap = base.gaps(begin)
    reasons = {b["name"]: b["reason"] for b in base.decisions[-1]["behaviors"]}
    run.end()
    for player in players.values():
        player.kill()
    assert gap < 0.5, f"no command for {gap} s"
    return {"steps": steps, "longest_gap_s": gap, "reasons_at_the_end": reasons}


def restarts(program, folder, count=10):
    """Both sides are killed and come back, ten times each."""
    base_of = lambda: subprocess.Popen([sys.executable, __file__, "base"], stdout=subprocess.PIPE, text=True,
                                       preexec_fn=with_me)
    run, nav = Program(program, folder), play("/cmd_vel_nav", 0.2)
    seconds = {"base": [], "driver": []}
    for _ in range(count):
        begin = time.monotonic()
        base = base_of()
        line = base.stdout.readline()
        assert line.startswith("command"), line
        seconds["base"].append(time.monotonic() - begin)
        base.kill()
        base.wait()
    base = Base()
    base.wait_for(0.2, 20.0)
    for _ in range(count):
        os.kill(run.plugin("driver"), signal.SIGKILL)
        begin = time.monotonic()
        time.sleep(0.05)
        base.wait_for(0.2, 20.0)
        after = [at for at, linear, _ in base.commands if at > begin + 0.05 and abs(linear - 0.2) < 0.005]
        seconds["driver"].append(after[0] - begin)
        time.sleep(0.5)
    run.end()
    nav.kill()
    time.sleep(0.3)
    assert base.commands[-1][1:] == (0.0, 0.0), base.commands[-1]
    return {side: {"times": len(all), "median_s": sorted(all)[len(all) // 2], "max_s": max(all)}
            for side, all in seconds.items()}


def restarted_base():
    """A base that says when it gets a command to drive."""
    init()
    base = Base()
    base.wait_for(0.2, 20.0)
    print("command", flush=True)
    time.sleep(60.0)


def main():
    match sys.argv[1:]:
        case ["base"]:
            restarted_base()
        case [name, program, folder]:
            init()
            try:
                router = zenoh_scenarios.start_router() if IS_ZENOH else None
                places = [globals(), vars(measurements), vars(zenoh_scenarios)]
                scenario = next(place[name] for place in places if name in place)
                print(json.dumps(scenario(program, folder)), flush=True)
            except BaseException:
                traceback.print_exc()
                # Threads of rclpy may hang at the end.
                os._exit(1)
            os._exit(0)


main()
