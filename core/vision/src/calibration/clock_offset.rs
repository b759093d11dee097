//! Offset between the clock of a camera and that of odometry, from turns that both observe.
//!
//! The turn rate by pictures is correlated with that of odometry at all offsets; the peak is refined by least squares.

use thiserror::Error;
use yamabico_geometry::Hypotenuse;

use super::floor_motion::parabola;
use super::heading_track::{HeadingTrack, TimedTurn};
use super::spread::block_jackknife;

/// Largest offset that is looked for, s, and step of the search, s.
pub const MAX_OFFSET_S: f64 = 1.0;
const STEP_S: f64 = 0.01;
/// Minimum number of turns.
pub const MIN_TURNS: usize = 30;
/// Minimum standard deviation of the turn rate, rad/s.
pub const MIN_RATE_SIGMA: f64 = 0.05;
/// Minimum correlation at the peak.
const MIN_CORRELATION: f64 = 0.7;
/// Correlation of another peak, relative to the highest, from which on the offset is ambiguous; and the distance between two peaks, s.
const AMBIGUOUS: f64 = 0.97;
const APART_S: f64 = 0.15;
/// Standard deviation above which the offset is not known, s.
const MAX_SIGMA_S: f64 = 0.02;
/// Lower bound of the standard deviation, s.
const MIN_SIGMA_S: f64 = 1e-3;

/// Offset between two clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockOffset {
    /// Time by which stamps of pictures are late relative to those of odometry, s.
    pub offset_s: f64,
    /// Standard deviation of the offset, s.
    pub sigma_s: f64,
    /// Correlation of the turn rates at this offset.
    pub correlation: f64,
    /// Turns by pictures over turns by odometry.
    pub scale: f64,
    /// Standard deviation of the turn rate by odometry, rad/s.
    pub rate_sigma: f64,
    /// Number of turns.
    pub turns: usize,
}

/// Reason why turns give no offset.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum ClockError {
    /// Too few turns.
    #[error(
        "only {found} turns are known from pictures and odometry: {MIN_TURNS} are needed. Record for 20 s or more, in a lit room with edges to see"
    )]
    TooFew {
        /// Turns.
        found: usize,
    },
    /// The robot hardly turned.
    #[error(
        "the robot turned at {rate_degps:.1}°/s on average, too little: turn it left and right at about 30°/s, at changing speed, for 20 s or more"
    )]
    Still {
        /// Standard deviation of the turn rate, degrees/s.
        rate_degps: f64,
    },
    /// Pictures and odometry disagree at every offset.
    #[error(
        "turns by pictures and by odometry do not agree (correlation {correlation:.2}): the wheels slip, or the pictures show too little"
    )]
    NoMatch {
        /// Highest correlation.
        correlation: f64,
    },
    /// Several offsets fit, as for regular turns to and fro.
    #[error("the turns fit for {first_ms:.0} ms and for {second_ms:.0} ms: turn less regularly")]
    Ambiguous {
        /// Best offset, ms.
        first_ms: f64,
        /// Another offset, ms.
        second_ms: f64,
    },
    /// The turns do not determine the offset.
    #[error(
        "the offset is uncertain: {offset_ms:.0} ± {sigma_ms:.0} ms (correlation {correlation:.2}). Record for longer, where there are edges \
         to see on all sides, and turn at changing speed"
    )]
    Uncertain {
        /// Offset, ms.
        offset_ms: f64,
        /// Its standard deviation, ms.
        sigma_ms: f64,
        /// Correlation of the turn rates.
        correlation: f64,
    },
}

