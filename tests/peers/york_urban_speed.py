"""Time from image to vanishing point with OpenCV: York Urban, or the images of a pattern such as 'FRAMES/hallway_640x480_*.png'."""

import glob
import os
import sys

from common import DATA, best_us, cv2, np
from vanishing_point import ransac, segments_edge_drawing, segments_fld, select, vote

pattern = sys.argv[1] if len(sys.argv) > 1 else os.path.join(DATA, "york_urban", "images", "*.jpg")
images = [cv2.imread(file, 0) for file in sorted(glob.glob(pattern))]
first = images[0]
# Into memory that exists already, as in the Rust benchmark.
median, gradient_x, gradient_y = np.empty_like(first), np.empty(first.shape, np.int16), np.empty(first.shape, np.int16)


def gradients():
    cv2.Scharr(first, cv2.CV_16S, 1, 0, gradient_x)
    cv2.Scharr(first, cv2.CV_16S, 0, 1, gradient_y)


print(f"3x3 median {best_us(lambda: cv2.medianBlur(first, 3, median), 200):.0f} us")
print(f"Scharr, both derivatives, {best_us(gradients, 200):.0f} us")
for name, run in {
    "FLD": segments_fld,
    "FLD + RANSAC": lambda image: ransac(*select(segments_fld(image))),
    "FLD + voting": lambda image: vote(*select(segments_fld(image))),
    "EdgeDrawing": segments_edge_drawing,
}.items():
    times_us = [best_us(lambda: run(image), 15) for image in images]
    print(f"{name}: median {np.median(times_us):.0f} us over {len(times_us)} images")
