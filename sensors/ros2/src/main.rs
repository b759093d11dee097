//! The program `yamabico-ros2`: a driver and behaviors, started by `yamabico`, and a look at the network.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use tracing_subscriber::EnvFilter;
use yamabico_host::process::{main as main_of, main_of_driver};
use yamabico_ros2::driver::driver;
use yamabico_ros2::lock::Lock;
use yamabico_ros2::network::Network;
use yamabico_ros2::network_config::NetworkConfig;
use yamabico_ros2::observer::Observer;
use yamabico_ros2::velocity::VelocityTopic;

const USAGE: &str = "\
yamabico-ros2: ROS 2 for Yamabico

In a robot file:  [devices.robot]     driver = \"ros2\"
In a task file:   [behaviors.nav2]    ros2_twist = \"/cmd_vel_nav\"
                  [behaviors.pause]   ros2_lock = \"/pause\"
                  [behaviors.report]  ros2_publish = \"/yamabico\"

By hand:
  yamabico-ros2 topics    topics of the domain ROS_DOMAIN_ID with their types, publishers and subscribers

Environment:
  ROS_DOMAIN_ID             domain, 0 without it
  RMW_IMPLEMENTATION        rmw_zenoh_cpp for Zenoh, rmw_fastrtps_cpp or rmw_cyclonedds_cpp for DDS (default)
  ZENOH_SESSION_CONFIG_URI  configuration file of Zenoh; without it, the router is at tcp/localhost:7447
  ZENOH_CONFIG_OVERRIDE     single keys of it, such as mode=\"client\";connect/endpoints=[\"tcp/192.168.1.5:7447\"]
  YAMABICO_LOG              log level: error, warn, info (default), debug or trace
";

/// Time for which `topics` looks.
const LOOK: Duration = Duration::from_secs(3);

fn main() -> ExitCode {
    // What Zenoh logs about itself is logged here in other words, with a remedy.
    let filter =
        EnvFilter::try_from_env("YAMABICO_LOG").unwrap_or_else(|_| EnvFilter::new("info,zenoh=error"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_ansi(false);
    log.with_writer(std::io::stderr).without_time().log_internal_errors(false).init();
    match std::env::args().nth(1).as_deref() {
        Some("driver") => main_of_driver(driver()),
        Some("twist") => main_of::<VelocityTopic>(),
        Some("lock") => main_of::<Lock>(),
        Some("publish") => main_of::<Observer>(),
        Some("topics") => topics(),
        _ => {
            let _ = std::io::stderr().write_all(USAGE.as_bytes());
            ExitCode::from(2)
        }
    }
}

/// Prints the topics of the domain.
fn topics() -> ExitCode {
    let network = match Network::join(&NetworkConfig::default()) {
        Ok(network) => network,
        Err(error) => {
            tracing::error!("{error}");
            return ExitCode::FAILURE;
        }
    };
    std::thread::sleep(LOOK);
    let mut lines = network.with_graph(|graph| {
        let line = |end: &yamabico_ros2::graph::Endpoint| {
            let role = if end.publishes { "publisher" } else { "subscriber" };
            format!("{:<32} {:<44} {role:<10} {}\n", end.topic, end.message_type, end.qos)
        };
        graph.endpoints().map(line).collect::<Vec<_>>()
    });
    lines.sort();
    let text =
        format!("domain {}: {} publishers and subscribers\n{}", network.domain, lines.len(), lines.concat());
    let _ = std::io::stdout().write_all(text.as_bytes());
    ExitCode::SUCCESS
}
