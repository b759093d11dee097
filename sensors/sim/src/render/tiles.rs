//! Joints of a surface, and the brightness of the tiles between them.

use super::shade::{BLOCK, SurfacePoints};
use crate::scene::Tiles;

/// Multiplies the irradiance of the first `count` points by the brightness of their tiles and joints; `u` and `v` are the
/// coordinates of the points, at least 0.
#[inline(always)]
pub fn apply(
    tiles: &Tiles,
    u: &[f32; BLOCK],
    v: &[f32; BLOCK],
    points: &SurfacePoints,
    count: usize,
    irradiance: &mut [f32; BLOCK],
) {
    let [pu, pv] = tiles.spacing_m;
    if pu <= 0.0 && pv <= 0.0 {
        return;
    }
    if tiles.is_regular() {
        for i in 0..count {
            let along = joint_share(u[i], points.du[i], pu, tiles.joint_width_m);
            let across = joint_share(v[i], points.dv[i], pv, tiles.joint_width_m);
            irradiance[i] *= 1.0 - (1.0 - tiles.joint_tone) * (1.0 - (1.0 - along) * (1.0 - across));
        }
        return;
    }
    for i in 0..count {
        irradiance[i] *= brightness(tiles, [u[i], v[i]], [points.du[i], points.dv[i]]);
    }
}

/// Returns the mean brightness of a pixel of this size at a point of turned, shifted or uneven tiles.
fn brightness(tiles: &Tiles, at: [f32; 2], size: [f32; 2]) -> f32 {
    let [cos, sin] = tiles.turn;
    let [pu, pv] = tiles.spacing_m;
    let u = cos * at[0] + sin * at[1];
    let v = cos * at[1] - sin * at[0];
    let du = cos.abs() * size[0] + sin.abs() * size[1];
    let dv = cos.abs() * size[1] + sin.abs() * size[0];
    let (rows, row_share) = cells(v, dv, pv);
    // Turned coordinates may be negative.
    let joint = |at: f32, size: f32, spacing: f32| {
        if spacing > 0.0 {
            joint_share(at.rem_euclid(spacing), size, spacing, tiles.joint_width_m)
        } else {
            0.0
        }
    };
    let across = joint(v, dv, pv);
    let (mut along, mut tone) = (0.0, 0.0);
    for (row, share) in rows.into_iter().zip([1.0 - row_share, row_share]) {
        if share <= 0.0 {
            continue;
        }
        let u = u + tiles.stagger * pu * 0.5 * (1.0 + draw(row, -1));
        along += share * joint(u, du, pu);
        let (columns, column_share) = cells(u, du, pu);
        tone += share * (1.0 - column_share) * draw(row, columns[0]);
        tone += share * column_share * draw(row, columns[1]);
    }
    // Tiles smaller than a pixel cannot be distinguished.
    let fine = |size: f32, spacing: f32| if spacing > 0.0 { size / spacing } else { 0.0 };
    let visible = (1.0 - fine(du, pu).max(fine(dv, pv))).max(0.0);
    // The deviation of an even distribution over [-1, 1] is the root of 1/3.
    let tone = 1.0 + 3_f32.sqrt() * tiles.contrast * visible * tone;
    tone * (1.0 - (1.0 - tiles.joint_tone) * (1.0 - (1.0 - along) * (1.0 - across)))
}

/// Returns the numbers of the tiles at both ends of [at - size / 2, at + size / 2], and the fraction that lies on the last.
#[inline]
fn cells(at: f32, size: f32, spacing: f32) -> ([i32; 2], f32) {
    if spacing <= 0.0 {
        return ([0, 0], 0.0);
    }
    let (low, high) = ((at - 0.5 * size) / spacing, (at + 0.5 * size) / spacing);
    let (first, last) = (low.floor() as i32, high.floor() as i32);
    let share = if last > first { (high - last as f32) * spacing / size } else { 0.0 };
    ([first, last], share.clamp(0.0, 1.0))
}

