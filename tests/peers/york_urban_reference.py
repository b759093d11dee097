"""Error of the vanishing point on the York Urban Database, for each detector and estimator of OpenCV."""

import json
import os

from common import DATA, cv2, np
from vanishing_point import ransac, segments_edge_drawing, segments_fld, segments_lsd, select, vote

folder = os.path.join(DATA, "york_urban")
with open(os.path.join(folder, "ground_truth.json")) as file:
    truth = json.load(file)
camera = truth["camera"]


def ray(pixel):
    direction = np.array(
        [(pixel[0] - camera["cx"]) / camera["f_px"], (pixel[1] - camera["cy"]) / camera["f_px"], 1.0]
    )
    return direction / np.linalg.norm(direction)


errors_deg = {}
for entry in truth["images"]:
    in_view = entry.get("in_image_horizontal_vp")
    if in_view is None:
        continue
    gray = cv2.imread(os.path.join(folder, entry["file"]), 0)
    axis = np.array(entry["vp_dirs"][in_view["vp_index"]])
    axis /= np.linalg.norm(axis)
    for detector, detect in (("FLD", segments_fld), ("LSD", segments_lsd), ("EdgeDrawing", segments_edge_drawing)):
        selected = select(detect(gray))
        for estimator, estimate in (("RANSAC", ransac), ("voting", vote)):
            point = estimate(*selected)
            error = np.degrees(np.arccos(min(1, abs(ray(point) @ axis)))) if np.isfinite(point[0]) else 90
            errors_deg.setdefault((detector, estimator), []).append((error, entry))

SUBSETS = {
    "all": lambda entry: True,
    "train": lambda entry: entry["split_eccv08"] == "train",
    "test": lambda entry: entry["split_eccv08"] == "test",
    "indoor": lambda entry: entry["indoor"],
    "corridor": lambda entry: entry["corridor_like"],
}
for (detector, estimator), results in errors_deg.items():
    for name, is_in in SUBSETS.items():
        errors = np.array([error for error, entry in results if is_in(entry)])
        if len(errors):
            print(
                f"{detector} + {estimator}, {name}, {len(errors)} photographs: median {np.median(errors):.2f} degrees, "
                f"90 % {np.percentile(errors, 90):.2f}, within 3 degrees {(errors <= 3).sum()}, within 5 {(errors <= 5).sum()}"
            )
