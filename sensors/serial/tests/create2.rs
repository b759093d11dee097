//! A Create 2 that is played by a thread: its modes, its stream, its wheels, and its habit of driving on.

use yamabico_core::geometry::Twist;
use yamabico_core::message::{Bumper, Odometry, RangeScanHeader};
use yamabico_played_devices::create2::Roomba;
use yamabico_played_devices::plug::Plug;
use yamabico_serial::create2::driver;

use crate::bench::{Bench, MAX_STOP_S, spec};

const SENSORS: [(&str, &str); 3] = [("encoders", ""), ("bumpers", ""), ("proximity", "")];

fn open(plug: &Plug<Roomba>) -> Bench {
    let mut bench = Bench::open(&driver(), &plug.port(), "", &SENSORS, Some("watchdog_ms = 200"));
    bench.run_until(3.0, "no odometry", |bench| !bench.messages::<Odometry>("encoders").is_empty());
    bench
}

fn newest(bench: &Bench) -> Odometry {
    *bench.messages::<Odometry>("encoders").last().unwrap()
}

#[test]
fn it_drives_and_its_odometry_follows_its_wheels_in_batches() {
    let plug = Plug::new(Roomba::new(0));
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.4));
    bench.run(2.0);
    let speeds = plug.device().speeds;
    assert!((speeds[0] - 0.153).abs() < 1e-9 && (speeds[1] - 0.247).abs() < 1e-9, "{speeds:?}");
    let odometry = bench.messages::<Odometry>("encoders");
    let steps = odometry.windows(2).map(|pair| (pair[1].stamp_ns - pair[0].stamp_ns) as f64 * 1e-9);
    let steps: Vec<f64> = steps.skip(50).collect();
    let even = steps.iter().filter(|step| (**step - 0.015).abs() < 0.003).count();
    assert!(even * 10 > steps.len() * 8, "{even} of {} steps are even", steps.len());
    let last = odometry.last().unwrap();
    assert!((last.vx - 0.2).abs() < 0.04 && (last.omega - 0.4).abs() < 0.3, "{last:?}");
    bench.twist = Some(Twist::ZERO);
    bench.run(0.5);
    let travel = plug.device().travel;
    let turned = (travel[1] - travel[0]) / 0.235;
    assert!((newest(&bench).theta - turned).abs() < 0.01, "{} {turned}", newest(&bench).theta);
}

#[test]
fn garbage_and_half_frames_lose_readings_but_no_motion() {
    let plug = Plug::new(Roomba::new(0));
    let mut bench = open(&plug);
    plug.set(|manners| manners.damage = 0.01);
    bench.twist = Some(Twist::planar(0.3, 0.0));
    bench.run(2.0);
    bench.twist = Some(Twist::ZERO);
    bench.run(0.2);
    plug.set(|manners| manners.damage = 0.0);
    bench.run(0.3);
    let (odometry, travel) = (newest(&bench), plug.device().travel[0]);
    assert!(travel > 0.4 && (odometry.x - travel).abs() < 0.002, "{} {travel}", odometry.x);
}

#[test]
fn its_counters_wrap_both_ways() {
    for (offset, direction) in [(32_700, 1.0), (-32_700, -1.0)] {
        let plug = Plug::new(Roomba::new(offset));
        let mut bench = open(&plug);
        bench.twist = Some(Twist::planar(0.4 * direction, 0.0));
        bench.run(0.6);
        bench.twist = Some(Twist::ZERO);
        bench.run(0.3);
        let [left, _] = plug.device().counts();
        assert!(f64::from(left) * direction < 0.0, "the counter has wrapped: {left}");
        let (odometry, travel) = (newest(&bench), plug.device().travel[0]);
        assert!((odometry.x - travel).abs() < 0.002 && travel.abs() > 0.1, "{} {travel}", odometry.x);
    }
}

#[test]
fn it_stops_when_commands_stop() {
    let plug = Plug::new(Roomba::new(0));
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.3, 0.0));
    bench.run_until(2.0, "does not drive", |_| plug.device().speeds[0] > 0.2);
    bench.twist = None;
    let took_s = bench.run_until(2.0, "drives on", |_| plug.device().speeds == [0.0; 2]);
    println!("create2: stopped {took_s:.3} s after the last command");
    assert!((0.1..MAX_STOP_S).contains(&took_s), "{took_s}");
}

