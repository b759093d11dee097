//! Four-way decisions on rendered scenes, judged by the geometry of the true world.
//!
//! `evaluate_scenes [--scenes N] [--set TOML] [--json] [--out DIR]`
//!
//! Each scene is a room with walls, desks and boxes of random sizes, places and dark colors on a bright floor, with random
//! lamps, exposure and noise, and a robot somewhere in it; in two of three a box stands within 1.2 m before it. The judge
//! (`examples/judge`) knows the solids' outlines, not the picture:
//! - *blocked*: a solid reaches into the robot's way, its circle with `side_m` on either side, within the stopping distance;
//! - then the *freer side* is the one where less is taken of the floor within the stopping distance (in view, at most
//!   `freer_side_m` beside the way), direction by direction;
//! - *stop* where of both sides more is taken than 80 of 219, the share at which the paper's limit lies.
//!
//! Borderline scenes allow two answers, and are counted: sides that differ by less than a tenth, a side within a tenth of
//! the share where it counts as blocked, and a solid outside the way, but nearer to it than one cell. Forward is never
//! right with a solid in the way. Scenes in which all of a solid in the way is nearer than the picture's lower edge are drawn
//! again: what the camera cannot show is the sonars' part. `strictly` counts them all with one right answer each. `--out` writes pictures of the
//! wrong ones.

mod judge;
mod office;
#[path = "office/overlay.rs"]
mod overlay;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::ExitCode;

use rand::RngExt;
use serde_json::json;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::message::Proposal;
use yamabico_free_space_avoider::Config;
use yamabico_free_space_avoider::navel_grid::NavelGridAvoider;
use yamabico_free_space_avoider::navel_grid::{Decision, Outlook, Side, decide};
use yamabico_sim::clearance::to_solids;
use yamabico_sim::random::{Stream, stream};
use yamabico_sim::world::{BoxItem, Floor, Lamp, Wall};
use yamabico_sim::{Photometry, Renderer, Scene, World};

use judge::{Judge, Verdict};

fn main() -> ExitCode {
    match evaluate() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::FAILURE
        }
    }
}

#[derive(Default)]
struct Tally {
    right: usize,
    strictly_right: usize,
    forward_into: usize,
    clear: usize,
    clear_right: usize,
    drawn_again: usize,
    borderline: BTreeMap<&'static str, usize>,
    confusion: BTreeMap<(&'static str, &'static str), usize>,
}

fn evaluate() -> Result<(), String> {
    let (mut scenes, mut toml, mut is_json, mut out) = (400, String::new(), false, None);
    let mut rest = std::env::args().skip(1);
    while let Some(argument) = rest.next() {
        let mut value = || rest.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--scenes" => scenes = value()?.parse().map_err(|e| format!("--scenes: {e}"))?,
            "--set" => toml = toml + &value()? + "\n",
            "--json" => is_json = true,
            "--out" => {
                let folder = PathBuf::from(value()?);
                std::fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
                out = Some(folder);
            }
            _ => return Err(format!("unknown argument {argument}")),
        }
    }
    let config: Config = toml::from_str(&toml).map_err(|e| e.to_string())?;
    let camera = office::camera(340, 180);
    let setup = office::setup(camera.0, camera.1);
    let behavior = NavelGridAvoider::new(&config, &setup).map_err(|e| e.to_string())?;
    let judge = Judge::new(&behavior, &config, camera.1);
    let mut sight = behavior.sight().clone();
    let mut rng = stream(1, "scenes");
    let mut tally = Tally::default();
    // What lies before the robot at the start must be floor; the scenes come later.
    let start = render(&mut rng, &room(&mut stream(0, "start")), Pose2::new(1.0, 1.0, 0.5))?;
    sight.see(start.view().map_err(|e| e.to_string())?);
    for number in 0..scenes {
        let (scene, robot) = place(&mut rng, &judge, &mut tally.drawn_again)?;
        let image = render_scene(&mut rng, &scene, robot)?;
        let view: ImageView = image.view().map_err(|e| e.to_string())?;
        let (outlook, trouble) = sight.see(view);
        let decision = match outlook {
            Outlook::Seen(weights, passage) => decide(&weights, passage, None),
            Outlook::Unclear => Decision::Stop,
        };
        let verdict = judge.judge(scene.solids(), robot);
        let is_right = tally.add(decision, &verdict);
        if let (Some(folder), false) = (&out, is_right) {
            let (ours, theirs) = (word(decision), word(verdict.best));
            let path = folder.join(format!("{number:03}_{ours}_not_{theirs}.png"));
            let Verdict { borderline, is_blocked, ahead_m, taken, .. } = &verdict;
            println!(
                "{number}: {ours}, not {theirs}; blocked {is_blocked}, {ahead_m:.2} m ahead, sides taken {taken:.2?}, \
                 borderline {borderline:?}; {outlook:?} {trouble:?}"
            );
            overlay::draw(view, &sight, &Proposal::default(), &path)?;
        }
    }
    tally.print(scenes, is_json);
    Ok(())
}

