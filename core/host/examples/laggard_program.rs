//! A behavior of another program that computes for a while in each call, and hangs on request.

use std::process::ExitCode;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};
use schemars::JsonSchema;
use serde::Deserialize;
use yamabico_core::behavior::{Behavior, Inputs, Outputs, ParameterError, Plugin, Setup, SlotInfo};
use yamabico_core::message::{Axes, Proposal, Reason};

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Config {
    /// Computing time of a call, ms.
    #[schemars(range(min = 0.0, max = 60000.0))]
    compute_ms: f64,
    /// File with the request to hang, `sleep` or `loop`. It is removed first, so that the next process does not hang.
    orders: String,
}

struct Laggard {
    computing: Duration,
    orders: String,
}

impl Plugin for Laggard {
    type Config = Config;
    const NAME: &'static str = "laggard";
    const SUMMARY: &'static str = "Computes in each call, and hangs on request.";
    const INPUTS: &'static [SlotInfo] = &[];
    const CLAIMS: Axes = Axes::NONE;

    fn new(config: Config, _: &Setup) -> Result<Self, ParameterError> {
        Ok(Laggard { computing: Duration::from_secs_f64(config.compute_ms * 1e-3), orders: config.orders })
    }
}

impl Behavior for Laggard {
    fn propose(&mut self, _: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
        let order = std::fs::read_to_string(&self.orders).unwrap_or_default();
        if std::fs::remove_file(&self.orders).is_ok() {
            match order.trim() {
                "sleep" => std::thread::sleep(Duration::from_secs(100_000)),
                "loop" => while std::hint::black_box(true) {},
                _ => {}
            }
        }
        let begun = computing_time();
        while computing_time() - begun < self.computing {}
        Proposal::abstain(Reason::Clear)
    }
}

/// Computing time of this thread since its start.
fn computing_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}

fn main() -> ExitCode {
    yamabico_host::process::main::<Laggard>()
}
