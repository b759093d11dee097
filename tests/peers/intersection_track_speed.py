"""The steps of following two vertical edges with OpenCV, one thread: `intersection_track_speed.py 'FRAMES/intersection_640x480_*.png'`.

The names of the pictures end in the columns of both edges. Each edge: a smoothed strip, the template of 20 x 40 over 25
columns by squared differences, the correlation of the same columns with uniqueness and parabola, the way back to the last
picture, the column of the steepest gradient, and the first template, grown, over 7 columns. The best of many rounds over the
pictures counts; the SSDA of ours has no counterpart in OpenCV, which compares every place to the end.
"""
import glob
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import cv2
import numpy as np

cv2.setNumThreads(1)
WIDTH, HEIGHT, REACH, ROW, ROUNDS = 20, 40, 12, 181, 400
ACROSS = np.array([1, 4, 6, 4, 1], np.float32) / 16
DOWN = np.full(9, 1 / 9, np.float32)
LEFT = WIDTH // 2 + 2 * REACH + 2


class Edge:
    def __init__(self, picture, column):
        self.column = column
        strip, at = self.strip(picture)
        self.running = self.patch(strip, at, 0)
        self.anchor = self.running.copy()
        self.last = self.patch(strip, at, REACH)

    def strip(self, picture):
        """Means over 9 rows of the binomial along the row, and where the edge is in them."""
        u, v = round(self.column), ROW
        piece = picture[v - HEIGHT // 2 - 1 : v + HEIGHT // 2 + 1, u - LEFT : u + LEFT]
        return cv2.sepFilter2D(piece, -1, ACROSS, DOWN), LEFT

    @staticmethod
    def patch(strip, at, margin):
        return strip[1 : 1 + HEIGHT, at - WIDTH // 2 - margin : at + WIDTH // 2 + margin].copy()

    def track(self, picture):
        """The exact column of the edge; `None` where a check fails."""
        strip, at = self.strip(picture)
        first = at - WIDTH // 2 - REACH
        area = strip[1 : 1 + HEIGHT, first : first + WIDTH + 2 * REACH]
        difference = cv2.matchTemplate(area, self.running, cv2.TM_SQDIFF)
        best = cv2.minMaxLoc(difference)[2][0]
        alike = cv2.matchTemplate(area, self.running, cv2.TM_CCOEFF_NORMED)[0]
        here = alike[best]
        if here < 0.7:
            return None
        others = max(alike[: max(best - 4, 0)].max(initial=-1), alike[best + 5 :].max(initial=-1))
        if others > here - 0.05:
            return None
        offset = 0.0
        if 0 < best < 2 * REACH:
            before, behind = alike[best - 1], alike[best + 1]
            bend = before - 2 * here + behind
            offset = 0.5 * (before - behind) / bend if bend < 0 else 0.0
        found = area[:, best : best + WIDTH]
        back = cv2.minMaxLoc(cv2.matchTemplate(self.last, found, cv2.TM_SQDIFF))[2][0]
        if abs(back - REACH) > 2:
            return None
        matched = round(self.column) - LEFT + first + best + WIDTH / 2 + offset
        middle = round(matched)
        means = cv2.reduce(picture[ROW - 20 : ROW + 21, middle - 6 : middle + 7], 0, cv2.REDUCE_AVG, dtype=cv2.CV_32F)[0]
        gradient = np.abs(means[2:] - means[:-2])
        gradient = np.maximum(gradient - 0.3 * gradient.max(), 0)
        column = middle - 5 + float(gradient @ np.arange(11)) / float(gradient.sum())
        at = round(column) - round(self.column) + LEFT
        if here >= 0.8:
            grown = cv2.resize(self.anchor, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)
            near = strip[1 : 1 + HEIGHT, at - WIDTH // 2 - 3 : at + WIDTH // 2 + 3]
            if abs(cv2.minMaxLoc(cv2.matchTemplate(near, grown, cv2.TM_CCOEFF_NORMED))[3][0] - 3) <= 1:
                self.running = self.patch(strip, at, 0)
        self.last = self.patch(strip, at, REACH)
        return column


def main():
    paths = sorted(glob.glob(sys.argv[1])) if len(sys.argv) > 1 else []
    if not paths:
        sys.exit(__doc__)
    pictures = [cv2.imread(path, cv2.IMREAD_GRAYSCALE) for path in paths]
    columns = [float(text) for text in os.path.basename(paths[0])[:-4].split("_")[-2:]]
    edges = [Edge(pictures[0], column) for column in columns]
    best, missed = float("inf"), 0
    for _ in range(ROUNDS):
        begin = time.perf_counter_ns()
        for picture in pictures:
            for edge in edges:
                missed += edge.track(picture) is None
        best = min(best, (time.perf_counter_ns() - begin) / 1e3 / len(pictures))
    found = [edge.track(pictures[0]) for edge in edges]
    print("OpenCV %s, track of two 20x40 templates, every check: %.1f us a picture, %d missed" % (cv2.__version__, best, missed))
    print("columns %s, true %s" % (found, columns))


if __name__ == "__main__":
    main()
