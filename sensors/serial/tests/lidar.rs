//! A lidar that is played by a thread.

use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::time::Time;
use yamabico_played_devices::lidar::Ld19;
use yamabico_played_devices::plug::Plug;
use yamabico_serial::lidar::driver;

use crate::bench::Bench;

fn scans(bench: &mut Bench) -> Vec<(RangeScanHeader, Vec<Beam>)> {
    bench.take::<RangeScanHeader>("lidar")
}

#[test]
fn scans_come_ten_times_a_second_through_noise_and_pulled_cables() {
    // In the middle of a round room, with a box at the left.
    let plug = Plug::new(Ld19::new(|azimuth_deg| if (azimuth_deg - 90.0).abs() < 10.0 { 0.7 } else { 2.5 }));
    let mut bench = Bench::open(&driver(), &plug.port(), "", &[("lidar", "x_m = 0.1")], None);
    bench.run(1.5);
    let clean = scans(&mut bench);
    assert!((11..=15).contains(&clean.len()), "{}", clean.len());
    for (header, beams) in &clean {
        assert_eq!((beams.len(), header.max_m), (240, 8.0));
        let left = beams.iter().filter(|beam| beam.range_m == 0.7);
        let left: Vec<f64> = left.map(|beam| beam.azimuth_rad.to_degrees()).collect();
        assert!(
            (11..=15).contains(&left.len()) && left.iter().all(|deg| (deg - 90.0).abs() < 12.0),
            "{left:?}"
        );
        assert!(beams.iter().all(|beam| beam.echo_m().is_some() && beam.x_m == 0.1));
    }
    let steps = clean.windows(2).map(|pair| Time(pair[1].0.stamp_ns).seconds_after(Time(pair[0].0.stamp_ns)));
    assert!(steps.skip(1).all(|step| (0.08..0.12).contains(&step)));

    plug.set(|manners| manners.damage = 0.001);
    bench.run(1.5);
    let noisy = scans(&mut bench);
    assert!(noisy.len() < clean.len(), "turns without a packet are dropped");
    let numbers: Vec<u64> = noisy.iter().map(|(header, _)| header.sequence).collect();
    assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "a gap counts as a loss: {numbers:?}");
    assert!(noisy.iter().all(|(_, beams)| beams.iter().all(|beam| [0.7, 2.5].contains(&beam.range_m))));

    plug.set(|manners| (manners.damage, manners.is_pulled) = (0.0, true));
    bench.run(0.3);
    scans(&mut bench);
    plug.set(|manners| manners.is_pulled = false);
    let took_s =
        bench.run_until(3.0, "not back", |bench| !bench.messages::<RangeScanHeader>("lidar").is_empty());
    println!("lidar: {} of {} turns through noise; back after {took_s:.2} s", noisy.len(), clean.len());
    assert!(took_s < 1.0, "{took_s}");
}
