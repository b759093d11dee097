//! What stands in the way and where, remembered while it is out of view.
//!
//! Ohya, Kosaka & Kak (1998) take all obstacles to stand one meter ahead. Differs from \[1\]: they are put where their foot is
//! seen on the floor, and stay on the map when the robot drives past.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use yamabico_core::geometry::Pose2;
use yamabico_core::time::Time;

/// How many are remembered.
const MOST: usize = 24;
/// What was seen is remembered for so long, seconds; and for so long where it is beside the robot, nearer than this, meters: a
/// robot that stands still gets no view of it.
pub const SEEN_S: f64 = 30.0;
const BESIDE_S: f64 = 120.0;
const BESIDE_M: f64 = 1.5;
/// No search looks farther aside, radians.
const SEARCHED_RAD: f64 = 1.2;
/// What was only heard is remembered for so long, seconds.
const HEARD_S: f64 = 1.5;
/// A sighting this much beyond the radius of a thing is still that thing, meters.
const SAME_M: f64 = 0.3;
/// Pictures without it, though its place is in view, after which it is gone.
const FORGOTTEN: u32 = 3;

/// Something that the map does not have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Thing {
    /// Its middle on the map, meters.
    #[serde(with = "place")]
    pub at: Point2<f64>,
    /// Meters.
    pub radius_m: f64,
    /// Whether it was seen in two of three pictures.
    pub is_confirmed: bool,
    /// When it was last sensed.
    pub seen: Time,
    was_seen: bool,
    history: u8,
    misses: u32,
    is_fresh: bool,
}

/// The edge of a picture that cuts what is seen.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    /// Where the picture was taken, meters, map.
    pub from: Point2<f64>,
    /// Its left edge, else its right one.
    pub is_left: bool,
}

impl Cut {
    /// Where something is that was known at one place and whose rest is seen at another: no farther away, and no farther into the
    /// picture, than either says.
    fn place(&self, known: Point2<f64>, seen: Point2<f64>) -> Point2<f64> {
        let (known, seen) = (known - self.from, seen - self.from);
        let is_known_farther_left = seen.perp(&known) > 0.0;
        let towards = if is_known_farther_left == self.is_left { known } else { seen };
        self.from + towards.cap_magnitude(known.norm().min(seen.norm()))
    }
}

/// The things.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Things {
    list: Vec<Thing>,
    /// Pictures since it was all forgotten.
    pictures: u32,
}

impl Default for Things {
    fn default() -> Self {
        Self { list: Vec::with_capacity(MOST), pictures: 0 }
    }
}

impl Things {
    /// All of them.
    #[must_use]
    pub fn all(&self) -> &[Thing] {
        &self.list
    }

    /// Those that count.
    pub fn confirmed(&self) -> impl Iterator<Item = &Thing> {
        self.list.iter().filter(|thing| thing.is_confirmed)
    }

    /// Forgets what may have gone, to begin anew: all but what was seen beside `robot` (map) and is out of view, however it
    /// turns to search.
    pub fn forget_ahead(&mut self, robot: Option<Pose2>) {
        let is_out_of_view = |thing: &Thing| {
            robot.is_some_and(|robot| {
                let at = robot.inverse().transform_point(thing.at);
                at.coords.norm() < BESIDE_M && at.y.atan2(at.x).abs() > SEARCHED_RAD
            })
        };
        self.list.retain(|thing| thing.was_seen && is_out_of_view(thing));
        self.pictures = 0;
    }

