//! The scan up the columns, and the color of the floor in front of the robot.

use nalgebra::Point2;
use yamabico_geometry::camera::{Mount, Pinhole};

use super::cells::CellImage;
use super::floor_end::{FloorEnd, FreeFloor};
use super::lab::Lab;
use super::near_color::NearColor;
use super::rules::ColumnRules;
use super::texture::FloorTexture;
use super::view::FloorView;
use super::wall_beside::columns_from_side;
use crate::floor_appearance::Picture;

/// Lightness from which a cell is overexposed, and that of a floor up to which this is no color of a thing: a lamp's mirror
/// image, or sunlight.
const OVEREXPOSED: f32 = 248.0;
const MAX_DARK_FLOOR: f32 = 220.0;
/// Least numbers of columns and rows of cells: with fewer, the area in front of the robot has none.
const MIN_CELLS: [usize; 2] = [4, 8];
/// Rows at the lower border of the picture where no end of the floor is found, cells.
const BORDER_ROWS: usize = 2;
/// Rows of a column on each side of the end of the floor whose lightness is compared.
const SHADE_ROWS: usize = 4;
/// Share of the rows around the horizon up to which those that differ from the floor are noise: nothing ends the floor there.
const MAX_BOUNDLESS_SHARE: f32 = 0.2;
/// Share of the columns without floor from which the picture shows none.
const MIN_LOST_SHARE: f64 = 0.7;

/// Distance between the ends of neighboring columns up to which one thing ends the floor in both, m.
const SAME_FOOT_M: f64 = 0.3;

/// Finds the end of the floor in each column. Allocates when it is created and no more.
#[derive(Clone, Debug)]
pub struct FloorColumns {
    rules: ColumnRules,
    cells: CellImage,
    view: FloorView,
    near: NearColor,
    texture: FloorTexture,
    /// Cells that differ from the floor, column by column from above.
    differs: Vec<bool>,
    /// Cells that are overexposed on a darker floor.
    glare: Vec<bool>,
    /// Row of the last floor cell before the end of the floor, if it ends within the range; else the first row scanned.
    ends: Vec<usize>,
    /// Columns that look like floor up to above the horizon.
    boundless: Vec<bool>,
    /// Row above the end from which on the column looks like the floor again; else the first row scanned.
    tops: Vec<usize>,
}

impl FloorColumns {
    /// Creates the scan of a camera; `None` if it sees no floor within range in its lower half, or has only a few pixels.
    #[must_use]
    pub fn new(pinhole: &Pinhole, mount: &Mount, rules: ColumnRules) -> Option<Self> {
        let [width, height] = pinhole.intrinsics().size();
        let cells = CellImage::new(width as usize, height as usize);
        let [columns, rows] = cells.size();
        let view = FloorView::new(&cells, pinhole, mount, rules.max_range_m, rules.min_height_m);
        (columns >= MIN_CELLS[0]
            && rows >= MIN_CELLS[1]
            && view.top + BORDER_ROWS + 2 < rows
            && mount.z > 0.0)
            .then(|| Self {
                rules,
                view,
                near: NearColor::new(&cells),
                texture: FloorTexture::new(cells.size()),
                differs: vec![false; rows],
                glare: vec![false; columns * rows],
                ends: vec![rows - 1; columns],
                tops: vec![0; columns],
                boundless: vec![false; columns],
                cells,
            })
    }

    /// True if the camera sees the floor at `place` (robot frame, m) where nothing hides it: it lies between the borders of the view,
    /// and not below it.
    #[must_use]
    pub fn is_in_view(&self, place: Point2<f64>) -> bool {
        self.view.shows(place)
    }

    /// Sets whether the spread of the floor's lightness in front of the robot is tolerated, as it is at first: things of its lightness are
    /// not found, which takes another sense. On a floor that mirrors, it is the spread of what stands elsewhere.
    pub fn tolerate_spread(&mut self, tolerates: bool) {
        self.near.tolerate_spread(tolerates);
    }

    /// Takes in a picture. The color of the area in front of the robot is learned if `learns` is set: nothing stands
    /// there. Returns false if the picture has another size; the results are then those of the last one.
    pub fn look(&mut self, picture: Picture, learns: bool) -> bool {
        if !self.cells.fill(picture) {
            return false;
        }
        let colors = self.near.update(&self.cells, learns);
        self.texture.look(picture, self.cells.cell());
        self.scan_all(colors);
        if learns {
            self.texture.learn(&self.ends);
        }
        true
    }

