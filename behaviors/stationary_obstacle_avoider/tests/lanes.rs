//! Method `lanes`: evidence in a grid, lanes beside the path, and ways out.

use crate::rig::{Situation, beam, camera, feed, feed_beams, feed_sonar, pose, render, setup, tick};
use yamabico_core::geometry::{Pose2, Twist};
use yamabico_core::message::{Axis, Kind, Odometry, Pose, PoseStatus, Proposal, Reason};
use yamabico_core::testing::{Bench, allocations};
use yamabico_core::time::Time;
use yamabico_stationary_obstacle_avoider::{LaneAvoider, ODOMETRY, POSE, StationaryObstacleAvoider};

type Avoider = Bench<StationaryObstacleAvoider>;

fn avoider() -> Avoider {
    avoider_with("")
}

fn avoider_with(keys: &str) -> Avoider {
    let toml = format!("map = \"maps/hallway.toml\"\ngate_m = 0.3\n{keys}");
    Bench::new(&toml, setup(camera().0)).expect("a valid configuration")
}

fn lanes(bench: &Avoider) -> &LaneAvoider {
    bench.behavior.lanes().expect("method `lanes`")
}

/// Stands at `robot` from `from_s` on for `duration_s` with 20 scans and 10 pictures a second; returns the last proposal.
fn stand(
    bench: &mut Avoider,
    robot: Pose2,
    from_s: f64,
    duration_s: f64,
    obstacle: Option<[f64; 2]>,
) -> Proposal {
    let pixels = render(robot, obstacle);
    let range_m = obstacle.map(|[x, _]| (x - robot.x - 0.37).max(0.05)).filter(|range_m| *range_m < 0.5);
    let steps = (duration_s * 20.0) as u32;
    let proposals = (0..steps).map(|i| {
        let situation =
            Situation { seconds: from_s + 0.05 * f64::from(i), robot, range_m, ..Situation::default() };
        tick(bench, &situation, (i % 2 == 0).then_some(&pixels[..]))
    });
    proposals.last().expect("a proposal")
}

#[test]
fn an_empty_hallway_leaves_the_driving_to_others() {
    for (i, (x, y, theta)) in [(3.0, 0.0, 0.0), (4.0, 0.2, 0.1), (5.0, -0.2, -0.1)].into_iter().enumerate() {
        let mut bench = avoider();
        let proposal = stand(&mut bench, Pose2::new(x, y, theta), i as f64, 2.0, None);
        let answer = (proposal.kind(), proposal.reason());
        assert_eq!(answer, (Some(Kind::Abstain), Some(Reason::Clear)), "{}", proposal.note.as_str());
    }
}

#[test]
fn a_box_ahead_is_driven_around_on_its_wider_side() {
    for (y, side) in [(0.25, -1.0), (-0.25, 1.0)] {
        let mut bench = avoider();
        let proposal = stand(&mut bench, Pose2::new(3.0, 0.0, 0.0), 0.0, 1.0, Some([4.6, y]));
        assert_eq!(proposal.kind(), Some(Kind::Drive), "{}", proposal.note.as_str());
        assert!(proposal.twist.linear > 0.05 && proposal.twist.angular * side > 0.02, "{:?}", proposal.twist);
        let places = lanes(&bench).occupied();
        let near = places
            .iter()
            .filter(|place| (place.x - 1.5).abs() < 0.35 && (f64::from(place.y) - y).abs() < 0.35);
        assert!(near.count() >= 3, "the box must be on the grid: {places:?}");
    }
}

#[test]
fn the_look_of_the_floor_and_geometry_each_find_a_box() {
    let find = |keys: &str| {
        let mut bench = avoider_with(keys);
        // Whether the floor mirrors is known after some pictures, and upright edges count from place to place.
        for i in 0..28 {
            let robot = Pose2::new(2.15 + 0.05 * f64::from(i), 0.0, 0.0);
            stand(&mut bench, robot, 0.1 * f64::from(i), 0.1, Some([4.6, 0.25]));
        }
        lanes(&bench).occupied().iter().filter(|place| (0.7..1.3).contains(&place.x)).count()
    };
    let keys = ["uses_look = false\nuses_geometry = false", "uses_look = false", "uses_geometry = false"];
    let [neither, geometry, look] = keys.map(find);
    assert!(neither == 0 && geometry >= 2 && look >= 2, "{neither} {geometry} {look}");
}

