//! After warm-up `propose` does not allocate, with an overlay of beams, gate and echoes.

use yamabico_core::behavior::Setup;
use yamabico_core::geometry::Pose2;
use yamabico_core::message::{Beam, DecisionHeader, Odometry, RangeScanHeader, Twist};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_sonar_halt::{DECISION, ODOMETRY, SONAR, SonarHalt};

#[test]
fn propose_does_not_allocate() {
    let mut bench = Bench::<SonarHalt>::new("", Setup::default()).unwrap();
    bench.draw();
    for i in 0..20_u32 {
        let seconds = 0.05 * f64::from(i);
        let stamp_ns = Time::from_secs_f64(seconds).0;
        let beams = [Beam { range_m: 1.5 - seconds, cone_rad: 0.4, x_m: 0.2, ..Beam::default() }; 3];
        let header = RangeScanHeader { stamp_ns, ..RangeScanHeader::default() };
        let twist = Twist::planar(0.3, 0.2);
        let decision = DecisionHeader { stamp_ns, wished: twist, ..DecisionHeader::default() };
        bench.at(seconds).feed(&SONAR, &header, &beams).feed(&DECISION, &decision, &[]);
        bench.feed(&ODOMETRY, &Odometry::new(stamp_ns, &Pose2::default(), &twist), &[]);
        let (_, counted) = allocations(|| bench.propose());
        assert!(i < 2 || counted.calls == 0, "call {i}: {counted:?}");
        // Three cones, two edges of the path of each twist with its end, three echoes with the nearest range.
        assert_eq!([bench.marks("beams"), bench.marks("gate"), bench.marks("echoes")], [6, 50, 25]);
    }
}
