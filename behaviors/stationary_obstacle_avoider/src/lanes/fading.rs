//! Fading of evidence: what one look showed is forgotten in seconds, what is established and out of view in minutes. Runs for each cell
//! in each call, inlined.

/// Log odds by one kind of evidence from which a cell is established: it has been seen occupied in several pictures.
const ESTABLISHED: f32 = 3.0;
/// Change of the log odds toward zero, per second; that of an established cell; and that of one that can be seen again only from elsewhere.
const FADE_PER_S: f32 = 0.7;
const FADE_ESTABLISHED_PER_S: f32 = 0.15;
const FADE_UNSEEN_PER_S: f32 = 0.05;
/// Distance from the robot's center up to which a cell that the sonars alone have established, out of the camera's view, fades like any
/// established one, m: a turn takes the beams off who stands beside the robot.
pub(super) const BESIDE_M: f64 = 1.0;

/// Change toward zero of log odds by the camera, per second; `stays` is true where the camera does not look, unless what is there has come
/// and may leave.
#[inline]
pub(super) fn camera_per_s(odds: f32, stays: impl FnOnce() -> bool) -> f32 {
    if odds <= ESTABLISHED {
        FADE_PER_S
    } else if stays() {
        FADE_UNSEEN_PER_S
    } else {
        FADE_ESTABLISHED_PER_S
    }
}

/// Change toward zero of log odds by the sonars, per second; `is_beside` is true beside the robot, out of the camera's view.
#[inline]
pub(super) fn sonar_per_s(odds: f32, is_beside: impl FnOnce() -> bool) -> f32 {
    if odds > ESTABLISHED && is_beside() { FADE_ESTABLISHED_PER_S } else { FADE_PER_S }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;
    use yamabico_core::geometry::Pose2;
    use yamabico_core::message::Beam;

    use super::super::occupancy::{Evidence, OccupancyGrid};

    fn is_something_there(grid: &OccupancyGrid) -> bool {
        grid.occupied().next().is_some()
    }

    #[test]
    fn what_was_seen_often_outlasts_time_out_of_view() {
        let remembers = |seconds: u32, is_in_view: bool| {
            let mut grid = OccupancyGrid::default();
            for _ in 0..4 {
                grid.add(Evidence::Look, [Point2::new(0.42, 0.03)].into_iter(), 1.3);
            }
            (0..seconds).for_each(|_| grid.advance(Point2::origin(), 1.0, |_| is_in_view));
            is_something_there(&grid)
        };
        assert!(remembers(30, false), "a camera does not see below its view");
        assert!(!remembers(30, true) && !remembers(120, false), "at last it is forgotten");
    }

    #[test]
    fn what_stands_beside_the_robot_stays_while_no_beam_looks_there() {
        // Seconds for which what the sonar alone has established at a range is kept, by a robot that has turned away from it.
        let kept_s = |range_m: f64, is_in_view: bool| {
            let mut grid = OccupancyGrid::default();
            let beam = Beam { cone_rad: 0.4, range_m, ..Beam::default() };
            (0..6).for_each(|_| grid.add_beam(&beam, &Pose2::IDENTITY, |_| true));
            let is_kept = |_: &u32| {
                grid.advance(Point2::origin(), 0.1, |_| is_in_view);
                is_something_there(&grid)
            };
            0.1 * (0..1000).take_while(is_kept).count() as f64
        };
        assert!((20.0..30.0).contains(&kept_s(0.6, false)), "{}", kept_s(0.6, false));
        assert!(kept_s(1.3, false) < 7.0 && kept_s(0.6, true) < 7.0);

        let mut grid = OccupancyGrid::default();
        let beam = Beam { cone_rad: 0.4, range_m: 0.6, ..Beam::default() };
        (0..6).for_each(|_| grid.add_beam(&beam, &Pose2::IDENTITY, |_| true));
        let beyond = Beam { range_m: 2.5, ..beam };
        (0..40).for_each(|_| grid.add_beam(&beyond, &Pose2::IDENTITY, |_| true));
        assert!(!is_something_there(&grid), "a beam that passes its place clears it");
    }
}
