//! Merging of collinear pieces.

use super::split::Piece;
use std::f64::consts::PI;

/// Conditions for merging two pieces.
#[derive(Clone, Copy, Debug)]
pub(super) struct MergeRule {
    /// Maximum angle between the pieces, rad.
    pub angle: f64,
    /// Maximum distance of the shorter piece's endpoints from the line of the longer one, px.
    pub distance: f64,
    /// Maximum gap, px; `gap_share` may allow more.
    pub gap: f64,
    /// Maximum gap as a share of the longer piece.
    pub gap_share: f64,
}

/// Merges collinear pieces of equal polarity. Leaves `pieces` sorted by angle.
pub(super) fn merge_collinear(pieces: &mut Vec<Piece>, rule: MergeRule) {
    pieces.sort_unstable_by(|a, b| a.line.angle.total_cmp(&b.line.angle));
    let count = pieces.len();
    let mut i = 0;
    while i < count {
        // Directions are modulo pi: the first piece follows the last.
        let mut step = 1;
        while step < count {
            let j = (i + step) % count;
            let turn = if i + step < count { 0.0 } else { PI };
            if pieces[j].line.angle + turn - pieces[i].line.angle > rule.angle {
                break;
            }
            if let Some(joined) = joined(&pieces[i], &pieces[j], rule) {
                // The merged angle lies between both, so the order stays good enough for one pass.
                pieces[i] = joined;
                pieces[j].moments.count = 0.0;
                pieces[j].from = 0.0;
                pieces[j].to = 0.0;
            }
            step += 1;
        }
        i += 1;
    }
    pieces.retain(|piece| piece.moments.count > 0.0);
}

fn joined(a: &Piece, b: &Piece, rule: MergeRule) -> Option<Piece> {
    let (long, short) = if a.length() >= b.length() { (a, b) } else { (b, a) };
    if short.moments.count == 0.0 || a.gradient.dot(&b.gradient) <= 0.0 {
        return None;
    }
    let ends = [short.line.point_at(short.from), short.line.point_at(short.to)];
    if ends.iter().any(|&end| long.line.distance_of(end).abs() > rule.distance) {
        return None;
    }
    let positions = ends.map(|end| long.line.position_of(end));
    let (from, to) = (positions[0].min(positions[1]), positions[0].max(positions[1]));
    let gap = (from - long.to).max(long.from - to);
    if gap > rule.gap.max(rule.gap_share * long.length()) || gap < -0.5 * short.length() {
        return None;
    }
    let moments = long.moments.merged(&short.moments);
    let line = moments.line()?;
    let all = [ends[0], ends[1], long.line.point_at(long.from), long.line.point_at(long.to)];
    let positions = all.map(|end| line.position_of(end));
    Some(Piece {
        moments,
        line,
        from: positions.into_iter().fold(f64::INFINITY, f64::min),
        to: positions.into_iter().fold(f64::NEG_INFINITY, f64::max),
        gradient: a.gradient + b.gradient,
    })
}
