"""The steps of the polar cells with OpenCV and numpy, one thread: `polar_cells_speed.py 'FRAMES/field_256x220_*.png'`.

Thresholds in three channels, closing (two dilations, two erosions, 3x3), counts of 6 x 32 cells, free cells from the innermost
outwards. Counts come from a masked histogram of labels, which is faster than numpy's. For each picture the best of many runs;
the median and the largest over the pictures are printed.
"""
import glob
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import cv2
import numpy as np

cv2.setNumThreads(1)
RINGS, DIRECTIONS, RUNS = 6, 32, 300
# Blue, green, red.
LEAST, MOST = np.array((50, 110, 30), np.uint8), np.array((140, 210, 115), np.uint8)
SQUARE = np.ones((3, 3), np.uint8)
WIDTH, HEIGHT = 256, 220


def template(edges):
    """Label of each pixel, 0 outside; pixels of each cell."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    ahead, left = (HEIGHT - 1) / 2 - v, (WIDTH - 1) / 2 - u
    square = ahead * ahead + left * left
    ring = np.searchsorted(edges * edges, square, side="right") - 1
    turn = 2 * np.pi / DIRECTIONS
    direction = ((np.arctan2(left, ahead) % (2 * np.pi) + 1e-9) / turn).astype(int) % DIRECTIONS
    labels = np.where((ring >= 0) & (ring < RINGS), ring * DIRECTIONS + direction + 1, 0)
    return labels.astype(np.uint8), np.bincount(labels.ravel(), minlength=RINGS * DIRECTIONS + 1)[1:]


LABELS, AREAS = template(np.linspace(24.0, 96.0, RINGS + 1))
INSIDE = (LABELS > 0).astype(np.uint8) * 255


def distances(counts, share=0.8):
    free = (counts / AREAS).reshape(RINGS, DIRECTIONS) >= share
    return np.where(free.all(0), RINGS, np.argmin(free, axis=0))


def closed(picture):
    mask = cv2.inRange(picture, LEAST, MOST)
    mask = cv2.erode(cv2.dilate(mask, SQUARE, iterations=2), SQUARE, iterations=2)
    return cv2.bitwise_and(mask, INSIDE)


def by_histogram(picture):
    counts = cv2.calcHist([LABELS], [0], closed(picture), [256], [0, 256])
    return distances(counts.ravel()[1:RINGS * DIRECTIONS + 1])


def by_numpy(picture):
    return distances(np.bincount(LABELS[closed(picture) != 0], minlength=RINGS * DIRECTIONS + 1)[1:])


def best_us(run):
    best = float("inf")
    for _ in range(RUNS):
        begin = time.perf_counter_ns()
        run()
        best = min(best, (time.perf_counter_ns() - begin) / 1e3)
    return best


def main():
    paths = sorted(glob.glob(sys.argv[1])) if len(sys.argv) > 1 else []
    if not paths:
        sys.exit(__doc__)
    times = {"masked histogram": [], "numpy bincount": [], "thresholds alone": []}
    for path in paths:
        picture = cv2.imread(path)
        print(os.path.basename(path), "free rings", *by_histogram(picture))
        times["masked histogram"].append(best_us(lambda: by_histogram(picture)))
        times["numpy bincount"].append(best_us(lambda: by_numpy(picture)))
        times["thresholds alone"].append(best_us(lambda: cv2.inRange(picture, LEAST, MOST)))
    for what, each in times.items():
        each.sort()
        print("OpenCV %s, %s: median %.1f us, largest %.1f us" % (cv2.__version__, what, each[len(each) // 2], each[-1]))


if __name__ == "__main__":
    main()