/// Returns a number in [-1, 1] that belongs to a tile.
#[inline]
fn draw(row: i32, column: i32) -> f32 {
    let mut bits = (row as u32).wrapping_mul(0x9e37_79b1) ^ (column as u32).wrapping_mul(0x85eb_ca77);
    bits = (bits ^ (bits >> 15)).wrapping_mul(0x2c1b_3c6d);
    bits = (bits ^ (bits >> 12)).wrapping_mul(0x297a_2d39);
    bits ^= bits >> 15;
    bits as f32 * (2.0 / u32::MAX as f32) - 1.0
}

/// Returns the fraction of [at - size / 2, at + size / 2] that lies on joints of this width, which start at every multiple
/// of `spacing`.
#[inline]
fn joint_share(at: f32, size: f32, spacing: f32, width: f32) -> f32 {
    if spacing <= 0.0 {
        return 0.0;
    }
    let size = size.clamp(1e-4, 8.0 * spacing);
    let joints_up_to = |t: f32| {
        let turns = t / spacing;
        let whole = turns as i32 as f32;
        whole * width + ((turns - whole) * spacing).min(width)
    };
    // Both ends must be positive.
    let low = at - 0.5 * size + 8.0 * spacing;
    (joints_up_to(low + size) - joints_up_to(low)) / size
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_share_is_one_on_a_joint_none_beside_it_and_the_mean_from_afar() {
        assert!((joint_share(0.602, 0.001, 0.6, 0.004) - 1.0).abs() < 1e-2);
        assert!(joint_share(0.3, 0.1, 0.6, 0.004).abs() < 1e-4);
        assert!((joint_share(0.6, 0.004, 0.6, 0.004) - 0.5).abs() < 1e-2);
        assert!((joint_share(3.1, 2.4, 0.6, 0.004) - 0.004 / 0.6).abs() < 1e-4);
    }

    fn planks() -> Tiles {
        Tiles {
            spacing_m: [1.2, 0.12],
            joint_width_m: 0.002,
            joint_tone: 1.0,
            stagger: 1.0,
            contrast: 0.2,
            ..Tiles::NONE
        }
    }

    #[test]
    fn tiles_differ_with_the_configured_contrast_and_are_even_within() {
        let tiles = planks();
        let at = |row: i32, x: f32| brightness(&tiles, [x, (row as f32 + 0.5) * 0.12], [0.002, 0.002]);
        let tones: Vec<f32> = (0..2000).map(|i| at(i % 200, 1.7 + (i / 200) as f32 * 1.2)).collect();
        let mean = tones.iter().sum::<f32>() / 2000.0;
        let deviation = (tones.iter().map(|t| (t - mean).powi(2)).sum::<f32>() / 2000.0).sqrt();
        assert!((mean - 1.0).abs() < 0.02 && (deviation - 0.2).abs() < 0.02, "{mean} {deviation}");
        // Along a row the brightness changes at most once in less than the length of a plank.
        for row in 0..50 {
            let changes =
                (0..100).filter(|i| at(row, 5.0 + *i as f32 * 0.01) != at(row, 5.01 + *i as f32 * 0.01));
            assert!(changes.count() <= 2, "row {row}");
        }
    }

    #[test]
    fn joints_of_turned_tiles_run_in_the_turned_direction() {
        let (sin, cos) = 0.5_f32.sin_cos();
        let tiles = Tiles { turn: [cos, sin], joint_tone: 0.0, contrast: 0.0, stagger: 0.0, ..planks() };
        // A joint of the rows passes through the origin: points on it are dark, points between two joints bright.
        for t in [1.0_f32, 2.3, 4.1] {
            let on = |off: f32| [t * cos - off * sin, t * sin + off * cos];
            let (joint, tile) =
                (brightness(&tiles, on(0.001), [1e-4; 2]), brightness(&tiles, on(0.06), [1e-4; 2]));
            assert!(joint < 0.1 && tile > 0.9, "{t}: {joint} {tile}");
        }
    }
}
