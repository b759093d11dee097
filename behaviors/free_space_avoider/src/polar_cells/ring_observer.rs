//! Observation of the free floor around the robot in the image of a mirror camera.

use crate::polar_cells::ring_cells::RingCells;
use nalgebra::{Matrix2, Vector2};
use yamabico_core::behavior::ParameterError;
use yamabico_core::camera::{MirrorCamera, MirrorImage, Mount};
use yamabico_core::geometry::Hypotenuse;
use yamabico_core::image::RgbView;
use yamabico_core::message::Reason;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::morphology::Morphology;

use super::floor_model::FloorModel;
use super::free_cells::FreeCells;
use super::mirror_center::mirror_offset;
use crate::config::Config;
use crate::direction::FreeDistances;
use crate::echoes::Echoes;

/// Maximum tilt or roll of the mirror, rad; with more, its rings are not circles on the floor.
const MAX_LEAN_RAD: f64 = 0.02;
/// Distance between the robot's circle and the innermost ring edge, m; keeps the robot's own image out of the ring.
const BESIDE_ROBOT_M: f64 = 0.01;
/// Number of consecutive frames after which a cell counts as free.
const FREE_FRAMES: u8 = 2;
/// Blocked share of the innermost ring above which the floor's colors are suspect.
const MAX_BLOCKED: f64 = 0.5;
/// Number of consecutive suspect frames after which the floor's colors are wrong.
const SUSPECT_FRAMES: u32 = 3;
/// Blocked share of the innermost ring up to which the floor's colors are tracked.
const MAX_BLOCKED_TO_FOLLOW: f64 = 0.1;
/// Maximum offset of the mirror's center, px.
const MAX_OFFSET_PX: f64 = 2.5;
/// Maximum share of floor color in the robot's own image.
const MAX_FLOOR_INSIDE: f64 = 0.5;

/// Reason why an image gives no free distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RingFailure {
    /// At the start, the floor in front of the robot is dark, overexposed or of several colors.
    NoFloorAhead,
    /// Hardly anything around the robot has the floor's colors: changed light, another floor, or a covered mirror.
    MaskUnreliable,
    /// The robot's own image has the floor's colors.
    LowContrast,
    /// The center of the mirror is not at its calibrated position.
    MirrorMoved {
        /// Offset, px.
        offset_px: f64,
    },
}

impl RingFailure {
    /// Returns the reason for the proposal.
    #[must_use]
    pub const fn reason(self) -> Reason {
        match self {
            RingFailure::NoFloorAhead | RingFailure::MaskUnreliable => Reason::FloorModelBroken,
            RingFailure::LowContrast => Reason::LowContrast,
            RingFailure::MirrorMoved { .. } => Reason::Inconsistent,
        }
    }
}

/// Observer of free floor in images of one mirror camera.
#[derive(Clone, Debug)]
pub struct RingObserver {
    mirror: MirrorImage,
    edges_px: Vec<f64>,
    edges_m: Vec<f64>,
    cells: RingCells,
    closing: u32,
    floor: FloorModel,
    morphology: Morphology,
    mask: BitImage,
    counts: Vec<u32>,
    free: FreeCells,
    distances: FreeDistances,
    suspect_frames: u32,
    /// Pixels well inside the robot's own image, (u, v).
    inside: Vec<(u16, u16)>,
}

