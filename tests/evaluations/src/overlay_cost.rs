//! Cost of overlays: of the seam without a viewer, and of drawing.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Args;
use yamabico::plugins::plugins;
use yamabico_core::behavior::{OutputSink, Outputs, PublishError, Slot};
use yamabico_core::message::{FrameHeader, MessageType, OverlayHeader};
use yamabico_core::time::Time;
use yamabico_host::bus::{Bus, TopicSpec};
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::execution::Overlays;
use yamabico_runtime::record::Tee;
use yamabico_runtime::run::{Options, RunResult, run};

use crate::report::{Cell, Report, Table, number};

/// Number of measured calls of the seam in a round.
const CALLS: u64 = 200_000;
/// Number of rounds; the fastest one counts, since other programs disturb the others.
const ROUNDS: usize = 51;
/// Time between two calls of a behavior.
const CALL_PERIOD: Duration = Duration::from_millis(5);
/// Maximum share of a call that the seam may cost without a viewer.
const MAX_SHARE: f64 = 0.01;
const CAMERA: Slot<FrameHeader> = Slot::required("camera", "frames");

/// Cost of overlays in shipped tasks: of the seam without a viewer, as a share of each behavior's median call, and of drawing, as the
/// ratio of medians and of the recording's size with and without overlays.
///
/// Runs each task twice in lockstep in one process, and fails if the seam costs more than 1 % of a call.
#[derive(Args)]
pub struct Arguments {
    /// Names of tasks in `configs`.
    #[arg(default_values_t = ["hallway", "corridor", "intersection", "office", "field", "room"].map(String::from))]
    tasks: Vec<String>,
    /// Duration of each run, s.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
}

impl Arguments {
    pub fn run(&self) -> Result<Report, String> {
        let seam_ns = seam_ns().map_err(|error| error.to_string())?;
        let mut table = Table::new(
            format!("Overlays; the seam costs {seam_ns:.1} ns a call without a viewer"),
            &["task", "behavior", "call p50 without, us", "with, us", "ratio", "seam, % of a call"],
        );
        let mut files = Table::new("Recordings", &["task", "without, MB", "with, MB", "digests"]);
        let mut worst = 0.0_f64;
        for name in &self.tasks {
            let [without, with] = [Overlays::OnRequest, Overlays::Recorded]
                .map(|overlays| run_task(name, self.seconds, overlays));
            let (without, with) = (without?, with?);
            for (behavior, summary) in &without.summary.behaviors {
                let [before_us, after_us] =
                    [summary.timing.p50_us, with.summary.behaviors[behavior].timing.p50_us];
                let share = seam_ns / 1e3 / before_us;
                worst = worst.max(share);
                table.row([
                    Cell::from(name.as_str()),
                    behavior.as_str().into(),
                    number(before_us, 1),
                    number(after_us, 1),
                    number(after_us / before_us, 2),
                    number(100.0 * share, 3),
                ]);
            }
            let megabytes = |result: &RunResult| {
                result.recording.as_ref().map_or(Cell::None, |file| number(file.bytes as f64 / 1e6, 1))
            };
            let is_equal = without.summary.digest == with.summary.digest;
            files.row([
                Cell::from(name.as_str()),
                megabytes(&without),
                megabytes(&with),
                if is_equal { "equal" } else { "DIFFERENT" }.into(),
            ]);
        }
        let problem = format!("the seam costs {:.2} % of a call", 100.0 * worst);
        Ok(Report::new([table, files]).require(worst <= MAX_SHARE, problem))
    }
}

fn run_task(name: &str, seconds: f64, overlays: Overlays) -> Result<RunResult, String> {
    let set = vec![format!("run.duration_s={seconds}")];
    let overrides = Overrides { robot: None, set };
    let task = load(&yamabico_testkit::config(&format!("{name}.toml")), &overrides, &plugins())
        .map_err(|problems| problems.to_string())?;
    let file = std::env::temp_dir().join(format!("yamabico-overlay-cost-{}.mcap", std::process::id()));
    let options = Options { recording: Some(file.clone()), overlays, ..Options::default() };
    let result = run(&task, &options, &AtomicBool::new(false), &mut Tee::default(), &mut |_| {});
    let _ = std::fs::remove_file(file);
    result.map_err(|error| error.to_string())
}

/// Time that a host and a behavior spend in a call to find that there is no viewer, ns: the fastest of all rounds.
fn seam_ns() -> Result<f64, yamabico_host::bus::BusError> {
    let bus = Bus::ipc(&format!("overlay-cost-{}", std::process::id()))?;
    bus.create::<OverlayHeader>("overlay", &TopicSpec::default())?;
    let mut audience = bus.audience("overlay", &MessageType::of::<OverlayHeader>())?;
    let mut sink = NoSink;
    let mut outputs = Outputs::new(&mut sink);
    let header = FrameHeader::default();
    let mut now = Time::ZERO;
    let rounds = (0..ROUNDS).map(|_| {
        let begin = Instant::now();
        for _ in 0..CALLS {
            now = now + CALL_PERIOD;
            black_box(audience.is_present(black_box(now)));
            black_box(&mut outputs).draw(&CAMERA, black_box(&header), |overlay| {
                overlay.image("never", [0; 3]);
            });
        }
        begin.elapsed().as_secs_f64() * 1e9 / CALLS as f64
    });
    Ok(rounds.fold(f64::INFINITY, f64::min))
}

/// Publishes nothing.
struct NoSink;

impl OutputSink for NoSink {
    fn publish(&mut self, _: &str, _: &MessageType, _: &[u8], _: &[u8]) -> Result<(), PublishError> {
        Ok(())
    }

    fn publish_in_place(
        &mut self,
        _: &str,
        _: &MessageType,
        _: &[u8],
        _: usize,
        _: &mut dyn FnMut(&mut [u8]) -> ControlFlow<()>,
    ) -> Result<(), PublishError> {
        Ok(())
    }
}