#[test]
fn what_walks_into_the_way_from_the_left_and_pauses_is_passed_on_the_left() {
    let (mut bench, robot) = (avoider(), Pose2::new(3.0, 0.0, 0.0));
    // Whether the floor mirrors is known after some pictures of a robot that moves.
    for i in 0..20 {
        let robot = Pose2::new(2.0 + 0.05 * f64::from(i), 0.0, 0.0);
        stand(&mut bench, robot, 0.1 * f64::from(i), 0.1, None);
    }
    for i in 0..12 {
        let left_m = (0.8 - 0.08 * f64::from(i)).max(0.1);
        stand(&mut bench, robot, 2.0 + 0.1 * f64::from(i), 0.1, Some([4.7, left_m]));
    }
    let proposal = stand(&mut bench, robot, 3.2, 0.2, Some([4.7, 0.1]));
    assert!(proposal.twist.angular > 0.02, "{:?} {}", proposal.twist, proposal.note.as_str());
}

#[test]
fn floor_ends_cells_and_lanes_are_drawn() {
    let (mut bench, robot, obstacle) = (avoider(), Pose2::new(3.0, 0.0, 0.0), Some([4.6, 0.25]));
    stand(&mut bench, robot, 0.0, 1.0, obstacle);
    let (pixels, situation) =
        (render(robot, obstacle), Situation { seconds: 1.0, robot, ..Situation::default() });
    tick(bench.draw(), &situation, Some(&pixels));
    // Two edges of a lane along the stations, with a text.
    assert_eq!(
        ["path", "best lane", "lane of the path", "aim"].map(|name| bench.marks(name)),
        [28, 57, 57, 2]
    );
    assert!(bench.marks("occupied cells") >= 3 && bench.marks("floor ends") > 10, "{:?}", bench.layers());
}

#[test]
fn a_robot_before_an_obstacle_waits_and_then_backs_off_the_way_it_came() {
    let mut bench = avoider();
    for i in 0..8 {
        let seconds = 0.2 * f64::from(i);
        stand(&mut bench, Pose2::new(3.0 + 0.1 * f64::from(i), 0.0, 0.0), seconds, 0.2, Some([4.3, 0.0]));
    }
    let robot = Pose2::new(3.7, 0.0, 0.0);
    let waits = stand(&mut bench, robot, 1.6, 0.5, Some([4.3, 0.0]));
    assert_eq!((waits.kind(), waits.twist.linear), (Some(Kind::Drive), 0.0), "{}", waits.note.as_str());
    let mut fastest_back: f64 = 0.0;
    let mut faces_way_around = false;
    // The sonar heard it suddenly, so that it may go on for 5 s; a turn to the way around that never ends is given up after 5 s.
    for i in 0..36 {
        let proposal = stand(&mut bench, robot, 2.1 + 0.5 * f64::from(i), 0.5, Some([4.3, 0.0]));
        assert!(proposal.twist.linear <= 0.0, "never toward the obstacle: {}", proposal.note.as_str());
        fastest_back = fastest_back.min(proposal.twist.linear);
        faces_way_around |= proposal.twist.angular != 0.0 && proposal.note.as_str().contains("way around");
    }
    assert!(faces_way_around, "the corridor is free beside the obstacle");
    assert!(fastest_back < -0.05, "{fastest_back}");
    // A robot that did not come this way does not know that it is free behind.
    let mut fresh = avoider();
    for i in 0..12 {
        let proposal = stand(&mut fresh, robot, 0.5 * f64::from(i), 0.5, Some([4.3, 0.0]));
        assert!(proposal.twist.linear >= 0.0, "{}", proposal.note.as_str());
    }
}

#[test]
fn an_arrived_robot_is_left_alone() {
    let mut bench = avoider();
    let proposal = stand(&mut bench, Pose2::new(12.4, 0.0, 0.0), 0.0, 8.0, Some([12.95, 0.0]));
    assert_ne!(proposal.kind(), Some(Kind::Drive), "{}", proposal.note.as_str());
}

