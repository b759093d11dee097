//! Latency from publish to receive, of this crate's bus and of bare iceoryx2: two processes, busy polling, interleaved
//! rounds.
//!
//! `cargo bench -p yamabico-host --bench bus`; each of the two processes needs a processor. Prints the medians and
//! their ratio, ours to bare; the maximum allowed is 1.3.

#![allow(clippy::unwrap_used, missing_docs, reason = "a benchmark")]

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use yamabico_core::message::FrameHeader;
use yamabico_host::bus::{Bus, TopicSpec};

const SMALL: usize = 64;
const FRAME: usize = 640 * 480;
const ROUNDS: usize = 40;
const PER_ROUND: usize = 400;
const MAX_RATIO: f64 = 1.3;

fn main() {
    match (std::env::var("BUS_BENCH_ROBOT"), std::env::var("BUS_BENCH_BARE")) {
        (Ok(robot), Ok(bare)) => answer(&robot, &bare),
        _ => measure(),
    }
}

fn measure() {
    let robot = format!("bench-{}", std::process::id());
    let home = std::path::PathBuf::from(std::env::var_os("HOME").unwrap());
    let bare_root = BareRoot(home.join(format!(".yb{}", std::process::id())));
    let bare_root = &bare_root.0;
    let bus = Bus::ipc(&robot).unwrap();
    let node = bare_node(bare_root.to_str().unwrap());
    let _services = [("small", SMALL), ("frame", FRAME), ("answer", SMALL)].map(|(name, len)| {
        bus.create::<FrameHeader>(name, &TopicSpec { list_bytes: len, ..TopicSpec::default() }).unwrap();
        bare_service(&node, name, true)
    });
    let sizes = [("small", SMALL), ("frame", FRAME)];
    let ours = sizes.map(|(name, len)| (len, bus.publisher::<FrameHeader>(name).unwrap()));
    let bare = sizes.map(|(name, len)| (len, Bare::new(&node, name, len)));
    let ours_back = bus.subscriber::<FrameHeader>("answer").unwrap();
    let bare_back = bare_subscriber(&node, "answer");
    let child = Command::new(std::env::current_exe().unwrap())
        .env("BUS_BENCH_ROBOT", &robot)
        .env("BUS_BENCH_BARE", bare_root)
        .stdout(Stdio::null())
        .spawn();
    let child = Answerer(child.unwrap());
    // Both sides announce themselves once they listen: earlier messages would be lost.
    poll(|| ours_back.receive().unwrap().map(|_| 0));
    poll(|| bare_back.receive().unwrap().map(|_| 0));
    println!("publish to receive in two processes, {ROUNDS} rounds of {PER_ROUND}, nanoseconds");
    println!(
        "{:>8} {:>10} {:>10} {:>10} {:>10} {:>7}",
        "bytes", "ours p50", "bare p50", "ours p99", "bare p99", "ratio"
    );
    let mut worst: f64 = 0.0;
    for i in 0..2 {
        let (mut of_ours, mut of_bare) = (Vec::new(), Vec::new());
        for round in 0..=ROUNDS {
            let kept = |latency| if round == 0 { None } else { Some(latency) };
            for _ in 0..PER_ROUND {
                let (len, publisher) = &ours[i];
                publisher.publish_in_place(&stamped(), *len, |bytes| bytes.fill(1)).unwrap();
                of_ours.extend(kept(poll(|| ours_back.receive().unwrap().map(|s| s.header().stamp_ns))));
            }
            for _ in 0..PER_ROUND {
                bare[i].1.send(&stamped(), bare[i].0);
                of_bare
                    .extend(kept(poll(|| bare_back.receive().unwrap().map(|s| s.user_header().0.stamp_ns))));
            }
        }
        let (ours50, ours99) = quantiles(&mut of_ours);
        let (bare50, bare99) = quantiles(&mut of_bare);
        let ratio = ours50 as f64 / bare50 as f64;
        worst = worst.max(ratio);
        println!("{:>8} {ours50:>10} {bare50:>10} {ours99:>10} {bare99:>10} {ratio:>7.3}", ours[i].0);
    }
    drop(child);
    within_a_thread(&bus, &node);
    println!(
        "worst ratio {worst:.3}, maximum {MAX_RATIO}: {}",
        if worst <= MAX_RATIO { "met" } else { "MISSED" }
    );
}

/// The other process, which spins until it is killed, at the end of the measurement or when it fails.
struct Answerer(Child);

