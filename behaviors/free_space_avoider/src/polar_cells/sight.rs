//! From a picture of a mirror camera to how far the floor is free all around.

use nalgebra::{Matrix2, Vector2};
use yamabico_core::behavior::BuildError;
use yamabico_core::camera::{MirrorCamera, MirrorImage, Mount};
use yamabico_core::image::RgbView;
use yamabico_core::message::Reason;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::floor_color::FloorColors;
use yamabico_vision::morphology::Morphology;
use yamabico_vision::ring_cells::RingCells;

use super::floor_model::FloorModel;
use super::free_cells::FreeCells;
use super::mirror_center::mirror_offset;
use crate::config::Config;
use crate::direction::FreeDistances;

/// A mirror that leans by more than this (rad) is refused: its rings are no circles on the floor.
const MAX_LEAN_RAD: f64 = 0.02;
/// From the robot's circle to the innermost edge (m), so that the robot does not see itself.
const BESIDE_ROBOT_M: f64 = 0.01;
/// Frames that a cell must be free in before it counts as free.
const FRAMES: u8 = 2;
/// More of the innermost ring not being floor ...
const MAX_BLOCKED: f64 = 0.5;
/// ... in so many frames one after the other: the colors are wrong.
const FRAMES_BLOCKED: u32 = 3;
/// Colors are followed while no more of the innermost ring is blocked than this.
const MAX_BLOCKED_TO_FOLLOW: f64 = 0.1;
/// Farther (px) beside its place the mirror is not where it is said to be.
const MAX_OFFSET_PX: f64 = 2.5;
/// More of the robot's own image being floor-colored, everything is.
const MAX_FLOOR_INSIDE: f64 = 0.5;

/// What is wrong with a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trouble {
    /// At the start, what lies before the robot is dark, overexposed or of more than one color.
    NoFloorAhead,
    /// Hardly anything around the robot has the floor's colors: another light, another floor, a covered mirror.
    MaskUnreliable,
    /// Even the robot's own image has the floor's colors.
    LowContrast,
    /// The mirror is seen so many pixels beside its place.
    MirrorMoved {
        /// Distance, pixels.
        offset_px: f64,
    },
}

impl Trouble {
    /// In the common words.
    #[must_use]
    pub const fn reason(self) -> Reason {
        match self {
            Trouble::NoFloorAhead | Trouble::MaskUnreliable => Reason::FloorModelBroken,
            Trouble::LowContrast => Reason::LowContrast,
            Trouble::MirrorMoved { .. } => Reason::Inconsistent,
        }
    }
}

/// Sees free floor in pictures of one mirror camera.
#[derive(Clone, Debug)]
pub struct RingSight {
    image: MirrorImage,
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
    blocked_frames: u32,
    /// Pixels well inside the robot's own image, (u, v).
    inside: Vec<(u16, u16)>,
}

impl RingSight {
    /// A sight for this camera on a robot of this radius (m), with colors that were learned, or none.
    ///
    /// # Errors
    /// A mirror that leans or whose picture does not show the floor from beside the robot to the farthest ring.
    pub fn new(
        config: &Config,
        camera: &MirrorCamera,
        mount: &Mount,
        radius_m: f64,
        learned: Option<FloorColors>,
    ) -> Result<Self, BuildError> {
        let broken = |problem: String| BuildError::new("inputs.camera", problem);
        if !mount.is_finite() || mount.tilt.abs().max(mount.roll.abs()) > MAX_LEAN_RAD {
            return Err(broken("leans: polar-cells needs an upright mirror".into()));
        }
        let (sin, cos) = mount.pan.sin_cos();
        let turned = Matrix2::new(cos, -sin, sin, cos) * orientation(camera.image());
        let image = camera.image().with_orientation(turned).map_err(|e| broken(e.to_string()))?;
        let nearest_m = radius_m + mount.x.hypot(mount.y) + BESIDE_ROBOT_M;
        let edges_px = ring_edges_px(camera, mount.z, nearest_m, config).map_err(broken)?;
        let edges_m: Option<Vec<f64>> =
            edges_px.iter().map(|&edge| camera.floor_radius_m(edge, mount.z)).collect();
        let edges_m = edges_m.ok_or_else(|| broken("does not show the floor in every ring".into()))?;
        let directions = config.directions as usize;
        let around_px = f64::from(2 * config.closing_px + 1);
        let cells =
            RingCells::new(&image, &edges_px, directions, around_px).map_err(|e| broken(e.to_string()))?;
        let floor = match learned {
            Some(colors) => FloorModel::learned(colors),
            None => {
                let tolerance = config.color_tolerance.min(255) as u8;
                FloorModel::seeded(&image, edges_px[0], edges_px[1], tolerance)
            }
        };
        let farthest_m = edges_m[edges_m.len() - 1];
        let viewpoint = Vector2::new(mount.x, mount.y);
        Ok(Self {
            inside: pixels_inside(&image, 0.6 * image.blind_radius_px()),
            image,
            edges_px,
            edges_m,
            closing: config.closing_px,
            floor,
            morphology: Morphology::default(),
            mask: BitImage::new(image.width as usize, image.height as usize),
            counts: Vec::with_capacity(cells.areas().len()),
            free: FreeCells::new(&cells, config.free_share, FRAMES),
            distances: FreeDistances::all_around(viewpoint, directions, farthest_m),
            cells,
            blocked_frames: 0,
        })
    }