    /// True if most columns show no floor at all: something wide is before the camera, or the floor does not look as it did.
    #[must_use]
    pub fn shows_no_floor(&self) -> bool {
        let last = self.cells.size()[1] - BORDER_ROWS - 1;
        let without = self.ends.iter().filter(|&&row| row >= last).count();
        without as f64 >= MIN_LOST_SHARE * self.ends.len() as f64
    }

    /// Takes the area in front of the robot in the last picture as floor, whatever was known before, and evaluates the picture again.
    pub fn relearn(&mut self) {
        let colors = self.near.relearn(&self.cells);
        self.scan_all(colors);
    }

    /// Scans the columns with these colors of the floor.
    fn scan_all(&mut self, colors: [Lab; 2]) {
        for column in 0..self.cells.size()[0] {
            (self.ends[column], self.boundless[column]) = self.scan(column, colors);
            // Two rows in a row: one may be noise, or a joint.
            let mut above = self.differs[self.view.top..self.ends[column]].windows(2);
            self.tops[column] = self.view.top + above.rposition(|rows| !rows[0] && !rows[1]).unwrap_or(0);
        }
    }

    /// Scans a column. Returns the row where the floor ends: its lowest row that differs from the floor over the height
    /// of an obstacle, or the first row scanned; and true if the column looks like floor up to above the horizon.
    fn scan(&mut self, column: usize, mut colors: [Lab; 2]) -> (usize, bool) {
        let [columns, rows] = self.cells.size();
        let follow = 1.0 - (1.0 - self.rules.follow).powf(240.0 / rows as f32);
        let tolerance = self.near.tolerance(&self.rules);
        for row in (self.view.sky.unwrap_or(self.view.top)..rows - 1).rev() {
            let seen = self.cells.row(row)[column];
            let is_overexposed = seen[0] > OVEREXPOSED && colors[0][0] < MAX_DARK_FLOOR;
            let mut is_other = true;
            for color in &mut colors {
                let off: Lab = std::array::from_fn(|channel| seen[channel] - color[channel]);
                if off.iter().zip(&tolerance).all(|(off, tolerance)| off.abs() <= *tolerance) {
                    is_other = false;
                    *color = std::array::from_fn(|channel| color[channel] + follow * off[channel]);
                }
            }
            let is_plain = row > self.view.top && self.texture.is_plain(column, row);
            self.differs[row] = (is_other || is_plain) && !is_overexposed;
            self.glare[row * columns + column] = is_overexposed;
        }
        let is_end = |row: usize| {
            let from = (row + 1).saturating_sub(self.view.height_rows[row]).max(self.view.top);
            let covered = &self.differs[from..=row];
            let count = covered.iter().filter(|differs| **differs).count();
            self.differs[row] && count as f32 > self.rules.min_share * covered.len() as f32
        };
        let end =
            (self.view.top + 1..rows - BORDER_ROWS).rev().find(|&row| is_end(row)).unwrap_or(self.view.top);
        let is_boundless = end == self.view.top
            && self.view.sky.is_some_and(|sky| {
                let beyond = &self.differs[sky..self.view.top];
                let count = beyond.iter().filter(|differs| **differs).count();
                (count as f32) < MAX_BOUNDLESS_SHARE * beyond.len() as f32
            });
        (end, is_boundless)
    }

    /// Places on the floor where it ends, robot frame, m: the feet of obstacles and walls.
    pub fn ends(&self) -> impl Iterator<Item = FloorEnd> {
        let last = self.cells.size()[1] - BORDER_ROWS - 1;
        let columns = self.ends.iter().zip(&self.tops).enumerate();
        columns.filter(move |&(_, (&row, _))| row > self.view.top && row < last).map(
            |(column, (&row, &top))| {
                let [[u, from], [_, to]] = [top, row].map(|row| self.cells.middle(column, row));
                FloorEnd {
                    place: self.view.place(column, row),
                    u,
                    rows: [from, to],
                    is_lone: self.is_lone(column),
                    is_darker: self.is_darker(column),
                }
            },
        )
    }

    /// True if what ends the floor in a column is darker over its lowest rows than the last of the floor.
    fn is_darker(&self, column: usize) -> bool {
        let (end, rows) = (self.ends[column], self.cells.size()[1]);
        let from = end.saturating_sub(SHADE_ROWS).max(self.tops[column] + 1).min(end);
        let floor = end + BORDER_ROWS..(end + BORDER_ROWS + SHADE_ROWS).min(rows);
        let [thing, floor] = [from..end + 1, floor].map(|rows| self.cells.lightness(column, rows));
        thing < floor - self.near.tolerance(&self.rules)[0]
    }