    /// Whether there were pictures enough for what is in view to count.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.pictures >= 2
    }

    /// Begins a picture.
    pub fn begin(&mut self) {
        for thing in &mut self.list {
            thing.is_fresh = false;
        }
    }

    /// Takes a sighting of the picture begun: at a place on the map, meters. The rest of what the picture's edge cuts is outside.
    pub fn see(&mut self, at: Point2<f64>, radius_m: f64, cut: Option<Cut>, now: Time) {
        let is_same = |thing: &Thing| (thing.at - at).norm() < thing.radius_m.max(radius_m) + SAME_M;
        let known = self.list.iter_mut().filter(|thing| !thing.is_fresh && is_same(thing));
        let nearest = known.min_by(|a, b| (a.at - at).norm().total_cmp(&(b.at - at).norm()));
        let new = Thing {
            at,
            radius_m,
            is_confirmed: false,
            seen: now,
            was_seen: true,
            history: 0,
            misses: 0,
            is_fresh: true,
        };
        if let Some(thing) = nearest {
            let Thing { is_confirmed, history, .. } = *thing;
            let at = cut.map_or(at, |cut| cut.place(thing.at, at));
            *thing = Thing { at, is_confirmed, history, ..new };
        } else if self.list.len() < MOST {
            self.list.push(new);
        }
    }

    /// Takes an echo at a place on the map, meters: it counts at once.
    pub fn hear(&mut self, at: Point2<f64>, radius_m: f64, now: Time) {
        if let Some(thing) = self.list.iter_mut().find(|thing| (thing.at - at).norm() < thing.radius_m) {
            (thing.is_confirmed, thing.seen) = (true, now);
            return;
        }
        if self.list.len() < MOST {
            self.list.push(Thing {
                at,
                radius_m,
                is_confirmed: true,
                seen: now,
                was_seen: false,
                history: 0,
                misses: 0,
                is_fresh: true,
            });
        }
    }

    /// Ends a picture: `is_in_view` tells of a place whether it would have been seen.
    pub fn end(&mut self, is_in_view: impl Fn(Point2<f64>) -> bool) {
        self.pictures = self.pictures.saturating_add(1);
        for thing in &mut self.list {
            if !thing.is_fresh && !is_in_view(thing.at) {
                continue;
            }
            thing.history = thing.history << 1 | u8::from(thing.is_fresh);
            thing.misses = if thing.is_fresh { 0 } else { thing.misses + 1 };
            thing.is_confirmed |= (thing.history & 0b111).count_ones() >= 2;
        }
        self.list.retain(|thing| thing.misses < FORGOTTEN);
    }

    /// Forgets what was sensed too long ago. `robot`: where it is on the map, meters.
    pub fn expire(&mut self, now: Time, robot: Option<Point2<f64>>) {
        self.list.retain(|thing| {
            let is_beside = robot.is_some_and(|robot| (thing.at - robot).norm() < BESIDE_M);
            let longest_s = match (thing.was_seen, is_beside) {
                (true, true) => BESIDE_S,
                (true, false) => SEEN_S,
                (false, _) => HEARD_S,
            };
            now.seconds_after(thing.seen) <= longest_s
        });
    }

    /// Whether a robot of `half_width_m` that goes from `pose` for `length_m` in the direction `bearing` (rad, from its heading)
    /// touches none that counts. One that is nearer already may be left behind.
    #[must_use]
    pub fn is_free(&self, pose: &Pose2, bearing: f64, length_m: f64, half_width_m: f64) -> bool {
        let inverse = pose.inverse();
        let (sin, cos) = bearing.sin_cos();
        self.confirmed().all(|thing| {
            let at = inverse.transform_point(thing.at);
            let (along, across) = (cos * at.x + sin * at.y, cos * at.y - sin * at.x);
            let nearest = across.hypot(along - along.clamp(0.0, length_m));
            along <= 0.0 || nearest >= thing.radius_m + half_width_m
        })
    }
}

