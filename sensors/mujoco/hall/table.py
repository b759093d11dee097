"""Tables of results: by controller and task, with columns for the floors."""

from collections import Counter
from math import sqrt
from statistics import mean, median

from .job import CONTROLLERS
from .scenario import FLOORS, TASKS

#: Quantile of the normal distribution for an interval of 95 %.
Z_95 = 1.96


def wilson_interval(hits: int, runs: int) -> tuple[float, float]:
    """Returns the interval of 95 % of a proportion (Wilson, 1927)."""
    if runs == 0:
        return 0.0, 1.0
    share, square = hits / runs, Z_95 * Z_95
    middle = share + square / (2 * runs)
    reach = Z_95 * sqrt(share * (1 - share) / runs + square / (4 * runs * runs))
    scale = 1 + square / runs
    return max(0.0, (middle - reach) / scale), min(1.0, (middle + reach) / scale)


def arrivals(runs: list[dict]) -> str:
    """Returns how many of the runs arrived."""
    return f"{sum(run['outcome'] == 'arrived' for run in runs)} of {len(runs)}" if runs else "-"


def markdown(runs: list[dict]) -> str:
    """Returns one table of all runs: arrived by floor and in total, contacts driven into and passive, stuck, times, offset."""
    floors = [floor for floor in FLOORS if any(run["floor"] == floor for run in runs)]
    head = ["controller", "task", *floors, "all", "95 %", "driven into", "passive", "stuck, late, failed", "time", "RMS offset", "stops"]
    rows = [head, ["---"] * len(head)]
    for controller in CONTROLLERS:
        for task in TASKS:
            chosen = [run for run in runs if (run["controller"], run["task"]) == (controller, task)]
            if chosen:
                by_floor = [arrivals([run for run in chosen if run["floor"] == floor]) for floor in floors]
                rows.append([controller, task, *by_floor, *_totals(chosen)])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def line(run: dict) -> str:
    """Returns one run in one line."""
    what = f"{run['controller']:8} {run['task']:6} {run['floor']:8} seed {run['seed']:4} style {run['style']:2}  {run['outcome']:8}"
    if run["outcome"] == "error":
        return f"{what} {run['problem']}"
    contact = f" {run['contact']}{' (passive)' if run['passive'] else ''}" if run["contact"] else ""
    rms = "-" if run["rms_offset_m"] is None else f"{run['rms_offset_m']:.2f} m"
    ends = f"{run['end'][0]:.1f}, {run['end'][1]:.1f}"
    return f"{what}{contact} {run['time_s']:.1f} s, clearance {run['min_clearance_m']:.2f} m, RMS {rms}, {run['stops']} stops, at {ends}"


def _totals(runs: list[dict]) -> list[str]:
    outcomes = Counter(run["outcome"] for run in runs)
    scored = [run for run in runs if run["outcome"] != "error"]
    arrived = [run for run in scored if run["outcome"] == "arrived"]
    low, high = wilson_interval(len(arrived), len(runs))
    contacts = Counter(run["contact"] for run in scored if run["outcome"] == "contact" and not run["passive"])
    passive = sum(run["outcome"] == "contact" and run["passive"] for run in scored)
    offsets = [run["rms_offset_m"] for run in scored if run["rms_offset_m"] is not None]
    return [
        arrivals(runs),
        f"{100 * low:.0f} to {100 * high:.0f}",
        ", ".join(f"{count} {name}" for name, count in contacts.most_common()) or "none",
        str(passive),
        f"{outcomes['stuck']}, {outcomes['timeout']}, {outcomes['error']}",
        f"{median(run['time_s'] for run in arrived):.1f} s" if arrived else "-",
        f"{median(offsets):.2f} m" if offsets else "-",
        f"{mean(run['stops'] for run in scored):.1f}" if scored else "-",
    ]
