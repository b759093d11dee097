//! Detecting, tracking and mapping edges does not allocate after the first turn.

use nalgebra::{Point2, Vector2};
use yamabico_core::testing::{Allocations, allocations};
use yamabico_geometry::Pose2;
use yamabico_geometry::camera::MirrorImage;
use yamabico_geometry::image::GrayImage;
use yamabico_vision::azimuth_map::{
    AdjacencyTable, Inflation, LocusRule, LocusTracker, ObservedEdge, ObstacleClusters, VisibilityGraph,
    inflate, star_polygon,
};
use yamabico_vision::azimuth_profile::ProfileRule;
use yamabico_vision::radial_edges::{RadialEdgeRule, RadialEdges};

fn picture(image: &MirrorImage, turn: f64) -> GrayImage {
    let mut picture = GrayImage::new(image.width as usize, image.height as usize);
    let width = picture.width();
    for (i, out) in picture.pixels_mut().iter_mut().enumerate() {
        let pixel = Vector2::new((i % width) as f64, (i / width) as f64);
        let azimuth = image.azimuth_from_pixel(pixel).unwrap_or(0.0) + turn;
        *out = if (azimuth * 4.0).sin() > 0.0 { 180 } else { 70 };
    }
    picture
}

#[test]
fn frames_after_the_first_do_not_allocate() {
    let image = MirrorImage::centered(256, 240).with_ring(0.0, 118.0).unwrap();
    // The robot turns back and forth: edges appear, disappear, and reappear.
    let turns: Vec<f64> =
        (0..24).map(|i| 0.02 * f64::from(i)).chain((0..24).rev().map(|i| 0.02 * f64::from(i))).collect();
    let pictures: Vec<_> = turns.iter().map(|turn| picture(&image, -turn)).collect();
    let mut edges = RadialEdges::new(&image, &RadialEdgeRule::within(&image), ProfileRule::default());
    let mut tracker = LocusTracker::new(LocusRule::default());
    let mut table = AdjacencyTable::default();
    let mut seen = Vec::with_capacity(64);
    let mut around = |picture: &GrayImage, turn: f64| {
        let found = edges.find(picture.view().unwrap()).unwrap();
        seen.clear();
        seen.extend(found.iter().map(|edge| ObservedEdge {
            azimuth_rad: edge.azimuth_rad,
            sign: edge.sign,
            length_px: edge.length_px,
        }));
        tracker.update(&seen, &Pose2::new(0.0, 0.0, -turn));
        let loci = tracker.loci();
        let places = tracker.locus_of_observed().iter().zip(&seen);
        table.update(
            places.filter_map(|(place, edge)| place.map(|place| (loci[place].number, edge.azimuth_rad))),
        );
        loci.len()
    };
    let mut run = || turns.iter().zip(&pictures).map(|(turn, picture)| around(picture, *turn)).max();
    assert_eq!(run(), Some(8));
    let (most, asked) = allocations(&mut run);
    assert_eq!(most, Some(8));
    assert_eq!(asked, Allocations::default());
}

#[test]
fn a_second_plan_does_not_allocate() {
    let edges: Vec<_> =
        (0..12).map(|i| Point2::new(1.0 + 0.3 * f64::from(i % 4), 0.9 * f64::from(i / 4) - 0.9)).collect();
    let (mut clusters, mut graph) = (ObstacleClusters::default(), VisibilityGraph::default());
    let (mut corners, mut star, mut around) = (Vec::new(), Vec::new(), Vec::new());
    let mut obstacles: Vec<Vec<Point2<f64>>> = vec![Vec::new(); edges.len()];
    let mut plan = || {
        let labels = clusters.label(&edges, 0.35, |_, _| false);
        for (first, obstacle) in obstacles.iter_mut().enumerate() {
            let of_it = edges.iter().zip(labels).filter(|(_, label)| **label == first);
            inflate(of_it.map(|(edge, _)| *edge), &Inflation::of_robot(0.15, 0.01), &mut corners, obstacle);
        }
        around.clear();
        around.extend_from_slice(&edges);
        star_polygon(Point2::origin(), &mut around, &mut star);
        graph.shortest(Point2::origin(), Point2::new(3.0, 0.2), &obstacles).map(|(path, _)| path.len())
    };
    let first = plan();
    assert!(first.is_ok_and(|corners| corners > 2), "{first:?}");
    let (second, asked) = allocations(plan);
    assert_eq!(second, first);
    assert_eq!(asked, Allocations::default());
}
