//! Buildings drawn from seeds: their tasks run as they are written, without a contact in the first seconds, and the same seed gives
//! the same run.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use yamabico::building::{WITH_MAP, WITHOUT_MAP, write};
use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, load};
use yamabico_runtime::record::Tee;
use yamabico_runtime::run::{Options, RunResult, run};
use yamabico_sim::building::Building;
use yamabico_testkit::workspace;

fn drive(seed: u64, file: &str) -> RunResult {
    let building = Building::new(seed, &[]).unwrap();
    let name = format!("building-{seed}-{}", std::process::id());
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    write(&building, &folder, workspace()).unwrap();
    let overrides = Overrides { robot: None, set: vec!["run.duration_s=8".to_owned()] };
    let task =
        load(&folder.join(file), &overrides, &plugins()).unwrap_or_else(|problems| panic!("{problems}"));
    let options = Options { seed, ..Options::default() };
    let result = run(&task, &options, &AtomicBool::new(false), &mut Tee::default(), &mut |_| {}).unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    result
}

#[test]
fn the_tasks_of_a_building_run_and_repeat() {
    for file in [WITH_MAP, WITHOUT_MAP] {
        let [first, second] = [1, 2].map(|seed| drive(seed, file));
        assert_eq!((first.summary.contacts, second.summary.contacts), (Some(0), Some(0)), "{file}");
        assert_ne!(first.summary.digest, second.summary.digest, "{file}: another seed is another building");
        assert_eq!(first.summary.digest, drive(1, file).summary.digest, "{file}");
    }
}