    /// Takes a picture of the camera's size; what is wrong with it. Where something is, no direction is free.
    ///
    /// # Errors
    /// [`Trouble`].
    pub fn see(&mut self, picture: RgbView) -> Result<(), Trouble> {
        let looked = self.look(picture);
        if looked.is_err() {
            self.free.forget();
            self.distances.set([]);
        }
        looked
    }

    fn look(&mut self, picture: RgbView) -> Result<(), Trouble> {
        if !self.floor.begin(picture) {
            return Err(Trouble::NoFloorAhead);
        }
        self.measure(picture);
        let blocked = self.free.blocked_inside(&self.counts);
        self.blocked_frames = if blocked > MAX_BLOCKED { self.blocked_frames + 1 } else { 0 };
        if self.blocked_frames >= FRAMES_BLOCKED {
            // Another light makes all around another color.
            if !self.floor.begin_again(picture) {
                return Err(Trouble::MaskUnreliable);
            }
            self.blocked_frames = 0;
            self.measure(picture);
        }
        let Some(colors) = self.floor.colors() else { return Err(Trouble::NoFloorAhead) };
        let inside = |&&(u, v): &&(u16, u16)| colors.contains(picture.pixel(usize::from(u), usize::from(v)));
        let floor_inside = self.inside.iter().filter(inside).count();
        if floor_inside as f64 > MAX_FLOOR_INSIDE * self.inside.len() as f64 {
            return Err(Trouble::LowContrast);
        }
        if let Some(offset_px) = mirror_offset(picture, &self.image, colors).map(|offset| offset.norm())
            && offset_px > MAX_OFFSET_PX
        {
            return Err(Trouble::MirrorMoved { offset_px });
        }
        self.free.update(&self.counts);
        self.distances.set(self.free.rings().iter().map(|&rings| self.edges_m[rings]));
        if blocked <= MAX_BLOCKED_TO_FOLLOW {
            self.floor.follow(picture);
        }
        Ok(())
    }

    /// Floor colors to counts.
    fn measure(&mut self, picture: RgbView) {
        if let Some(colors) = self.floor.colors() {
            colors.mark(picture, self.cells.columns(), &mut self.mask);
            self.morphology.close(&mut self.mask, self.closing);
            self.cells.count(&self.mask, &mut self.counts);
        }
    }

    /// Only the way from a picture to free distances, without any look at what may be wrong with it.
    pub fn distances_of(&mut self, picture: RgbView) -> &FreeDistances {
        if self.floor.begin(picture) {
            self.measure(picture);
            self.free.update(&self.counts);
            self.distances.set(self.free.rings().iter().map(|&rings| self.edges_m[rings]));
        }
        &self.distances
    }

    /// How far each direction is free by the last picture, robot frame at that instant.
    #[must_use]
    pub fn distances(&self) -> &FreeDistances {
        &self.distances
    }

    /// The cells of the last picture that are free.
    #[must_use]
    pub fn free(&self) -> &FreeCells {
        &self.free
    }

    /// The mirror's image, turned as the mirror is on the robot.
    #[must_use]
    pub fn image(&self) -> &MirrorImage {
        &self.image
    }

    /// Edges of the rings from the innermost outwards, pixels of the mirror plane.
    #[must_use]
    pub fn edges_px(&self) -> &[f64] {
        &self.edges_px
    }

    /// The same on the floor, meters from the mirror's axis.
    #[must_use]
    pub fn edges_m(&self) -> &[f64] {
        &self.edges_m
    }

    /// What is floor now.
    #[must_use]
    pub fn colors(&self) -> Option<&FloorColors> {
        self.floor.colors()
    }
}

/// The matrix from image to mirror directions.
fn orientation(image: &MirrorImage) -> Matrix2<f64> {
    let column = |along: Vector2<f64>| image.mirror_from_pixel(image.center() + along);
    Matrix2::from_columns(&[column(Vector2::x()), column(Vector2::y())])
}

/// Edges equally spaced in the picture, from beside the robot to the farthest floor.
fn ring_edges_px(
    camera: &MirrorCamera,
    height_m: f64,
    nearest_m: f64,
    config: &Config,
) -> Result<Vec<f64>, String> {
    let image = camera.image();
    let first = match camera.radius_px(nearest_m, -height_m) {
        Ok(radius_px) => radius_px,
        Err(yamabico_core::camera::Unseen::BlindCenter) => image.blind_radius_px(),
        Err(problem) => {
            return Err(format!("does not show the floor {nearest_m:.2} m from its axis: {problem}"));
        }
    };
    // The robot's own edge is blurred.
    let first = first.max(image.blind_radius_px() + 1.0).ceil();
    let last = camera.radius_px(config.farthest_m, -height_m).map_err(|problem| {
        format!(
            "does not show the floor {:.2} m from its axis: {problem}: set a smaller farthest_m",
            config.farthest_m
        )
    })?;
    let last = last.floor();
    if last - first < 2.0 * f64::from(config.rings) {
        return Err(format!(
            "has only {:.0} px from the robot to the farthest floor for {} rings: set fewer rings or a larger farthest_m",
            last - first,
            config.rings
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
