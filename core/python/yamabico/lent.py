"""Pictures read where their sender wrote them, for as long as they are lent.

A picture is lent for one call of `propose`. Whoever uses it, or any array taken from it, later than that gets a
`ReleasedError`; what is to be kept is copied (`pixels.copy()`). What numpy lets slip through (`numpy.asarray` of an array that
was kept) still reads this very picture: its memory is given back only when nobody can reach it any more.
"""

import ctypes

import numpy as np

from .messages import Encoding


class ReleasedError(RuntimeError):
    """A picture was used after the call that it was lent for."""


class Lease:
    """Says whether what was lent may still be used."""

    def __init__(self, slot):
        self.slot = slot
        self.is_over = False

    def check(self):
        """Raises `ReleasedError` where it may not."""
        if self.is_over:
            raise ReleasedError(f"the picture of `{self.slot}` was lent for one call: copy what is to be kept")


class LentArray(np.ndarray):
    """A read-only array in shared memory, and every view taken from it. Results of computing with it are ordinary arrays."""

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
        """An ordinary array that may be kept."""
        return np.array(self.view(np.ndarray), order=order, copy=True)

    def astype(self, *args, **kwargs):
        """An ordinary array that may be kept."""
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
    """The bytes at `address` as a read-only array under `lease`. `keeper` lives as long as anything that reads them."""
    memory = (ctypes.c_uint8 * length).from_address(address)
    memory.keeper = keeper
    array = np.frombuffer(memoryview(memory).toreadonly(), dtype=np.uint8).view(LentArray)
    object.__setattr__(array, "_lease", lease)
    return array


def pixels_of(header, bytes_):
    """The picture that `bytes_` hold: (height, width), or (height, width, 3) of a color picture.

    Raises `ValueError` where the header does not fit its bytes.
    """
    channels = {Encoding.GRAY8: 1, Encoding.RGB8: 3}.get(header.encoding)
    row = header.width * (channels or 0)
    if not row or not header.height or header.stride < row or header.stride * header.height > len(bytes_):
        raise ValueError(f"{len(bytes_)} bytes are no picture of {header}")
    rows = bytes_[: header.stride * header.height].reshape(header.height, header.stride)[:, :row]
    return rows if channels == 1 else rows.reshape(header.height, header.width, channels)


def _lease_of(array):
    return object.__getattribute__(array, "_lease") if isinstance(array, LentArray) else None


def _check(array):
    lease = object.__getattribute__(array, "__dict__").get("_lease")
    if lease is not None and lease.is_over:
        lease.check()


def _plain(value, leases=None):
    """`value` with ordinary arrays in the place of lent ones, whose leases are checked and gathered."""
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
    """A view of what is lent, such as `numpy.flipud` returns, is lent as well."""
    if isinstance(result, (tuple, list)) and type(result) in (tuple, list):
        return type(result)(_lent_again(part, leases) for part in result)
    if isinstance(result, np.ndarray) and not result.flags.owndata:
        for lease, source in leases:
            if np.may_share_memory(result, source.view(np.ndarray)):
                lent = result.view(LentArray)
                object.__setattr__(lent, "_lease", lease)
                return lent
    return result