impl RingObserver {
    /// Creates the observer for a camera on a robot of radius `radius_m`, with or without learned colors.
    ///
    /// # Errors
    /// The mirror leans, or its image does not show the floor from beside the robot to the last ring.
    pub fn new(
        config: &Config,
        camera: &MirrorCamera,
        mount: &Mount,
        radius_m: f64,
        learned: Option<FloorColors>,
    ) -> Result<Self, ParameterError> {
        let broken = |problem: String| ParameterError::new("inputs.camera", problem);
        if !mount.is_finite() || mount.tilt.abs().max(mount.roll.abs()) > MAX_LEAN_RAD {
            return Err(broken(format!(
                "must be an upright mirror camera, tilt and roll at most {:.1} degrees: correct its mount",
                MAX_LEAN_RAD.to_degrees()
            )));
        }
        let (sin, cos) = mount.pan.sin_cos();
        let turned = Matrix2::new(cos, -sin, sin, cos) * orientation(camera.image());
        let mirror = camera.image().with_orientation(turned).map_err(|e| broken(e.to_string()))?;
        let nearest_m = radius_m + mount.x.hypotenuse(mount.y) + BESIDE_ROBOT_M;
        let edges_px = ring_edges_px(camera, mount.z, nearest_m, config).map_err(broken)?;
        let edges_m: Option<Vec<f64>> =
            edges_px.iter().map(|&edge| camera.floor_radius_m(edge, mount.z)).collect();
        let edges_m = edges_m.ok_or_else(|| broken("does not show the floor in every ring".into()))?;
        let directions = config.directions as usize;
        let around_px = f64::from(2 * config.closing_px + 1);
        let cells =
            RingCells::new(&mirror, &edges_px, directions, around_px).map_err(|e| broken(e.to_string()))?;
        let floor = match learned {
            Some(colors) => FloorModel::learned(colors),
            None => {
                let tolerance = config.color_tolerance.min(255) as u8;
                FloorModel::seeded(&mirror, edges_px[0], edges_px[1], tolerance)
            }
        };
        let farthest_m = edges_m[edges_m.len() - 1];
        let viewpoint = Vector2::new(mount.x, mount.y);
        Ok(Self {
            inside: pixels_inside(&mirror, 0.6 * mirror.blind_radius_px()),
            edges_px,
            edges_m,
            closing: config.closing_px,
            floor,
            morphology: Morphology::default(),
            mask: BitImage::new(mirror.width as usize, mirror.height as usize),
            counts: Vec::with_capacity(cells.areas().len()),
            free: FreeCells::new(&cells, config.free_share, FREE_FRAMES),
            distances: FreeDistances::all_around(viewpoint, directions, farthest_m),
            mirror,
            cells,
            suspect_frames: 0,
        })
    }

    /// Updates the free distances with an image of the camera's size. After a failure, no direction is free.
    ///
    /// # Errors
    /// [`RingFailure`].
    pub fn observe(&mut self, image: RgbView) -> Result<(), RingFailure> {
        let result = self.update(image);
        if result.is_err() {
            self.free.reset();
            self.distances.set([]);
        }
        result
    }

    fn update(&mut self, image: RgbView) -> Result<(), RingFailure> {
        if !self.floor.begin(image) {
            return Err(RingFailure::NoFloorAhead);
        }
        self.measure(image);
        let blocked = self.free.blocked_inside(&self.counts);
        self.suspect_frames = if blocked > MAX_BLOCKED { self.suspect_frames + 1 } else { 0 };
        if self.suspect_frames >= SUSPECT_FRAMES {
            // The light may have changed: the floor then has another single color all around.
            if !self.floor.begin_again(image) {
                return Err(RingFailure::MaskUnreliable);
            }
            self.suspect_frames = 0;
            self.measure(image);
        }
        let Some(colors) = self.floor.colors() else { return Err(RingFailure::NoFloorAhead) };
        let inside = |&&(u, v): &&(u16, u16)| colors.contains(image.pixel(usize::from(u), usize::from(v)));
        let floor_inside = self.inside.iter().filter(inside).count();
        if floor_inside as f64 > MAX_FLOOR_INSIDE * self.inside.len() as f64 {
            return Err(RingFailure::LowContrast);
        }
        if let Some(offset_px) = mirror_offset(image, &self.mirror, colors).map(|offset| offset.norm())
            && offset_px > MAX_OFFSET_PX
        {
            return Err(RingFailure::MirrorMoved { offset_px });
        }
        self.update_distances();
        if blocked <= MAX_BLOCKED_TO_FOLLOW {
            self.floor.follow(image);
        }
        Ok(())
    }

    /// Counts the pixels of floor color in each cell.
    fn measure(&mut self, image: RgbView) {
        if let Some(colors) = self.floor.colors() {
            colors.mark(image, self.cells.columns(), &mut self.mask);
            self.morphology.close(&mut self.mask, self.closing);
            self.cells.count(&self.mask, &mut self.counts);
        }
    }