#[test]
fn without_pictures_the_speed_is_limited_and_without_scans_the_robot_stands() {
    let mut bench = avoider();
    let situation = |seconds: f64| Situation { seconds, ..Situation::default() };
    let blind =
        (0..40).map(|i| tick(&mut bench, &situation(0.05 * f64::from(i)), None)).last().expect("a proposal");
    assert_eq!((blind.kind(), blind.reason()), (Some(Kind::Limit), Some(Reason::StaleInput)));
    stand(&mut bench, Pose2::new(3.0, 0.0, 0.0), 2.0, 1.0, None);
    let silent = bench.at(3.4).propose();
    assert_eq!((silent.kind(), silent.twist.linear), (Some(Kind::Drive), 0.0), "{}", silent.note.as_str());
}

#[test]
fn without_a_place_on_the_map_the_robot_may_only_turn() {
    let mut bench = avoider();
    let situation = |seconds: f64, status: PoseStatus| Situation { seconds, status, ..Situation::default() };
    stand(&mut bench, Pose2::new(3.0, 0.0, 0.0), 0.0, 1.0, None);
    let lost = tick(&mut bench, &situation(1.0, PoseStatus::Lost), None);
    assert_eq!(
        (lost.kind(), lost.reason()),
        (Some(Kind::Halt), Some(Reason::Lost)),
        "{}",
        lost.note.as_str()
    );
    assert!(lost.axes.contains(Axis::Linear) && !lost.axes.contains(Axis::Angular));
    let found = stand(&mut bench, Pose2::new(3.0, 0.0, 0.0), 1.1, 0.5, None);
    assert_eq!(found.kind(), Some(Kind::Abstain), "{}", found.note.as_str());
    // The localizer falls silent, and the other inputs do not.
    for i in 0..20 {
        let seconds = 1.6 + 0.05 * f64::from(i);
        let stamp_ns = Time::from_secs_f64(seconds).0;
        bench.at(seconds);
        bench.feed(&ODOMETRY, &Odometry::new(stamp_ns, &Pose2::new(3.0, 0.0, 0.0), &Twist::ZERO), &[]);
        feed_sonar(&mut bench, stamp_ns, None);
    }
    let stale = bench.propose();
    assert_eq!((stale.kind(), stale.reason()), (Some(Kind::Halt), Some(Reason::StaleInput)));
}

#[test]
fn what_is_near_when_scans_return_has_not_come_suddenly() {
    let is_waited_for = |has_scan: bool| {
        let mut bench = avoider();
        let at = |i: u32| Situation { seconds: 0.05 * f64::from(i), ..Situation::default() };
        let before = (0..40).map(|i| Situation { has_scan, ..at(i) });
        let after = (40..60).map(|i| Situation { range_m: Some(0.8), ..at(i) });
        let mut proposals = before.chain(after).map(|situation| tick(&mut bench, &situation, None));
        proposals.any(|proposal| proposal.note.as_str().contains("crosses"))
    };
    assert!(is_waited_for(true), "it came");
    assert!(!is_waited_for(false), "it may have stood there before");
}

#[test]
fn on_a_floor_that_may_mirror_what_comes_to_a_standing_robot_or_echoes_is_waited_for() {
    // True if a robot that moves by `step_m` with each picture waits for a box that is there from the tenth on.
    let is_waited_for = |step_m: f64, azimuth_rad: f64| {
        let mut bench = avoider();
        let mut proposals = (0..16).map(|i| {
            let robot = Pose2::new(3.0 + step_m * f64::from(i - 15), 0.0, 0.0);
            let box_m = (i >= 10).then_some([4.7, 0.1]);
            let seconds = 0.1 * f64::from(i);
            let situation = Situation { seconds, robot, has_scan: false, ..Situation::default() };
            feed(&mut bench, &situation, Some(&render(robot, box_m)));
            feed_beams(&mut bench, seconds, &[beam(azimuth_rad, box_m.map(|[x, _]| x - 0.4 - robot.x))]);
            bench.propose()
        });
        proposals.any(|proposal| proposal.note.as_str().contains("crosses"))
    };
    assert!(is_waited_for(0.0, 0.8), "a mirror image comes as the robot moves");
    assert!(is_waited_for(0.02, 0.0), "a mirror image gives no echo");
    assert!(!is_waited_for(0.02, 0.8), "it may be a mirror image");
}

