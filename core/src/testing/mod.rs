//! Tests of a behavior without bus, robot, clock or files.
//!
//! A [`Bench`] feeds messages to one behavior and returns its proposals. A sensor is tested by polling it with a
//! [`Published`] as the sink of its outputs; code that runs devices is tested with a [`FakeDriver`].
//!
//! ```
//! # use yamabico_core::behavior::{Behavior, ParameterError, Inputs, Outputs, Plugin, Setup, Slot, SlotInfo};
//! # use yamabico_core::message::{Axes, Beam, Kind, Proposal, RangeScanHeader, Reason};
//! # use yamabico_core::testing::{Bench, NoParameters};
//! # const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges ahead");
//! # struct SonarHalt;
//! # impl Plugin for SonarHalt {
//! #     type Config = NoParameters;
//! #     const NAME: &'static str = "sonar-halt";
//! #     const SUMMARY: &'static str = "Halts before obstacles.";
//! #     const INPUTS: &'static [SlotInfo] = &[SONAR.info()];
//! #     const CLAIMS: Axes = Axes::NONE;
//! #     fn new(_: NoParameters, _: &Setup) -> Result<Self, ParameterError> {
//! #         Ok(SonarHalt)
//! #     }
//! # }
//! # impl Behavior for SonarHalt {
//! #     fn propose(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) -> Proposal {
//! #         let near = inputs.fresh(&SONAR).any(|scan| scan.items.iter().any(|beam| beam.range_m < 0.5));
//! #         if near { Proposal::halt(Axes::ALL, Reason::Echo) } else { Proposal::abstain(Reason::Clear) }
//! #     }
//! # }
//! let mut bench = Bench::<SonarHalt>::new("", Setup::default())?;
//! let beam = Beam { range_m: 0.3, ..Beam::default() };
//! bench.at(1.0).feed(&SONAR, &RangeScanHeader::default(), &[beam]);
//! assert_eq!(bench.propose().kind(), Some(Kind::Halt));
//! # Ok::<(), ParameterError>(())
//! ```

mod allocations;
mod fake_driver;
mod inbox;
mod published;

pub use allocations::{Allocations, CountingAllocator, allocations};
pub use fake_driver::{FakeDriver, NoParameters, plain_sensor};
pub use published::Published;

use crate::behavior::{InputSource, Inputs, Outputs, ParameterError, Plugin, Setup, Slot, SlotSource};
use crate::camera::{Calibration, Distortion, Intrinsics, Mount};
use crate::message::{FrameHeader, Message, Proposal};
use crate::overlay::{Overlay, layers};
use crate::sensor::{SensorInfo, SensorKind};
use crate::time::Time;
use inbox::Inbox;
use yamabico_parameters::FileKind;

/// Creates the setup of a behavior whose slot `camera` holds a calibrated camera without distortion: 10 Hz, 40 ms
/// latency.
#[must_use]
pub fn camera_setup(intrinsics: Intrinsics, mount: Mount) -> Setup {
    let kind = SensorKind::Camera {
        intrinsics,
        distortion: Distortion::NONE,
        mount,
        calibrated: Calibration::Measured,
    };
    let (period_s, latency_s) = (0.1, 0.04);
    let sensor = SensorInfo { name: "front".into(), message: FrameHeader::NAME, period_s, latency_s, kind };
    Setup { sensors: vec![("camera".into(), sensor)], ..Setup::default() }
}

/// A test bench for one behavior.
pub struct Bench<B: Plugin> {
    /// The behavior under test.
    pub behavior: B,
    now: Time,
    slots: Slots,
    published: Published,
    overlay: Option<Overlay>,
}

