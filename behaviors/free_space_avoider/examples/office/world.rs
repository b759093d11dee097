//! The office of `configs/office.toml`.

use yamabico_sim::Photometry;

/// Its world.
pub const OFFICE: &str = include_str!("../../../../configs/worlds/office.toml");

/// Lens and sensor of the robot's camera there.
pub fn photometry() -> Photometry {
    Photometry { exposure: 0.65, ..Photometry::default() }
}
