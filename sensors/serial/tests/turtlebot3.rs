//! An OpenCR board that is played by a thread: its registers, its wheels, and its heartbeat.

use yamabico_core::geometry::Twist;
use yamabico_core::message::{Imu, Odometry};
use yamabico_played_devices::plug::Plug;
use yamabico_played_devices::turtlebot3::{OpenCr, TRACK_M};
use yamabico_serial::turtlebot3::driver;

use crate::bench::{Bench, MAX_STOP_S};

const SENSORS: [(&str, &str); 2] = [("encoders", ""), ("imu", "")];

fn open(plug: &Plug<OpenCr>) -> Bench {
    let mut bench = Bench::open(&driver(), &plug.port(), "", &SENSORS, Some(""));
    bench.run_until(2.0, "no odometry", |bench| !bench.messages::<Odometry>("encoders").is_empty());
    bench
}

#[test]
fn it_drives_through_noise_and_past_the_end_of_its_counters() {
    let plug = Plug::new(OpenCr::new(i64::from(i32::MAX) - 500));
    plug.set(|manners| manners.damage = 0.001);
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.1, 0.5));
    bench.run(2.0);
    assert_eq!(plug.device().command(), [0.1, 0.5]);
    bench.twist = Some(Twist::ZERO);
    bench.run(0.2);
    plug.set(|manners| manners.damage = 0.0);
    bench.run(0.3);
    let odometry = bench.messages::<Odometry>("encoders");
    let travel = plug.device().travel;
    let (last, turned) = (odometry.last().unwrap(), (travel[1] - travel[0]) / TRACK_M);
    assert!((last.theta - turned).abs() < 0.005 && turned > 0.5, "{} {turned}", last.theta);
    assert!(odometry.len() > 20, "{}", odometry.len());
    let imu = *bench.messages::<Imu>("imu").last().unwrap();
    assert!((imu.linear_acceleration[2] - 9.81).abs() < 1e-6 && imu.roll == 0.0 && imu.pitch == 0.0);
}

#[test]
fn the_heartbeat_stops_with_the_commands() {
    let plug = Plug::new(OpenCr::new(0));
    let mut bench = open(&plug);
    assert_eq!(plug.device().beats, 0, "no command, no beat");
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(0.6);
    let beats = plug.device().beats;
    assert!((3..=8).contains(&beats) && plug.device().command()[0] == 0.2, "{beats}");
    bench.twist = None;
    let took_s = bench.run_until(1.0, "drives on", |_| plug.device().command() == [0.0; 2]);
    assert!((0.1..MAX_STOP_S).contains(&took_s), "{took_s}");
    let beats = plug.device().beats;
    bench.run(0.5);
    assert_eq!(plug.device().beats, beats, "no beat without a command");
    assert!(bench.messages::<Odometry>("encoders").len() > 20, "it still measures");
}

#[test]
fn a_pulled_cable_stops_the_board_and_it_comes_back() {
    let plug = Plug::new(OpenCr::new(0));
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(0.5);
    plug.set(|manners| manners.is_pulled = true);
    let took_s = bench.run_until(1.0, "drives on", |_| plug.device().command() == [0.0; 2]);
    assert!(took_s < 0.3 + MAX_STOP_S, "{took_s}");
    bench.take::<Odometry>("encoders");
    plug.set(|manners| manners.is_pulled = false);
    let back_s = bench.run_until(2.0, "not back", |bench| {
        !bench.messages::<Odometry>("encoders").is_empty() && plug.device().command()[0] == 0.2
    });
    println!("turtlebot3: stopped {took_s:.2} s after the cable was pulled, back after {back_s:.2} s");
}
