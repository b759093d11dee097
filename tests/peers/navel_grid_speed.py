"""The steps of the navel grid with OpenCV and numpy, one thread: `navel_grid_speed.py 'FRAMES/office_340x180_*.png'`.

3x3 median, histogram, iterative threshold, binary image, cells by area average, free cells from the bottom of each column.
For each picture the best of many runs; the median and the largest over the pictures are printed.
"""
import glob
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import cv2
import numpy as np

cv2.setNumThreads(1)
COLUMNS, ROWS, RUNS = 17, 9, 200
LEVELS = np.arange(256, dtype=np.float64)


def threshold(histogram):
    """Level half-way between the means of what it separates, from running sums."""
    count, total = np.cumsum(histogram), np.cumsum(histogram * LEVELS)
    level = total[-1] / count[-1]
    while True:
        below = int(np.ceil(level)) - 1
        dark = total[below] / count[below]
        bright = (total[-1] - total[below]) / (count[-1] - count[below])
        middle = (dark + bright) / 2
        if middle == level:
            return level
        level = middle


def profile(picture):
    """Free cells of each column, and the level."""
    filtered = cv2.medianBlur(picture, 3)
    histogram = cv2.calcHist([filtered], [0], None, [256], [0, 256]).ravel().astype(np.float64)
    level = threshold(histogram)
    _, dark = cv2.threshold(filtered, int(np.ceil(level)) - 1, 255, cv2.THRESH_BINARY_INV)
    share = cv2.resize(dark, (COLUMNS, ROWS), interpolation=cv2.INTER_AREA)
    obstacle = share[::-1] > 0.25 * 255
    return np.where(obstacle.any(0), np.argmax(obstacle, axis=0), ROWS), level


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
    whole, median = [], []
    for path in paths:
        picture = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        free, level = profile(picture)
        print(os.path.basename(path), "level %.2f, free" % level, *free)
        whole.append(best_us(lambda: profile(picture)))
        median.append(best_us(lambda: cv2.medianBlur(picture, 3)))
    for what, times in (("picture to free cells", whole), ("median alone", median)):
        times.sort()
        print("OpenCV %s, %s: median %.1f us, largest %.1f us" % (cv2.__version__, what, times[len(times) // 2], times[-1]))


if __name__ == "__main__":
    main()