    /// Updates the free cells and distances from the counts.
    fn update_distances(&mut self) {
        self.free.update(&self.counts);
        self.distances.set(self.free.rings().iter().map(|&rings| self.edges_m[rings]));
    }

    /// Lowers the free distances to those of the echoes.
    pub fn bound(&mut self, echoes: &Echoes) {
        self.distances.bound(|viewpoint, borders| echoes.nearest_m(viewpoint, borders));
    }

    /// Returns the free distances in an image, without checks for failures.
    pub fn distances_of(&mut self, image: RgbView) -> &FreeDistances {
        if self.floor.begin(image) {
            self.measure(image);
            self.update_distances();
        }
        &self.distances
    }

    /// Returns the free distances in the last image, in the robot frame at its capture.
    #[must_use]
    pub fn distances(&self) -> &FreeDistances {
        &self.distances
    }

    /// Returns the free cells in the last image.
    #[must_use]
    pub fn free(&self) -> &FreeCells {
        &self.free
    }

    /// Returns the geometry of the mirror's image, rotated by the pan of the mount.
    #[must_use]
    pub fn mirror(&self) -> &MirrorImage {
        &self.mirror
    }

    /// Returns the radii of the ring edges from the innermost outward, pixels of the mirror plane.
    #[must_use]
    pub fn edges_px(&self) -> &[f64] {
        &self.edges_px
    }

    /// Returns the distances of the ring edges on the floor from the mirror's axis, from the innermost outward, m.
    #[must_use]
    pub fn edges_m(&self) -> &[f64] {
        &self.edges_m
    }

    /// Returns the current colors of the floor.
    #[must_use]
    pub fn colors(&self) -> Option<&FloorColors> {
        self.floor.colors()
    }
}

/// Returns the matrix from image directions to mirror directions.
fn orientation(image: &MirrorImage) -> Matrix2<f64> {
    let column = |along: Vector2<f64>| image.mirror_from_pixel(image.center() + along);
    Matrix2::from_columns(&[column(Vector2::x()), column(Vector2::y())])
}

/// Returns the radii of the ring edges, equally spaced in the image, from beside the robot to the farthest floor.
fn ring_edges_px(
    camera: &MirrorCamera,
    height_m: f64,
    nearest_m: f64,
    config: &Config,
) -> Result<Vec<f64>, String> {
    let image = camera.image();
    let first = match camera.radius_px(nearest_m, -height_m) {
        Ok(radius_px) => radius_px,
        Err(yamabico_core::camera::MirrorProjectionError::BlindCenter) => image.blind_radius_px(),
        Err(problem) => {
            return Err(format!("does not show the floor {nearest_m:.2} m from its axis: {problem}"));
        }
    };
    // The edge of the robot's own image is blurred.
    let first = first.max(image.blind_radius_px() + 1.0).ceil();
    let last = camera.radius_px(config.max_range_m, -height_m).map_err(|problem| {
        format!(
            "does not show the floor {:.2} m from its axis: {problem}: set a smaller max_range_m",
            config.max_range_m
        )
    })?;
    let last = last.floor();
    if last - first < 2.0 * f64::from(config.rings) {
        return Err(format!(
            "must have at least {} px from the robot to the farthest floor for {} rings, but has {:.0} px: set fewer \
             rings or a larger max_range_m",
            2 * config.rings,
            config.rings,
            last - first
        ));
    }
    let step = (last - first) / f64::from(config.rings);
    Ok((0..=config.rings).map(|ring| first + step * f64::from(ring)).collect())
}

fn pixels_inside(image: &MirrorImage, radius_px: f64) -> Vec<(u16, u16)> {
    let mut inside = Vec::new();
    for v in (0..image.height.min(u32::from(u16::MAX))).step_by(2) {
        for u in (0..image.width.min(u32::from(u16::MAX))).step_by(2) {
            let point = image.mirror_from_pixel(Vector2::new(f64::from(u), f64::from(v)));
            if point.norm() < radius_px {
                inside.push((u as u16, v as u16));
            }
        }
    }
    inside
}
