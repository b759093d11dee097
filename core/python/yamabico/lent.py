"""Zero-copy access to the pixels of frames in shared memory.

The pixels are valid during one call of `propose`. Later use of the array, or of any view of it, raises `ReleasedError`; use
`pixels.copy()` to keep data. An array that bypasses this check (`numpy.asarray` of a kept array) still reads the same frame,
since the memory is released only after the last reference is gone.
"""

import ctypes

import numpy as np

from .messages import Encoding


class ReleasedError(RuntimeError):
    """Pixels were used after the call of `propose` in which they were valid."""


class Lease:
    """Validity of the pixels of one slot."""

    def __init__(self, slot):
        self.slot = slot
        self.is_over = False

    def check(self):
        """Raises `ReleasedError` if the pixels are no longer valid."""
        if self.is_over:
            raise ReleasedError(f"the pixels of `{self.slot}` are valid during one call of `propose` only: use `pixels.copy()` to keep them")


class LentArray(np.ndarray):
    """A read-only array in shared memory, or a view of one. Results of computations are ordinary arrays."""

    def __array_finalize__(self, source):
        lease = None if source is None or self.flags.owndata else _lease_of(source)
        object.__setattr__(self, "_lease", lease)

    def __getattribute__(self, name):
        _check(self)
        return super().__getattribute__(name)

    def __array_ufunc__(self, ufunc, method, *inputs, out=None, **others):
        if out is not None:
            others["out"] = _plain(out)
        return getattr(ufunc, method)(*_plain(inputs), **_plain(others))

    def __array_function__(self, function, types, args, kwargs):
        leases = []
        result = function(*_plain(args, leases), **_plain(kwargs, leases))
        return _lent_again(result, leases)

    def copy(self, order="C"):
        """Returns an ordinary array, which stays valid."""
        return np.array(self.view(np.ndarray), order=order, copy=True)

    def astype(self, *args, **kwargs):
        """Returns an ordinary array, which stays valid."""
        kwargs["copy"] = True
        return self.view(np.ndarray).astype(*args, **kwargs)

    def __copy__(self):
        return self.copy()

    def __deepcopy__(self, memo):
        return self.copy()


def _guard(name):
    method = getattr(np.ndarray, name)

    def guarded(self, *args):
        _check(self)
        return method(self, *args)

    guarded.__name__ = name
    setattr(LentArray, name, guarded)


for _name in ("getitem", "setitem", "iter", "len", "contains", "bool", "int", "float", "index", "repr", "str", "array", "reduce"):
    _guard(f"__{_name}__")


def lend(address, length, keeper, lease):
    """Returns the bytes at `address` as a read-only array that `lease` guards. Keeps `keeper` alive as long as the memory is in use."""
    memory = (ctypes.c_uint8 * length).from_address(address)
    memory.keeper = keeper
    array = np.frombuffer(memoryview(memory).toreadonly(), dtype=np.uint8).view(LentArray)
    object.__setattr__(array, "_lease", lease)
    return array


def pixels_of(header, bytes_):
    """Returns the image in `bytes_` as an array of shape (height, width), or (height, width, 3) for a color frame.

    Raises `ValueError` if the header does not match the bytes.
    """
    channels = {Encoding.GRAY8: 1, Encoding.RGB8: 3}.get(header.encoding)
    row = header.width * (channels or 0)
    if not row or not header.height or header.stride < row or header.stride * header.height > len(bytes_):
        raise ValueError(f"{len(bytes_)} bytes do not match the frame {header}")
    rows = bytes_[: header.stride * header.height].reshape(header.height, header.stride)[:, :row]
    return rows if channels == 1 else rows.reshape(header.height, header.width, channels)


def _lease_of(array):
    return object.__getattribute__(array, "_lease") if isinstance(array, LentArray) else None


def _check(array):
    lease = object.__getattribute__(array, "__dict__").get("_lease")
    if lease is not None and lease.is_over:
        lease.check()


def _plain(value, leases=None):
    """Returns `value` with lent arrays replaced by ordinary ones; checks their leases and appends them to `leases`."""
    if isinstance(value, LentArray):
        lease = _lease_of(value)
        if lease is not None:
            lease.check()
            if leases is not None:
                leases.append((lease, value))
        return value.view(np.ndarray)
    if isinstance(value, (tuple, list)):
        return type(value)(_plain(part, leases) for part in value)
    if isinstance(value, dict):
        return {key: _plain(part, leases) for key, part in value.items()}
    return value


def _lent_again(result, leases):
    """Guards results that are views of lent arrays, such as those of `numpy.flipud`."""
    if isinstance(result, (tuple, list)) and type(result) in (tuple, list):
        return type(result)(_lent_again(part, leases) for part in result)
    if isinstance(result, np.ndarray) and not result.flags.owndata:
        for lease, source in leases:
            if np.may_share_memory(result, source.view(np.ndarray)):
                lent = result.view(LentArray)
                object.__setattr__(lent, "_lease", lease)
                return lent
    return result
