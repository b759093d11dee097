//! Nothing that a file can hold makes the loader panic.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use proptest::prelude::*;
use yamabico_host::config::{Overrides, load};
use yamabico_parameters::Style;
use yamabico_testkit::fuzz;

use super::fakes::plugins;

const TASK: &str = include_str!("../valid/hallway.toml");
const ROBOT: &str = include_str!("../valid/robots/sim.toml");

/// Loads a task and a robot of these bytes and renders the errors.
fn load_bytes(task: &[u8], robot: &[u8], set: Vec<String>) -> std::io::Result<()> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("yamabico-config-{}-{number}", std::process::id()));
    std::fs::create_dir_all(folder.join("robots"))?;
    std::fs::create_dir_all(folder.join("worlds"))?;
    std::fs::write(folder.join("worlds/hallway.toml"), "")?;
    std::fs::write(folder.join("task.toml"), task)?;
    std::fs::write(folder.join("robots/sim.toml"), robot)?;
    let overrides = Overrides { robot: None::<PathBuf>, set };
    if let Err(problems) = load(&folder.join("task.toml"), &overrides, &plugins()) {
        assert!(
            !problems.is_empty(),
            "refused without a reason:\n{}\n{}",
            String::from_utf8_lossy(task),
            String::from_utf8_lossy(robot)
        );
        assert!(!problems.render(Style::Plain).is_empty());
        assert!(!problems.render(Style::Colored).is_empty());
        assert_eq!(problems.entries().len(), problems.len());
    }
    std::fs::remove_dir_all(folder)
}

/// `text` with a stretch replaced by something else that TOML knows, or by noise.
fn mutated(text: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let scrap = prop_oneof![
        Just(Vec::new()),
        prop::sample::select(vec![
            "[",
            "]",
            "=",
            "\"",
            "{",
            "}",
            ".",
            "\n",
            "#",
            "[[",
            "'''",
            "nan",
            "-1",
            "1e400",
            "é",
            "\u{202e}",
            "true",
            "9999999999999999999",
            "1979-05-27",
            "[]",
            "{}",
            "type = 3\n",
            "inputs = 1\n",
            "\r\n",
            "\t",
            "\u{1f916}",
        ])
        .prop_map(|text| text.as_bytes().to_vec()),
        prop::collection::vec(any::<u8>(), 0..8),
        // A line or half of one from elsewhere in the same file.
        (0..text.len(), 1..40usize)
            .prop_map(|(at, len)| text.as_bytes()[at..(at + len).min(text.len())].to_vec()),
    ];
    prop::collection::vec((0..text.len(), 0..12usize, scrap), 1..5).prop_map(|edits| {
        let mut bytes = text.as_bytes().to_vec();
        for (at, len, scrap) in edits {
            let at = at.min(bytes.len());
            let end = (at + len).min(bytes.len());
            bytes.splice(at..end, scrap);
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_files_are_read_or_refused(task in mutated(TASK), robot in mutated(ROBOT)) {
        load_bytes(&task, ROBOT.as_bytes(), Vec::new()).unwrap();
        load_bytes(TASK.as_bytes(), &robot, Vec::new()).unwrap();
        load_bytes(&task, &robot, Vec::new()).unwrap();
    }

    #[test]
    fn noise_is_refused(bytes in prop::collection::vec(any::<u8>(), 0..200), text in "\\PC{0,80}") {
        load_bytes(&bytes, &bytes, Vec::new()).unwrap();
        load_bytes(text.as_bytes(), ROBOT.as_bytes(), Vec::new()).unwrap();
    }

    #[test]
    fn any_override_is_taken_or_refused(
        key in "(robot\\.)?(behaviors|run|arbiter|sensors|drive|inhibit)(\\.[a-z\"é-]{0,6}){0,3}",
        value in "\\PC{0,12}",
        text in "\\PC{0,20}",
    ) {
        load_bytes(TASK.as_bytes(), ROBOT.as_bytes(), vec![format!("{key}={value}"), text]).unwrap();
    }
}

#[test]
fn deep_nesting_is_refused() {
    let dots = format!("{}x = 1", "a.".repeat(100_000));
    let header = format!("[{}x]", "a.".repeat(100_000));
    let lists = format!("a = {}", "[".repeat(100_000));
    let tables = format!("a = {}", "{a=".repeat(100_000));
    for text in [dots, header, lists, tables] {
        load_bytes(text.as_bytes(), text.as_bytes(), vec![text.clone()]).unwrap();
    }
}

#[test]
fn fuzz_configuration() {
    let (task, robot) = (TASK.as_bytes(), ROBOT.as_bytes());
    fuzz::run("configuration", &[task.to_vec(), robot.to_vec()], |bytes| {
        load_bytes(bytes, robot, Vec::new()).unwrap();
        load_bytes(task, bytes, Vec::new()).unwrap();
    });
}
