"""Line segments and the vanishing point of a corridor with OpenCV: detectors and estimators for the other programs.

As a program: error and time of each combination on 24 rendered corridors.
"""

import os

from common import benchmark, cv2, np

FOCAL_PX = 500.0

_lsd = cv2.createLineSegmentDetector(0)
_lsd_refined = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD)
_fld = cv2.ximgproc.createFastLineDetector(20, 1.41, 50, 100, 3, False)
_edge_drawing = cv2.ximgproc.createEdgeDrawing()


def segments_lsd(gray):
    return _lsd.detect(gray)[0].reshape(-1, 4)


def segments_lsd_refined(gray):
    return _lsd_refined.detect(gray)[0].reshape(-1, 4)


def segments_fld(gray):
    return _fld.detect(gray).reshape(-1, 4)


def segments_hough(gray):
    lines = cv2.HoughLinesP(cv2.Canny(gray, 60, 120), 1, np.pi / 360, 50, minLineLength=40, maxLineGap=4)
    return lines.reshape(-1, 4).astype(np.float32)


def segments_edge_drawing(gray):
    _edge_drawing.detectEdges(gray)
    return _edge_drawing.detectLines().reshape(-1, 4)


DETECTORS = {
    "LSD": segments_lsd,
    "LSD, refined": segments_lsd_refined,
    "FLD": segments_fld,
    "EdgeDrawing": segments_edge_drawing,
    "Canny and Hough": segments_hough,
}


def select(segments, min_length=25):
    """Returns the longest 120 segments that are neither short, horizontal nor vertical, and their lengths."""
    direction = segments[:, 2:] - segments[:, :2]
    lengths = np.hypot(direction[:, 0], direction[:, 1])
    slope = np.abs(np.degrees(np.arctan2(direction[:, 1], direction[:, 0]))) % 180
    slope = np.minimum(slope, 180 - slope)
    keep = (lengths > min_length) & (slope > 8) & (slope < 80)
    segments, lengths = segments[keep], lengths[keep]
    if len(segments) > 120:
        longest = np.argsort(-lengths)[:120]
        segments, lengths = segments[longest], lengths[longest]
    return segments.astype(np.float64), lengths


def _homogeneous_lines(segments):
    ones = np.ones(len(segments))
    return np.cross(np.c_[segments[:, :2], ones], np.c_[segments[:, 2:], ones])


def ransac(segments, lengths, iterations=200, seed=1):
    """Returns the vanishing point (x, y) by RANSAC weighted by length, refined by least squares."""
    count = len(segments)
    if count < 2:
        return np.nan, np.nan
    rng = np.random.default_rng(seed)
    lines = _homogeneous_lines(segments)
    middles = (segments[:, :2] + segments[:, 2:]) / 2
    directions = (segments[:, 2:] - segments[:, :2]) / lengths[:, None]
    pairs = rng.choice(count, (iterations, 2), p=lengths / lengths.sum())
    candidates = np.cross(lines[pairs[:, 0]], lines[pairs[:, 1]])
    candidates = candidates[np.abs(candidates[:, 2]) > 1e-6]
    candidates = candidates[:, :2] / candidates[:, 2:]
    max_sine = np.sin(np.radians(2))

    offsets = candidates[:, None, :] - middles[None]
    distances = np.hypot(offsets[..., 0], offsets[..., 1]) + 1e-9
    sines = np.abs(offsets[..., 0] * directions[:, 1] - offsets[..., 1] * directions[:, 0]) / distances
    best = candidates[np.argmax(((sines < max_sine) * lengths).sum(1))]
    for _ in range(3):
        offsets = best - middles
        distances = np.hypot(offsets[:, 0], offsets[:, 1]) + 1e-9
        sines = np.abs(offsets[:, 0] * directions[:, 1] - offsets[:, 1] * directions[:, 0]) / distances
        inliers = sines < max_sine
        weights = lengths[inliers] / distances[inliers]
        normals = np.c_[-directions[inliers, 1], directions[inliers, 0]]
        offsets_of_lines = (normals * middles[inliers]).sum(1)
        best = np.linalg.lstsq(normals * weights[:, None], offsets_of_lines * weights, rcond=None)[0]
    return tuple(best)


