//! Four-way decisions of the navel grid on rendered scenes.

mod reference;

use std::collections::BTreeMap;

use clap::Args;
use rand::RngExt;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::GrayImage;
use yamabico_core::overlay::Overlay;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::echoes::Echoes;
use yamabico_free_space_avoider::navel_grid::NavelGridAvoider;
use yamabico_free_space_avoider::navel_grid::{Decision, Observation, Side, decide, overlay};
use yamabico_rigs::office;
use yamabico_sim::clearance::to_solids;
use yamabico_sim::random::{Stream, stream};
use yamabico_sim::world::{BoxItem, Floor, Lamp, Wall};
use yamabico_sim::{Photometry, Renderer, Scene, World};
use yamabico_vision::floor_appearance::Picture;

use self::reference::{Answer, Reference};
use crate::arguments::{Parameters, Samples};
use crate::images::Output;
use crate::report::{Report, Table, percent};

/// Four-way decisions of the navel grid on rendered scenes, compared with the geometry of the world.
///
/// Each scene is a room with walls, desks and boxes of random sizes, positions and dark colors on a bright floor, with random lamps,
/// exposure and noise, and a robot in it; in two of three scenes a box stands within 1.2 m ahead. The reference uses the outlines of
/// the obstacles, not the image. *Blocked*: an obstacle reaches into the path (the robot's circle and `side_m` on either side) within
/// the stopping distance; then the *freer side* is the one whose floor within the stopping distance (in view, at most `freer_side_m`
/// beside the path) is less occupied; *stop* if more than 80 of 219 of both sides is occupied (the limit of the paper). Borderline
/// scenes have two acceptable decisions and are counted: sides that differ by less than a tenth, a side within a tenth of the limit, an
/// obstacle within one cell of the path. Forward is never correct with an obstacle in the path. Scenes whose obstacle in the path is
/// nearer than the lower edge of the image are drawn again. `strict` counts only the best decision. Images: the wrong decisions.
#[derive(Args)]
pub struct Arguments {
    #[command(flatten)]
    samples: Samples,
    #[command(flatten)]
    parameters: Parameters,
}

#[derive(Default)]
struct Tally {
    correct: usize,
    strictly_correct: usize,
    forward_into: usize,
    clear: usize,
    clear_correct: usize,
    drawn_again: usize,
    borderline: BTreeMap<&'static str, usize>,
    confusion: BTreeMap<(&'static str, &'static str), usize>,
}

impl Arguments {
    pub fn run(&self, out: &Output) -> Result<Report, String> {
        let scenes = self.samples.count_or(400);
        let config: Config = self.parameters.over("")?.try_into().map_err(|error| format!("{error}"))?;
        let camera = office::camera(340, 180);
        let setup = office::setup(camera.0, camera.1);
        let behavior = NavelGridAvoider::new(&config, &setup).map_err(|error| error.to_string())?;
        let reference = Reference::new(&behavior, &config, camera.1);
        let mut observer = behavior.observer().clone();
        let mut rng = stream(self.samples.seed, "scenes");
        let mut tally = Tally::default();
        // The foreground of the first image must be floor.
        let start = Scene::new(&room(&mut stream(0, "start")), 0).map_err(|error| error.to_string())?;
        let start = render(&mut rng, &start, Pose2::new(1.0, 1.0, 0.5))?;
        observer.observe(Picture::Gray(start.view().map_err(|error| error.to_string())?), &Echoes::default());
        for index in 0..scenes {
            let (scene, robot) = place(&mut rng, &reference, &mut tally.drawn_again)?;
            let image = render(&mut rng, &scene, robot)?;
            let view = image.view().map_err(|error| error.to_string())?;
            let (outlook, trouble) = observer.observe(Picture::Gray(view), &Echoes::default());
            let decision = match outlook {
                Observation::Seen(weights, passage) => decide(&weights, passage, None),
                Observation::Unclear => Decision::Stop,
            };
            let answer = reference.answer(scene.solids(), robot);
            let is_correct = tally.add(decision, &answer);
            if out.is_on() && !is_correct {
                let (ours, best) = (name(decision), name(answer.best));
                let Answer { borderline, is_blocked, ahead_m, occupied, .. } = &answer;
                eprintln!(
                    "{index}: {ours}, not {best}; blocked {is_blocked}, {ahead_m:.2} m ahead, sides occupied {occupied:.2?}, \
                     borderline {borderline:?}; {outlook:?} {trouble:?}"
                );
                let mut grid = Overlay::default();
                overlay::draw(&mut grid, &observer, &camera.0, None);
                out.layers(&format!("{index:03}_{ours}_not_{best}"), view, Some(&grid))?;
            }
        }
        Ok(tally.report(scenes))
    }
}

impl Tally {
    /// Adds a decision; returns true if it is acceptable.
    fn add(&mut self, decision: Decision, answer: &Answer) -> bool {
        let is_correct = answer.allowed.contains(&Some(decision));
        self.correct += usize::from(is_correct);
        self.strictly_correct += usize::from(decision == answer.best);
        self.forward_into += usize::from(decision == Decision::Forward && answer.is_blocked);
        match answer.borderline {
            Some(reason) => *self.borderline.entry(reason).or_default() += 1,
            None => {
                self.clear += 1;
                self.clear_correct += usize::from(is_correct);
            }
        }
        *self.confusion.entry((name(answer.best), name(decision))).or_default() += 1;
        is_correct
    }

