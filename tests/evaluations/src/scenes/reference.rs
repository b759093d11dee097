//! The correct decision of a robot, from the outlines of the obstacles around it instead of an image.

use yamabico_core::camera::Mount;
use yamabico_core::geometry::Pose2;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::navel_grid::NavelGridAvoider;
use yamabico_free_space_avoider::navel_grid::ground::Swath;
use yamabico_free_space_avoider::navel_grid::{Decision, Side};
use yamabico_sim::scene::Solid;

/// Occupied share above which a side is blocked: 80 of 219, Abdelfatah et al.
const BLOCKED_SHARE: f64 = 80.0 / 219.0;
/// Difference below which two shares are equal.
const EQUAL: f64 = 0.1;
/// Number of directions of the view.
const DIRECTIONS: usize = 120;

/// Geometry of the robot, its camera and its grid.
pub struct Reference {
    path: Swath,
    /// The path, widened by one cell.
    wide_path: Swath,
    sides_m: f64,
    nearest_m: f64,
    half_view_rad: f64,
    camera_x_m: f64,
}

/// The correct decision and its reasons.
pub struct Answer {
    /// Best decision.
    pub best: Decision,
    /// All acceptable decisions.
    pub allowed: [Option<Decision>; 4],
    /// Reason for more than one acceptable decision.
    pub borderline: Option<&'static str>,
    /// True if an obstacle is in the path within the stopping distance.
    pub is_blocked: bool,
    /// Distance of the first obstacle in the path, m.
    pub ahead_m: f64,
    /// Occupied shares of the left and the right side.
    pub occupied: [f64; 2],
}

impl Reference {
    /// Takes the path and the grid from the behavior.
    pub fn new(behavior: &NavelGridAvoider, config: &Config, mount: Mount) -> Self {
        let path = behavior.path();
        let observer = behavior.observer();
        let (rows, columns) = (f64::from(config.rows), f64::from(config.columns));
        let covered = observer.covered().0.iter().copied().max().unwrap_or(0);
        let middle = observer.size().columns / 2;
        // Far edge of the last row of cells that the path reaches, and the width of a cell there.
        let end = |column, free| observer.ground().end(column, free).map_or(0.0, |end| end.distance_m);
        let length_m = end(middle, (covered + 1).min(rows as u32));
        let half_view_rad = 45_f64.to_radians();
        let cell_m = 2.0 * (length_m - mount.x) * half_view_rad.tan() / columns / mount.tilt.cos();
        Self {
            path,
            wide_path: Swath { length_m, half_width_m: path.half_width_m + cell_m },
            sides_m: path.half_width_m + config.freer_side_m,
            nearest_m: observer.ground().nearest_m().unwrap_or(0.0),
            half_view_rad,
            camera_x_m: mount.x,
        }
    }

    /// Returns true if an obstacle in the path is entirely nearer than the lower edge of the image.
    pub fn is_blind(&self, solids: &[Solid], robot: Pose2) -> bool {
        outlines(solids, robot).iter().any(|outline| {
            let ahead = in_strip(outline, self.path.half_width_m);
            !ahead.is_empty() && ahead.iter().all(|point| point[0] < self.nearest_m)
        })
    }

    /// Returns the correct decision for a pose among obstacles.
    pub fn answer(&self, solids: &[Solid], robot: Pose2) -> Answer {
        let outlines = outlines(solids, robot);
        let ahead_m = nearest_ahead(&outlines, self.path.half_width_m);
        let is_blocked = ahead_m <= self.path.length_m;
        let is_near = nearest_ahead(&outlines, self.wide_path.half_width_m) <= self.wide_path.length_m;
        let occupied = [1.0, -1.0].map(|side| self.occupied(&outlines, side));
        let turn = if occupied[0] <= occupied[1] { Side::Left } else { Side::Right };
        let freer = occupied[0].min(occupied[1]);
        let blocked = if freer > BLOCKED_SHARE { Decision::Stop } else { Decision::Turn(turn) };
        let mut allowed = [None; 4];
        let mut borderline = None;
        let best = if is_blocked { blocked } else { Decision::Forward };
        allowed[0] = Some(best);
        if is_blocked || is_near {
            if !is_blocked {
                allowed[1] = Some(blocked);
                borderline = Some("an obstacle within one cell of the path");
            }
            if (occupied[0] - occupied[1]).abs() < EQUAL {
                allowed[2] = Some(Decision::Turn(Side::Left));
                allowed[3] = Some(Decision::Turn(Side::Right));
                borderline = borderline.or(Some("sides equally free"));
                if freer > BLOCKED_SHARE + EQUAL {
                    // Turning is not acceptable if both sides are clearly blocked.
                    (allowed[2], allowed[3]) = (None, None);
                    borderline = borderline.filter(|&why| why != "sides equally free");
                }
            }
            if (freer - BLOCKED_SHARE).abs() < EQUAL {
                allowed[1] = allowed[1].or(Some(Decision::Stop));
                let other = allowed.iter().position(Option::is_none);
                if let Some(index) = other {
                    allowed[index] =
                        Some(if blocked == Decision::Stop { Decision::Turn(turn) } else { Decision::Stop });
                }
                borderline = borderline.or(Some("a side close to blocked"));
            }
        }
        Answer { best, allowed, borderline, is_blocked, ahead_m, occupied }
    }

