"""Base classes of messages and of their items."""

import ctypes


#: Names of the plain types in a declaration.
_PLAIN = {ctypes.c_uint8: "u8", ctypes.c_uint32: "u32", ctypes.c_int32: "i32", ctypes.c_uint64: "u64", ctypes.c_double: "f64"}


class Item(ctypes.Structure):
    """An item of a list, or a struct inside a header."""

    def __repr__(self):
        names = [name.lstrip("_") for name, *_ in self._fields_]
        return f"{type(self).__name__}({', '.join(f'{name}={_shown(getattr(self, name))}' for name in names)})"


class Message(Item):
    """A header. `NAME` is the versioned name, `CHANNEL` "latest" or "stream", `ITEM` the class of the items or None."""

    NAME = ""
    CHANNEL = ""
    ITEM = None

    @classmethod
    def type_name(cls):
        """Returns the type name that the transport compares."""
        return cls.NAME

    @classmethod
    def declaration(cls):
        """Returns the layout of a message type of a program's own, with which other programs read it."""
        declared = {"name": cls.NAME, "channel": cls.CHANNEL, "header": _fields(cls)}
        return declared if cls.ITEM is None else {**declared, "items": _fields(cls.ITEM)}


def _fields(structure):
    return [{"name": name.lstrip("_"), "type": _type(kind)} for name, kind in structure._fields_]


def _type(kind):
    if kind in _PLAIN:
        return _PLAIN[kind]
    if issubclass(kind, ctypes.Structure):
        return _fields(kind)
    if issubclass(kind, ctypes.Array):
        return f"text[{kind._length_}]" if kind._type_ is ctypes.c_char else f"{_type(kind._type_)}[{kind._length_}]"
    raise TypeError(f"{kind.__name__} is no type of a message: use c_uint8, c_uint32, c_int32, c_uint64, c_double or c_char arrays")


def text(field):
    """Returns a property that reads and writes the bytes of `field` as text, truncated at the last whole character that fits."""

    def read(self):
        value = getattr(self, field)
        if isinstance(value, bytes):
            return _decoded(value)
        return [_decoded(element.value) for element in value]

    def write(self, value):
        kind = dict((name, kind) for name, kind in self._fields_)[field]
        # No byte of an earlier text remains behind a shorter one.
        ctypes.memset(ctypes.addressof(self) + getattr(type(self), field).offset, 0, ctypes.sizeof(kind))
        if isinstance(value, str):
            setattr(self, field, _encoded(value, ctypes.sizeof(kind)))
            return
        array = getattr(self, field)
        for index, element in enumerate(value):
            array[index].value = _encoded(element, ctypes.sizeof(kind._type_))

    return property(read, write)


def _decoded(value):
    return value.decode("utf-8", errors="ignore")


def _encoded(value, room):
    return value.encode("utf-8")[:room].decode("utf-8", errors="ignore").encode("utf-8")


def _shown(value):
    return list(value) if isinstance(value, ctypes.Array) else repr(value)
