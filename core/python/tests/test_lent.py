"""The pixels of a frame cannot be used after the call in which they are valid."""

import copy
import ctypes
import gc
import unittest
import weakref

import numpy as np

from yamabico.lent import Lease, ReleasedError, lend, pixels_of
from yamabico.messages import Encoding, FrameHeader


class Keeper:
    """Stands for a sample of the bus: freed when its last reference is gone."""

    def __init__(self):
        self.memory = (ctypes.c_uint8 * 24)(*range(24))


def lent():
    keeper = Keeper()
    lease = Lease("camera")
    header = FrameHeader(width=5, height=4, stride=6, encoding=Encoding.GRAY8)
    image = pixels_of(header, lend(ctypes.addressof(keeper.memory), 24, keeper, lease))
    return image, lease, weakref.ref(keeper)


class Lending(unittest.TestCase):
    def test_it_reads_in_place_and_cannot_be_written(self):
        image, _, keeper = lent()
        self.assertEqual(image.shape, (4, 5))
        self.assertEqual(int(image[1, 0]), 6)
        keeper().memory[6] = 99
        self.assertEqual(int(image[1, 0]), 99)
        with self.assertRaises(ValueError):
            image[0, 0] = 1

    def test_every_use_after_release_is_refused(self):
        image, lease, _ = lent()
        views = {
            "itself": image,
            "slice": image[1:],
            "transposed": image.T,
            "with another axis": image[np.newaxis],
            "flipped": np.flipud(image),
            "split": np.split(image, 2)[1],
            "diagonal": np.diagonal(image),
            "seen again": image.view(),
        }
        lease.is_over = True
        uses = {
            "index": lambda a: a[0],
            "sum": lambda a: a.sum(),
            "ufunc": lambda a: np.add(a, 1),
            "operator": lambda a: 2 * a,
            "as output": lambda a: np.add(np.zeros(a.view(np.ndarray).shape), 1, out=a),
            "function": lambda a: np.mean(a),
            "in a list": lambda a: np.concatenate([a, a]),
            "iterated": lambda a: list(a),
            "copied": lambda a: a.copy(),
            "deep copied": copy.deepcopy,
            "converted": lambda a: a.astype(float),
            "listed": lambda a: a.tolist(),
            "shown": repr,
            "its shape": lambda a: a.shape,
        }
        for name, view in views.items():
            for use, attempt in uses.items():
                with self.subTest(view=name, use=use), self.assertRaises(ReleasedError):
                    attempt(view)

    def test_copies_and_results_may_be_kept(self):
        image, lease, keeper = lent()
        kept = [image.copy(), image.astype(np.float32), image + 1, np.sort(image), image.mean(axis=0), copy.copy(image)]
        del image
        lease.is_over = True
        gc.collect()
        self.assertIsNone(keeper(), "nothing keeps the sample alive")
        self.assertTrue(all(array.sum() > 0 for array in kept))

    def test_an_array_that_bypasses_the_check_keeps_its_own_frame(self):
        image, lease, keeper = lent()
        plain = np.asarray(image)[1:]
        del image
        lease.is_over = True
        gc.collect()
        self.assertIsNotNone(keeper(), "its memory is not released")
        self.assertEqual(int(plain[0, 0]), 6)
        del plain
        gc.collect()
        self.assertIsNone(keeper())

    def test_a_header_that_does_not_fit_is_refused(self):
        bytes_ = np.zeros(24, dtype=np.uint8)
        for header in [
            FrameHeader(width=5, height=5, stride=6, encoding=Encoding.GRAY8),
            FrameHeader(width=7, height=3, stride=6, encoding=Encoding.GRAY8),
            FrameHeader(width=5, height=4, stride=6, encoding=9),
            FrameHeader(width=2, height=5, stride=6, encoding=Encoding.RGB8),
            FrameHeader(width=0, height=4, stride=6, encoding=Encoding.GRAY8),
        ]:
            with self.assertRaises(ValueError):
                pixels_of(header, bytes_)
        color = FrameHeader(width=2, height=4, stride=6, encoding=Encoding.RGB8)
        self.assertEqual(pixels_of(color, bytes_).shape, (4, 2, 3))


if __name__ == "__main__":
    unittest.main()
