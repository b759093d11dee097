use nalgebra::{Point2, Vector2};
use thiserror::Error;
use yamabico_core::camera::MirrorCamera;
use yamabico_vision::bit_image::BitImage;
use yamabico_vision::polygon::hull_of_sorted;

/// Corner of the floor's hull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineVertex {
    /// Position on the floor in the robot frame, m.
    pub point_in_robot: Point2<f64>,
    /// Unit vector away from the mirror's axis.
    pub outward: Vector2<f64>,
    /// Derivative of the distance on the floor with respect to the radius in the image, m/px.
    pub slope_m_per_px: f64,
    /// Distance from the center of the image in the mirror plane, px.
    pub radius_px: f64,
}

impl OutlineVertex {
    /// Returns the weight that converts squared residuals on the floor (m²) approximately to the image (px²).
    #[must_use]
    pub fn weight(&self) -> f64 {
        1.0 / (self.slope_m_per_px * self.slope_m_per_px)
    }
}

/// Selection of the corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlineRule {
    /// Height of the mirror frame's origin above the floor, m.
    pub height_m: f64,
    /// Maximum distance of a corner from the center of the image, px; farther ones are too imprecise.
    pub max_radius_px: f64,
}

/// The mask does not have the size of the camera's image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("the size of the mask differs from the size of the camera's image")]
pub struct OutlineError;

/// Convex hull of the floor in an image, and its corners on the floor. Reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct FloorOutline {
    extremes: Vec<Point2<f64>>,
    hull: Vec<Point2<f64>>,
    vertices: Vec<OutlineVertex>,
}

impl FloorOutline {
    /// Computes the hull of the set pixels of a mask. Sekimori et al. (2001), section IV: the first and last floor
    /// pixel of each row are sufficient.
    ///
    /// # Errors
    /// The mask does not have the size of the camera's image.
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
        // Rows as x, columns as y: the points are created in sorted order.
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

    /// Sets the hull, given in the mirror plane, px.
    pub fn take_hull(&mut self, hull: &[Point2<f64>], camera: &MirrorCamera, rule: &OutlineRule) {
        self.hull.clear();
        self.hull.extend_from_slice(hull);
        self.project(camera, rule);
    }

    /// Returns the corners of the hull in the mirror plane, px, except those on the border of the image.
    #[must_use]
    pub fn hull(&self) -> &[Point2<f64>] {
        &self.hull
    }

    /// Returns the corners of the hull on the floor, in order.
    #[must_use]
    pub fn vertices(&self) -> &[OutlineVertex] {
        &self.vertices
    }

    /// Projects the corners to the floor again, with their radius in the image reduced by `inward_px`.
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

/// Returns the first and last set bit of a row.
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
    fn extents_may_span_several_words() {
        assert_eq!(extent(&[0, 0]), None);
        assert_eq!(extent(&[1 << 63, 0b110]), Some((63, 66)));
        assert_eq!(extent(&[0, 0b1000]), Some((67, 67)));
    }
}
