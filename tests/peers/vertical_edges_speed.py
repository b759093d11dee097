"""Vertical edges: threshold, non-maximum suppression and difference from a model in five regions, with OpenCV and numpy.

Writes its image to the temporary folder (`yamabico-peers/vertical_edges.raw`), where the Rust benchmark `vertical_edges` reads it.
"""

from common import FOLDER, benchmark, corridor, cv2, np

THRESHOLD = 80
MODEL_TOLERANCE = np.ones((3, 5), np.uint8)
ROW_NEIGHBORHOOD = np.array([[1, 1, 1]], np.uint8)

image = corridor(256, 240, (130, 100), 4, 3)
model = np.zeros_like(image)
for column in (30, 61, 95, 140, 171, 200, 228):
    cv2.line(model, (column, 40), (column + 2, 210), 255, 1)
regions = [(i * 51, 60, 51, 170) for i in range(5)]


def edges_numpy():
    """Sobel, and maxima of each row by comparisons in numpy."""
    gradient = np.abs(cv2.Sobel(image, cv2.CV_16S, 1, 0))
    edges = np.zeros_like(image)
    center = gradient[:, 1:-1]
    is_maximum = (center >= gradient[:, :-2]) & (center > gradient[:, 2:])
    edges[:, 1:-1] = ((center > THRESHOLD) & is_maximum) * np.uint8(255)
    return edges


def edges_opencv():
    """Sobel, and maxima of each row by a horizontal dilation."""
    gradient = cv2.convertScaleAbs(cv2.Sobel(image, cv2.CV_16S, 1, 0), alpha=0.25)
    maxima = cv2.compare(gradient, cv2.dilate(gradient, ROW_NEIGHBORHOOD), cv2.CMP_EQ)
    return cv2.bitwise_and(maxima, cv2.threshold(gradient, THRESHOLD // 4, 255, cv2.THRESH_BINARY)[1])


def edges_canny():
    return cv2.Canny(image, 60, 120)


def unexplained(edges):
    """Counts the edge pixels of each region that the model does not explain."""
    extra = cv2.bitwise_and(edges, cv2.bitwise_not(cv2.dilate(model, MODEL_TOLERANCE)))
    return [cv2.countNonZero(extra[y : y + h, x : x + w]) for x, y, w, h in regions]


if __name__ == "__main__":
    image.tofile(f"{FOLDER}/vertical_edges.raw")
    print("unexplained edge pixels:", *(unexplained(edges()) for edges in (edges_numpy, edges_opencv, edges_canny)))
    benchmark(
        {
            "Sobel, numpy maxima": lambda: unexplained(edges_numpy()),
            "Sobel, OpenCV maxima": lambda: unexplained(edges_opencv()),
            "Canny": lambda: unexplained(edges_canny()),
            "step: Sobel": lambda: cv2.Sobel(image, cv2.CV_16S, 1, 0),
            "step: dilate model": lambda: cv2.dilate(model, MODEL_TOLERANCE),
        },
        "256x240",
    )