impl Drop for Answerer {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Receives on every topic and answers each message with its latency.
fn answer(robot: &str, bare_root: &str) {
    let bus = Bus::join(robot).unwrap();
    let node = bare_node(bare_root);
    let ours = ["small", "frame"].map(|name| bus.subscriber::<FrameHeader>(name).unwrap());
    let bare = ["small", "frame"].map(|name| bare_subscriber(&node, name));
    let ours_back = bus.publisher::<FrameHeader>("answer").unwrap();
    let bare_back = Bare::new(&node, "answer", SMALL);
    ours_back.publish(&FrameHeader::default(), &[0; SMALL]).unwrap();
    bare_back.send(&FrameHeader::default(), SMALL);
    loop {
        for subscriber in &ours {
            if let Some(sample) = subscriber.receive().unwrap() {
                let latency = now_ns() - sample.header().stamp_ns;
                ours_back
                    .publish(&FrameHeader { stamp_ns: latency, ..Default::default() }, &[0; SMALL])
                    .unwrap();
            }
        }
        for subscriber in &bare {
            if let Some(sample) = subscriber.receive().unwrap() {
                let latency = now_ns() - sample.user_header().0.stamp_ns;
                bare_back.send(&FrameHeader { stamp_ns: latency, ..Default::default() }, SMALL);
            }
        }
    }
}

/// Measures send and receive on one thread, without the scheduler.
fn within_a_thread(bus: &Bus, node: &Node<ipc::Service>) {
    bus.create::<FrameHeader>("thread", &TopicSpec { list_bytes: SMALL, ..TopicSpec::default() }).unwrap();
    let _service = bare_service(node, "thread", true);
    let (ours, ours_back) =
        (bus.publisher("thread").unwrap(), bus.subscriber::<FrameHeader>("thread").unwrap());
    let (bare, bare_back) = (Bare::new(node, "thread", SMALL), bare_subscriber(node, "thread"));
    let (mut of_ours, mut of_bare) = (Vec::new(), Vec::new());
    const N: u32 = 20_000;
    for _ in 0..15 {
        let begun = Instant::now();
        for _ in 0..N {
            ours.publish_in_place(&FrameHeader::default(), SMALL, |bytes| bytes.fill(1)).unwrap();
            assert!(std::hint::black_box(ours_back.receive().unwrap()).is_some());
        }
        of_ours.push((begun.elapsed() / N).as_nanos() as u64);
        let begun = Instant::now();
        for _ in 0..N {
            bare.send(&FrameHeader::default(), SMALL);
            assert!(std::hint::black_box(bare_back.receive().unwrap()).is_some());
        }
        of_bare.push((begun.elapsed() / N).as_nanos() as u64);
    }
    let (ours, bare) = (quantiles(&mut of_ours).0, quantiles(&mut of_bare).0);
    println!(
        "send and receive on one thread, {SMALL} bytes: ours {ours} ns, bare {bare} ns, ratio {:.3}",
        ours as f64 / bare as f64
    );
}

fn poll(mut look: impl FnMut() -> Option<u64>) -> u64 {
    let begun = Instant::now();
    loop {
        if let Some(latency) = look() {
            return latency;
        }
        assert!(begun.elapsed() < Duration::from_secs(20), "no answer");
    }
}

fn stamped() -> FrameHeader {
    FrameHeader { stamp_ns: now_ns(), ..Default::default() }
}

fn now_ns() -> u64 {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    #[allow(unsafe_code, reason = "the time lives through the call")]
    unsafe {
        libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut now);
    }
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

fn quantiles(values: &mut [u64]) -> (u64, u64) {
    values.sort_unstable();
    (values[values.len() / 2], values[values.len() * 99 / 100])
}

/// Header with the trait that iceoryx2 requires.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, Default)]
struct BareHeader(FrameHeader);

#[allow(unsafe_code, reason = "plain old data behind no pointer")]
unsafe impl ZeroCopySend for BareHeader {}

type BareSubscriber = iceoryx2::port::subscriber::Subscriber<ipc::Service, [u8], BareHeader>;
type BareService =
    iceoryx2::service::port_factory::publish_subscribe::PortFactory<ipc::Service, [u8], BareHeader>;

/// Publisher on bare iceoryx2.
struct Bare(iceoryx2::port::publisher::Publisher<ipc::Service, [u8], BareHeader>);

impl Bare {
    fn new(node: &Node<ipc::Service>, name: &str, len: usize) -> Bare {
        let publisher = bare_service(node, name, false)
            .publisher_builder()
            .initial_max_slice_len(len)
            .allocation_strategy(AllocationStrategy::Static)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create();
        Bare(publisher.unwrap())
    }

    fn send(&self, header: &FrameHeader, len: usize) {
        let mut sample = self.0.loan_slice_uninit(len).unwrap();
        *sample.user_header_mut() = BareHeader(*header);
        #[allow(unsafe_code, reason = "every byte is written before the sample is declared initialized")]
        let sample = unsafe {
            std::ptr::write_bytes(sample.payload_mut().as_mut_ptr().cast::<u8>(), 1, len);
            sample.assume_init()
        };
        sample.send().unwrap();
    }
}

fn bare_subscriber(node: &Node<ipc::Service>, name: &str) -> BareSubscriber {
    bare_service(node, name, false).subscriber_builder().buffer_size(1).history_request(1).create().unwrap()
}

fn bare_service(node: &Node<ipc::Service>, name: &str, create: bool) -> BareService {
    let builder = node
        .service_builder(&name.try_into().unwrap())
        .publish_subscribe::<[u8]>()
        .user_header::<BareHeader>();
    let builder = builder.payload_alignment(Alignment::ALIGN_8);
    if !create {
        return builder.open().unwrap();
    }
    builder
        .max_publishers(1)
        .max_subscribers(8)
        .max_nodes(64)
        .subscriber_max_buffer_size(1)
        .subscriber_max_borrowed_samples(3)
        .history_size(1)
        .enable_safe_overflow(true)
        .create()
        .unwrap()
}

fn bare_node(root: &str) -> Node<ipc::Service> {
    set_log_level(LogLevel::Fatal);
    NodeBuilder::new()
        .config(&bare_config(root))
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .unwrap()
}

fn bare_config(root: &str) -> Config {
    let mut config = Config::default();
    config.global.prefix = FileName::new(bare_prefix(root).as_bytes()).unwrap();
    config.global.set_root_path(&Path::new(root.as_bytes()).unwrap());
    config
}

fn bare_prefix(root: &str) -> String {
    format!("{}_", root.rsplit('.').next().unwrap())
}

/// Folder of the bare services' files; removed when everything else is dropped.
struct BareRoot(std::path::PathBuf);

impl Drop for BareRoot {
    fn drop(&mut self) {
        let prefix = bare_prefix(self.0.to_str().unwrap());
        let _ = std::fs::remove_dir_all(&self.0);
        for segment in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if segment.file_name().to_string_lossy().starts_with(&prefix) {
                let _ = std::fs::remove_file(segment.path());
            }
        }
    }
}
