"""The robot's bus. The supervisor creates the topics; plugins open them. Each port belongs to the thread that opened it."""

import ctypes
import time

import iceoryx2 as iox2

from .messages import MESSAGES

#: Queue length of a subscriber of a stream, messages.
STREAM_DEPTH = 64
#: Timeout for opening a topic, s.
OPEN_TIMEOUT_S = 0.5
#: Time between two attempts, s.
RETRY_S = 0.025


class BusError(RuntimeError):
    """A topic could not be opened, or a message could not be published or received."""


class Bus:
    """The bus of a running robot; the launch configuration contains its folder and file prefix."""

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
        self._node = _retry("the bus", lambda: builder().create(iox2.ServiceType.Ipc))
        self._topics = {}

    def publisher(self, topic, message):
        """Opens a publisher of messages of the class `message` on `topic`."""
        service = self._topic(topic, message)
        notifies = _attribute(service, "yamabico.notifies") == "true"
        return Publisher(topic, message, service, self._event(topic) if notifies else None)

    def subscriber(self, topic, message):
        """Opens a subscriber of messages of the class `message` on `topic`."""
        return Subscriber(topic, message, self._topic(topic, message))

    def wait_set(self, topics):
        """Returns a wait set for messages on any of `topics`."""
        return WaitSet([self._event(topic) for topic in topics])

    def _topic(self, topic, message):
        if topic not in self._topics:
            builder = lambda: (
                self._node.service_builder(iox2.ServiceName.new(topic))
                .publish_subscribe(iox2.Slice[ctypes.c_uint8])
                .user_header(message)
                .payload_alignment(iox2.Alignment.new(8))
            )
            self._topics[topic] = _retry(f"topic `{topic}` as {message.NAME}", lambda: builder().open())
        return self._topics[topic]

    def _event(self, topic):
        service = lambda: self._node.service_builder(iox2.ServiceName.new(topic)).event().open()
        return _retry(f"the notification of topic `{topic}`", service)


class Publisher:
    """Publishes messages of one class."""

    def __init__(self, topic, message, service, event):
        self._message = message
        self._topic = topic
        self.max_item_bytes = int(_attribute(service, "yamabico.list_bytes") or 0)
        self._port = (
            service.publisher_builder()
            .initial_max_slice_len(max(self.max_item_bytes, 1))
            .allocation_strategy(iox2.AllocationStrategy.Static)
            .max_loaned_samples(1)
            .backpressure_strategy(iox2.BackpressureStrategy.DiscardData)
            .create()
        )
        self._notifier = event and event.notifier_builder().create()
        self._service = service

    def is_watched(self):
        """Returns true if the topic has a subscriber in any process."""
        return self._service.dynamic_config.number_of_subscribers > 0

    def publish(self, header, items=b""):
        """Publishes `header` and `items`: bytes, a ctypes array, or a contiguous numpy array."""
        if type(header) is not self._message:
            raise BusError(f"`{self._topic}` carries {self._message.__name__}, but the message is {type(header).__name__}")
        data = memoryview(items).cast("B")
        if len(data) > self.max_item_bytes:
            raise BusError(f"`{self._topic}` takes at most {self.max_item_bytes} bytes of items, but the message has {len(data)}")
        sample = self._port.loan_slice_uninit(len(data))
        ctypes.memmove(sample.user_header_ptr, ctypes.byref(header), ctypes.sizeof(header))
        if len(data):
            memoryview((ctypes.c_uint8 * len(data)).from_address(sample.payload_ptr)).cast("B")[:] = data
        sample.assume_init().send()
        try:
            if self._notifier:
                self._notifier.notify()
        except iox2.NotifierNotifyError:
            pass  # The subscriber has pending notifications already, and the message is delivered.


class Subscriber:
    """Subscribes to messages of one class."""

    def __init__(self, topic, message, service):
        self.message = message
        self._topic = topic
        latest = message.CHANNEL == "latest"
        self._port = service.subscriber_builder().buffer_size(1 if latest else STREAM_DEPTH).history_request(int(latest)).create()

    def receive(self):
        """Returns the oldest unread message as (header, sample), or None. The header is a copy."""
        try:
            sample = self._port.receive()
        except iox2.ReceiveError as error:
            raise BusError(f"`{self._topic}`: {error}; too many earlier messages are still in use: copy the data instead of keeping views") from None
        if sample is None:
            return None
        header = self.message.from_buffer_copy(ctypes.string_at(sample.user_header_ptr, ctypes.sizeof(self.message)))
        return header, sample


class WaitSet:
    """Waits for messages."""

    def __init__(self, events):
        self._listeners = [event.listener_builder().create() for event in events]
        self._set = iox2.WaitSetBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)
        self._guards = [self._set.attach_notification(listener) for listener in self._listeners]

    def wait(self, timeout_s):
        """Returns when a message has arrived, or after `timeout_s`."""
        if not self._listeners:
            time.sleep(timeout_s)
            return
        self._set.wait_and_process_with_timeout(iox2.Duration.from_nanos(max(int(timeout_s * 1e9), 1)))
        for listener in self._listeners:
            listener.try_wait()


def items_of(message, sample):
    """Returns a copy of the items of a message, as an array of the item class or as bytes."""
    length = sample.payload().len()
    data = ctypes.string_at(sample.payload_ptr, length) if length else b""
    if message.ITEM is None:
        return data
    return (message.ITEM * (length // ctypes.sizeof(message.ITEM))).from_buffer_copy(data)


def message_class(name, own=()):
    """Returns the message class of a versioned name, one of this package or one of the program's `own`.

    Raises `BusError` if the name or its version is unknown.
    """
    for message in own:
        if message.NAME == name:
            return message
    if name in MESSAGES:
        return MESSAGES[name]
    family = name.rpartition(".")[0]
    known = [other for other in MESSAGES if other.rpartition(".")[0] == family]
    if known:
        raise BusError(f"`{name}` is another version of `{known[0]}`: install the version of this package that belongs to the robot")
    raise BusError(f"message type `{name}` is unknown to this package")


def _attribute(service, key):
    values = service.attributes.key_values(iox2.AttributeKey.new(key))
    return values[0].to_string() if values else None


def _retry(what, attempt):
    begun = time.monotonic()
    while True:
        try:
            return attempt()
        except Exception as error:
            if "IncompatibleTypes" in str(error) or time.monotonic() - begun + RETRY_S > OPEN_TIMEOUT_S:
                raise BusError(f"{what} could not be opened: {error}") from None
            time.sleep(RETRY_S)
