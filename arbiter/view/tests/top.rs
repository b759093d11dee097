//! The dashboard in the terminal: golden screens.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use yamabico_view::model::Model;
use yamabico_view::recording::Recording;
use yamabico_view::top::{Pane, Screen, draw};

use crate::fixture::{Folder, HALT_S};

/// Text of the screen with 110 columns and 30 rows.
fn render(model: &Model, screen: &Screen) -> String {
    let mut terminal = Terminal::new(TestBackend::new(110, 30)).unwrap();
    terminal.draw(|frame| draw(frame, model, screen)).unwrap();
    terminal.backend().to_string()
}

#[test]
fn the_overview_and_the_log_of_a_halted_robot() {
    let folder = Folder::new("top");
    let mut recording = Recording::open(&folder.record()).unwrap();
    let model = recording.at(HALT_S.0 + 1.0).unwrap();
    let mut screen = Screen::new("kame");
    screen.select_next(&model);
    assert_eq!(screen.selected_behavior(&model).as_deref(), Some("avoider"));
    insta::assert_snapshot!("overview", render(&model, &screen));
    screen.toggle(Pane::Topic);
    screen.set_echo(vec!["kind: \"halt\"".to_owned()]);
    screen.set_note("avoider is disabled".to_owned());
    insta::assert_snapshot!("topic", render(&model, &screen));
}

#[test]
fn a_robot_without_decisions_and_a_small_terminal_are_drawn() {
    let screen = Screen::new("kame");
    let text = render(&Model::default(), &screen);
    assert!(text.contains("waiting for the first decision"), "{text}");
    let mut terminal = Terminal::new(TestBackend::new(20, 5)).unwrap();
    terminal.draw(|frame| draw(frame, &Model::default(), &screen)).unwrap();
}
