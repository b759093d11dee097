//! Texts of errors, and output into a pipe that is not read.

use std::process::Stdio;

use yamabico_testkit::config;

use crate::program::{assert_exit, text, yamabico};

#[test]
fn check_says_how_many_errors_there_are() {
    let task = config("corridor.toml");
    let check = |set: &str| yamabico().arg("check").arg(&task).args(["--set", set]).output().unwrap();
    let checked = check("behaviors.wall-follower.speed_mps=9");
    assert_exit(&checked, 2, &["exceeds the robot's maximum", "[ --set ]", "\n1 error\n"]);
    assert!(!text(&checked).contains("nothing was opened"));
    assert_exit(&check("arbiter.rate_hz"), 2, &["write, for example, --set "]);
}

#[test]
fn a_former_name_of_a_parameter_is_answered_with_its_name() {
    for (task, behavior, former, name) in [
        ("corridor.toml", "wall-follower", "largest_turn_radps", "max_turn_radps"),
        ("corridor.toml", "wall-follower", "largest_offset_m", "max_offset_m"),
        ("corridor.toml", "stuck-recovery", "patience_s", "progress_timeout_s"),
        ("intersection.toml", "intersection-tracker", "largest_turn_radps", "max_turn_radps"),
        ("localization.toml", "map-localizer", "largest_turn_radps", "max_turn_radps"),
        ("hallway.toml", "stationary-obstacle-avoider", "largest_turn_radps", "max_turn_radps"),
        ("office.toml", "free-space-avoider", "patience_s", "blocked_timeout_s"),
        ("field.toml", "free-space-avoider", "farthest_m", "max_range_m"),
    ] {
        let set = format!("behaviors.{behavior}.{former}=1.0");
        let checked = yamabico().arg("check").arg(config(task)).args(["--set", &set]).output().unwrap();
        let error = format!("unknown key `{former}`");
        assert_exit(&checked, 2, &[&error, &format!("did you mean `{name}`?"), "\n1 error\n"]);
    }
}

#[test]
fn a_missing_task_is_named_without_an_excerpt() {
    let missing = yamabico().args(["run", "missing.toml"]).output().unwrap();
    assert_exit(&missing, 2, &["Error: file missing.toml does not exist\n  Help: ", "nothing was opened"]);
    assert!(!text(&missing).contains('╭'));
}

#[test]
fn misspelled_commands_get_a_suggestion() {
    for (arguments, suggestion) in
        [(&["rnu"][..], "'run'"), (&["topic", "lsit"], "'list'"), (&["new", "behavoir"], "'behavior'")]
    {
        assert_exit(&yamabico().args(arguments).output().unwrap(), 2, &[suggestion]);
    }
    let unlike = yamabico().arg("foo").output().unwrap();
    assert_exit(&unlike, 2, &["unrecognized subcommand 'foo'"]);
    assert!(!text(&unlike).contains("similar"), "{}", text(&unlike));
}

#[test]
fn a_closed_pipe_ends_no_command_with_a_panic() {
    let task = config("corridor.toml");
    let task = task.to_str().unwrap();
    for (arguments, code) in [
        (&["check", task][..], 0),
        (&["check", task, "--set", "arbiter.rate_hz=x"], 2),
        (&["check", task, "--set", "arbiter.rate_hz=x", "--json"], 2),
        (&["describe", "wall-follower"], 0),
        (&["describe", "foo"], 2),
        (&["graph", task], 0),
        (&["list"], 0),
        (&["schema"], 0),
        (&["rnu\u{7}"], 2),
        (&["--help"], 0),
    ] {
        let mut command = yamabico();
        let command = command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop((child.stdout.take(), child.stderr.take()));
        assert_eq!(child.wait().unwrap().code(), Some(code), "{arguments:?}");
    }
}
