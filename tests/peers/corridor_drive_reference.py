"""Error of the vanishing point's column and sign of steering on the corridor drive: FLD with voting."""

import csv
import os

from common import DATA, cv2, np
from vanishing_point import segments_fld, select, vote

# Distance of a label from the center below which it decides no steering direction, px.
STEERING_DEADBAND_PX = 10

folder = os.path.join(DATA, "corridor_drive")
errors_px, steered, correct = [], 0, 0
with open(os.path.join(folder, "labels.csv")) as file:
    for row in csv.DictReader(file):
        path = os.path.join(folder, "images", row["name"] + ".jpg")
        if not row["polygon_vp_x"] or not os.path.exists(path):
            continue
        gray = cv2.imread(path, 0)
        height, width = gray.shape
        column = vote(*select(segments_fld(gray), 25), width=width, height=height)[0]
        label, center = float(row["polygon_vp_x"]), (width - 1) / 2
        errors_px.append(abs(column - label) if np.isfinite(column) else 480)
        if abs(label - center) > STEERING_DEADBAND_PX:
            steered += 1
            correct += (column - center) * (label - center) > 0
print(
    f"{len(errors_px)} frames: column error median {np.median(errors_px):.1f} px, 90 % {np.percentile(errors_px, 90):.1f} px; "
    f"steering sign correct in {correct} of {steered}"
)
