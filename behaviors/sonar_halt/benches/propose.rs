//! One `propose` with a scan of three beams.

use criterion::{Criterion, criterion_group, criterion_main};
use yamabico_core::behavior::Setup;
use yamabico_core::message::{Beam, RangeScanHeader};
use yamabico_core::testing::Bench;
use yamabico_sonar_halt::{SONAR, SonarHalt};

fn propose(criterion: &mut Criterion) {
    let mut bench = Bench::<SonarHalt>::new("", Setup::default()).expect("defaults are valid");
    let beams = [Beam { range_m: 2.0, cone_rad: 0.4, ..Beam::default() }; 3];
    let mut header = RangeScanHeader::default();
    criterion.bench_function("sonar_halt/propose", |b| {
        b.iter(|| {
            header.stamp_ns += 50_000_000;
            bench.at(header.stamp_ns as f64 * 1e-9).feed(&SONAR, &header, &beams).propose()
        });
    });
}

criterion_group!(benches, propose);
criterion_main!(benches);
