//! Follows a corridor by the vanishing point and the floor lines of its walls.
