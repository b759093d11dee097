//! The same hops over iceoryx2 alone, without this project.

use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use yamabico_core::message::{Command, FrameHeader, Proposal};
use yamabico_core::time::Time;

use super::{FRAME, PERIOD};

/// Stamp of a frame, in front of as many bytes as the message of this project has.
type Stamp = u64;

/// Hops in the order of a frame: name, bytes.
const HOPS: [(&str, usize); 3] = [
    ("frame", FRAME + size_of::<FrameHeader>()),
    ("proposal", size_of::<Proposal>()),
    ("command", size_of::<Command>()),
];

/// Time after which a frame counts as lost.
const LOST: Duration = Duration::from_secs(2);

/// Folder of the bare services' files; removed when dropped.
pub struct Root(std::path::PathBuf);

impl Root {
    pub fn new() -> Root {
        Root(std::path::PathBuf::from(format!("/dev/shm/ybl{}", std::process::id())))
    }

    pub fn path(&self) -> &str {
        self.0.to_str().unwrap()
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        let prefix = prefix(self.path());
        let _ = std::fs::remove_dir_all(&self.0);
        for segment in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if segment.file_name().to_string_lossy().starts_with(&prefix) {
                let _ = std::fs::remove_file(segment.path());
            }
        }
    }
}

/// Sending end of a hop.
struct Sender(Publisher<ipc::Service, [u8], Stamp>, Notifier<ipc::Service>, usize);

/// Receiving end of a hop.
struct Receiver(Subscriber<ipc::Service, [u8], Stamp>, Listener<ipc::Service>);

/// Process that sends frames and waits for commands.
pub struct Chain {
    node: Node<ipc::Service>,
}

impl Chain {
    /// Creates every hop.
    pub fn open(root: &Root) -> Chain {
        Chain { node: node(root.path()) }
    }

    /// Latencies of `frames` frames that are not lost, ns.
    pub fn measure(self, frames: usize) -> Vec<u64> {
        let (sender, receiver) = (Sender::open(&self.node, 0), Receiver::open(&self.node, 2));
        // The robot's first frame waits for its processes; half a period of distance keeps the two apart.
        std::thread::sleep(Duration::from_millis(500) + PERIOD / 2);
        let mut latencies = Vec::with_capacity(frames);
        let mut next = Instant::now();
        while latencies.len() < frames {
            next += PERIOD;
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
            let stamp = Time::monotonic_now().0;
            sender.send(stamp);
            let begun = Instant::now();
            while begun.elapsed() < LOST {
                if receiver.wait() == Some(stamp) {
                    latencies.push(Time::monotonic_now().0 - stamp);
                    break;
                }
            }
        }
        latencies
    }
}

/// Process of a relay: receives on its hop and sends on the next.
pub fn relay(role: &str, root: &str) {
    let hop = if role == "behavior" { 0 } else { 1 };
    let node = node(root);
    let (receiver, sender) = (Receiver::open(&node, hop), Sender::open(&node, hop + 1));
    loop {
        if let Some(stamp) = receiver.wait() {
            sender.send(stamp);
        }
    }
}

impl Sender {
    fn open(node: &Node<ipc::Service>, hop: usize) -> Sender {
        let (name, bytes) = HOPS[hop];
        let publisher = service(node, name)
            .publisher_builder()
            .initial_max_slice_len(bytes)
            .allocation_strategy(AllocationStrategy::Static)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create();
        let notifier = event(node, name).notifier_builder().create();
        Sender(publisher.unwrap(), notifier.unwrap(), bytes)
    }

    fn send(&self, stamp: Stamp) {
        let mut sample = self.0.loan_slice_uninit(self.2).unwrap();
        *sample.user_header_mut() = stamp;
        #[allow(unsafe_code, reason = "every byte is written before the sample is marked as initialized")]
        let sample = unsafe {
            std::ptr::write_bytes(sample.payload_mut().as_mut_ptr().cast::<u8>(), 1, self.2);
            sample.assume_init()
        };
        sample.send().unwrap();
        self.1.notify().unwrap();
    }
}

impl Receiver {
    fn open(node: &Node<ipc::Service>, hop: usize) -> Receiver {
        let (name, _) = HOPS[hop];
        let subscriber = service(node, name).subscriber_builder().buffer_size(1).create();
        let listener = event(node, name).listener_builder().create();
        Receiver(subscriber.unwrap(), listener.unwrap())
    }

    /// Waits for a notification of the hop; returns the newest stamp, if there is one.
    fn wait(&self) -> Option<Stamp> {
        self.1.timed_wait(|_| {}, Duration::from_millis(100)).unwrap();
        self.0.receive().unwrap().map(|sample| *sample.user_header())
    }
}

type FrameService =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, [u8], Stamp>;

fn service(node: &Node<ipc::Service>, name: &str) -> FrameService {
    let builder = node.service_builder(&name.try_into().unwrap()).publish_subscribe::<[u8]>();
    let builder = builder.user_header::<Stamp>().payload_alignment(Alignment::ALIGN_8);
    builder.subscriber_max_buffer_size(1).enable_safe_overflow(true).open_or_create().unwrap()
}

fn event(
    node: &Node<ipc::Service>,
    name: &str,
) -> iceoryx2::service::port_factory::event::PortFactory<ipc::Service> {
    node.service_builder(&name.try_into().unwrap()).event().open_or_create().unwrap()
}

fn node(root: &str) -> Node<ipc::Service> {
    set_log_level(LogLevel::Fatal);
    let mut config = Config::default();
    config.global.prefix = FileName::new(prefix(root).as_bytes()).unwrap();
    config.global.set_root_path(&Path::new(root.as_bytes()).unwrap());
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .unwrap()
}

fn prefix(root: &str) -> String {
    format!("{}_", root.rsplit('/').next().unwrap())
}
