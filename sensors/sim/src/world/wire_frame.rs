//! Wire-frame map of the walls, doors and windows of a world.

use std::collections::HashSet;

use nalgebra::{Point2, Point3, Vector2};
use yamabico_vision::map::{Edge, Wall as MapWall, WireFrame};

use super::{Corridor, Door, Wall, Window, World};
use crate::scene::build::{FRAME_DEPTH_M, FRAME_WIDTH_M, LEAF_M, REBATE_M, WINDOW_BAR_M, between_doors};

impl World {
    /// Returns a map of the building in the world frame: corners, baseboards, ceiling lines, doors and windows, without lamps and
    /// boxes.
    #[must_use]
    pub fn wire_frame(&self) -> WireFrame {
        let mut draft = Draft::default();
        let walls = self.corridor.iter().flat_map(Corridor::walls).chain(self.walls.iter().cloned());
        walls.for_each(|wall| draft.wall(&wall, self.ceiling.height_m));
        WireFrame::new(draft.edges, draft.walls)
    }
}

#[derive(Default)]
struct Draft {
    edges: Vec<Edge>,
    walls: Vec<MapWall>,
    drawn: HashSet<[[i64; 3]; 2]>,
}

/// Coordinate system of a wall: along it, and to its left.
#[derive(Clone, Copy)]
struct Face {
    from: Vector2<f64>,
    along: Vector2<f64>,
    left: Vector2<f64>,
}

impl Face {
    fn at(&self, along_m: f64, left_m: f64) -> Point2<f64> {
        Point2::from(self.from + self.along * along_m + self.left * left_m)
    }

    fn point(&self, along_m: f64, left_m: f64, z: f64) -> Point3<f64> {
        let plan = self.at(along_m, left_m);
        Point3::new(plan.x, plan.y, z)
    }
}

impl Draft {
    fn wall(&mut self, wall: &Wall, ceiling_m: f64) {
        let run = Vector2::from(wall.to_m) - Vector2::from(wall.from_m);
        let (length, along) = (run.norm(), run.normalize());
        let face = Face { from: Vector2::from(wall.from_m), along, left: Vector2::new(-along.y, along.x) };
        let top_m = wall.height_m.min(ceiling_m);
        for end in [0.0, length] {
            self.edge(face.point(end, 0.0, 0.0), face.point(end, 0.0, top_m));
        }
        self.edge(face.point(0.0, 0.0, top_m), face.point(length, 0.0, top_m));

        if let Some(dado) = wall.dado {
            for [from, to] in between_doors(wall, length) {
                self.edge(face.point(from, 0.0, dado.height_m), face.point(to, 0.0, dado.height_m));
            }
        }
        let mut doors: Vec<&Door> = wall.doors.iter().collect();
        doors.sort_by(|a, b| a.at_m.total_cmp(&b.at_m));
        let (mut foot_from, mut wall_from) = (0.0, 0.0);
        for door in doors {
            let half = 0.5 * door.width_m;
            self.foot(wall, &face, foot_from, door.at_m - half - FRAME_WIDTH_M);
            foot_from = door.at_m + half + FRAME_WIDTH_M;
            self.hide(face.at(wall_from, 0.0), face.at(door.at_m - half + REBATE_M, 0.0));
            wall_from = door.at_m + half - REBATE_M;
            self.door(door, &face, wall.thickness_m);
        }
        self.foot(wall, &face, foot_from, length);
        self.hide(face.at(wall_from, 0.0), face.at(length, 0.0));
        for window in &wall.windows {
            self.window(window, &face, length);
        }
    }

    /// Adds the baseboard, or without one the line between wall and floor.
    fn foot(&mut self, wall: &Wall, face: &Face, from: f64, to: f64) {
        if to - from < 1e-3 {
            return;
        }
        let Some(board) = wall.baseboard else {
            self.edge(face.point(from, 0.0, 0.0), face.point(to, 0.0, 0.0));
            return;
        };
        let line = |z: f64| (face.point(from, board.depth_m, z), face.point(to, board.depth_m, z));
        let (top, bottom) = (line(board.height_m), line(0.0));
        self.edge(top.0, top.1);
        self.detail(bottom.0, bottom.1);
    }

