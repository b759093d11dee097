//! After warm-up, a call of the behavior allocates nothing.

use crate::rig::{Situation, TABLE, camera, feed, render, setup};
use yamabico_core::camera::Pinhole;
use yamabico_core::geometry::Pose2;
use yamabico_core::image::ImageView;
use yamabico_core::testing::{Bench, allocations};
use yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider;
use yamabico_stationary_obstacle_avoider::detector::{Detector, DetectorRules};
use yamabico_stationary_obstacle_avoider::threshold_table::ThresholdTable;
use yamabico_vision::map::WireFrame;

#[test]
fn a_frame_allocates_nothing_after_warm_up() {
    let setup = setup(camera().0);
    let map = WireFrame::read(&setup.folder.join("maps/hallway.toml")).expect("a map");
    let table = ThresholdTable::read(&setup.folder.join("maps/hallway-thresholds.toml")).expect("a table");
    let (intrinsics, mount) = camera();
    let mut detector =
        Detector::new(Pinhole::ideal(intrinsics), mount, map, DetectorRules::for_size(256, 240));
    let poses = [0.0, 0.05, -0.05].map(|theta| Pose2::new(3.0, 0.1, theta));
    let frames = poses.map(|pose| render(pose, Some([4.6, 0.2])));
    for i in 0..60 {
        let (pose, pixels) = (poses[i % 3], &frames[i % 3]);
        let image = ImageView::new(pixels, 256, 240, 256).expect("an image");
        let place = table.at(&pose, 1.0).expect("thresholds");
        let (flagged, asked) = allocations(|| {
            detector.detect(image, &pose, 1e-3, &place).expect("results").iter().any(|s| s.is_obstacle)
        });
        assert!(flagged && (i < 10 || asked.calls == 0), "look {i}: {asked:?}");
    }
    let mut bench = Bench::<StationaryObstacleAvoider>::new(TABLE, setup).expect("a configuration");
    let mut counted = 0;
    for i in 0..200_u32 {
        let situation = Situation { seconds: 0.05 * f64::from(i), robot: poses[0], ..Situation::default() };
        let pixels = (i % 2 == 0).then_some(&frames[0][..]);
        feed(&mut bench, &situation, pixels);
        let (_, asked) = allocations(|| bench.propose());
        if i >= 100 {
            assert_eq!(asked.calls, 0, "call {i}");
            counted += 1;
        }
    }
    assert_eq!(counted, 100);
}