impl Tally {
    fn add(&mut self, decision: Decision, verdict: &Verdict) -> bool {
        let is_right = verdict.allowed.contains(&Some(decision));
        self.right += usize::from(is_right);
        self.strictly_right += usize::from(decision == verdict.best);
        self.forward_into += usize::from(decision == Decision::Forward && verdict.is_blocked);
        match verdict.borderline {
            Some(why) => *self.borderline.entry(why).or_default() += 1,
            None => {
                self.clear += 1;
                self.clear_right += usize::from(is_right);
            }
        }
        *self.confusion.entry((word(verdict.best), word(decision))).or_default() += 1;
        is_right
    }

    fn print(&self, scenes: usize, is_json: bool) {
        let share = |count: usize| 100.0 * count as f64 / scenes as f64;
        if is_json {
            let confusion: Vec<_> = self.confusion.iter().collect();
            println!(
                "{}",
                json!({
                    "scenes": scenes, "right": self.right, "strictly_right": self.strictly_right,
                    "clear": self.clear, "clear_right": self.clear_right, "drawn_again": self.drawn_again,
                    "forward_with_an_obstacle_in_the_way": self.forward_into,
                    "borderline": self.borderline, "true_decided_count": confusion,
                })
            );
            return;
        }
        println!("{scenes} scenes: {} right ({:.1} %)", self.right, share(self.right));
        println!("without borderline scenes: {} of {} right", self.clear_right, self.clear);
        println!("strictly: {} right ({:.1} %)", self.strictly_right, share(self.strictly_right));
        println!("forward with an obstacle within the stopping distance: {}", self.forward_into);
        println!("drawn again, as a solid in the way was out of the picture: {}", self.drawn_again);
        for (why, count) in &self.borderline {
            println!("borderline, {why}: {count}");
        }
        for ((truth, ours), count) in &self.confusion {
            println!("best {truth}, decided {ours}: {count}");
        }
    }
}

fn word(decision: Decision) -> &'static str {
    match decision {
        Decision::Forward => "forward",
        Decision::Turn(Side::Left) => "left",
        Decision::Turn(Side::Right) => "right",
        Decision::Stop => "stop",
    }
}

/// A room and a robot that touches nothing in it.
fn place(rng: &mut Stream, judge: &Judge, drawn_again: &mut usize) -> Result<(Scene, Pose2), String> {
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
            if !judge.is_blind(scene.solids(), robot) {
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
        height_m: 2.6,
        thickness_m: 0.12,
        color: dark(rng),
        baseboard: None,
        doors: Vec::new(),
        windows: Vec::new(),
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

fn render(rng: &mut Stream, world: &World, robot: Pose2) -> Result<yamabico_core::image::GrayImage, String> {
    render_scene(rng, &Scene::new(world, 0).map_err(|e| e.to_string())?, robot)
}

fn render_scene(
    rng: &mut Stream,
    scene: &Scene,
    robot: Pose2,
) -> Result<yamabico_core::image::GrayImage, String> {
    let photometry = Photometry {
        exposure: rng.random_range(0.5..0.8),
        noise_sigma: rng.random_range(1.0..4.0),
        ..Photometry::default()
    };
    let mut renderer = Renderer::new(photometry, stream(rng.random(), "noise"));
    office::render(&mut renderer, scene, office::camera(340, 180), robot)
}
