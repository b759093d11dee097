//! The stationary-obstacle-avoider without learned thresholds, so that a task loads whose table is missing or of another camera.

use std::sync::Arc;

use yamabico_core::behavior::{Behavior, BehaviorFactory, BehaviorInfo, ParameterError, Plugin, Setup};
use yamabico_core::plugins::Plugins;
use yamabico_stationary_obstacle_avoider::StationaryObstacleAvoider;
use yamabico_stationary_obstacle_avoider::threshold_table::THRESHOLD_FILE;

/// Makes the stationary-obstacle-avoider of `plugins` ignore its learned thresholds.
pub(super) fn without_learned_thresholds(mut plugins: Plugins) -> Plugins {
    for factory in &mut plugins.behaviors {
        if factory.info().name == StationaryObstacleAvoider::NAME {
            *factory = Arc::new(Unlearned::new(Arc::clone(factory)));
        }
    }
    plugins
}

/// A factory that removes the key of the threshold file before it builds.
struct Unlearned {
    info: BehaviorInfo,
    inner: Arc<dyn BehaviorFactory>,
}

impl Unlearned {
    fn new(inner: Arc<dyn BehaviorFactory>) -> Unlearned {
        let mut info = inner.info().clone();
        info.files.retain(|file| file.key != THRESHOLD_FILE.key);
        // Without this format the file need not exist.
        if let Some(schema) = info.parameters["properties"][THRESHOLD_FILE.key].as_object_mut() {
            schema.remove("format");
        }
        Unlearned { info, inner }
    }
}

impl BehaviorFactory for Unlearned {
    fn info(&self) -> &BehaviorInfo {
        &self.info
    }

    fn build(&self, parameters: &toml::Table, setup: &Setup) -> Result<Box<dyn Behavior>, ParameterError> {
        let mut parameters = parameters.clone();
        parameters.remove(THRESHOLD_FILE.key);
        self.inner.build(&parameters, setup)
    }
}
