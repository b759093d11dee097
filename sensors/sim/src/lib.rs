//! A simulated world: cameras, sonars, wheel encoders and a drive.
