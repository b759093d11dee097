"""Message types that the wheels of ROS 2 lack: their names, with messages as bytes.

A publisher of serialized messages needs of a type only its name. So the type support of `std_msgs/msg/String` is copied and renamed.
"""

import ctypes
import struct

from std_msgs.msg import String


class _Callbacks(ctypes.Structure):
    """Beginning of the callbacks that Fast DDS's type support has: the names of the package and of the type."""

    _fields_ = [("namespace", ctypes.c_char_p), ("name", ctypes.c_char_p), ("rest", ctypes.c_void_p * 14)]


_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)


class _TypeSupport(ctypes.Structure):
    _fields_ = [("identifier", ctypes.c_char_p), ("data", ctypes.c_void_p), ("function", _FUNCTION),
                ("descriptions", ctypes.c_void_p * 3)]


_KEPT = []


def _handle(kind):
    """Type support of `std_msgs/msg/String`."""
    library = ctypes.CDLL(f"libstd_msgs__rosidl_typesupport_{kind}.so")
    function = library[f"rosidl_typesupport_{kind}__get_message_type_support_handle__std_msgs__msg__String"]
    function.restype = ctypes.POINTER(_TypeSupport)
    return function()


def foreign_type(package, name):
    """Returns a class that rclpy takes for the message `package/msg/name`; its publishers take bytes."""
    original = _handle("fastrtps_c").contents
    callbacks = _Callbacks.from_buffer_copy(ctypes.cast(original.data, ctypes.POINTER(_Callbacks)).contents)
    callbacks.namespace, callbacks.name = f"{package}::msg".encode(), name.encode()
    support = _TypeSupport.from_buffer_copy(original)
    support.data = ctypes.addressof(callbacks)
    introspection = ctypes.cast(_handle("introspection_c"), ctypes.c_void_p).value

    def of(_, identifier):
        known = {original.identifier: ctypes.addressof(support), b"rosidl_typesupport_introspection_c": introspection}
        return known.get(identifier)

    support.function = _FUNCTION(of)
    _KEPT.extend([callbacks, support, of])
    capsule = ctypes.pythonapi.PyCapsule_New
    capsule.restype, capsule.argtypes = ctypes.py_object, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]

    kind = type(String)
    kind.__import_type_support__()
    names = ["_CREATE_ROS_MESSAGE", "_CONVERT_FROM_PY", "_CONVERT_TO_PY", "_DESTROY_ROS_MESSAGE"]
    attributes = {name: getattr(kind, name) for name in names}
    # rclpy looks in the class of the class.
    attributes["_TYPE_SUPPORT"] = capsule(ctypes.addressof(support), None, None)
    return type(f"Metaclass_{name}", (type,), attributes)(name, (), {})


class Cdr:
    """Writes a message in CDR, little-endian."""

    def __init__(self):
        self.data = bytearray(b"\0\1\0\0")

    def number(self, form, value):
        size = struct.calcsize(form)
        self.data.extend(b"\0" * (-(len(self.data) - 4) % size))
        self.data.extend(struct.pack("<" + form, value))
        return self

    def text(self, text):
        encoded = text.encode() + b"\0"
        self.number("I", len(encoded)).data.extend(encoded)
        return self

    def header(self, stamp, frame):
        return self.number("i", stamp.sec).number("I", stamp.nanosec).text(frame)

    def bytes(self):
        return bytes(self.data)