#[test]
fn it_comes_back_after_its_cable_was_pulled_and_after_a_reset() {
    let plug = Plug::new(Roomba::new(5000));
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(0.5);
    for round in 0..3 {
        let (before, starts) = (newest(&bench), plug.device().starts);
        plug.set(|manners| manners.is_pulled = true);
        // The robot drives on: it has no watchdog, and no command reaches it.
        bench.run(0.5);
        assert!(plug.device().speeds[0] > 0.1);
        if round == 2 {
            plug.device().reset();
        }
        bench.take::<Odometry>("encoders");
        plug.set(|manners| manners.is_pulled = false);
        let back = |bench: &mut Bench| !bench.messages::<Odometry>("encoders").is_empty();
        let took_s = bench.run_until(4.0, "not back", back);
        assert!(plug.device().starts > starts, "stopped before it was driven again");
        println!("create2: measures again {took_s:.2} s after its cable is back");
        assert!(took_s < 2.0, "round {round}: {took_s}");
        let after = bench.messages::<Odometry>("encoders")[0];
        let jump_m = (after.x - before.x).abs();
        assert!(jump_m < 0.6, "round {round}: {jump_m}");
        if round == 2 {
            assert!(jump_m < 0.05 && after.covariance[0] > before.covariance[0], "{jump_m}");
        }
        bench.run_until(3.0, "does not drive again", |_| plug.device().speeds[0] > 0.1);
    }
    // Silence without a loss of the line: the robot was reset.
    plug.device().reset();
    bench.run(0.1);
    bench.take::<Odometry>("encoders");
    let took_s = bench.run_until(4.0, "not back", |bench| !bench.messages::<Odometry>("encoders").is_empty());
    assert!(took_s < 2.5, "{took_s}");
}

#[test]
fn bumpers_are_told_and_a_lifted_robot_drives_again_after_a_while() {
    let plug = Plug::new(Roomba::new(0));
    let mut bench = open(&plug);
    bench.twist = Some(Twist::planar(0.2, 0.0));
    bench.run(0.3);
    plug.device().bumps = 0b0010;
    bench.run(0.1);
    assert_eq!(bench.messages::<Bumper>("bumpers").last().unwrap().pressed, 1, "left bumper");
    let scans = bench.take::<RangeScanHeader>("proximity");
    let nearest = |beams: &[yamabico_core::message::Beam]| {
        beams.iter().filter_map(|beam| Some((beam.echo_m()?, beam.azimuth_rad.to_degrees().round()))).next()
    };
    assert_eq!(nearest(&scans.last().unwrap().1), Some((0.0, 45.0)));
    plug.device().bumps = 0b0100;
    bench.run_until(1.0, "drives in the air", |_| plug.device().speeds == [0.0; 2]);
    plug.device().bumps = 0;
    let took_s = bench.run_until(5.0, "stays passive", |_| plug.device().speeds[0] > 0.1);
    assert!(took_s > 1.5, "too early: {took_s}");
}

#[test]
fn a_port_that_is_missing_or_no_port_is_told_with_the_remedy() {
    let refused = |port: &str| {
        let spec = spec(std::path::Path::new(port), "", &SENSORS, None);
        driver().open(spec).err().unwrap().to_string()
    };
    let missing = refused("/dev/ttyUSB77");
    assert!(missing.contains("/dev/ttyUSB77 does not exist") && missing.contains("port"), "{missing}");
    assert!(refused("/dev/null").contains("/dev/null"));
}

#[test]
fn two_sensors_of_a_kind_and_lockstep_are_refused() {
    let plug = Plug::new(Roomba::new(0));
    let twice = spec(&plug.port(), "", &[("encoders", ""), ("encoders", "")], None);
    assert!(driver().open(twice).err().unwrap().to_string().contains("one sensor of the kind"));
    let mut device =
        driver().open(spec(&plug.port(), "", &SENSORS, None)).map_err(|e| e.to_string()).unwrap();
    let mut published = yamabico_core::testing::Published::default();
    let mut outputs = yamabico_core::behavior::Outputs::new(&mut published);
    let refused = device.sensors[0].1.poll(yamabico_core::time::Time::ZERO, &mut outputs);
    assert!(refused.unwrap_err().to_string().contains("--live"));
}
