"""Radial edges of a mirror picture with OpenCV and numpy, one thread: `radial_edges_speed.py FRAMES`.

FRAMES holds ring_512x480.png and the true azimuths beside it, as `cargo bench -p yamabico-core --bench radial_edges` writes them.
Each way from the picture to the peaks over the azimuth; the median of many runs, and how many true edges lie within a degree.
"""
import os
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import cv2
import numpy as np

cv2.setNumThreads(1)
BINS, LEAST, OBLIQUE, RUNS = 720, 60, np.float32(np.sin(np.radians(15))), 400


def peaks(profile, least=15):
    """Local maxima of the smoothed profile."""
    kernel = np.array([1, 2, 3, 2, 1], np.float32) / 9
    smooth = np.convolve(np.concatenate((profile[-2:], profile, profile[:2])), kernel, "valid")
    return np.flatnonzero((smooth > np.roll(smooth, 1)) & (smooth >= np.roll(smooth, -1)) & (smooth > least))


class Ways:
    """The tables that a tuned program would keep, and the ways from picture to peaks."""

    def __init__(self, picture):
        self.picture = picture
        height, width = picture.shape
        row, column = np.mgrid[:height, :width].astype(np.float32)
        ahead, left = (height - 1) / 2 - row, (width - 1) / 2 - column
        radius = np.hypot(ahead, left) + 1e-6
        self.ring = (radius > 30) & (radius < 238)
        turn = np.arctan2(left, ahead) % (2 * np.pi)
        self.bin = (turn / (2 * np.pi) * BINS).astype(np.int64) % BINS
        self.outward = (-left / radius, -ahead / radius)
        angle = (np.arange(BINS, dtype=np.float32) + 0.5) / BINS * 2 * np.pi
        radii = np.linspace(30, 238, 208, dtype=np.float32)
        u = (width - 1) / 2 - np.sin(angle)[:, None] * radii
        v = (height - 1) / 2 - np.cos(angle)[:, None] * radii
        self.maps = cv2.convertMaps(u.astype(np.float32), v.astype(np.float32), cv2.CV_16SC2)

    def remap(self):
        """Unrolled picture by fixed maps, derivative along the azimuth, column sums."""
        polar = cv2.remap(self.picture, *self.maps, cv2.INTER_LINEAR)
        slope = cv2.convertScaleAbs(cv2.Sobel(polar, cv2.CV_16S, 0, 1))
        edge = cv2.threshold(slope, LEAST, 1, cv2.THRESH_BINARY)[1]
        return peaks(cv2.reduce(edge, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F).ravel())

    def sparse(self):
        """Both derivatives, and the test of the direction on the strong pixels only."""
        gx, gy = cv2.spatialGradient(self.picture)
        strong = cv2.add(cv2.convertScaleAbs(gx), cv2.convertScaleAbs(gy)) > LEAST
        index = np.flatnonzero(strong & self.ring)
        x, y = gx.ravel()[index].astype(np.float32), gy.ravel()[index].astype(np.float32)
        along = np.abs(x * self.outward[0].ravel()[index] + y * self.outward[1].ravel()[index])
        kept = index[along < OBLIQUE * np.sqrt(x * x + y * y)]
        return peaks(np.bincount(self.bin.ravel()[kept], minlength=BINS).astype(np.float32))


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
    picture = cv2.imread(os.path.join(sys.argv[1], "ring_512x480.png"), cv2.IMREAD_GRAYSCALE)
    truth = np.loadtxt(os.path.join(sys.argv[1], "ring_512x480.txt")) / (2 * np.pi) * BINS
    ways = Ways(picture)
    for name in ("remap", "sparse"):
        found = getattr(ways, name)() + 0.5
        off = [np.min(np.abs((edge - found + BINS / 2) % BINS - BINS / 2)) for edge in truth]
        near = np.sum(np.array(off) * 360 / BINS < 1)
        time_us = median_us(getattr(ways, name))
        print("OpenCV %s, %s: %d peaks, %d of %d true edges, median %.0f us" % (
            cv2.__version__, name, len(found), near, len(truth), time_us))


if __name__ == "__main__":
    main()
