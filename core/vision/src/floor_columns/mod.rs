//! End of the floor in each column of a picture, by a color that follows slow changes.
//!
//! The color of the floor in front of the robot is carried up each column of the picture. Lamp pools, vignetting and
//! patterns of low contrast change it slowly, so that it follows; the foot of an obstacle changes it at once, and for as
//! many rows as the obstacle is high. The color that the floor had before the light changed at once is carried up, too:
//! where the floor in the sun borders on the shade it does not end. Thin joints and stripes are too low to count, and what
//! differs no more than the floor in front of the robot does in itself is floor, where that is tolerated. Where the floor
//! is speckled, what is plain is none, even if it has the color of the floor.
//!
//! Ulrich & Nourbakhsh (2000) compare pixels with the colors of an area ahead of the robot. Differs from \[1\]: the
//! color is followed up the columns instead of counted in histograms, and an end of the floor needs a height.

mod cells;
mod floor_end;
mod lab;
mod near_color;
mod rules;
mod scan;
mod texture;
mod view;
mod wall_beside;

pub use cells::CellImage;
pub use floor_end::{FloorEnd, FreeFloor};
pub use lab::Lab;
pub use rules::ColumnRules;
pub use scan::FloorColumns;

#[cfg(test)]
mod tests {
    use yamabico_geometry::camera::{Intrinsics, Mount, Pinhole};
    use yamabico_geometry::image::ImageView;

    use super::{ColumnRules, FloorColumns};
    use crate::floor_appearance::Picture;

    const SIZE: (usize, usize) = (256, 240);

    fn columns(rules: ColumnRules) -> FloorColumns {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.1));
        FloorColumns::new(&pinhole, &Mount::tilted(0.5, 0.15), rules).unwrap()
    }

    /// Looks at the picture of these gray levels.
    fn look(columns: &mut FloorColumns, learns: bool, level: impl Fn(usize, usize) -> u8) {
        let (width, height) = SIZE;
        let pixels: Vec<u8> = (0..width * height).map(|i| level(i % width, i / width)).collect();
        let image = ImageView::new(&pixels, width, height, width).expect("an image");
        assert!(columns.look(Picture::Gray(image), learns));
    }

    #[test]
    fn a_plain_box_of_the_color_of_a_speckled_floor_ends_it() {
        let mut columns = columns(ColumnRules::default());
        let mut ends_with = |has_box: bool, learns: bool| {
            look(&mut columns, learns, |u, v| match (u, v) {
                (100..140, 100..180) if has_box => 110,
                (u, v) => {
                    102 + ((u as u32 / 3 * 7919 + v as u32 / 3 * 104_729).wrapping_mul(2_654_435_761) >> 28)
                        as u8
                }
            });
            columns.ends().map(|end| end.u).collect::<Vec<f64>>()
        };
        assert!(ends_with(true, false).is_empty(), "the texture of the floor is not known yet");
        (0..10).for_each(|_| assert!(ends_with(false, true).is_empty()));
        let found = ends_with(true, false);
        assert!(found.len() >= 8 && found.iter().all(|u| (95.0..145.0).contains(u)), "{found:?}");
    }

    #[test]
    fn a_cloudy_carpet_does_not_end_and_a_dark_box_on_it_does() {
        let ends = |tolerates: bool| {
            let mut columns = columns(ColumnRules::default());
            columns.tolerate_spread(tolerates);
            [false, true].map(|has_box| {
                look(&mut columns, !has_box, |u, v| match (u, v) {
                    (100..140, 100..180) if has_box => 60,
                    (u, v) => (110.0 + 20.0 * (u as f64 / 14.0).sin() * (v as f64 / 10.0).sin()) as u8,
                });
                columns.ends().count()
            })
        };
        let [empty, with_box] = ends(true);
        assert!(empty == 0 && with_box >= 8, "{empty} {with_box}");
        let [empty, _] = ends(false);
        assert!(empty > 8, "{empty}");
    }

    #[test]
    fn a_faint_box_is_found_on_a_floor_that_is_hardly_cloudy() {
        let boxes_with = |min_spread: f32| {
            let mut columns = columns(ColumnRules { min_spread, ..ColumnRules::default() });
            [false, true].map(|has_box| {
                look(&mut columns, !has_box, |u, v| match (u, v) {
                    (100..140, 100..180) if has_box => 119,
                    // Thin rows, half of them brighter and half of them darker by 9.5 on average.
                    (u, v) => match (v / 4 % 5, 9 + (u % 2) as u8) {
                        (0, off) => 110 - off,
                        (2, off) => 110 + off,
                        _ => 110,
                    },
                });
                columns.ends().filter(|end| (95.0..145.0).contains(&end.u)).count()
            })
        };
        let [empty, with_box] = boxes_with(ColumnRules::default().min_spread);
        let [_, taken_for_floor] = boxes_with(0.0);
        assert!(empty == 0 && with_box >= 8 && taken_for_floor == 0, "{empty} {with_box} {taken_for_floor}");
    }

    #[test]
    fn a_floor_in_the_sun_goes_on_in_the_shade_that_was_seen_before() {
        let ends = |was_in_the_shade: bool| {
            let mut columns = columns(ColumnRules::default());
            let mut look_at = |shade: u8, shade_to: usize, has_box: bool, is_other_light: bool| {
                look(&mut columns, false, |u, v| match (u, v) {
                    (100..140, 100..180) if has_box => 40,
                    (_, v) if v < shade_to => shade,
                    _ => 170,
                });
                if is_other_light {
                    columns.relearn();
                }
                (columns.ends().count(), columns.shows_no_floor())
            };
            if was_in_the_shade {
                look_at(90, SIZE.1, false, true);
            }
            look_at(90, 0, false, true);
            let (border, _) = look_at(90, 150, false, false);
            let (with_box, _) = look_at(90, 150, true, false);
            assert!(with_box >= 8, "{with_box}");
            // Somewhat darker than it was: the floor's color is now that of the shade as it looks here.
            let (_, shows_no_floor) = look_at(81, SIZE.1, false, false);
            (border, shows_no_floor)
        };
        assert_eq!(ends(true), (0, false));
        let (border, shows_no_floor) = ends(false);
        assert!(border > 25 && shows_no_floor, "{border}");
    }

    #[test]
    fn pictures_of_few_pixels_are_refused_or_scanned() {
        let look = |width: usize, height: usize| {
            let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(width as u32, height as u32, 0.8));
            let mut columns = FloorColumns::new(&pinhole, &Mount::tilted(0.5, 0.5), ColumnRules::default())?;
            let pixels = vec![90; width * height];
            let image = ImageView::new(&pixels, width, height, width).expect("an image");
            Some(columns.look(Picture::Gray(image), true))
        };
        assert!((1..40).all(|pixels| look(pixels, 24) != Some(false) && look(24, pixels) != Some(false)));
        assert_eq!([look(3, 24), look(24, 7), look(24, 24)], [None, None, Some(true)]);
    }

    #[test]
    fn a_camera_that_sees_no_floor_is_refused() {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 0.8));
        let rules = ColumnRules::default();
        assert!(FloorColumns::new(&pinhole, &Mount::tilted(0.5, -0.6), rules).is_none());
        assert!(FloorColumns::new(&pinhole, &Mount::level(0.0), rules).is_none());
    }
}