/// Estimates the offset.
///
/// # Errors
/// [`ClockError`].
pub fn fit_clock_offset(turns: &[TimedTurn], odometry: &HeadingTrack) -> Result<ClockOffset, ClockError> {
    let turns: Vec<TimedTurn> =
        turns.iter().copied().filter(|turn| turn.to_s > turn.from_s && turn.turn.is_finite()).collect();
    let rates: Vec<f64> = turns.iter().filter_map(|turn| odometry.rate(turn, 0.0)).collect();
    if rates.len() < MIN_TURNS {
        return Err(ClockError::TooFew { found: rates.len() });
    }
    let rate_sigma = deviation(&rates);
    if rate_sigma < MIN_RATE_SIGMA {
        return Err(ClockError::Still { rate_degps: rate_sigma.to_degrees() });
    }
    let steps = (MAX_OFFSET_S / STEP_S).round() as i32;
    let scores: Vec<f64> = (-steps..=steps)
        .map(|step| Fit::of(&turns, odometry, f64::from(step) * STEP_S).map_or(-1.0, |fit| fit.correlation))
        .collect();
    let best = (0..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b])).unwrap_or(0);
    let offset_of = |index: usize| (index as f64 - f64::from(steps)) * STEP_S;
    if scores[best] < MIN_CORRELATION {
        return Err(ClockError::NoMatch { correlation: scores[best].max(0.0) });
    }
    let is_peak =
        |i: usize| i > 0 && i + 1 < scores.len() && scores[i] >= scores[i - 1] && scores[i] >= scores[i + 1];
    let is_other = |i: &usize| {
        is_peak(*i)
            && (offset_of(*i) - offset_of(best)).abs() > APART_S
            && scores[*i] > AMBIGUOUS * scores[best]
    };
    if let Some(other) = (0..scores.len()).filter(is_other).max_by(|a, b| scores[*a].total_cmp(&scores[*b])) {
        return Err(ClockError::Ambiguous {
            first_ms: 1e3 * offset_of(best),
            second_ms: 1e3 * offset_of(other),
        });
    }
    let around =
        |i: i64| usize::try_from(best as i64 + i).ok().and_then(|i| scores.get(i)).copied().unwrap_or(-1.0);
    let start_s = offset_of(best) + STEP_S * parabola([around(-1), scores[best], around(1)]);
    let refine = |turns: &[TimedTurn]| refined(turns, odometry, start_s);
    let offset_s = refine(&turns).unwrap_or(start_s);
    let fit = Fit::of(&turns, odometry, offset_s).ok_or(ClockError::TooFew { found: 0 })?;
    let [sigma_s] =
        block_jackknife(&turns, |turns| refine(turns).map(|offset| [offset])).unwrap_or([f64::INFINITY]);
    if sigma_s > MAX_SIGMA_S {
        let (offset_ms, sigma_ms) = (1e3 * offset_s, 1e3 * sigma_s);
        return Err(ClockError::Uncertain { offset_ms, sigma_ms, correlation: fit.correlation });
    }
    Ok(ClockOffset {
        offset_s,
        sigma_s: sigma_s.hypotenuse(MIN_SIGMA_S),
        correlation: fit.correlation,
        scale: fit.scale,
        rate_sigma,
        turns: rates.len(),
    })
}

/// Linear fit of the turn rates by pictures to those by odometry at one offset.
struct Fit {
    correlation: f64,
    scale: f64,
    bias: f64,
}

impl Fit {
    fn of(turns: &[TimedTurn], odometry: &HeadingTrack, offset_s: f64) -> Option<Self> {
        let pairs: Vec<(f64, f64)> =
            turns.iter().filter_map(|turn| Some((odometry.rate(turn, offset_s)?, turn.rate()))).collect();
        if 2 * pairs.len() < turns.len() || pairs.len() < 3 {
            return None;
        }
        let count = pairs.len() as f64;
        let (mean_x, mean_y) =
            (pairs.iter().map(|p| p.0).sum::<f64>() / count, pairs.iter().map(|p| p.1).sum::<f64>() / count);
        let sum =
            |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(x, y)| f(x - mean_x, y - mean_y)).sum::<f64>();
        let (xx, xy, yy) = (sum(&|x, _| x * x), sum(&|x, y| x * y), sum(&|_, y| y * y));
        let scale = xy / xx;
        let correlation = xy / (xx * yy).sqrt();
        correlation.is_finite().then_some(Self { correlation, scale, bias: mean_y - scale * mean_x })
    }
}

