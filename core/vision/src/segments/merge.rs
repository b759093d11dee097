//! Joins pieces that lie on one line.

use super::split::Piece;
use std::f64::consts::PI;

/// When two pieces are one.
#[derive(Clone, Copy, Debug)]
pub(super) struct MergeRule {
    /// Largest angle between them, rad.
    pub angle: f64,
    /// Largest distance of the shorter one's ends from the longer one's line, px.
    pub distance: f64,
    /// Largest gap, px, or ...
    pub gap: f64,
    /// ... largest gap as a share of the longer one.
    pub gap_share: f64,
}

/// Joins collinear pieces of one polarity; `pieces` is left sorted by angle.
pub(super) fn merge_collinear(pieces: &mut Vec<Piece>, rule: MergeRule) {
    pieces.sort_unstable_by(|a, b| a.line.angle.total_cmp(&b.line.angle));
    let count = pieces.len();
    let mut i = 0;
    while i < count {
        // Directions are modulo pi: behind the last comes the first again.
        let mut step = 1;
        while step < count {
            let j = (i + step) % count;
            let turn = if i + step < count { 0.0 } else { PI };
            if pieces[j].line.angle + turn - pieces[i].line.angle > rule.angle {
                break;
            }
            if let Some(joined) = joined(&pieces[i], &pieces[j], rule) {
                // The new angle lies between the two, so the order is kept well enough for one pass.
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
    let places = ends.map(|end| long.line.position_of(end));
    let (from, to) = (places[0].min(places[1]), places[0].max(places[1]));
    let gap = (from - long.to).max(long.from - to);
    if gap > rule.gap.max(rule.gap_share * long.length()) || gap < -0.5 * short.length() {
        return None;
    }
    let moments = long.moments.merged(&short.moments);
    let line = moments.line()?;
    let all = [ends[0], ends[1], long.line.point_at(long.from), long.line.point_at(long.to)];
    let places = all.map(|end| line.position_of(end));
    Some(Piece {
        moments,
        line,
        from: places.into_iter().fold(f64::INFINITY, f64::min),
        to: places.into_iter().fold(f64::NEG_INFINITY, f64::max),
        gradient: a.gradient + b.gradient,
    })
}
