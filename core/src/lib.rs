//! The vocabulary of Yamabico: messages, seams, bus, configuration, geometry, cameras and vision.
