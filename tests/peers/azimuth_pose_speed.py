"""Pose from 40 bearings with numpy, one thread: `azimuth_pose_speed.py FRAMES`.

FRAMES holds bearings_*.txt as `cargo bench -p yamabico-map-localizer --bench poses` writes them. Nearest edge of the map for each
bearing within a gate, and one update of an extended Kalman filter; the median of many runs, and the error.
"""
import glob
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np

GATE, RUNS = 6.6349, 2000


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def update(pose, covariance, edges, signs, seen, seen_signs, variance):
    """Individual gating, the nearest one each, and the information form of the update."""
    away = edges - pose[:2]
    squared = (away ** 2).sum(1)
    jacobian = np.c_[away[:, 1] / squared, -away[:, 0] / squared, -np.ones(len(edges))]
    predicted = np.arctan2(away[:, 1], away[:, 0]) - pose[2]
    spread = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian) + variance
    off = wrap(seen[:, None] - predicted[None])
    distance = np.where(seen_signs[:, None] == signs[None], off * off / spread[None], np.inf)
    nearest = distance.argmin(1)
    rows = np.flatnonzero(distance[np.arange(len(seen)), nearest] < GATE)
    h, innovation = jacobian[nearest[rows]], off[rows, nearest[rows]]
    inverse = np.linalg.inv(np.linalg.inv(covariance) + h.T @ h / variance)
    return pose + inverse @ (h.T @ innovation) / variance, len(rows)


def main():
    paths = sorted(glob.glob(os.path.join(sys.argv[1], "bearings_*.txt"))) if len(sys.argv) == 2 else []
    if not paths:
        sys.exit(__doc__)
    for path in paths:
        lines = [np.array(line.split(), float) for line in open(path)]
        pose, deviations, truth = lines[:3]
        rows = np.array(lines[3:])
        problem = (pose, np.diag(deviations ** 2), rows[:, :2], rows[:, 2], rows[:, 3], rows[:, 4], rows[0, 5] ** 2)
        found, pairs = update(*problem)
        times = []
        for _ in range(RUNS):
            begin = time.perf_counter_ns()
            update(*problem)
            times.append((time.perf_counter_ns() - begin) / 1e3)
        name, error = os.path.basename(path), np.hypot(*(found - truth)[:2])
        print("numpy, %s: %d paired, off by %.1f mm, median %.0f us" % (name, pairs, 1e3 * error, sorted(times)[RUNS // 2]))


if __name__ == "__main__":
    main()
