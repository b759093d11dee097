//! Halts the robot while a sonar sees something nearer than its gate.
