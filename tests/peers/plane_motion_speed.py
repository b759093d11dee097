"""Alignment of the floor and judgement of a picture beside OpenCV, one thread: `plane_motion_speed.py FRAMES [ROUNDS]`.

Each round runs `cargo bench -p yamabico-vision --bench plane_motion`, which writes pictures with known motion, our alignments and our
times to the folder FRAMES, and then OpenCV on the same pictures from the same priors; without cargo, the files already there are taken.
findTransformECC aligns the area that ours aligns (cropped, which is faster than a mask), at most ten steps as ours, by every pixel
or by as many as ours; calcOpticalFlowPyrLK follows the points that ours judges. Thread CPU time, medians over the pairs.
"""
import json
import os
import shutil
import subprocess
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import cv2
import numpy as np

cv2.setNumThreads(1)
ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
SIZES, RUNS = ("256x240", "640x480"), 3
STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 10, 1e-4)
# Borders that ours leaves, px: left, right and bottom.
LEFT, BORDER = 6, 4
# Bird's-eye view: pixel (m), nearest and farthest floor of the current and of the older picture, and half its width (m).
CELL, NEAR, FAR, FAR_OLDER, HALF = 0.01, 0.75, 2.6, 3.1, 1.2


def shifted(x, y):
    return np.array([[1, 0, x], [0, 1, y], [0, 0, 1.0]])


def reduction(k):
    """Pixels of a picture reduced by k from those of the whole one."""
    return np.array([[1 / k, 0, 0.5 / k - 0.5], [0, 1 / k, 0.5 / k - 0.5], [0, 0, 1]])


def motion_matrix(motion):
    cos, sin = np.cos(motion[2]), np.sin(motion[2])
    return np.array([[cos, -sin, motion[0]], [sin, cos, motion[1]], [0, 0, 1]])


def moved(warp, pixels):
    """Pixels of the older picture; `pixels` are homogeneous columns."""
    there = warp @ pixels
    return (there[:2] / there[2]).T


def ecc(current, older, warp, model, blur, mask=None):
    """Best warp from current to older pixels and the time, ms."""
    warp = (warp / warp[2, 2]).astype(np.float32)
    start = warp if model == cv2.MOTION_HOMOGRAPHY else np.ascontiguousarray(warp[:2])
    begin = time.thread_time_ns()
    found = cv2.findTransformECC(current, older, start, model, STOP, mask, blur)[1]
    took_ms = (time.thread_time_ns() - begin) / 1e6
    return (found if len(found) == 3 else np.vstack((found, (0, 0, 1)))).astype(float), took_ms


