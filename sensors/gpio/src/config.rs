//! Parameters of the chip and of its sonars.

use std::path::PathBuf;
use std::time::Duration;

use schemars::JsonSchema;
use serde::Deserialize;
use serde_inline_default::serde_inline_default;
use yamabico_core::behavior::ParameterError;
use yamabico_core::sonar_ring::RingGeometry;

use crate::ring::RingConfig;

/// Parameters of a chip with lines.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChipConfig {
    /// Device file of the chip with the lines; `gpioinfo` lists chips and lines. On a Raspberry Pi, the one whose lines are named
    /// GPIO0, GPIO1, ...
    #[serde_inline_default("/dev/gpiochip0".into())]
    #[schemars(extend("format" = "path"))]
    pub chip: PathBuf,
}

/// Parameters of its sonars.
#[serde_inline_default]
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SonarConfig {
    /// Directions of the sonars in the order in which they fire, positive to the left.
    #[schemars(length(min = 1, max = 8), extend("examples" = [[0.0]]))]
    pub azimuths_deg: Vec<f64>,
    /// Numbers of their trigger lines, in the same order.
    #[schemars(length(min = 1, max = 8), extend("examples" = [[23]]))]
    pub triggers: Vec<u32>,
    /// Numbers of their echo lines. A sonar of 5 V needs a voltage divider to 3.3 V in this line.
    #[schemars(length(min = 1, max = 8), extend("examples" = [[24]]))]
    pub echoes: Vec<u32>,
    /// Time from one shot to the next. The echoes of the first must have died away: shorter turns show things that are not there.
    #[serde_inline_default(60.0)]
    #[schemars(range(min = 30.0, max = 500.0))]
    pub turn_ms: f64,
    /// Opening angle of each.
    #[serde_inline_default(25.0)]
    #[schemars(range(min = 1.0, max = 90.0))]
    pub cone_deg: f64,
    /// Distance of each from the robot's center, in its direction.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 2.0))]
    pub from_center_m: f64,
    /// Minimum range.
    #[serde_inline_default(0.02)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_m: f64,
    /// Maximum range; a longer echo counts as none.
    #[serde_inline_default(3.0)]
    #[schemars(range(min = 0.1, max = 5.0))]
    pub max_m: f64,
    /// Speed of sound: 331 at 0 °C, 343 at 20 °C, 352 at 35 °C.
    #[serde_inline_default(343.0)]
    #[schemars(range(min = 300.0, max = 370.0))]
    pub sound_mps: f64,
}

/// Lines of one sonar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wiring {
    /// Number of the line that fires it.
    pub trigger: u32,
    /// Number of the line of its echo.
    pub echo: u32,
}

impl SonarConfig {
    /// Checks the parameters against each other.
    ///
    /// # Errors
    /// The key to change.
    pub fn check(&self) -> Result<(), ParameterError> {
        let refused = |key, problem: String| Err(ParameterError::new(key, problem));
        let count = self.azimuths_deg.len();
        for (key, lines) in [("triggers", &self.triggers), ("echoes", &self.echoes)] {
            if lines.len() != count {
                return refused(key, format!("needs one line for each of the {count} `azimuths_deg`"));
            }
        }
        self.geometry().check()?;
        let lines = self.triggers.iter().chain(&self.echoes);
        let twice = lines
            .enumerate()
            .find(|(i, line)| self.triggers.iter().chain(&self.echoes).take(*i).any(|other| other == *line));
        if let Some((i, line)) = twice {
            let key = if i < count { "triggers" } else { "echoes" };
            return refused(key, format!("names line {line} twice: each sonar has two lines of its own"));
        }
        let ring = self.ring();
        if ring.turn < ring.watch() {
            let min_ms = (1e3 * ring.watch().as_secs_f64()).ceil();
            return refused(
                "turn_ms",
                format!("must be at least {min_ms} ms: sound needs that long to max_m and back"),
            );
        }
        Ok(())
    }

    /// Lines of each sonar.
    #[must_use]
    pub fn wiring(&self) -> Vec<Wiring> {
        let lines = self.triggers.iter().zip(&self.echoes);
        lines.map(|(trigger, echo)| Wiring { trigger: *trigger, echo: *echo }).collect()
    }

    /// Time until every sonar has measured once, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        1e-3 * self.turn_ms * self.azimuths_deg.len() as f64
    }

    fn geometry(&self) -> RingGeometry<'_> {
        RingGeometry {
            azimuths_deg: &self.azimuths_deg,
            cone_deg: self.cone_deg,
            from_center_m: self.from_center_m,
            range_m: [self.min_m, self.max_m],
        }
    }

    /// Geometry and times of the ring.
    #[must_use]
    pub fn ring(&self) -> RingConfig {
        RingConfig {
            beams: self.geometry().beams(),
            range_m: [self.min_m, self.max_m],
            sound_mps: self.sound_mps,
            turn: Duration::from_secs_f64(1e-3 * self.turn_ms),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(keys: &str) -> Result<(), String> {
        let text = format!("azimuths_deg = [20, -20]\n{keys}");
        toml::from_str::<SonarConfig>(&text).unwrap().check().map_err(|error| error.to_string())
    }

    #[test]
    fn contradictions_name_their_key() {
        assert_eq!(check("triggers = [5, 6]\nechoes = [12, 13]"), Ok(()));
        let refused = [
            ("triggers = [5]\nechoes = [12, 13]", "triggers"),
            ("triggers = [5, 6]\nechoes = [12, 13, 14]", "echoes"),
            ("triggers = [5, 6]\nechoes = [12, 5]", "line 5 twice"),
            ("triggers = [5, 6]\nechoes = [12, 13]\nmax_m = 0.1\nmin_m = 0.2", "max_m"),
            ("triggers = [5, 6]\nechoes = [12, 13]\nmax_m = 5\nturn_ms = 30", "at least 36 ms"),
        ];
        for (keys, problem) in refused {
            let error = check(keys).unwrap_err();
            assert!(error.contains(problem), "{error}");
        }
    }
}
