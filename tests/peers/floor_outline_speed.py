"""Pose from the outline of the floor with OpenCV and numpy, one thread: `floor_outline_speed.py FRAMES`.

FRAMES holds floor_256x220.png as `cargo bench -p yamabico-map-localizer --bench poses` writes it. Row ends, hull, moments, and the
linear fit to the lines of the field, as in the behavior; the median of many runs, whole and for the fit alone.
"""
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import cv2
import numpy as np

cv2.setNumThreads(1)
A, B, C = 10.12, 2.054e-2, 2.298e5
LENGTH, GOALS, WIDTH, GOAL, RUNS = 1370.0, 1550.0, 762.5, 250.0, 400
HALF = [((GOALS, -GOAL), (GOALS, GOAL)), ((LENGTH, -WIDTH), (LENGTH, -GOAL)), ((LENGTH, GOAL), (LENGTH, WIDTH)),
        ((LENGTH, WIDTH), (-LENGTH, WIDTH))]
ENDS = np.array(HALF + [tuple((-x, -y) for x, y in ends) for ends in HALF])
FROM, ALONG = ENDS[:, 0], ENDS[:, 1] - ENDS[:, 0]
SQUARED = (ALONG ** 2).sum(1)
NORMALS = np.c_[ALONG[:, 1], -ALONG[:, 0]] / np.sqrt(SQUARED)[:, None]
OFFSETS = (NORMALS * FROM).sum(1)


def corners(mask):
    """Hull of the first and last floor pixel of each row, bird's-eye pixels."""
    rows = np.flatnonzero(mask.any(1))
    first, last = mask[rows].argmax(1), mask.shape[1] - 1 - mask[rows, ::-1].argmax(1)
    ends = np.concatenate((np.c_[first, rows], np.c_[last, rows])).astype(np.int32)
    hull = cv2.convexHull(ends)[:, 0]
    return (mask.shape[0] - 1) / 2 - hull[:, 1], (mask.shape[1] - 1) / 2 - hull[:, 0]


def fit(x, y):
    """Floor points, moments, and steps until they are small."""
    radius = np.hypot(x, y)
    root = np.sqrt(C + radius ** 2)
    slope = (A - B * C / root) / (A - B * root) ** 2
    points = np.c_[x, y] / (A - B * root)[:, None]
    weight = 1 / slope ** 2
    moments = cv2.moments(points.astype(np.float32))
    center = np.array([moments["m10"], moments["m01"]]) / moments["m00"]
    axis = 0.5 * np.arctan2(2 * moments["mu11"], moments["mu20"] - moments["mu02"])
    for _ in range(20):
        sin, cos = np.sin(axis), np.cos(axis)
        p = (points - center) @ np.array([[cos, -sin], [sin, cos]])
        away = p[:, None] - FROM[None]
        share = np.clip((away * ALONG[None]).sum(2) / SQUARED, 0, 1)
        nearest = ((away - share[..., None] * ALONG[None]) ** 2).sum(2).argmin(1)
        normal = NORMALS[nearest]
        error = OFFSETS[nearest] - (normal * p).sum(1)
        row = np.c_[normal, normal[:, 0] * p[:, 1] - normal[:, 1] * p[:, 0]]
        weighted = row * weight[:, None]
        a, b, turn = np.linalg.solve(weighted.T @ row, weighted.T @ error)
        axis += turn
        sin, cos = np.sin(axis), np.cos(axis)
        center = center - np.array([a * cos - b * sin, a * sin + b * cos])
        if abs(a) <= 0.1 and abs(b) <= 0.1 and abs(turn) <= 1e-4:
            break
    sin, cos = np.sin(-axis), np.cos(-axis)
    return -center[0] * cos + center[1] * sin, -center[0] * sin - center[1] * cos, -axis


def median_us(run):
    times = []
    for _ in range(RUNS):
        begin = time.perf_counter_ns()
        run()
        times.append((time.perf_counter_ns() - begin) / 1e3)
    return sorted(times)[RUNS // 2]


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    mask = cv2.imread(os.path.join(sys.argv[1], "floor_256x220.png"), cv2.IMREAD_GRAYSCALE) > 0
    seen = corners(mask)
    print("OpenCV %s, numpy: %d corners, pose %.1f mm %.1f mm %.4f" % (cv2.__version__, len(seen[0]), *fit(*seen)))
    print("mask to pose: median %.0f us" % median_us(lambda: fit(*corners(mask))))
    print("corners to pose alone: median %.0f us" % median_us(lambda: fit(*seen)))


if __name__ == "__main__":
    main()