class Problem:
    """Camera, pictures and pairs of one size."""

    def __init__(self, folder, size):
        with open(os.path.join(folder, "plane_motion_%s.json" % size)) as file:
            data = json.load(file)
        self.looks, self.judged_ms = data["looks"], data["judged_ms"]
        names = {look["current"] for look in self.looks} | {pair["previous"] for pair in self.pairs()}
        self.pictures = {name: cv2.imread(os.path.join(folder, name), cv2.IMREAD_GRAYSCALE) for name in names}
        if not names or any(picture is None for picture in self.pictures.values()):
            raise OSError("a picture of %s is missing" % size)
        (fx, fy), (cx, cy) = data["focal_px"], data["center_px"]
        self.matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        self.rotation = np.array(data["robot_from_camera_rows"]).reshape(3, 3)
        self.position = np.array(data["camera_in_robot_m"])
        self.width, self.height = map(int, size.split("x"))
        self.top = data["top_row"]
        self.area = (self.width - LEFT - BORDER) * (self.height - BORDER - self.top)
        self.spacing = max(1, round(np.sqrt(self.area / self.pairs()[0]["our_pixels"])))
        grid = np.mgrid[LEFT:self.width - BORDER:self.width // 32, self.top:self.height - BORDER:self.height // 40]
        self.grid = np.vstack((grid.reshape(2, -1), np.ones(grid[0].size)))

    def pairs(self):
        return [pair for look in self.looks for pair in look["pairs"]]

    def warp(self, motion):
        """Homography of the floor from current to older pixels."""
        turn = motion_matrix((0, 0, motion[2]))
        shift = self.rotation.T @ (turn @ self.position + (motion[0], motion[1], 0) - self.position)
        plane = np.outer(shift, self.rotation.T @ (0, 0, -1.0)) / self.position[2]
        return self.matrix @ (self.rotation.T @ turn @ self.rotation + plane) @ np.linalg.inv(self.matrix)

    def motion(self, warp, prior):
        """Motion whose warp is the nearest to `warp` on the aligned floor; the mount is known exactly."""
        goal, motion = moved(warp, self.grid), np.array(prior)
        at = lambda motion: moved(self.warp(motion), self.grid).ravel()
        for _ in range(10):
            slope = np.stack([(at(motion + step) - at(motion - step)) / 2e-6 for step in 1e-6 * np.eye(3)], 1)
            motion = motion + np.linalg.lstsq(slope, goal.ravel() - at(motion), rcond=None)[0]
        return motion

    def off_px(self, warp, truth):
        off = moved(warp, self.grid) - moved(self.warp(truth), self.grid)
        return np.sqrt((off ** 2).sum(1).mean())

    def crops(self, name, older, k):
        """Area of the current and of the older picture, reduced by k, and the pixels of each from those of the whole picture."""
        current, top = self.pictures[name], max(self.top - self.height // 8, 0)
        left, rows = (0, self.height - top) if older else (LEFT, self.height - BORDER - self.top)
        top = top if older else self.top
        columns = self.width if older else self.width - LEFT - BORDER
        part = current[top:top + rows // k * k, left:left + columns // k * k]
        part = cv2.resize(part, (columns // k, rows // k), interpolation=cv2.INTER_AREA) if k > 1 else part.copy()
        return part, reduction(k) @ shifted(-left, -top)

    def homography(self, look, pair, k):
        """The time includes the reduction of the newest picture."""
        older, to_older = self.crops(pair["previous"], True, k)
        begin = time.thread_time_ns()
        current, to_current = self.crops(look["current"], False, k)
        reduced_ms = (time.thread_time_ns() - begin) / 1e6
        start = to_older @ self.warp(pair["prior_motion"]) @ np.linalg.inv(to_current)
        # A reduced picture is smooth enough.
        found, took_ms = ecc(current, older, start, cv2.MOTION_HOMOGRAPHY, 1 if k > 1 else 5)
        return np.linalg.inv(to_older) @ found @ to_current, reduced_ms + took_ms

    def affine(self, look, pair, _):
        """Affine rest after the older picture is warped by the prior."""
        current, to_current = self.crops(look["current"], False, 1)
        prior = self.warp(pair["prior_motion"]) @ np.linalg.inv(to_current)
        begin = time.thread_time_ns()
        older = cv2.warpPerspective(self.pictures[pair["previous"]], prior, current.shape[::-1],
                                    flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        warped_ms = (time.thread_time_ns() - begin) / 1e6
        found, took_ms = ecc(current, older, np.eye(3), cv2.MOTION_AFFINE, 5)
        return prior @ found @ to_current, warped_ms + took_ms

    def birds_eye(self, picture, far):
        """Floor from above, and its floor points from its pixels."""
        floor = np.array([[0, -CELL, far], [-CELL, 0, HALF], [0, 0, 1]])
        toward = self.rotation.T
        pixel = self.matrix @ np.column_stack((toward[:, 0], toward[:, 1], -toward @ self.position))
        size = (round(2 * HALF / CELL), round((far - NEAR) / CELL))
        return cv2.warpPerspective(picture, pixel @ floor, size, flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP), floor

    def euclidean(self, look, pair, _):
        """The motion itself, as turn and shift of the floor from above; the views are made before."""
        current, floor = self.birds_eye(self.pictures[look["current"]], FAR)
        older, floor_older = self.birds_eye(self.pictures[pair["previous"]], FAR_OLDER)
        inside = np.zeros((self.height, self.width), np.uint8)
        inside[BORDER:-BORDER, LEFT:-BORDER] = 255
        mask = cv2.erode(self.birds_eye(inside, FAR_OLDER)[0] // 255, np.ones((5, 5), np.uint8))
        # ECC masks pixels of the older picture: the border of the current one gets there by the prior.
        start = np.linalg.inv(floor_older) @ motion_matrix(pair["prior_motion"]) @ floor
        seen = cv2.erode(self.birds_eye(inside, FAR)[0] // 255, np.ones((5, 5), np.uint8))
        mask &= cv2.warpAffine(seen, start[:2], mask.shape[::-1], flags=cv2.INTER_NEAREST)
        found, took_ms = ecc(current, older, start, cv2.MOTION_EUCLIDEAN, 5, mask)
        motion = floor_older @ found @ np.linalg.inv(floor)
        return self.warp((motion[0, 2], motion[1, 2], np.arctan2(motion[1, 0], motion[0, 0]))), took_ms

    def follow(self, look, pair, window, levels):
        """Time to follow the judged points into the older picture, ms."""
        points = np.array(look["judged_pixels"], np.float32)
        pixels = np.column_stack((points, np.ones(len(points)))).T
        start = np.ascontiguousarray(moved(self.warp(pair["prior_motion"]), pixels), np.float32)
        current, older = self.pictures[look["current"]], self.pictures[pair["previous"]]
        begin = time.thread_time_ns()
        cv2.calcOpticalFlowPyrLK(current, older, points, start, winSize=(window, window), maxLevel=levels,
                                 flags=cv2.OPTFLOW_USE_INITIAL_FLOW)
        return (time.thread_time_ns() - begin) / 1e6


REDUCED, SMALL = "ECC homography, as many pixels", "Lucas-Kanade, 15x15, 2 levels"
WAYS = {"ECC homography, every pixel": (Problem.homography, False), REDUCED: (Problem.homography, True),
        "ECC affine, every pixel": (Problem.affine, False), "ECC Euclidean, from above, 1 cm": (Problem.euclidean, False)}
FOLLOWERS = {"Lucas-Kanade, 21x21, 4 levels": (21, 3), SMALL: (15, 1)}


def measure(problem, times_ms, warps):
    """Adds the median time of each step in this round, ms; keeps the warps of each way, `None` where ECC gave up."""
    pairs = [(look, pair) for look in problem.looks for pair in look["pairs"]]
    add = lambda name, values: times_ms.setdefault(name, []).append(np.median(values))
    add("align", [pair["our_ms"] for _, pair in pairs])
    add("prepare", [look["prepared_ms"] for look in problem.looks])
    add("judge", problem.judged_ms)
    for name, (way, is_reduced) in WAYS.items():
        found = [align(problem, way, look, pair, problem.spacing if is_reduced else 1) for look, pair in pairs]
        warps[name] = [warp for warp, _ in found]
        add(name, [took_ms for warp, took_ms in found if warp is not None] or [np.nan])
    for name, setting in FOLLOWERS.items():
        add(name, [problem.follow(look, pair, *setting) for look, pair in pairs for _ in range(RUNS)])


def align(problem, way, look, pair, k):
    try:
        runs = [way(problem, look, pair, k) for _ in range(RUNS)]
    except cv2.error:
        return None, np.nan
    return runs[0][0], np.median([took_ms for _, took_ms in runs])


def report_times(times_ms):
    times = {name: np.array(each) for name, each in times_ms.items()}
    print("  ours: alignment %.2f ms, preparation of a picture %.2f ms, picture judged %.2f ms" % tuple(
        np.median(times[name]) for name in ("align", "prepare", "judge")))

    both = times["align"] + times["prepare"]

    def line(name, peer, ours):
        ratios = ["%.1f (%.1f to %.1f) times our %s" % (np.median(peer / each), min(peer / each), max(peer / each), what)
                  for what, each in ours.items()]
        print("  %-46s %6.2f ms, %s" % (name, np.median(peer), ", ".join(ratios)))

    for name in WAYS:
        line(name, times[name], {"alignment": times["align"], "alignment and preparation": both})
    for name in FOLLOWERS:
        line(name + ", one older picture", times[name], {"judgement": times["judge"]})
    line("ECC, as many pixels, and 15x15, three times", 3 * (times[REDUCED] + times[SMALL]), {"judgement": times["judge"]})


def report_accuracy(problem, scene, warps):
    """Median and largest error of the motion, and that of the floor's warp."""
    looks = [look["scene"] for look in problem.looks for _ in look["pairs"]]
    pairs = [pair for pair, where in zip(problem.pairs(), looks) if where == scene]
    answers = {"prior": [(pair["prior_motion"], problem.warp(pair["prior_motion"])) for pair in pairs],
               "ours": [(pair["our_motion"], np.reshape(pair["our_warp_rows"], (3, 3))) for pair in pairs]}
    for name, each in warps.items():
        each = [warp for warp, where in zip(each, looks) if where == scene]
        answers[name] = [warp is not None and (problem.motion(warp, pair["prior_motion"]), warp)
                         for warp, pair in zip(each, pairs)]
    for name, each in answers.items():
        known = [(np.subtract(answer[0], pair["true_motion"]), problem.off_px(answer[1], pair["true_motion"]))
                 for answer, pair in zip(each, pairs) if answer]
        if not known:
            print("  %s, %s: none of %d aligned" % (scene, name, len(pairs)))
            continue
        way = [1e3 * np.hypot(off[0], off[1]) for off, _ in known]
        turn = [np.degrees(abs(off[2])) for off, _ in known]
        print("  %s, %-31s median %5.2f mm %.3f degrees %.2f px, largest %5.1f mm %.2f degrees, %d of %d aligned" % (
            scene, name, np.median(way), np.median(turn), np.median([px for _, px in known]), max(way), max(turn),
            len(known), len(pairs)))


def run_ours(folder):
    """Writes pictures, alignments and times; the filter matches none of criterion's own measurements."""
    command = ["cargo", "bench", "-p", "yamabico-vision", "--bench", "plane_motion", "--", "none"]
    frames = dict(os.environ, YAMABICO_FRAMES=os.path.abspath(folder))
    done = subprocess.run(command, cwd=ROOT, env=frames, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        sys.exit(done.stdout)


def main():
    if len(sys.argv) not in (2, 3) or not "".join(sys.argv[2:] or "1").isdigit():
        sys.exit(__doc__)
    folder, rounds = sys.argv[1], max(1, int("".join(sys.argv[2:] or "3")))
    if not shutil.which("cargo"):
        print("no cargo: ours as the files say, one round")
        rounds = 1
    times_ms, warps = {size: {} for size in SIZES}, {size: {} for size in SIZES}
    for _ in range(rounds):
        if shutil.which("cargo"):
            run_ours(folder)
        try:
            problems = {size: Problem(folder, size) for size in SIZES}
        except (OSError, ValueError, KeyError, IndexError) as error:
            sys.exit("%s: %s\n%s" % (folder, error, __doc__))
        for size, problem in problems.items():
            measure(problem, times_ms[size], warps[size])
    for size, problem in problems.items():
        print("%s: %d pairs, OpenCV %s, rounds: %d; ours aligns %d pixels of the %d, and judges %d points" % (
            size, len(problem.pairs()), cv2.__version__, rounds, problem.pairs()[0]["our_pixels"], problem.area,
            np.median([len(look["judged_pixels"]) for look in problem.looks])))
        report_times(times_ms[size])
        for scene in sorted({look["scene"] for look in problem.looks}):
            report_accuracy(problem, scene, warps[size])


if __name__ == "__main__":
    main()
