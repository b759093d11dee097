"""Calibrates lenses with OpenCV from the pictures that `EVAL calibration --out DIR` writes: prints focal lengths and principal points.

    python lens_calibration.py DIR
"""

import collections
import pathlib
import sys

import cv2
import numpy as np

COLUMNS, ROWS = 9, 6
corners = np.array([[i % COLUMNS, i // COLUMNS, 0] for i in range(COLUMNS * ROWS)], np.float32) * 0.025
lenses = collections.defaultdict(list)
for path in sorted(pathlib.Path(sys.argv[1]).glob("lens_*_*.png")):
    lenses[int(path.stem.split("_")[1])].append(path)
for seed, paths in sorted(lenses.items()):
    found = []
    for path in paths:
        gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        is_found, points = cv2.findChessboardCorners(gray, (COLUMNS, ROWS))
        if is_found:
            stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
            found.append(cv2.cornerSubPix(gray, points, (5, 5), (-1, -1), stop))
    size = gray.shape[::-1]
    rms, matrix, *_ = cv2.calibrateCamera([corners] * len(found), found, size, None, None, flags=cv2.CALIB_FIX_K3)
    numbers = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]
    print(seed, len(found), "of", len(paths), "boards, rms", f"{rms:.3f}", *(f"{number:.2f}" for number in numbers))