    fn door(&mut self, door: &Door, face: &Face, thickness_m: f64) {
        let half = 0.5 * door.width_m;
        let (outer, inner) = (half + FRAME_WIDTH_M, half - REBATE_M);
        let (head_m, lintel_m) = (door.height_m + FRAME_WIDTH_M, door.height_m - REBATE_M);
        let leaf_left_m = -0.6 * thickness_m;
        let at = |offset: f64, left_m: f64, z: f64| face.point(door.at_m + offset, left_m, z);
        for side in [-1.0, 1.0] {
            // The edge of the frame and its edge on the wall nearly coincide.
            let outline_left_m = 0.5 * FRAME_DEPTH_M;
            self.edge(at(side * outer, outline_left_m, 0.0), at(side * outer, outline_left_m, head_m));
            self.detail(at(side * inner, FRAME_DEPTH_M, 0.0), at(side * inner, FRAME_DEPTH_M, lintel_m));
            let depth_m = if door.open_deg > 0.0 { -thickness_m - FRAME_DEPTH_M } else { leaf_left_m };
            self.detail(at(side * inner, depth_m, 0.0), at(side * inner, depth_m, lintel_m));
            self.hide(face.at(door.at_m + side * inner, 0.0), face.at(door.at_m + side * inner, depth_m));
        }
        self.edge(at(-outer, FRAME_DEPTH_M, head_m), at(outer, FRAME_DEPTH_M, head_m));
        self.detail(at(-inner, FRAME_DEPTH_M, lintel_m), at(inner, FRAME_DEPTH_M, lintel_m));
        let hinge = face.at(door.at_m - inner, leaf_left_m);
        if door.open_deg <= 0.0 {
            self.hide(hinge, face.at(door.at_m + inner, leaf_left_m));
            return;
        }
        self.leaf(door, face, hinge, lintel_m);
        self.room(door, face, thickness_m);
    }

    /// Adds the leaf of an open door.
    fn leaf(&mut self, door: &Door, face: &Face, hinge: Point2<f64>, top_m: f64) {
        let (sin, cos) = (-door.open_deg.to_radians()).sin_cos();
        let turned = face.along * cos + face.left * sin;
        let out = Vector2::new(-turned.y, turned.x);
        let free = hinge + turned * (door.width_m - 2.0 * REBATE_M);
        self.edge(free.coords.push(0.0).into(), free.coords.push(top_m).into());
        let back = free - out * LEAF_M;
        self.detail(back.coords.push(0.0).into(), back.coords.push(top_m).into());
        self.hide(hinge, free);
        self.hide(free, back);
        self.hide(back, hinge - out * LEAF_M);
    }

    /// Adds the walls of the room behind an open door, which occlude; its edges are not part of the map.
    fn room(&mut self, door: &Door, face: &Face, thickness_m: f64) {
        let half = 0.5 * door.width_m + 0.5;
        let (near, far) = (-thickness_m, -thickness_m - door.room_depth_m);
        let corners = [(-half, near), (-half, far), (half, far), (half, near)];
        let corners = corners.map(|(offset, left_m)| face.at(door.at_m + offset, left_m));
        for pair in corners.windows(2) {
            self.hide(pair[0], pair[1]);
        }
    }

    /// Adds the pane of a window and its frame.
    fn window(&mut self, window: &Window, face: &Face, wall_m: f64) {
        let at_m = window.at_m.unwrap_or(0.5 * wall_m);
        let left_m = 0.017;
        let mut rectangle = |inset: f64, draw: fn(&mut Self, Point3<f64>, Point3<f64>)| {
            let half = 0.5 * window.width_m - inset;
            let (low, high) = (window.sill_m + inset, window.sill_m + window.height_m - inset);
            let corners = [(-half, low), (half, low), (half, high), (-half, high)];
            let corners = corners.map(|(offset, z)| face.point(at_m + offset, left_m, z));
            for i in 0..4 {
                draw(self, corners[i], corners[(i + 1) % 4]);
            }
        };
        rectangle(WINDOW_BAR_M, Self::edge);
        rectangle(0.0, Self::detail);
    }

    fn edge(&mut self, from: Point3<f64>, to: Point3<f64>) {
        self.draw(Edge::between(from, to));
    }

    fn detail(&mut self, from: Point3<f64>, to: Point3<f64>) {
        self.draw(Edge::between(from, to).detail());
    }

    /// Adds an edge unless it exists, since walls share their corners. Ends are rounded to millimeters, as map files state
    /// them, so that edges that a file tells apart are told apart here.
    fn draw(&mut self, mut edge: Edge) {
        let rounded = |p: Point3<f64>| p.map(|meters| (meters * 1000.0).round() / 1000.0);
        (edge.from, edge.to) = (rounded(edge.from), rounded(edge.to));
        let whole = |p: Point3<f64>| [p.x, p.y, p.z].map(|meters| (meters * 1000.0).round() as i64);
        let mut ends = [whole(edge.from), whole(edge.to)];
        ends.sort_unstable();
        if ends[0] != ends[1] && self.drawn.insert(ends) {
            self.edges.push(edge);
        }
    }

    fn hide(&mut self, from: Point2<f64>, to: Point2<f64>) {
        if (to - from).norm() > 1e-3 {
            self.walls.push(MapWall { from, to });
        }
    }
}