    /// True if the floor reaches farther in both columns beside `column`, or beyond the border of the picture.
    fn is_lone(&self, column: usize) -> bool {
        let end_m = |column: usize| (self.view.place(column, self.ends[column]) - self.view.camera).norm();
        let max_m = end_m(column) + SAME_FOOT_M;
        let beside = [column.checked_sub(1), (column + 1 < self.ends.len()).then_some(column + 1)];
        beside.into_iter().flatten().all(|beside| end_m(beside) > max_m)
    }

    /// Places of floor before its end, robot frame, m. A wall beside the robot that looks like the floor has no foot to be seen: columns
    /// from a side of the picture on that look like floor up to above the horizon show none, with a few others between them. Nor does what is overexposed on a darker floor.
    pub fn free(&self) -> impl Iterator<Item = FreeFloor> {
        let rows = self.cells.size()[1];
        let last = rows - BORDER_ROWS - 1;
        let shows_nothing = move |column: usize| self.boundless[column] || self.ends[column] >= last;
        let width = self.ends.len();
        let left = columns_from_side(0..width, shows_nothing);
        let right = columns_from_side((left..width).rev(), shows_nothing);
        let is_beside = move |column: usize| column < left || column >= width - right;
        let columns = self.ends.iter().enumerate();
        let columns = columns.filter(move |&(column, _)| !(is_beside(column) && shows_nothing(column)));
        columns.flat_map(move |(column, &end)| {
            let is_told = move |&row: &usize| !self.glare[row * width + column];
            let is_boundless = self.boundless[column];
            let floor = move |row| FreeFloor { place: self.view.place(column, row), is_boundless };
            (end + 2..rows - 1).filter(is_told).map(floor)
        })
    }

    /// Nearest places in view in the columns without floor that adjoin `u` (pixels) on one side, if the floor reaches the lower border
    /// on the other, robot frame, m: what stands there has its foot there or nearer.
    pub fn covered_beside(&self, u: f64) -> impl Iterator<Item = Point2<f64>> {
        let last = self.cells.size()[1] - BORDER_ROWS - 1;
        let is_covered = move |&column: &usize| self.ends[column] >= last;
        let width = self.cells.middle(1, 0)[0] - self.cells.middle(0, 0)[0];
        let at = ((u / width) as usize).min(self.ends.len() - 1);
        let left = || (0..at).rev().take_while(is_covered);
        let right = || (at + 1..self.ends.len()).take_while(is_covered);
        let is_one_sided = (left().next().is_none()) != (right().next().is_none());
        let beside = is_one_sided.then(|| left().chain(right())).into_iter().flatten();
        beside.map(move |column| self.view.place(column, self.cells.size()[1] - 1))
    }

