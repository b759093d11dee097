//! Overlays: what a behavior saw, drawn over the message in which it saw it.

use super::{Name, Note, code_enum, item, message};

message! {
    /// Overlay of one call of a behavior. Its items are marks in layers; [`layers`](crate::overlay::layers) reads them.
    "yamabico.OverlayHeader.v1" Latest [OverlayMark]
    pub struct OverlayHeader {
        /// Stamp of the message that is drawn over; the capture of a frame.
        pub stamp_ns: u64,
        /// Sequence number.
        pub sequence: u64,
        /// Topic of the message that is drawn over.
        pub topic: Note,
        /// Number of marks that found no room.
        pub omitted: u64,
    }
}

code_enum! {
    /// Kind of a mark of an overlay.
    pub enum MarkKind {
        /// Begin of a layer in pixel coordinates of the frame.
        ImageLayer = 0 "image layer",
        /// Begin of a layer in the robot frame.
        RobotLayer = 1 "robot layer",
        /// Point.
        Point = 2 "point",
        /// Line from the first to the second point.
        Line = 3 "line",
        /// Circle around the first point.
        Circle = 4 "circle",
        /// Text that begins at the first point.
        Text = 5 "text",
    }
}

item! {
    /// A mark of an overlay, or the begin of a layer. Coordinates are pixels (right, down) or m (forward, left), by the layer.
    pub struct OverlayMark {
        /// A [`MarkKind`] code.
        pub kind: u32,
        /// Color, 0xRRGGBB.
        pub color: u32,
        /// First coordinate of the first point.
        pub x: f64,
        /// Second coordinate of the first point.
        pub y: f64,
        /// First coordinate of the second point; radius of a circle.
        pub x2: f64,
        /// Second coordinate of the second point.
        pub y2: f64,
        /// Name of a layer, or the text of a mark.
        pub text: Name,
    }
}

impl OverlayMark {
    /// Returns the kind, or `None` if the code is undefined.
    pub fn kind(&self) -> Option<MarkKind> {
        MarkKind::from_code(self.kind)
    }
}
