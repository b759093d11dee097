//! Parameters that all live cameras share.

/// Declares the parameters of a live camera: its own, and those that all share.
macro_rules! live_camera {
    ($(#[$meta:meta])* pub struct $name:ident { $($own:tt)* }) => {
        $(#[$meta])*
        #[serde_inline_default::serde_inline_default]
        #[derive(Clone, Debug, serde::Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($own)*
            /// Rate at which the camera is expected to send; the sensor counts as dead after three missing frames.
            #[serde_inline_default(30.0)]
            #[schemars(range(min = 0.1, max = 1000.0))]
            pub rate_hz: f64,
            /// Delay from the middle of the exposure to the arrival of a frame; frames are stamped that much earlier.
            #[serde_inline_default(50.0)]
            #[schemars(range(min = 0.0, max = 2000.0))]
            pub latency_ms: f64,
            /// Pixel format that is published: `gray8` is faster, `rgb8` is for behaviors that look at colors.
            #[serde(default)]
            pub encoding: yamabico_core::message::Encoding,
            /// Image size, focal length and principal point; images of another size are refused.
            pub intrinsics: yamabico_core::camera::IntrinsicsConfig,
            /// Accuracy of intrinsics and mount. If guessed, behaviors treat directions as approximate and do not use
            /// distances.
            #[serde_inline_default(yamabico_core::camera::Calibration::Guessed)]
            pub calibration: yamabico_core::camera::Calibration,
            /// Pose on the robot.
            pub mount: yamabico_core::camera::MountConfig,
        }

        impl $name {
            /// Returns the parameters that cameras of all kinds share.
            #[must_use]
            pub fn description(&self) -> crate::description::CameraDescription {
                crate::description::CameraDescription {
                    rate_hz: self.rate_hz,
                    latency_ms: self.latency_ms,
                    encoding: self.encoding,
                    intrinsics: self.intrinsics,
                    calibration: self.calibration,
                    mount: self.mount,
                }
            }
        }
    };
}

pub(crate) use live_camera;