impl<B: Plugin> Bench<B> {
    /// Builds the behavior from its parameters as TOML text, without the keys common to all behaviors.
    ///
    /// # Errors
    /// The text is not TOML, or a parameter would be refused in a task file: unknown keys, wrong types, values out of
    /// range, or an error of [`Plugin::new`].
    pub fn new(toml: &str, setup: Setup) -> Result<Bench<B>, ParameterError> {
        let kind = FileKind {
            key: B::NAME,
            what: "the behavior",
            schema: || schemars::schema_for!(B::Config),
            rules: |_| Vec::new(),
        };
        let table = kind.read(B::NAME, toml).map_err(|problems| {
            let key = problems.problems.first().map(|problem| first_key(toml, problem.span.start));
            ParameterError::new(key.unwrap_or_default(), problems.to_string())
        })?;
        let behavior = B::new(yamabico_parameters::read(&table)?, &setup)?;
        let slots = B::INPUTS.iter().map(|slot| Inbox::new(&*slot.name, slot.message.channel)).collect();
        let published = Published::declared(B::OUTPUTS);
        Ok(Bench { behavior, now: Time::ZERO, slots: Slots(slots), published, overlay: None })
    }

    /// Sets the time of the next calls, s.
    pub fn at(&mut self, seconds: f64) -> &mut Self {
        self.now = Time::from_secs_f64(seconds);
        self
    }

    /// Puts a message into a slot.
    ///
    /// # Panics
    /// The behavior has no such slot.
    pub fn feed<M: Message>(&mut self, slot: &Slot<M>, header: &M, items: &[M::Item]) -> &mut Self {
        let queue = self.slots.find(slot.name);
        queue.push(bytemuck::bytes_of(header), bytemuck::cast_slice(items));
        self
    }

    /// Counts `count` messages of a slot as lost to buffer overflow.
    ///
    /// # Panics
    /// The behavior has no such slot.
    pub fn lose<M: Message>(&mut self, slot: &Slot<M>, count: u64) -> &mut Self {
        self.slots.find(slot.name).lose(count);
        self
    }

    /// Calls the behavior once. Messages fed since the last call are fresh in this call only.
    pub fn propose(&mut self) -> Proposal {
        self.published.clear();
        if let Some(overlay) = &mut self.overlay {
            overlay.clear();
        }
        let mut outputs = Outputs::new(&mut self.published).with_overlay(self.overlay.as_mut());
        let proposal = self.behavior.propose(&Inputs::new(self.now, &self.slots), &mut outputs);
        for queue in &mut self.slots.0 {
            queue.mark_read();
        }
        proposal
    }

    /// Makes the behavior draw its overlay in every call from now on.
    pub fn draw(&mut self) -> &mut Self {
        self.overlay.get_or_insert_default();
        self
    }

    /// Returns the overlay of the last call; `None` if the behavior drew nothing or [`Bench::draw`] was not called.
    pub fn overlay(&self) -> Option<&Overlay> {
        self.overlay.as_ref().filter(|overlay| overlay.is_drawn())
    }

    /// Returns name and number of marks of each layer of that overlay, in the order of drawing; empty without an overlay.
    pub fn layers(&self) -> Vec<(String, usize)> {
        let marks = self.overlay().map_or(&[][..], Overlay::marks);
        layers(marks).map(|layer| (layer.name.to_string(), layer.marks.len())).collect()
    }

    /// Returns the number of marks in the layer `name` of that overlay; zero without such a layer.
    pub fn marks(&self, name: &str) -> usize {
        self.layers().iter().find(|(layer, _)| layer == name).map_or(0, |(_, marks)| *marks)
    }

    /// Returns header and items of the messages that the last call published on output `name`.
    pub fn published<M: Message>(&self, name: &str) -> Vec<(M, Vec<M::Item>)> {
        self.published.of(name)
    }
}

/// Returns the dotted key at byte `at` of a TOML text.
fn first_key(toml: &str, at: usize) -> String {
    yamabico_parameters::parse(toml, 0, &mut Vec::new()).map_or(String::new(), |table| table.path_at(at))
}

struct Slots(Vec<Inbox>);

impl Slots {
    fn find(&mut self, name: &str) -> &mut Inbox {
        let known: Vec<_> = self.0.iter().map(|queue| queue.name().to_owned()).collect();
        match self.0.iter_mut().find(|queue| queue.name() == name) {
            Some(queue) => queue,
            None => panic!("slot `{name}` does not exist; the slots are {known:?}"),
        }
    }
}

