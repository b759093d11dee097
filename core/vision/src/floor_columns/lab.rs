//! Colors in which equal distances look alike.

/// Numbers of steps of the tables: of an 8-bit channel with fractions, and of a linear intensity.
const CHANNEL_STEPS: usize = 1020;
const LINEAR_STEPS: usize = 4096;
/// Largest value of a channel.
const MAX_CHANNEL: f32 = 255.0;

/// A color in CIE L\*a\*b\* (1976) under daylight D65: lightness, green to red, blue to yellow. The lightness is scaled to
/// 0 to 255; the other two are zero for gray and rarely exceed 100 in magnitude.
pub type Lab = [f32; 3];

/// Converts colors from sRGB by tables.
#[derive(Clone, Debug)]
pub struct LabTables {
    /// Linear intensity of a channel, 0 to 1.
    linear: Vec<f32>,
    /// Cube root with the linear part near zero, as CIE defines it.
    root: Vec<f32>,
}

impl Default for LabTables {
    fn default() -> Self {
        let linear = |step: usize| {
            let share = step as f32 / CHANNEL_STEPS as f32;
            if share <= 0.04045 { share / 12.92 } else { ((share + 0.055) / 1.055).powf(2.4) }
        };
        let root = |step: usize| {
            let share = step as f32 / LINEAR_STEPS as f32;
            if share > 0.008_856 { share.cbrt() } else { 7.787 * share + 16.0 / 116.0 }
        };
        Self {
            linear: (0..=CHANNEL_STEPS).map(linear).collect(),
            root: (0..=LINEAR_STEPS).map(root).collect(),
        }
    }
}

impl LabTables {
    /// Converts an sRGB color with channels from 0 to 255.
    #[must_use]
    pub fn lab_of_rgb(&self, rgb: [f32; 3]) -> Lab {
        let [r, g, b] = rgb.map(|channel| self.linear(channel));
        let x = self.root((0.412_453 * r + 0.357_580 * g + 0.180_423 * b) / 0.950_456);
        let y = self.root(0.212_671 * r + 0.715_160 * g + 0.072_169 * b);
        let z = self.root((0.019_334 * r + 0.119_193 * g + 0.950_227 * b) / 1.088_754);
        [2.55 * (116.0 * y - 16.0), 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// Converts a gray value from 0 to 255.
    #[must_use]
    pub fn lab_of_gray(&self, gray: f32) -> Lab {
        [2.55 * (116.0 * self.root(self.linear(gray)) - 16.0), 0.0, 0.0]
    }

    fn linear(&self, channel: f32) -> f32 {
        look_up(&self.linear, channel / MAX_CHANNEL)
    }

    fn root(&self, share: f32) -> f32 {
        look_up(&self.root, share)
    }
}

/// Value of a table at a share of its length, interpolated.
fn look_up(table: &[f32], share: f32) -> f32 {
    let at = share.clamp(0.0, 1.0) * (table.len() - 1) as f32;
    let below = (at as usize).min(table.len() - 2);
    table[below] + (at - below as f32) * (table[below + 1] - table[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_colors() {
        let tables = LabTables::default();
        let close = |lab: Lab, l: f32, a: f32, b: f32| {
            let off = [lab[0] / 2.55 - l, lab[1] - a, lab[2] - b];
            assert!(off.iter().all(|off| off.abs() < 0.3), "{lab:?}: {off:?}");
        };
        close(tables.lab_of_rgb([255.0; 3]), 100.0, 0.0, 0.0);
        close(tables.lab_of_rgb([0.0; 3]), 0.0, 0.0, 0.0);
        close(tables.lab_of_rgb([255.0, 0.0, 0.0]), 53.24, 80.09, 67.20);
        close(tables.lab_of_rgb([0.0, 255.0, 0.0]), 87.73, -86.18, 83.18);
        close(tables.lab_of_rgb([0.0, 0.0, 255.0]), 32.30, 79.19, -107.86);
        close(tables.lab_of_rgb([119.0; 3]), 50.03, 0.0, 0.0);
        close(tables.lab_of_gray(119.0), 50.03, 0.0, 0.0);
    }
}