#[test]
fn on_a_floor_that_may_mirror_what_is_heard_aside_where_floor_was_is_waited_for() {
    // True if a robot that stands waits for an echo 0.9 m away on its left, after so many pictures.
    let is_waited_for = |pictures: i32| {
        let (mut bench, robot) = (avoider(), Pose2::new(3.0, 0.0, 0.0));
        let pixels = render(robot, None);
        let mut proposals = (0..20).map(|i| {
            let seconds = 0.1 * f64::from(i);
            let situation = Situation { seconds, robot, has_scan: false, ..Situation::default() };
            feed(&mut bench, &situation, (i < pictures).then_some(&pixels));
            feed_beams(&mut bench, seconds, &[beam(0.35, (i >= 12).then_some(0.9))]);
            bench.propose()
        });
        proposals.any(|proposal| proposal.note.as_str().contains("crosses"))
    };
    assert!(is_waited_for(10));
    assert!(!is_waited_for(1), "one picture does not show where floor is");
}

#[test]
fn on_a_matt_floor_what_is_heard_out_of_view_where_floor_was_is_waited_for() {
    // True if a robot that has just stopped waits for an echo that far away on its left.
    let is_waited_for = |range_m: f64| {
        let mut bench = avoider();
        let mut proposals = (0..30).map(|i| {
            // Whether the floor mirrors is known after some pictures of a robot that moves.
            let robot = Pose2::new(2.0 + 0.05 * f64::from(i.min(20)), 0.0, 0.0);
            let seconds = 0.1 * f64::from(i);
            let situation = Situation { seconds, robot, has_scan: false, ..Situation::default() };
            feed(&mut bench, &situation, Some(&render(robot, None)));
            feed_beams(&mut bench, seconds, &[beam(0.6, (i > 20).then_some(range_m))]);
            bench.propose()
        });
        proposals.any(|proposal| proposal.note.as_str().contains("crosses"))
    };
    assert!(is_waited_for(0.3), "it stands below the view");
    assert!(!is_waited_for(0.9), "the camera shows floor there");
}

#[test]
fn a_good_pose_ends_the_failure_of_a_malformed_one_and_a_picture_does_not() {
    let mut bench = avoider();
    let robot = Pose2::new(3.0, 0.0, 0.0);
    stand(&mut bench, robot, 0.0, 1.0, None);
    let pixels = render(robot, None);
    let mut reason_of = |seconds: f64, x: f64, pixels: Option<&[u8]>| {
        let situation = Situation { seconds, robot, ..Situation::default() };
        feed(&mut bench, &situation, pixels);
        bench.feed(&POSE, &Pose { x, ..pose(&situation) }, &[]).propose().reason()
    };
    assert_eq!(reason_of(1.0, f64::NAN, Some(&pixels)), Some(Reason::MalformedInput));
    assert_eq!(reason_of(1.05, 3.0, None), Some(Reason::Clear));
}

#[test]
fn a_picture_of_the_wrong_size_and_nonsense_as_saved_state_are_survived() {
    let mut bench = avoider();
    let short = vec![90_u8; 100];
    let proposal = tick(&mut bench, &Situation::default(), Some(&short));
    assert_eq!((proposal.kind(), proposal.reason()), (Some(Kind::Limit), Some(Reason::MalformedInput)));
    for nonsense in ["", "null", "[1, 2]", "[{\"mode\": \"Dance\"}, null]"] {
        use yamabico_core::behavior::Behavior;
        bench.behavior.restore_state(nonsense.as_bytes());
    }
    let proposal = stand(&mut bench, Pose2::new(3.0, 0.0, 0.0), 1.0, 1.0, None);
    assert_eq!(proposal.kind(), Some(Kind::Abstain), "{}", proposal.note.as_str());
}

#[test]
fn a_call_allocates_nothing_after_warm_up() {
    let mut bench = avoider();
    let robot = Pose2::new(3.0, 0.1, 0.0);
    let pixels = render(robot, Some([4.6, 0.2]));
    for i in 0..200_u32 {
        let situation = Situation { seconds: 0.05 * f64::from(i), robot, ..Situation::default() };
        feed(&mut bench, &situation, (i % 2 == 0).then_some(&pixels[..]));
        let (proposal, asked) = allocations(|| bench.propose());
        let drives = proposal.kind() == Some(Kind::Drive);
        assert!(i < 10 || drives, "call {i}: {}", proposal.note.as_str());
        assert!(i < 100 || asked.calls == 0, "call {i}: {asked:?}");
    }
}
