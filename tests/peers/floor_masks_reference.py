"""Precision and recall of the floor on photographs with floor masks: GrabCut, and a color histogram of the foreground.

Both get what the project's method gets: the foreground (lowest 12 %, middle fifth) is floor, the highest 38 % are not. Precision at
recall 0.7 ranks the pixels of all images of a group together; GrabCut's mask is ranked from the bottom upward.

    python floor_masks_reference.py [SCENE ...]
"""

import csv
import os
import sys

from common import DATA, cv2, np

FOLDER = os.path.join(DATA, "floor_masks")
RECALL = 0.7


def places(shape):
    """Foreground, and what lies above the horizon of a level camera."""
    height, width = shape
    v, u = np.mgrid[0:height, 0:width]
    above_bottom = (height - 0.5 - v) / height
    aside = np.abs((u + 0.5) / width - 0.5) * 2
    return (above_bottom < 0.12) & (aside < 0.2), above_bottom > 0.62


def grab_cut(image):
    """Five iterations; scores above 0 are floor."""
    foreground, no_floor = places(image.shape[:2])
    mask = np.full(image.shape[:2], cv2.GC_PR_BGD, np.uint8)
    mask[no_floor] = cv2.GC_BGD
    mask[foreground] = cv2.GC_FGD
    cv2.grabCut(image, mask, None, np.zeros((1, 65)), np.zeros((1, 65)), 5, cv2.GC_INIT_WITH_MASK)
    is_floor = (mask == cv2.GC_FGD) | (mask == cv2.GC_PR_FGD)
    height = image.shape[0]
    from_top = np.mgrid[0:height, 0 : image.shape[1]][0] / height + 1e-6
    return np.where(is_floor, from_top, from_top - 1)


def color(image):
    """Log ratio of the colors' frequency (Lab, 16 levels a channel, smoothed) in the foreground and above the horizon."""
    foreground, no_floor = places(image.shape[:2])
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2Lab) // 16
    index = (lab[..., 0].astype(int) * 16 + lab[..., 1]) * 16 + lab[..., 2]

    def frequency(chosen):
        counts = np.bincount(index[chosen], minlength=4096).reshape(16, 16, 16).astype(np.float32)
        for axis in range(3):
            rolled = np.moveaxis(counts, axis, 0)
            rolled[:] = rolled + 0.5 * (np.roll(rolled, 1, 0) + np.roll(rolled, -1, 0))
        return counts.ravel() / counts.sum()

    ratio = np.log((frequency(foreground) + 1e-4) / (frequency(no_floor) + 1e-4))
    scores = cv2.boxFilter(ratio[index].astype(np.float32), -1, (15, 15))
    scores[no_floor] = scores.min() - 1
    return scores


def frames():
    with open(os.path.join(FOLDER, "index.csv")) as file:
        for row in csv.DictReader(file):
            read = lambda kind, extension, flag: cv2.imread(os.path.join(FOLDER, kind, row["name"] + extension), flag)
            image, mask = read("images", ".jpg", 1), read("masks", ".png", 0)
            yield row["scene"], image, mask > 127, read("ignore", ".png", 0) <= 127


def row(name, results):
    """Prints precision and recall of scores above 0, and precision at recall 0.7."""
    scores, truth = (np.concatenate([result[i] for result in results]) for i in (0, 1))
    found = scores > 0
    both, floor = (found & truth).sum(), truth.sum()
    order = np.argsort(-scores, kind="stable")
    hits = np.cumsum(truth[order])
    last = np.searchsorted(hits, RECALL * floor)
    print(
        f"{name:24} {len(results):3} images: precision {both / max(found.sum(), 1):.3f}, recall {both / floor:.3f}; "
        f"precision at recall {RECALL}: {hits[last] / (last + 1):.3f}"
    )


if __name__ == "__main__":
    chosen = set(sys.argv[1:])
    for name, method in {"GrabCut": grab_cut, "color": color}.items():
        by_scene = {}
        for scene, image, mask, counts in frames():
            if not chosen or scene in chosen:
                by_scene.setdefault(scene, []).append((method(image)[counts], mask[counts]))
        for scene, results in sorted(by_scene.items()):
            row(f"{name}, {scene}", results)
        row(f"{name}, all", sum(by_scene.values(), []))