/// A place as its two coordinates.
mod place {
    use nalgebra::Point2;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(place: &Point2<f64>, serializer: S) -> Result<S::Ok, S::Error> {
        [place.x, place.y].serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Point2<f64>, D::Error> {
        <[f64; 2]>::deserialize(deserializer).map(Point2::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(things: &mut Things, x: f64) {
        things.begin();
        things.see(Point2::new(x, 0.0), 0.2, None, Time::ZERO);
        things.end(|_| true);
    }

    #[test]
    fn two_of_three_pictures_confirm_and_three_without_forget() {
        let mut things = Things::default();
        seen(&mut things, 2.0);
        assert_eq!(things.confirmed().count(), 0);
        things.begin();
        things.end(|_| true);
        seen(&mut things, 2.1);
        assert_eq!(things.confirmed().count(), 1);
        for _ in 0..5 {
            things.begin();
            things.end(|_| false);
        }
        assert_eq!(things.confirmed().count(), 1, "out of view it stays");
        for _ in 0..3 {
            things.begin();
            things.end(|_| true);
        }
        assert!(things.all().is_empty());
    }

    #[test]
    fn the_rest_of_what_the_edge_of_the_picture_cuts_goes_neither_farther_away_nor_farther_in() {
        let mut things = Things::default();
        seen(&mut things, 2.0);
        let cut = |is_left| Some(Cut { from: Point2::new(1.0, 0.0), is_left });
        for (at, cut, there) in [
            ([2.3, 0.0], cut(true), [2.0, 0.0]),
            ([1.9, 0.0], cut(true), [1.9, 0.0]),
            ([1.9, -0.1], cut(true), [1.9, 0.0]),
            ([1.9, 0.1], cut(true), [1.9, 0.1]),
            ([1.9, 0.2], cut(false), [1.9, 0.1]),
            ([2.1, 0.2], None, [2.1, 0.2]),
        ] {
            things.begin();
            things.see(Point2::from(at), 0.15, cut, Time::ZERO);
            things.end(|_| true);
            let off = (things.confirmed().next().unwrap().at - Point2::from(there)).norm();
            assert!(off < 0.015, "{at:?} is taken to be {off} m beside {there:?}");
        }
        things.begin();
        things.see(Point2::new(3.5, 0.0), 0.15, cut(true), Time::ZERO);
        assert_eq!(things.all().len(), 2, "what is not known yet is put where it seems to be");
    }

    #[test]
    fn the_way_past_a_thing_is_free_and_the_way_into_it_is_not() {
        let mut things = Things::default();
        seen(&mut things, 1.5);
        seen(&mut things, 1.5);
        let free = |bearing: f64| things.is_free(&Pose2::IDENTITY, bearing, 2.0, 0.23);
        assert!(!free(0.0) && !free(0.2) && free(0.35) && free(-0.35));
        let beside = Pose2::new(1.5, 0.45, 0.0);
        assert!(
            things.is_free(&beside, 0.0, 2.0, 0.23)
                && !things.is_free(&Pose2::new(1.3, 0.6, 0.0), -1.2, 2.0, 0.23)
        );
    }

    #[test]
    fn time_ends_a_memory_and_later_that_of_what_is_beside_the_robot() {
        let mut things = Things::default();
        things.hear(Point2::new(0.5, 0.0), 0.1, Time::ZERO);
        seen(&mut things, 3.0);
        seen(&mut things, 3.0);
        let mut left = |seconds: f64, robot_x: f64| {
            things.expire(Time::from_secs_f64(seconds), Some(Point2::new(robot_x, 0.0)));
            things.confirmed().count()
        };
        assert_eq!([left(1.4, 0.0), left(1.6, 0.0)], [2, 1]);
        assert_eq!([left(29.0, 0.0), left(119.0, 2.0), left(119.0, 0.0)], [1, 1, 0]);
        seen(&mut things, 3.0);
        things.expire(Time::from_secs_f64(121.0), Some(Point2::new(2.0, 0.0)));
        assert!(things.all().is_empty());
    }

    #[test]
    fn to_begin_anew_is_to_forget_all_but_what_was_seen_beside_the_robot() {
        let mut things = Things::default();
        for x in [1.0, 3.0] {
            things.begin();
            things.see(Point2::new(x, 0.0), 0.2, None, Time::ZERO);
            things.end(|_| false);
        }
        things.hear(Point2::new(0.0, 1.0), 0.1, Time::ZERO);
        things.forget_ahead(Some(Pose2::new(1.0, -0.5, 0.0)));
        assert_eq!(things.all().iter().map(|thing| thing.at).collect::<Vec<_>>(), [Point2::new(1.0, 0.0)]);
        let settled = [(); 3].map(|()| {
            let is_settled = things.is_settled();
            things.begin();
            things.end(|_| false);
            is_settled
        });
        assert_eq!(settled, [false, false, true], "the first picture confirms nothing");
        things.forget_ahead(None);
        assert!(things.all().is_empty());
    }
}
