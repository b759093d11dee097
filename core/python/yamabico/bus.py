"""The robot's bus: topics are opened, never created. Each port belongs to the thread that opened it."""

import ctypes
import time

import iceoryx2 as iox2

from .messages import MESSAGES

#: Messages that a reader of a stream can fall behind before it loses some.
STREAM_DEPTH = 64
#: No attempt to open a topic begins later than this, seconds.
PATIENCE_S = 0.5
PAUSE_S = 0.025


class BusError(RuntimeError):
    """A topic that does not open, or a message that does not pass."""


class Bus:
    """The bus of a running robot, whose supervisor told the folder and the prefix of the transport's files."""

    def __init__(self, root, prefix):
        iox2.set_log_level_from_env_or(iox2.LogLevel.Fatal)
        config = iox2.config.default()
        shared = config.global_cfg
        shared.prefix = iox2.FileName.new(prefix)
        shared.root_path = iox2.Path.new(root)
        shared.creation_timeout = iox2.Duration.from_millis(200)
        shared.node.cleanup_dead_nodes_on_creation = False
        shared.node.cleanup_dead_nodes_on_destruction = False
        shared.service.cleanup_dead_nodes_on_open = False
        builder = lambda: iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self._node = _patiently("the bus", lambda: builder().create(iox2.ServiceType.Ipc))
        self._topics = {}

    def publisher(self, topic, message):
        """The sending end of `topic` for messages of the class `message`."""
        service = self._topic(topic, message)
        rings = _attribute(service, "yamabico.rings") == "true"
        return Publisher(topic, message, service, self._bell(topic) if rings else None)

    def subscriber(self, topic, message):
        """A receiving end of `topic` for messages of the class `message`."""
        return Subscriber(topic, message, self._topic(topic, message))

    def waiter(self, topics):
        """Waits for messages on any of `topics`."""
        return Waiter([self._bell(topic) for topic in topics])

    def _topic(self, topic, message):
        if topic not in self._topics:
            builder = lambda: (
                self._node.service_builder(iox2.ServiceName.new(topic))
                .publish_subscribe(iox2.Slice[ctypes.c_uint8])
                .user_header(message)
                .payload_alignment(iox2.Alignment.new(8))
            )
            self._topics[topic] = _patiently(f"topic `{topic}` as {message.NAME}", lambda: builder().open())
        return self._topics[topic]

    def _bell(self, topic):
        service = lambda: self._node.service_builder(iox2.ServiceName.new(topic)).event().open()
        return _patiently(f"the bell of `{topic}`", service)


class Publisher:
    """Sends messages of one class."""

    def __init__(self, topic, message, service, bell):
        self._message = message
        self._topic = topic
        self.most_bytes = int(_attribute(service, "yamabico.list_bytes") or 0)
        self._port = (
            service.publisher_builder()
            .initial_max_slice_len(max(self.most_bytes, 1))
            .allocation_strategy(iox2.AllocationStrategy.Static)
            .max_loaned_samples(1)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .create()
        )
        self._bell = bell and bell.notifier_builder().create()

    def publish(self, header, items=b""):
        """Sends `header` and `items`: bytes, a ctypes array, or a contiguous numpy array."""
        if type(header) is not self._message:
            raise BusError(f"`{self._topic}` carries {self._message.__name__}, not {type(header).__name__}")
        data = memoryview(items).cast("B")
        if len(data) > self.most_bytes:
            raise BusError(f"`{self._topic}` holds at most {self.most_bytes} bytes of items, not {len(data)}")
        sample = self._port.loan_slice_uninit(len(data))
        ctypes.memmove(sample.user_header_ptr, ctypes.byref(header), ctypes.sizeof(header))
        if len(data):
            memoryview((ctypes.c_uint8 * len(data)).from_address(sample.payload_ptr)).cast("B")[:] = data
        sample.assume_init().send()
        try:
            if self._bell:
                self._bell.notify()
        except iox2.NotifierNotifyError:
            pass  # A bell that is full needs no ring: the message has been delivered.

    def welcome(self):
        """Hands the last value of a latest channel to readers that came since."""
        self._port.update_connections()


class Subscriber:
    """Receives messages of one class."""

    def __init__(self, topic, message, service):
        self.message = message
        self._topic = topic
        latest = message.CHANNEL == "latest"
        self._port = service.subscriber_builder().buffer_size(1 if latest else STREAM_DEPTH).history_request(int(latest)).create()

    def receive(self):
        """The oldest message that was not received yet, as (header, sample), or None. The header is a copy."""
        try:
            sample = self._port.receive()
        except iox2.ReceiveError as error:
            raise BusError(f"`{self._topic}`: {error}; views of earlier messages are kept: copy them") from None
        if sample is None:
            return None
        header = self.message.from_buffer_copy(ctypes.string_at(sample.user_header_ptr, ctypes.sizeof(self.message)))
        return header, sample


class Waiter:
    """Sleeps until something arrives."""

    def __init__(self, bells):
        self._listeners = [bell.listener_builder().create() for bell in bells]
        self._set = iox2.WaitSetBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        self._guards = [self._set.attach_notification(listener) for listener in self._listeners]

    def wait(self, longest_s):
        """Returns when something has arrived, or after so long."""
        if not self._listeners:
            time.sleep(longest_s)
            return
        self._set.wait_and_process_with_timeout(iox2.Duration.from_nanos(max(int(longest_s * 1e9), 1)))
        for listener in self._listeners:
            listener.try_wait()


def items_of(message, sample):
    """A copy of the items of a message: an array of the message's item class, or bytes."""
    length = sample.payload().len()
    data = ctypes.string_at(sample.payload_ptr, length) if length else b""
    if message.ITEM is None:
        return data
    return (message.ITEM * (length // ctypes.sizeof(message.ITEM))).from_buffer_copy(data)


def message_class(name):
    """The class of a versioned name. Raises `BusError`, naming both versions, where this package knows another one."""
    if name in MESSAGES:
        return MESSAGES[name]
    family = name.rpartition(".")[0]
    known = [other for other in MESSAGES if other.rpartition(".")[0] == family]
    if known:
        raise BusError(f"`{name}` is another version than the `{known[0]}` of this package: install that of the robot")
    raise BusError(f"this package knows no message `{name}`")


def _attribute(service, key):
    values = service.attributes.key_values(iox2.AttributeKey.new(key))
    return values[0].to_string() if values else None


def _patiently(what, attempt):
    begun = time.monotonic()
    while True:
        try:
            return attempt()
        except Exception as error:
            if "IncompatibleTypes" in str(error) or time.monotonic() - begun + PAUSE_S > PATIENCE_S:
                raise BusError(f"{what} does not open: {error}") from None
            time.sleep(PAUSE_S)
