//! One-way delays to and from another program on the same machine, for the figures in `tests/RESULTS.md`.
//!
//!     latency receive /scan sensor_msgs/msg/LaserScan 10      # p50, p99 and number of messages in 10 s
//!     latency send /command 10 50                             # TwistStamped at 50 Hz for 10 s

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use yamabico_core::geometry::Twist;
use yamabico_ros2::config::Reliability;
use yamabico_ros2::message::{Header, TwistStamped};
use yamabico_ros2::network::{Network, Subscription};
use yamabico_ros2::network_config::NetworkConfig;
use yamabico_ros2::ros_clock::calendar_now_ns;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let network = Network::join(&NetworkConfig::default())?;
    match words.as_slice() {
        ["receive", topic, message_type, seconds] => {
            receive(&network, topic, (*message_type).to_owned().leak(), seconds.parse()?);
        }
        ["send", topic, seconds, rate_hz] => send(&network, topic, seconds.parse()?, rate_hz.parse()?)?,
        _ => return Err("latency receive TOPIC TYPE SECONDS, or latency send TOPIC SECONDS RATE".into()),
    }
    Ok(())
}

fn receive(network: &Network, topic: &str, message_type: &'static str, seconds: f64) {
    let delays = Arc::new(Mutex::new(Vec::new()));
    let for_thread = Arc::clone(&delays);
    network.subscribe(Subscription {
        topic: topic.to_owned(),
        types: vec![message_type],
        reliability: Reliability::BestEffort,
        transient_local: false,
        needed_by: None,
        receive: Box::new(move |_, data, _| {
            let word = |at: usize| {
                data.get(at..at + 4).and_then(|bytes| bytes.try_into().ok()).map(u32::from_le_bytes)
            };
            if let (Some(sec), Some(nanosec)) = (word(4), word(8)) {
                let stamp_ns = u64::from(sec) * 1_000_000_000 + u64::from(nanosec);
                let delay_ms = 1e-6 * calendar_now_ns().saturating_sub(stamp_ns) as f64;
                for_thread.lock().unwrap_or_else(PoisonError::into_inner).push(delay_ms);
            }
        }),
        on_link: Box::new(|_| {}),
    });
    std::thread::sleep(Duration::from_secs_f64(seconds));
    let mut delays = std::mem::take(&mut *delays.lock().unwrap_or_else(PoisonError::into_inner));
    delays.sort_by(f64::total_cmp);
    let at = |share: f64| delays.get((share * delays.len() as f64) as usize).copied().unwrap_or(f64::NAN);
    println!("{{\"count\": {}, \"p50_ms\": {:.2}, \"p99_ms\": {:.2}}}", delays.len(), at(0.5), at(0.99));
}

fn send(
    network: &Network,
    topic: &str,
    seconds: f64,
    rate_hz: f64,
) -> Result<(), Box<dyn std::error::Error>> {
    let publisher = network.publisher::<TwistStamped>(topic)?;
    // Subscribers need a moment to match.
    std::thread::sleep(Duration::from_secs(2));
    let count = (seconds * rate_hz) as u32;
    for _ in 0..count {
        let header = Header::new(calendar_now_ns(), "base_link");
        publisher.publish(&TwistStamped { header, twist: (&Twist::ZERO).into() });
        std::thread::sleep(Duration::from_secs_f64(1.0 / rate_hz));
    }
    println!("{{\"sent\": {count}}}");
    Ok(())
}
