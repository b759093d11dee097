//! Every behaviour and driver that this binary brings along.

use yamabico_core::behavior::BehaviorPlugin;
use yamabico_core::config::Plugins;
use yamabico_core::sensor::DriverPlugin;

/// The behaviours.
static BEHAVIORS: &[BehaviorPlugin] = &[
    BehaviorPlugin::of::<yamabico_free_space_avoider::FreeSpaceAvoider>(),
    BehaviorPlugin::of::<yamabico_intersection_tracker::IntersectionTracker>(),
    BehaviorPlugin::of::<yamabico_map_localizer::MapLocalizer>(),
    BehaviorPlugin::of::<yamabico_sonar_halt::SonarHalt>(),
    BehaviorPlugin::of::<yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider>(),
    BehaviorPlugin::of::<yamabico_teleop::Teleop>(),
    BehaviorPlugin::of::<yamabico_wall_follower::WallFollower>(),
];

/// The drivers.
static DRIVERS: &[DriverPlugin] = &[yamabico_camera::PLUGIN, yamabico_sim::PLUGIN];

/// All of them.
pub static PLUGINS: Plugins<'static> = Plugins { behaviors: BEHAVIORS, drivers: DRIVERS };
