//! `yamabico report`, and the report that `yamabico run` writes.

use std::path::Path;
use std::process::Output;

use yamabico_testkit::config;

use crate::program::{TestFolder, yamabico};

const SHORT: [&str; 2] = ["--set", "run.duration_s=8"];

fn run(folder: &TestFolder, arguments: &[&str]) -> Output {
    let mut command = yamabico();
    command
        .arg("run")
        .arg(config("hallway.toml"))
        .arg("--out")
        .arg(folder.path())
        .args(SHORT)
        .args(arguments);
    command.output().unwrap()
}

fn report(recording: &Path) -> (Option<i32>, String) {
    let ended = yamabico().arg("report").arg(recording).output().unwrap();
    let text = [ended.stdout, ended.stderr].concat();
    (ended.status.code(), String::from_utf8(text).unwrap())
}

/// Asserts that a page has everything in it that it shows.
fn assert_self_contained(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>"));
    for forbidden in ["<script", "<link", "href=", "src=\"http", "@import", "url("] {
        assert!(!page.contains(forbidden), "the page loads something: {forbidden}");
    }
}

#[test]
fn of_a_run_says_what_happened() {
    let folder = TestFolder::new("report-run");
    let ran = run(&folder, &[]);
    let printed = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert!(printed.contains("run.html"), "{printed}");
    let page = std::fs::read_to_string(folder.file("run.html")).unwrap();
    assert_self_contained(&page);
    for part in [
        "<h1>hallway <span class=\"badge bad\">not arrived: time over</span></h1>",
        "The robot drove",
        "It touched nothing",
        "true path of the simulation",
        ">start</text>",
        ">goal</text>",
        "Who had control of each axis",
        "map-localizer took linear and angular",
        "<h2>Log</h2>",
        "Late and restarted",
        "in lockstep computing takes no time",
        "<td>seed</td><td class=\"text\">1</td>",
    ] {
        assert!(page.contains(part), "no {part:?}");
    }
    // The same page again from the recording alone.
    let (code, text) = report(&folder.file("run.mcap"));
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(std::fs::read_to_string(folder.file("run.html")).unwrap(), page);
    assert!(std::fs::read_to_string(folder.file("trajectory.svg")).unwrap().contains(">goal</text>"));
}

#[test]
fn is_not_written_if_it_is_not_wanted() {
    let folder = TestFolder::new("report-none");
    run(&folder, &["--no-report", "--no-overlays"]);
    assert!(folder.file("run.mcap").exists() && !folder.file("run.html").exists());
}

#[test]
fn of_a_recording_that_ends_early_covers_it_up_to_there() {
    let folder = TestFolder::new("report-cut");
    run(&folder, &["--no-report"]);
    let whole = std::fs::read(folder.file("run.mcap")).unwrap();
    let cut = folder.file("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() * 2 / 3]).unwrap();
    let (code, text) = report(&cut);
    assert_eq!(code, Some(0), "{text}");
    let page = std::fs::read_to_string(folder.file("cut.html")).unwrap();
    assert_self_contained(&page);
    for part in ["recording cut off", "The recording ends early", "The robot drove", "map-localizer took"] {
        assert!(page.contains(part), "no {part:?}");
    }
    // Every shorter piece gives a page or a clear error, never a crash.
    for share in [0, 1, 8, 40, 200, 1000, 5000, 100_000] {
        std::fs::write(&cut, &whole[..share.min(whole.len())]).unwrap();
        let (code, text) = report(&cut);
        assert!(code == Some(0) || code == Some(2) && text.contains("cut.mcap"), "{share}: {code:?} {text}");
        assert!(!text.contains("panicked"), "{text}");
    }
}

#[test]
fn of_something_else_is_refused_clearly() {
    let folder = TestFolder::new("report-else");
    let file = folder.file("else.mcap");
    std::fs::write(&file, "this is not a recording, but long enough to be one").unwrap();
    for (path, problem) in [
        (file.as_path(), "is not an MCAP recording"),
        (&folder.file("missing.mcap"), "cannot be opened"),
        (folder.path(), "Is a directory"),
    ] {
        let (code, text) = report(path);
        assert_eq!(code, Some(2), "{text}");
        assert!(text.contains(problem), "{text}");
    }
    // Bits that flip in the middle are an early end or a message that is left out.
    run(&folder, &["--no-report"]);
    let mut whole = std::fs::read(folder.file("run.mcap")).unwrap();
    let middle = whole.len() / 2;
    whole[middle..middle + 64].fill(0xff);
    std::fs::write(&file, &whole).unwrap();
    let (code, text) = report(&file);
    assert!(code == Some(0) && !text.contains("panicked"), "{text}");
}
