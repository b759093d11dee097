use nalgebra::{Point2, Vector2};
use thiserror::Error;
use yamabico_core::camera::MirrorCamera;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::polygon::hull_of_sorted;

/// A corner of the floor's hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineVertex {
    /// On the floor, robot's frame, meters.
    pub point_in_robot: Point2<f64>,
    /// Away from the mirror's axis, of unit length.
    pub outward: Vector2<f64>,
    /// How its distance grows with its radius in the picture, meters per pixel.
    pub slope_m_per_px: f64,
    /// Its distance from the center of the picture, pixels of the mirror plane.
    pub radius_px: f64,
}

impl OutlineVertex {
    /// One over the square of [`OutlineVertex::slope_m_per_px`]: weighted residuals are pixels, nearly.
    #[must_use]
    pub fn weight(&self) -> f64 {
        1.0 / (self.slope_m_per_px * self.slope_m_per_px)
    }
}

/// Which corners count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineRule {
    /// Height of the mirror frame's origin above the floor, meters.
    pub height_m: f64,
    /// Corners farther from the center of the picture tell too little, pixels.
    pub max_radius_px: f64,
}

/// The picture has no outline that can be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the mask is not of the size of the camera's picture")]
pub struct OutlineError;

/// The hull of the floor in a picture, and its corners on the floor. Keeps its buffers.
#[derive(Clone, Debug, Default)]
pub struct FloorOutline {
    extremes: Vec<Point2<f64>>,
    hull: Vec<Point2<f64>>,
    vertices: Vec<OutlineVertex>,
}

impl FloorOutline {
    /// Takes the hull of the set pixels of a mask. Sekimori et al. (2001), section IV: the first and the last floor pixel of
    /// each row are enough.
    ///
    /// # Errors
    /// [`OutlineError`].
    pub fn take_mask(
        &mut self,
        mask: &BitImage,
        camera: &MirrorCamera,
        rule: &OutlineRule,
    ) -> Result<(), OutlineError> {
        self.vertices.clear();
        self.hull.clear();
        let image = camera.image();
        if (mask.width(), mask.height()) != (image.width as usize, image.height as usize) {
            return Err(OutlineError);
        }
        self.extremes.clear();
        // Rows as x, columns as y: so the points are in order as they come.
        for v in 0..mask.height() {
            if let Some((first, last)) = extent(mask.row(v)) {
                self.extremes.push(Point2::new(v as f64, first as f64));
                self.extremes.push(Point2::new(v as f64, last as f64));
            }
        }
        hull_of_sorted(&self.extremes, &mut self.hull);
        let (right, bottom) = (mask.width() as f64 - 1.0, mask.height() as f64 - 1.0);
        self.hull.retain(|p| p.x > 0.0 && p.y > 0.0 && p.x < bottom && p.y < right);
        for corner in &mut self.hull {
            *corner = image.mirror_from_pixel(Vector2::new(corner.y, corner.x)).into();
        }
        self.project(camera, rule);
        Ok(())
    }

    /// Takes a hull in the mirror plane, pixels.
    pub fn take_hull(&mut self, hull: &[Point2<f64>], camera: &MirrorCamera, rule: &OutlineRule) {
        self.hull.clear();
        self.hull.extend_from_slice(hull);
        self.project(camera, rule);
    }

    /// The corners of the hull in the mirror plane, pixels; those on the border of the picture are left out.
    #[must_use]
    pub fn hull(&self) -> &[Point2<f64>] {
        &self.hull
    }

    /// The corners of the hull on the floor, in order.
    #[must_use]
    pub fn vertices(&self) -> &[OutlineVertex] {
        &self.vertices
    }

    /// Projects the hull's corners anew, as if each were seen `inward_px` nearer to the center.
    pub fn project_shifted(&mut self, camera: &MirrorCamera, rule: &OutlineRule, inward_px: f64) {
        for vertex in &mut self.vertices {
            if let Some(moved) = vertex_at(vertex.outward, vertex.radius_px, inward_px, camera, rule) {
                *vertex = moved;
            }
        }
    }

    fn project(&mut self, camera: &MirrorCamera, rule: &OutlineRule) {
        self.vertices.clear();
        let seen = self.hull.iter().filter_map(|corner| {
            let radius_px = corner.coords.norm();
            let is_near = radius_px > 0.0 && radius_px <= rule.max_radius_px;
            is_near.then(|| vertex_at(corner.coords / radius_px, radius_px, 0.0, camera, rule)).flatten()
        });
        self.vertices.extend(seen);
    }
}

fn vertex_at(
    outward: Vector2<f64>,
    radius_px: f64,
    inward_px: f64,
    camera: &MirrorCamera,
    rule: &OutlineRule,
) -> Option<OutlineVertex> {
    let at = radius_px - inward_px;
    let distance = camera.floor_radius_m(at, rule.height_m)?;
    let slope_m_per_px = camera.floor_slope_m_per_px(at, rule.height_m)?;
    Some(OutlineVertex {
        point_in_robot: Point2::from(outward * distance),
        outward,
        slope_m_per_px,
        radius_px,
    })
}

/// The first and the last set bit of a row.
fn extent(row: &[u64]) -> Option<(usize, usize)> {
    let first = row.iter().position(|word| *word != 0)?;
    let last = row.iter().rposition(|word| *word != 0)?;
    let start = 64 * first + row[first].trailing_zeros() as usize;
    let end = 64 * last + 63 - row[last].leading_zeros() as usize;
    Some((start, end))
}

#[cfg(test)]
mod tests {
    use super::extent;

    #[test]
    fn extents_cross_words() {
        assert_eq!(extent(&[0, 0]), None);
        assert_eq!(extent(&[1 << 63, 0b110]), Some((63, 66)));
        assert_eq!(extent(&[0, 0b1000]), Some((67, 67)));
    }
}