    /// Returns the share of the floor on one side (sign of y) that obstacles occupy or hide: a mean over the directions from the camera with
    /// larger weights for directions farther to the side.
    fn occupied(&self, outlines: &[Vec<[f64; 2]>], side: f64) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in 0..DIRECTIONS {
            // Tangents of the azimuth: from the edge of the view on this side (1) to the other (-1).
            let aside = 1.0 - 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64;
            // Weights of the paper: full for the two outer of 17 columns, a tenth less for each further column, zero after the eleventh.
            let weight = (3.0 + 8.5 * aside).clamp(0.0, 10.0);
            let (sin, cos) = (side * aside * self.half_view_rad.tan()).atan().sin_cos();
            let begin = (self.nearest_m - self.camera_x_m) / cos;
            let end = ((self.path.length_m - self.camera_x_m) / cos).min(self.sides_m / sin.abs());
            if end <= begin {
                continue;
            }
            let hit = outlines
                .iter()
                .filter_map(|outline| first_hit([self.camera_x_m, 0.0], [cos, sin], outline))
                .fold(f64::INFINITY, f64::min);
            sum += weight * (1.0 - (hit.clamp(begin, end) - begin) / (end - begin));
            weights += weight;
        }
        sum / weights
    }
}

fn in_robot(robot: &Pose2, point: [f64; 2]) -> [f64; 2] {
    let (sin, cos) = robot.theta.sin_cos();
    let (x, y) = (point[0] - robot.x, point[1] - robot.y);
    [cos * x + sin * y, cos * y - sin * x]
}

/// Returns the outlines of the solids that the robot can collide with, robot frame.
fn outlines(solids: &[Solid], robot: Pose2) -> Vec<Vec<[f64; 2]>> {
    solids
        .iter()
        .filter(|solid| solid.z[0] < 1.0 && solid.z[1] > 0.0)
        .map(|solid| solid.base.iter().map(|corner| in_robot(&robot, *corner)).collect())
        .collect()
}

/// Returns the part of an outline ahead of the robot's center with |y| <= `half_width_m`.
fn in_strip(outline: &[[f64; 2]], half_width_m: f64) -> Vec<[f64; 2]> {
    let left = clipped(outline, |p| half_width_m - p[1]);
    clipped(&clipped(&left, |p| half_width_m + p[1]), |p| p[0])
}

/// Returns the distance (x) of the first outline in the strip |y| <= `half_width_m`; infinite if there is none.
fn nearest_ahead(outlines: &[Vec<[f64; 2]>], half_width_m: f64) -> f64 {
    let points = outlines.iter().flat_map(|outline| in_strip(outline, half_width_m));
    points.map(|point| point[0]).fold(f64::INFINITY, f64::min)
}

/// Returns the part of a convex outline in which the linear function `inside` is not negative.
fn clipped(outline: &[[f64; 2]], inside: impl Fn(&[f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut kept = Vec::new();
    for (i, a) in outline.iter().enumerate() {
        let b = &outline[(i + 1) % outline.len()];
        let (da, db) = (inside(a), inside(b));
        if da >= 0.0 {
            kept.push(*a);
        }
        if da * db < 0.0 {
            let t = da / (da - db);
            kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
        }
    }
    kept
}

/// Returns the distance along a ray (unit direction) at which it enters an outline; zero if it starts inside.
fn first_hit(from: [f64; 2], towards: [f64; 2], outline: &[[f64; 2]]) -> Option<f64> {
    let mut hits = Vec::new();
    for (i, a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        let edge = [b[0] - a[0], b[1] - a[1]];
        let to = [a[0] - from[0], a[1] - from[1]];
        let cross = towards[0] * edge[1] - towards[1] * edge[0];
        if cross.abs() < 1e-12 {
            continue;
        }
        let along = (to[0] * edge[1] - to[1] * edge[0]) / cross;
        let along_edge = (to[0] * towards[1] - to[1] * towards[0]) / cross;
        if (0.0..=1.0).contains(&along_edge) && along >= 0.0 {
            hits.push(along);
        }
    }
    // One crossing of a convex outline: the ray starts inside.
    match hits.len() {
        0 => None,
        1 => Some(0.0),
        _ => Some(hits.iter().copied().fold(f64::INFINITY, f64::min)),
    }
}