    fn report(&self, scenes: usize) -> Report {
        let mut decisions = Table::new(
            format!("Decisions ({} scenes drawn again, obstacle below the image)", self.drawn_again),
            &["decisions", "scenes", "correct", "correct, %"],
        );
        for (name, count, correct) in [
            ("acceptable", scenes, self.correct),
            ("acceptable, without borderline scenes", self.clear, self.clear_correct),
            ("strict", scenes, self.strictly_correct),
            ("forward without obstacle in the path", scenes, scenes - self.forward_into),
        ] {
            decisions.row([name.into(), count.into(), correct.into(), percent(correct as f64, count as f64)]);
        }
        let mut borderline = Table::new("Borderline scenes", &["reason", "scenes"]);
        for (&reason, &count) in &self.borderline {
            borderline.row([reason.into(), count.into()]);
        }
        let mut confusion = Table::new("Confusion", &["best", "decided", "scenes"]);
        for (&(best, decided), &count) in &self.confusion {
            confusion.row([best.into(), decided.into(), count.into()]);
        }
        Report::new([decisions, borderline, confusion])
    }
}

fn name(decision: Decision) -> &'static str {
    match decision {
        Decision::Forward => "forward",
        Decision::Turn(Side::Left) => "left",
        Decision::Turn(Side::Right) => "right",
        Decision::Stop => "stop",
    }
}

/// Draws a room and a pose without contact in it.
fn place(rng: &mut Stream, reference: &Reference, drawn_again: &mut usize) -> Result<(Scene, Pose2), String> {
    loop {
        let mut world = room(rng);
        let [width, depth] = [world.walls[0].to_m[0], world.walls[1].to_m[1]];
        let robot = Pose2::new(
            rng.random_range(0.3..width - 0.3),
            rng.random_range(0.3..depth - 0.3),
            rng.random_range(-3.1..3.1),
        );
        if rng.random_bool(2.0 / 3.0) {
            let ahead = Pose2::new(rng.random_range(0.45..1.2), rng.random_range(-0.6..0.6), 0.0);
            let at = robot.compose(&ahead);
            world.boxes.push(clutter(rng, [at.x, at.y]));
        }
        let scene = Scene::new(&world, 0).map_err(|e| e.to_string())?;
        if to_solids(scene.solids(), [robot.x, robot.y], office::RADIUS_M, 1.0) > 0.02 {
            if !reference.is_blind(scene.solids(), robot) {
                return Ok((scene, robot));
            }
            *drawn_again += 1;
        }
    }
}

fn room(rng: &mut Stream) -> World {
    let (width, depth) = (rng.random_range(3.0..8.0), rng.random_range(3.0..6.0));
    let corners = [[0.0, 0.0], [width, 0.0], [width, depth], [0.0, depth]];
    let walls = (0..4).map(|i| Wall {
        from_m: corners[i],
        to_m: corners[(i + 1) % 4],
        color: dark(rng),
        ..Wall::default()
    });
    let walls = walls.collect();
    let count = rng.random_range(1..9);
    let boxes = (0..count)
        .map(|_| {
            let at_m = [rng.random_range(0.2..width - 0.2), rng.random_range(0.2..depth - 0.2)];
            clutter(rng, at_m)
        })
        .collect();
    let lamps = (0..4).map(|i| Lamp {
        at_m: [width * (0.25 + 0.5 * f64::from(i % 2)), depth * (0.25 + 0.5 * f64::from(i / 2))],
        size_m: [1.2, 0.6],
        brightness: rng.random_range(6.0..12.0),
    });
    let lamps = lamps.collect();
    let tone = rng.random_range(0.6..0.8_f32);
    World {
        texture_seed: rng.random(),
        walls,
        boxes,
        lamps,
        floor: Floor {
            color: [tone, tone * 0.98, tone * 0.92],
            speckle: rng.random_range(0.02..0.1),
            gloss: rng.random_range(0.0..0.3),
            joint_spacing_m: if rng.random_bool(0.5) { [0.5, 0.5] } else { [0.0, 0.0] },
            ..Floor::default()
        },
        ambient: Some(rng.random_range(0.5..0.8)),
        ..World::default()
    }
}

fn clutter(rng: &mut Stream, at_m: [f64; 2]) -> BoxItem {
    let mut side = || rng.random_range(0.12..0.9);
    let size_m = [side(), side(), side()];
    BoxItem { at_m, yaw_deg: rng.random_range(-90.0..90.0), size_m, color: dark(rng), ..BoxItem::default() }
}

fn dark(rng: &mut Stream) -> [f32; 3] {
    let tone = rng.random_range(0.04..0.25_f32);
    [tone, tone * rng.random_range(0.7..1.0), tone * rng.random_range(0.5..1.0)]
}

fn render(rng: &mut Stream, scene: &Scene, robot: Pose2) -> Result<GrayImage, String> {
    let photometry = Photometry {
        exposure: rng.random_range(0.5..0.8),
        noise_sigma: rng.random_range(1.0..4.0),
        ..Photometry::default()
    };
    let mut renderer = Renderer::new(photometry, stream(rng.random(), "noise"));
    office::render(&mut renderer, scene, office::camera(340, 180), robot)
}
