//! Boxes and people of a drawn building.

use rand::RngExt;

use super::BEYOND_M;
use super::properties::{PersonKind, Properties, one_of};
use crate::random::Stream;
use crate::scene::PERSON_RADIUS_M;
use crate::world::{BoxItem, Color, Person, World};
use yamabico_core::geometry::Hypotenuse;

/// Speed at which a robot is expected, m/s.
const ROBOT_MPS: f64 = 0.4;
/// Minimum free width beside a box, m: twice that of a small robot.
const MIN_GAP_M: f64 = 0.85;
/// Minimum distance between two obstacles along the hallway, m.
const MIN_SPACING_M: f64 = 2.2;
/// Number of attempts to place a box.
const ATTEMPTS: u32 = 200;

/// Doors through which a person crosses: world x of that on the left and that on the right.
pub type Crossing = [f64; 2];

/// Adds the person, and returns the doors that the walk needs.
pub fn place_people(world: &mut World, p: &Properties, rng: &mut Stream) -> Option<Crossing> {
    let at = rng.random_range(4.0..(p.distance_m - 2.5).clamp(4.5, 8.0));
    let side = one_of(rng, &[-1.0, 1.0]);
    let mut person = Person {
        path_m: Vec::new(),
        pause_s: Vec::new(),
        start_s: 0.0,
        jitter_s: 0.0,
        speed_mps: rng.random_range(0.6..1.1),
        gives_way_m: p.gives_way_m,
        height_m: rng.random_range(1.55..1.9),
        shirt: cloth(rng),
        trousers: cloth(rng),
    };
    let mut crossing = None;
    match p.person {
        PersonKind::None => return None,
        PersonKind::Stands => person.path_m = vec![[at, side * (p.width_m / 2.0 - PERSON_RADIUS_M - 0.05)]],
        PersonKind::Meets => {
            let lane = side * (p.width_m / 2.0 - PERSON_RADIUS_M - 0.08);
            let from = p.distance_m + BEYOND_M - 0.6;
            person.path_m = vec![[from, lane], [-1.5, lane]];
            // They meet about halfway.
            person.start_s = (at / ROBOT_MPS - (from - at) / person.speed_mps).max(0.0);
        }
        PersonKind::Crosses => {
            let out = at + rng.random_range(0.6..1.2);
            // Squarely through the doors.
            let (deep, near) = (p.width_m / 2.0 + 1.3, p.width_m / 2.0 - 0.2);
            let middle = [at + 0.2, rng.random_range(-0.2..0.2)];
            person.path_m =
                vec![[at, side * deep], [at, side * near], middle, [out, -side * near], [out, -side * deep]];
            person.pause_s = vec![0.0, 0.0, rng.random_range(2.0..6.0)];
            // Steps out shortly before the robot arrives.
            let walk_s = (deep + 0.5) / person.speed_mps;
            let ahead_m = rng.random_range(1.2..2.5);
            person.start_s = ((at - ahead_m) / ROBOT_MPS - walk_s).max(0.0);
            crossing = Some(if side > 0.0 { [at, out] } else { [out, at] });
        }
    }
    world.people.push(person);
    crossing
}

/// Adds boxes that leave a passage on one side.
pub fn place_boxes(world: &mut World, p: &Properties, rng: &mut Stream) {
    let occupied = |world: &World| -> Vec<f64> {
        let people = world.people.iter().filter(|_| p.person != PersonKind::Meets);
        let people = people.filter_map(|person| person.path_m.get(person.path_m.len() / 2).map(|at| at[0]));
        world.boxes.iter().map(|item| item.at_m[0]).chain(people).collect()
    };
    // Whoever comes along one wall keeps that side free.
    let meets = world.people.first().filter(|_| p.person == PersonKind::Meets);
    let free_side = meets.map(|person| -person.path_m[0][1].signum());
    for _ in 0..p.boxes {
        for _ in 0..ATTEMPTS {
            let size_m =
                [rng.random_range(0.2..0.38), rng.random_range(0.2..0.34), rng.random_range(0.22..0.6)];
            let reach = 0.5 * f64::hypotenuse(size_m[0], size_m[1]);
            let (min, max) = ((MIN_GAP_M + reach - p.width_m / 2.0).max(0.0), p.width_m / 2.0 - reach - 0.02);
            let x = rng.random_range(2.5..p.distance_m - 1.2);
            let is_free = occupied(world).iter().all(|other| (other - x).abs() >= MIN_SPACING_M);
            if !is_free || min >= max {
                continue;
            }
            // In the path of a robot on the centerline, if the width allows it.
            let aside = rng.random_range(min..max.clamp(min + 0.01, f64::max(0.45, min + 0.02)));
            let side = free_side.unwrap_or(one_of(rng, &[-1.0, 1.0]));
            world.boxes.push(BoxItem {
                at_m: [x, aside * side],
                yaw_deg: rng.random_range(-45.0..45.0),
                size_m,
                color: cardboard(rng, world.floor.color),
                ..BoxItem::default()
            });
            break;
        }
    }
}

/// Returns the color of a box: white, brown, gray, dark, or tinted and about as bright as the floor.
fn cardboard(rng: &mut Stream, floor: Color) -> Color {
    let like_floor = floor.map(|c| c * one_of(rng, &[0.75, 1.3]));
    one_of(rng, &[[0.85, 0.85, 0.83], [0.3, 0.19, 0.1], [0.4, 0.4, 0.42], [0.06, 0.06, 0.07], like_floor])
        .map(|c| c.min(1.0))
}

fn cloth(rng: &mut Stream) -> Color {
    let tone = one_of(rng, &[0.05, 0.15, 0.35, 0.65]);
    super::floor::tinted(rng, tone, 0.5)
}