/// Refines the offset by least squares with robust weights, together with scale and bias.
fn refined(turns: &[TimedTurn], odometry: &HeadingTrack, start_s: f64) -> Option<f64> {
    let mut offset_s = start_s;
    for _ in 0..8 {
        let fit = Fit::of(turns, odometry, offset_s)?;
        let half_s = 0.02;
        let rows: Vec<(f64, f64)> = turns
            .iter()
            .filter_map(|turn| {
                let at = |offset_s: f64| odometry.rate(turn, offset_s);
                let slope = fit.scale * (at(offset_s + half_s)? - at(offset_s - half_s)?) / (2.0 * half_s);
                Some((slope, turn.rate() - fit.bias - fit.scale * at(offset_s)?))
            })
            .collect();
        let residuals: Vec<f64> = rows.iter().map(|row| row.1).collect();
        let scale = super::spread::robust_sigma(&residuals)?.max(1e-6);
        let (mut top, mut bottom) = (0.0, 0.0);
        for (slope, residual) in &rows {
            let off = residual / (3.0 * scale);
            let weight = (1.0 + off * off).powi(-2);
            top += weight * slope * residual;
            bottom += weight * slope * slope;
        }
        let step = (top / bottom).clamp(-STEP_S, STEP_S);
        if !step.is_finite() {
            return None;
        }
        offset_s += step;
    }
    Some(offset_s)
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Heading of a robot that turns to and fro with changing speed.
    fn heading(seconds: f64) -> f64 {
        0.8 * (0.9 * seconds).sin() + 0.3 * (2.3 * seconds + 1.0).sin()
    }

    fn odometry() -> HeadingTrack {
        let mut track = HeadingTrack::default();
        for i in 0..1500 {
            let seconds = 0.02 * f64::from(i);
            track.push(seconds, yamabico_geometry::wrap_angle(heading(seconds) + 3.0));
        }
        track
    }

    fn turns(late_s: f64, amplitude: f64) -> Vec<TimedTurn> {
        let stamp = |i: i32| 2.0 + 0.1 * f64::from(i);
        let noise = |i: i32| 2e-3 * f64::from(i * 37 % 11 - 5) / 5.0;
        let turn = |i: i32| amplitude * (heading(stamp(i + 1)) - heading(stamp(i))) + noise(i);
        (0..250)
            .map(|i| TimedTurn { from_s: stamp(i) + late_s, to_s: stamp(i + 1) + late_s, turn: turn(i) })
            .collect()
    }

    #[test]
    fn the_offset_is_recovered_with_its_sign() {
        for late_s in [0.0, 0.083, -0.31] {
            let found = fit_clock_offset(&turns(late_s, 1.03), &odometry()).unwrap();
            assert!((found.offset_s - late_s).abs() < 3.0 * found.sigma_s.max(1e-3), "{late_s}: {found:?}");
            assert!(found.sigma_s < 6e-3 && (found.scale - 1.03).abs() < 0.01, "{found:?}");
        }
    }

    #[test]
    fn what_shows_no_turns_is_refused() {
        let still = fit_clock_offset(&turns(0.0, 1.0), &{
            let mut track = HeadingTrack::default();
            (0..1500).for_each(|i| track.push(0.02 * f64::from(i), 0.1));
            track
        });
        assert!(matches!(still, Err(ClockError::Still { .. })), "{still:?}");
        assert!(matches!(fit_clock_offset(&[], &odometry()), Err(ClockError::TooFew { found: 0 })));
        // A third of the turns is not seen, as before plain walls.
        let blind: Vec<_> = turns(0.0, 1.0)
            .into_iter()
            .enumerate()
            .map(|(i, turn)| if i / 20 % 3 == 0 { TimedTurn { turn: 0.0, ..turn } } else { turn })
            .collect();
        let blind = fit_clock_offset(&blind, &odometry());
        assert!(matches!(blind, Err(ClockError::Uncertain { .. })), "{blind:?}");
        let wrong: Vec<_> = turns(0.0, 1.0)
            .into_iter()
            .enumerate()
            .map(|(i, turn)| TimedTurn { turn: 0.01 * ((i * i) as f64).sin(), ..turn })
            .collect();
        assert!(matches!(fit_clock_offset(&wrong, &odometry()), Err(ClockError::NoMatch { .. })));
    }
}
