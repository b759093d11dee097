//! Duration of one decision, compared with a scan for the highest fresh priority in the same slots.

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use yamabico_arbiter::decide::{ArbiterState, Decision, decide};
use yamabico_arbiter::kinematics::Kinematics;
use yamabico_arbiter::policy::{BehaviorPolicy, Policy, Wire};
use yamabico_core::message::{Axes, Kind, Proposal, Reason, Sector, Twist};
use yamabico_core::sensor::MotionLimits;
use yamabico_core::time::Time;

const START: Time = Time(1_000_000_000);

/// Policy of `count` behaviors whose proposals stay fresh for the whole benchmark.
fn policy(count: usize) -> Policy {
    let behaviors = (0..count).map(|i| BehaviorPolicy {
        max_age: Duration::from_secs(1_000_000),
        max_evidence_age: Duration::from_secs(1_000_000),
        ..BehaviorPolicy::new(&format!("behavior-{i}"), i as i32)
    });
    let kinematics = Kinematics::Differential { base_m: 0.4, wheel_radius_m: 0.1, max_wheel_radps: 10.0 };
    Policy::new(MotionLimits::default(), kinematics, behaviors.collect())
}

/// Drive proposals of every behavior.
fn drives(count: usize) -> Vec<Option<Proposal>> {
    let drive = |i: usize| Proposal {
        sequence: 7,
        priority: i as i32,
        stamp_ns: START.0,
        evidence_ns: START.0,
        ..Proposal::drive(Axes::PLANAR, Twist::planar(0.3 + i as f64 * 1e-3, 0.1))
    };
    (0..count).map(|i| Some(drive(i))).collect()
}

/// Mixture of proposals: of every eight, one halts turning, two limit, one abstains, one is malformed and three drive.
fn mixture(count: usize) -> Vec<Option<Proposal>> {
    let mut proposals = drives(count);
    for (i, slot) in proposals.iter_mut().enumerate() {
        let ahead = Sector { center_rad: 0.2, half_width_rad: 0.5 };
        let other = match i % 8 {
            0 => Proposal::halt(Axes::ANGULAR, Reason::Echo),
            1 => Proposal::limit(Axes::LINEAR, Twist::planar(0.2, 0.0), Reason::WallNear),
            2 => Proposal::limit(Axes::LINEAR, Twist::planar(0.1, 0.0), Reason::WallNear).in_sector(ahead),
            3 => Proposal::abstain(Reason::Clear),
            4 => Proposal::drive(Axes::PLANAR, Twist::planar(f64::NAN, 0.0)),
            _ => continue,
        };
        *slot = Some(Proposal { sequence: 7, stamp_ns: START.0, evidence_ns: START.0, ..other });
    }
    proposals
}

/// Twist of the fresh drive proposal with the highest priority.
fn scan(proposals: &[Option<Proposal>], now: Time, max_age: Duration) -> Option<Twist> {
    let mut best: Option<&Proposal> = None;
    for proposal in proposals.iter().flatten() {
        let wins = best.is_none_or(|best| proposal.priority > best.priority);
        if wins && proposal.kind == Kind::Drive.code() && now.since(Time(proposal.stamp_ns)) <= max_age {
            best = Some(proposal);
        }
    }
    best.map(|proposal| proposal.twist)
}

fn measure(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("decide");
    for count in [4, 16, 64, 256] {
        group.throughput(Throughput::Elements(count as u64));
        let mut wired = policy(count);
        wired.wires =
            (0..count / 4).map(|i| Wire::suppress(i + count / 2, i, Duration::from_millis(100))).collect();
        let cases = [
            ("drives", policy(count), drives(count)),
            ("mixture", policy(count), mixture(count)),
            ("mixture with wires", wired, mixture(count)),
        ];
        for (name, policy, proposals) in &cases {
            let mut state = ArbiterState::new(policy);
            let mut decision = Decision::new(policy);
            let mut now = START;
            group.bench_function(BenchmarkId::new(*name, count), |bencher| {
                bencher.iter(|| {
                    now = now + Duration::from_micros(1);
                    decide(policy, &mut state, black_box(proposals), now, &mut decision);
                    black_box(decision.commanded)
                });
            });
        }
        let proposals = drives(count);
        let mut now = START;
        group.bench_function(BenchmarkId::new("scan for the highest priority", count), |bencher| {
            bencher.iter(|| {
                now = now + Duration::from_micros(1);
                scan(black_box(&proposals), now, Duration::from_secs(1_000_000))
            });
        });
    }
    group.finish();
}

criterion_group!(benches, measure);
criterion_main!(benches);