    /// Ends of the floor as pixels, for pictures of what was seen.
    pub fn end_pixels(&self) -> impl Iterator<Item = [f64; 2]> {
        self.ends.iter().enumerate().map(|(column, &row)| self.cells.middle(column, row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use yamabico_geometry::camera::Intrinsics;
    use yamabico_geometry::image::ImageView;

    const SIZE: (usize, usize) = (256, 240);

    fn columns() -> FloorColumns {
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.1));
        FloorColumns::new(&pinhole, &Mount::tilted(0.5, 0.15), ColumnRules::default()).expect("floor in view")
    }

    /// Row of the horizon.
    const HORIZON: usize = 88;

    /// A floor with a shade that grows slowly to the right and up, a bright wall above the horizon, and a box in columns 100 to 139
    /// from row `top` to row `bottom`.
    fn picture(top: usize, bottom: usize) -> Vec<u8> {
        let shade = |u: usize, v: usize| match (u, v) {
            (100..140, v) if (top..bottom).contains(&v) => 60,
            (_, ..HORIZON) => 230,
            (u, v) => (110 + (240 - v) / 6 + u / 40) as u8,
        };
        (0..SIZE.0 * SIZE.1).map(|i| shade(i % SIZE.0, i / SIZE.0)).collect()
    }

    fn places(columns: &FloorColumns) -> impl Iterator<Item = Point2<f64>> {
        columns.free().map(|floor| floor.place)
    }

    fn look(columns: &mut FloorColumns, pixels: &[u8]) -> bool {
        look_at(columns, pixels, true)
    }

    fn look_at(columns: &mut FloorColumns, pixels: &[u8], learns: bool) -> bool {
        let (width, height) = SIZE;
        columns.look(Picture::Gray(ImageView::new(pixels, width, height, width).expect("an image")), learns)
    }

    #[test]
    fn a_box_ends_the_floor_at_its_foot() {
        let mut columns = columns();
        assert!(look(&mut columns, &picture(100, 180)));
        let pinhole = Pinhole::ideal(Intrinsics::from_horizontal_fov(256, 240, 1.1));
        let mount = Mount::tilted(0.5, 0.15);
        let ray = mount.rotation_body_from_camera()
            * pinhole.ray_from_pixel(Vector2::new(120.0, 179.0)).expect("a ray");
        let foot_m = 0.5 * ray.x / -ray.z;
        let ends: Vec<_> = columns.ends().map(|end| end.place).collect();
        assert!((8..=11).contains(&ends.len()), "{}", ends.len());
        for end in ends {
            assert!(
                (end.x - foot_m).abs() < 0.06 && end.y.abs() < 0.15,
                "{end:?} instead of {foot_m:.2} m ahead"
            );
        }
        let beyond = places(&columns).filter(|place| place.x > foot_m + 0.1 && place.y.abs() < 0.02).count();
        assert_eq!(beyond, 0, "nothing behind the box is free");
        assert!(columns.free().count() > 1500);
        let is_darker = |columns: &FloorColumns| columns.ends().map(|end| end.is_darker).collect::<Vec<_>>();
        assert!(is_darker(&columns).iter().all(|is_darker| *is_darker));
        let bright: Vec<u8> =
            picture(100, 180).iter().map(|&shade| if shade == 60 { 200 } else { shade }).collect();
        assert!(look_at(&mut columns, &bright, false));
        let bright = is_darker(&columns);
        assert!(bright.len() >= 8 && bright.iter().all(|is_darker| !is_darker), "{bright:?}");
    }

    #[test]
    fn a_box_that_the_picture_cuts_covers_the_columns_beside_its_edge() {
        let mut columns = columns();
        assert!(look(&mut columns, &picture(0, 0)) && look_at(&mut columns, &picture(100, 240), false));
        let [left, right] = [101.0, 141.0].map(|u| columns.covered_beside(u).collect::<Vec<_>>());
        assert!((8..=11).contains(&left.len()) && (8..=11).contains(&right.len()), "{left:?} {right:?}");
        let is_before_camera = |place: &Point2<f64>| (0.6..0.7).contains(&place.x) && place.y.abs() < 0.1;
        assert!(left.iter().chain(&right).all(is_before_camera), "{left:?} {right:?}");
        assert_eq!(columns.covered_beside(120.0).count(), 0, "covered on both sides");
        assert_eq!(columns.covered_beside(60.0).count(), 0, "floor on both sides");
        assert!(look(&mut columns, &picture(100, 180)));
        assert_eq!(columns.covered_beside(101.0).count(), 0, "its foot is in the picture");
    }

    #[test]
    fn a_wall_that_looks_like_the_floor_shows_no_floor() {
        let mut columns = columns();
        let wall = |columns: std::ops::Range<usize>| {
            let mut pixels = picture(0, 0);
            for (i, shade) in pixels.iter_mut().enumerate().take(HORIZON * SIZE.0) {
                if columns.contains(&(i % SIZE.0)) {
                    *shade = 137;
                }
            }
            pixels
        };
        let count = |columns: &FloorColumns, sides: std::ops::Range<f64>| {
            places(columns).filter(|place| sides.contains(&(place.y / place.x))).count()
        };
        assert!(look(&mut columns, &wall(0..0)));
        let [left, right] = [0.1..9.0, -9.0..0.1].map(|sides| count(&columns, sides));
        assert!(look(&mut columns, &wall(0..100)));
        assert!(count(&columns, 0.2..9.0) == 0, "to the left");
        assert!(count(&columns, -9.0..0.1) == right && left > 500, "{right}");
        let mut stained = wall(0..100);
        let stain = (HORIZON..HORIZON + 60).flat_map(|row| (40..48).map(move |column| row * SIZE.0 + column));
        stain.for_each(|at| stained[at] = 20);
        assert!(look(&mut columns, &stained));
        assert!(count(&columns, 0.2..9.0) < 100, "beside two columns that end");
        assert!(look(&mut columns, &wall(100..140)));
        assert_eq!(count(&columns, -9.0..9.0), left + right, "the end of a corridor may look so, too");
        let boundless = columns.free().filter(|floor| floor.is_boundless);
        assert!(boundless.count() > 300 && columns.free().any(|floor| !floor.is_boundless));
        assert!(look(&mut columns, &wall(0..SIZE.0)));
        assert_eq!(columns.free().count(), 0);
    }

    #[test]
    fn a_speck_is_lone_and_a_box_is_not() {
        let mut columns = columns();
        assert!(look(&mut columns, &picture(100, 180)));
        assert!(columns.ends().all(|end| !end.is_lone));
        assert!(look(&mut columns, &picture(0, 0)));
        assert_eq!(columns.ends().count(), 0, "an empty floor");
        let row = columns.cells.size()[1] - 40;
        for column in [0, 30, 63] {
            columns.ends[column] = row;
            assert!(columns.ends().all(|end| end.is_lone), "the floor goes on on both sides of {column}");
        }
        columns.ends[31] = row + 1;
        let lone: Vec<_> = columns.ends().map(|end| end.is_lone).collect();
        assert_eq!(lone, [true, false, false, true], "two columns side by side are one thing");
    }

    #[test]
    fn a_joint_and_slow_shades_are_floor() {
        let mut columns = columns();
        assert!(look(&mut columns, &picture(170, 174)));
        assert_eq!(columns.ends().count(), 0);
    }

    #[test]
    fn the_color_is_learned_only_where_nothing_stands() {
        let mut columns = columns();
        assert!(look(&mut columns, &picture(0, 0)));
        let covered: Vec<u8> =
            (0..SIZE.0 * SIZE.1).map(|i| if i / SIZE.0 < HORIZON { 230 } else { 60 }).collect();
        let view = ImageView::new(&covered, SIZE.0, SIZE.1, SIZE.0).expect("an image");
        for _ in 0..20 {
            assert!(columns.look(Picture::Gray(view), false));
        }
        assert_eq!(columns.free().count(), 0);
        for _ in 0..20 {
            assert!(columns.look(Picture::Gray(view), true));
        }
        assert!(columns.free().count() > 1000, "a floor of another brightness is learned");
    }

    #[test]
    fn what_steps_before_the_robot_is_not_learned() {
        let mut columns = columns();
        let legs: Vec<u8> = picture(0, 0)
            .iter()
            .enumerate()
            .map(|(i, &shade)| if (90..170).contains(&(i % SIZE.0)) { 60 } else { shade })
            .collect();
        assert!(look(&mut columns, &picture(0, 0)));
        assert!((0..3).all(|_| look(&mut columns, &legs)), "before a sensor detects them");
        assert!(look_at(&mut columns, &picture(0, 0), false) && columns.ends().count() == 0);
    }

    #[test]
    fn another_floor_is_learned_anew() {
        let (mut columns, floor) = (columns(), picture(0, 0));
        assert!(look(&mut columns, &floor) && !columns.shows_no_floor());
        let sunny: Vec<u8> = floor.iter().map(|shade| shade.saturating_add(60)).collect();
        let image = ImageView::new(&sunny, SIZE.0, SIZE.1, SIZE.0).expect("an image");
        assert!(columns.look(Picture::Gray(image), false) && columns.shows_no_floor());
        columns.relearn();
        assert!(!columns.shows_no_floor() && columns.ends().count() == 0);
        assert!(look(&mut columns, &picture(120, 160)), "the next picture is evaluated, too");
    }

    #[test]
    fn a_lamp_in_the_floor_is_no_thing_and_a_bright_box_is() {
        let patch = |shade: u8| {
            let mut pixels = picture(0, 0);
            for v in 100..180 {
                pixels[v * SIZE.0 + 100..v * SIZE.0 + 140].fill(shade);
            }
            let mut columns = columns();
            assert!(look(&mut columns, &pixels));
            let behind = places(&columns)
                .filter(|place| (1.2..1.6).contains(&place.x) && (0.0..0.1).contains(&place.y));
            (columns.ends().count(), behind.count())
        };
        assert_eq!(patch(255), (0, 0), "neither a thing nor floor");
        assert!(patch(200).0 > 5);
        let bright: Vec<u8> =
            picture(0, 0).iter().map(|&shade| if shade == 230 { 60 } else { 252 }).collect();
        let mut columns = columns();
        assert!(look(&mut columns, &bright) && columns.free().count() > 1000, "a floor may be white");
    }
}
