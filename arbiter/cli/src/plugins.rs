//! The behaviors and drivers that this binary brings along.

use yamabico_core::behavior::factory;
use yamabico_core::plugins::Plugins;

/// All of them.
#[must_use]
pub fn plugins() -> Plugins {
    Plugins {
        behaviors: vec![
            factory::<yamabico_free_space_avoider::FreeSpaceAvoider>(),
            factory::<yamabico_intersection_tracker::IntersectionTracker>(),
            factory::<yamabico_map_localizer::MapLocalizer>(),
            factory::<yamabico_sonar_halt::SonarHalt>(),
            factory::<yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider>(),
            factory::<yamabico_stuck_recovery::StuckRecovery>(),
            factory::<yamabico_teleop::Teleop>(),
            factory::<yamabico_wall_follower::WallFollower>(),
        ],
        drivers: [
            vec![
                yamabico_camera::driver(),
                yamabico_gpio::driver(),
                yamabico_recording::driver(),
                yamabico_sim::driver(),
            ],
            yamabico_serial::drivers(),
        ]
        .concat(),
    }
}