impl InputSource for Slots {
    fn slot(&self, index: usize) -> Option<&dyn SlotSource> {
        self.0.get(index).map(|queue| queue as &dyn SlotSource)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::behavior::{Behavior, PublishError, SlotInfo};
    use crate::message::{Axes, Beam, Odometry, Pose, RangeScanHeader, Reason, Twist};

    const SONAR: Slot<RangeScanHeader> = Slot::required("sonar", "ranges");
    const POSE: Slot<Pose> = Slot::optional("pose", "pose of the robot");

    /// Drives at a speed equal to the nearest range, and publishes it as odometry.
    struct Nearest;

    #[derive(serde::Deserialize, schemars::JsonSchema)]
    #[serde(default)]
    struct OneKey {
        /// Ranges below this are noise.
        #[schemars(range(min = 0.0, max = 1.0))]
        min_m: f32,
    }

    impl Default for OneKey {
        fn default() -> Self {
            OneKey { min_m: 0.1 }
        }
    }

    impl Plugin for Nearest {
        type Config = OneKey;
        const NAME: &'static str = "nearest";
        const SUMMARY: &'static str = "Drives at a speed equal to the nearest range.";
        const INPUTS: &'static [SlotInfo] = &[SONAR.info(), POSE.info()];
        const OUTPUTS: &'static [SlotInfo] =
            &[Slot::<Odometry>::required("odometry", "wheel odometry").info()];
        const CLAIMS: Axes = Axes::LINEAR;

        fn new(config: OneKey, _: &Setup) -> Result<Self, ParameterError> {
            let _ = config.min_m;
            Ok(Nearest)
        }
    }

    impl Behavior for Nearest {
        fn propose(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) -> Proposal {
            let ranges = inputs.fresh(&SONAR).flat_map(|scan| scan.items.iter().filter_map(Beam::echo_m));
            let nearest = ranges.fold(f64::INFINITY, f64::min);
            let odometry = Odometry { x: nearest, stamp_ns: inputs.now().0, ..Default::default() };
            outputs.publish("odometry", &odometry, &[]).unwrap();
            let undeclared = outputs.publish("wheels", &odometry, &[]);
            assert_eq!(undeclared, Err(PublishError::NoSuchOutput("wheels".into())));
            let wrong = outputs.publish("odometry", &Pose::default(), &[]);
            assert!(matches!(wrong, Err(PublishError::WrongType { .. })), "{wrong:?}");
            assert!(inputs.fresh(&POSE).count() <= 1);
            if inputs.is_fresh(&SONAR) {
                Proposal::drive(Axes::LINEAR, Twist::planar(nearest, 0.0))
            } else {
                Proposal::abstain(Reason::StaleInput)
            }
        }
    }

    #[test]
    fn messages_are_fresh_once_and_published_ones_can_be_read() {
        let mut bench = Bench::<Nearest>::new("", Setup::default()).unwrap();
        let beam = |range_m| Beam { range_m, ..Default::default() };
        bench.at(1.5).feed(&SONAR, &RangeScanHeader::default(), &[beam(2.0), beam(0.7)]);
        bench.feed(&SONAR, &RangeScanHeader::default(), &[beam(0.9)]);
        assert_eq!(bench.propose().twist.linear, 0.7);
        let published = bench.published::<Odometry>("odometry");
        assert_eq!((published.len(), published[0].0.x, published[0].0.stamp_ns), (1, 0.7, 1_500_000_000));
        assert_eq!(bench.propose().reason(), Some(Reason::StaleInput));
    }

    #[test]
    fn a_latest_value_replaces_the_one_before() {
        let mut bench = Bench::<Nearest>::new("", Setup::default()).unwrap();
        for _ in 0..3 {
            bench.feed(&POSE, &Pose::default(), &[]);
        }
        let pose = bench.slots.find("pose");
        assert_eq!((pose.len(), pose.fresh(), pose.lost()), (1, 1, 0));
        bench.propose();
    }

    #[test]
    fn invalid_parameters_are_refused() {
        let refused = |toml: &str| Bench::<Nearest>::new(toml, Setup::default()).err().unwrap().problem;
        assert!(refused("mim_m = 0.5").contains("did you mean `min_m`?"));
        assert!(refused("min_m = 3").contains("must be at most 1 m"));
    }
}