def vote(segments, lengths, cell=4, width=640, height=480):
    """Returns the vanishing point (x, y) by votes of all pairs of segments in a smoothed grid."""
    count = len(segments)
    if count < 2:
        return np.nan, np.nan
    lines = _homogeneous_lines(segments)
    i, j = np.triu_indices(count, 1)
    crossings = np.cross(lines[i], lines[j])
    sines = np.abs(crossings[:, 2]) / (lengths[i] * lengths[j])
    keep = sines > 0.05
    x, y = crossings[keep, 0] / crossings[keep, 2], crossings[keep, 1] / crossings[keep, 2]
    weights = np.minimum(lengths[i], lengths[j])[keep] * sines[keep]
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    columns, rows = width // cell, height // cell
    cells = (y[inside] // cell).astype(int) * columns + (x[inside] // cell).astype(int)
    grid = np.bincount(cells, weights[inside], columns * rows).reshape(rows, columns).astype(np.float32)
    grid = cv2.GaussianBlur(grid, (0, 0), 1.5)
    _, _, _, peak = cv2.minMaxLoc(grid)
    x0, y0 = max(peak[0] - 3, 0), max(peak[1] - 3, 0)
    window = grid[y0 : peak[1] + 4, x0 : peak[0] + 4]
    ys, xs = np.mgrid[: window.shape[0], : window.shape[1]]
    total = window.sum()
    return (x0 + (xs * window).sum() / total + 0.5) * cell, (y0 + (ys * window).sum() / total + 0.5) * cell


ESTIMATORS = {"RANSAC": ransac, "voting": vote}


def rendered_corridor(seed, width=640, height=480, noise=4):
    """Renders a corridor seen by a pinhole camera; returns the gray image and the vanishing point of its axis (x, y)."""
    rng = np.random.default_rng(seed)
    yaw, pitch = np.radians(rng.uniform(-12, 12)), np.radians(rng.uniform(-6, 6))
    offset, camera_height = rng.uniform(-0.4, 0.4), 1.2
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    rotation = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]]) @ np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    image = np.full((height, width), 150, np.uint8)

    def clip(points, near=0.05):
        clipped = []
        for a, b in zip(points, points[1:] + points[:1]):
            if a[2] >= near:
                clipped.append(a)
            if (a[2] >= near) != (b[2] >= near):
                clipped.append(a + (near - a[2]) / (b[2] - a[2]) * (b - a))
        return clipped

    def polygon(points, level):
        in_camera = [rotation @ (np.array(point, float) - np.array([offset, 0, 0])) for point in points]
        visible = clip(in_camera)
        if len(visible) < 3:
            return
        pixels = [(FOCAL_PX * p[0] / p[2] + width / 2, FOCAL_PX * p[1] / p[2] + height / 2) for p in visible]
        pixels = np.clip(np.array(pixels), -2e4, 2e4)
        cv2.fillPoly(image, [np.round(pixels * 16).astype(np.int32)], int(level), cv2.LINE_AA, 4)

    def along(x0, y0, x1, y1, z0, z1):
        return [(x0, y0, z0), (x1, y1, z0), (x1, y1, z1), (x0, y0, z1)]

    wall, floor, ceiling, near, far = 1.2, camera_height, camera_height - 2.6, -3, 25.0
    polygon(along(-wall, floor, wall, floor, near, far), 95)
    polygon(along(-wall, ceiling, wall, ceiling, near, far), 215)
    polygon(along(-wall, floor, -wall, ceiling, near, far), 150)
    polygon(along(wall, floor, wall, ceiling, near, far), 135)
    polygon([(-wall, floor, far), (wall, floor, far), (wall, ceiling, far), (-wall, ceiling, far)], 185)
    for x in (-0.4, 0.4):
        polygon(along(x, floor, x + 0.02, floor, near, far), 75)
    for z in np.arange(0.5, 20, 1.0):
        polygon(along(-wall, floor, wall, floor, z, z + 0.02), 80)
    for z in np.arange(2, 22, 4.0):
        polygon([(-0.3, ceiling, z), (0.3, ceiling, z), (0.3, ceiling, z + 1.2), (-0.3, ceiling, z + 1.2)], 250)
    for side in (-wall, wall):
        polygon(along(side, floor, side, floor - 0.12, near, far), 50)
        polygon(along(side, floor - 1.0, side, floor - 1.06, near, far), 80)
        z = rng.uniform(0.8, 2)
        while z < 20:
            polygon(along(side, floor, side, floor - 2.05, z, z + 0.9), rng.integers(50, 115))
            z += rng.uniform(2.2, 3.5)
    image = cv2.GaussianBlur(image, (3, 3), 0.7)
    image = np.clip(image + rng.normal(0, noise, image.shape), 0, 255).astype(np.uint8)
    axis = rotation @ np.array([0, 0, 1.0])
    return image, (FOCAL_PX * axis[0] / axis[2] + width / 2, FOCAL_PX * axis[1] / axis[2] + height / 2)


def errors_px(images, estimate):
    """Returns the sorted distances between estimated and true vanishing points; infinite if there is no estimate."""
    errors = []
    for image, truth in images:
        try:
            point = estimate(image)
            errors.append(np.hypot(point[0] - truth[0], point[1] - truth[1]))
        except Exception:
            errors.append(np.inf)
    return np.sort(np.nan_to_num(np.array(errors), nan=np.inf))


def main():
    images = [rendered_corridor(seed) for seed in range(24)]
    for name, detect in {} if os.environ.get("SKIPACC") else DETECTORS.items():
        count = np.median([len(detect(image)) for image, _ in images])
        for estimator, estimate in ESTIMATORS.items():
            errors = errors_px(images, lambda image: estimate(*select(detect(image))))
            p90 = errors[int(0.9 * len(errors))]
            print(
                f"{name} + {estimator}: error median {np.median(errors):.2f} px, 90 % {p90:.2f}, max {errors[-1]:.1f}; "
                f"{count:.0f} segments (median)"
            )
    gray = images[0][0]
    selected = select(segments_lsd(gray))
    candidates = {f"{name} alone": (lambda detect=detect: detect(gray)) for name, detect in DETECTORS.items()}
    for name, detect in DETECTORS.items():
        candidates[f"{name} + RANSAC"] = lambda detect=detect: ransac(*select(detect(gray)))
    candidates["LSD + voting"] = lambda: vote(*select(segments_lsd(gray)))
    candidates["step: RANSAC"] = lambda: ransac(*selected)
    candidates["step: voting"] = lambda: vote(*selected)
    candidates["step: Canny"] = lambda: cv2.Canny(gray, 60, 120)
    benchmark(candidates, "640x480", repetitions=40, rounds=4)


if __name__ == "__main__":
    main()
