//! Drawing of the dashboard.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Cell, Paragraph, Row, Table};

use crate::model::{BehaviorView, EventKind, Model, STAGES, Sample, Snapshot};

/// Colors of the behaviors, in the order of the task.
const COLORS: [Color; 7] = [
    Color::Blue,
    Color::Yellow,
    Color::Magenta,
    Color::Green,
    Color::Cyan,
    Color::LightRed,
    Color::LightBlue,
];
/// Width of a bar of ages, cells.
const BAR_CELLS: usize = 10;

/// Lower part of the screen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pane {
    /// Sensors, latency and strip of winners.
    #[default]
    Overview,
    /// Log of events.
    Log,
    /// Newest message of a topic.
    Topic,
}

/// Choices of the operator, and texts that come from elsewhere.
#[derive(Clone, Debug, Default)]
pub struct Screen {
    robot: String,
    is_running: bool,
    pane: Pane,
    behavior: usize,
    topic: usize,
    echo: Vec<String>,
    note: String,
}

impl Screen {
    /// Screen of the robot of this name.
    pub fn new(robot: &str) -> Screen {
        Screen { robot: robot.to_owned(), is_running: true, ..Screen::default() }
    }

    /// Lower part.
    pub fn pane(&self) -> Pane {
        self.pane
    }

    /// Shows another lower part.
    pub fn set_pane(&mut self, pane: Pane) {
        (self.pane, self.echo) = (pane, Vec::new());
    }

    /// Shows this lower part, or the overview if it is shown already.
    pub fn toggle(&mut self, pane: Pane) {
        self.set_pane(if self.pane == pane { Pane::Overview } else { pane });
    }

    /// Says whether the robot runs.
    pub fn set_running(&mut self, is_running: bool) {
        self.is_running = is_running;
    }

    /// Shows the effect of a key in the last line.
    pub fn set_note(&mut self, note: String) {
        self.note = note;
    }

    /// Shows these lines of the selected topic.
    pub fn set_echo(&mut self, lines: Vec<String>) {
        self.echo = lines;
    }

    /// Selects the next behavior, or topic.
    pub fn select_next(&mut self, model: &Model) {
        let count = self.count(model);
        let index = self.index();
        *index = (*index + 1).min(count.saturating_sub(1));
    }

    /// Selects the previous behavior, or topic.
    pub fn select_previous(&mut self) {
        let index = self.index();
        *index = index.saturating_sub(1);
    }

    fn index(&mut self) -> &mut usize {
        if self.pane == Pane::Topic { &mut self.topic } else { &mut self.behavior }
    }

    fn count(&self, model: &Model) -> usize {
        match self.pane {
            Pane::Topic => model.setup().0.topics.len(),
            _ => model.decision().map_or(0, |decision| decision.verdicts.len()),
        }
    }

    /// Name of the selected behavior.
    pub fn selected_behavior(&self, model: &Model) -> Option<String> {
        let verdicts = &model.decision()?.verdicts;
        verdicts.get(self.behavior).map(|verdict| verdict.behavior.as_str().to_owned())
    }

    /// Name of the selected topic.
    pub fn selected_topic(&self, model: &Model) -> Option<String> {
        model.setup().0.topics.get(self.topic).map(|[name, _]| name.clone())
    }
}

/// Draws the state of the robot.
pub fn draw(frame: &mut Frame<'_>, model: &Model, screen: &Screen) {
    let snapshot = model.snapshot();
    let rows = snapshot.behaviors.len() as u16 + 3;
    let [head, behaviors, rest, foot] = Layout::vertical([
        Constraint::Length(2 + snapshot.axes.len() as u16),
        Constraint::Length(rows),
        Constraint::Min(3),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    draw_head(frame, head, &snapshot, screen);
    draw_behaviors(frame, behaviors, &snapshot, screen);
    match screen.pane {
        Pane::Overview => draw_overview(frame, rest, model, &snapshot),
        Pane::Log => draw_log(frame, rest, model),
        Pane::Topic => draw_topic(frame, rest, model, screen),
    }
    let keys = "q quit  ↑↓ select  e enable  d disable  s e-stop  r reset  l log  t topic";
    let foot_text = if screen.note.is_empty() { keys } else { &screen.note };
    frame.render_widget(Paragraph::new(foot_text).dim(), foot);
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, snapshot: &Snapshot, screen: &Screen) {
    let color = match snapshot.mode {
        "driving" => Color::Green,
        "idle" => Color::Gray,
        "halted" => Color::Yellow,
        _ => Color::Red,
    };
    let what = if screen.is_running { &snapshot.headline } else { "not running" };
    let mut lines = vec![Line::from(vec![
        Span::from(format!("{}  ", screen.robot)).bold(),
        Span::from(format!("{:.1} s  ", snapshot.time_s)).dim(),
        Span::from(what.to_owned()).fg(color).bold(),
    ])];
    for axis in &snapshot.axes {
        let speed = format!("{:<8}{:>6.2} {:<6}", axis.axis, axis.commanded, axis.unit);
        lines.push(Line::from(vec![Span::from(speed).bold(), Span::from(axis.why.join("; "))]));
    }
    frame.render_widget(Paragraph::new(lines), area);
}

fn draw_behaviors(frame: &mut Frame<'_>, area: Rect, snapshot: &Snapshot, screen: &Screen) {
    let header = ["behavior", "outcome", "share", "age", "rate", "p99", "restarts", "why"];
    let rows = snapshot.behaviors.iter().enumerate().map(|(index, behavior)| {
        let row = behavior_row(index, behavior);
        if index == screen.behavior { row.style(Style::new().add_modifier(Modifier::REVERSED)) } else { row }
    });
    let widest = snapshot.behaviors.iter().map(|behavior| behavior.name.chars().count()).max().unwrap_or(8);
    let widths = [
        Constraint::Length(widest as u16 + 8),
        Constraint::Length(14),
        Constraint::Length(5),
        Constraint::Length(BAR_CELLS as u16 + 8),
        Constraint::Length(8),
        Constraint::Length(16),
        Constraint::Length(8),
        Constraint::Min(10),
    ];
    let table = Table::new(rows, widths).header(Row::new(header).dim()).block(Block::bordered());
    frame.render_widget(table, area);
}

fn behavior_row(index: usize, behavior: &BehaviorView) -> Row<'static> {
    let outcome = Style::new().fg(if behavior.drives { Color::Green } else { Color::Reset });
    let p99 = behavior.calls.map_or(String::new(), |calls| match behavior.budget_ms {
        Some(budget_ms) => format!("{:.1} of {budget_ms:.0} ms", calls.p99_ms),
        None => format!("{:.1} ms", calls.p99_ms),
    });
    let why = match behavior.because.as_str() {
        "" => behavior.why.clone(),
        because => format!("{}: {because}", behavior.why),
    };
    let name = vec![
        Span::from("■ ").fg(COLORS[index % COLORS.len()]),
        Span::from(format!("{} ({})", behavior.name, behavior.priority)),
    ];
    Row::new([
        Cell::from(Line::from(name)),
        Cell::from(behavior.outcome).style(outcome),
        Cell::from(format!("{:>3.0} %", 100.0 * behavior.control_share)),
        Cell::from(age_bar(behavior.age_s, behavior.max_age_s)),
        Cell::from(format!("{:>5.1} Hz", behavior.rate_hz)),
        Cell::from(p99),
        Cell::from(if behavior.restarts == 0 { String::new() } else { behavior.restarts.to_string() }),
        Cell::from(why),
    ])
}

/// Bar of an age against its maximum, and the age.
fn age_bar(age_s: Option<f64>, max_s: Option<f64>) -> Line<'static> {
    let Some(age_s) = age_s else { return Line::from("-") };
    let share = age_s / max_s.unwrap_or(0.2).max(1e-6);
    let full = ((share * BAR_CELLS as f64).round().clamp(0.0, BAR_CELLS as f64)) as usize;
    let color = if share > 1.0 { Color::Red } else { Color::Blue };
    let text = if age_s < 9.995 { format!("{:>4.0} ms", age_s * 1e3) } else { format!("{age_s:>5.0} s") };
    Line::from(vec![
        Span::from("█".repeat(full)).fg(color),
        Span::from("░".repeat(BAR_CELLS - full)).dim(),
        Span::from(text),
    ])
}

fn draw_overview(frame: &mut Frame<'_>, area: Rect, model: &Model, snapshot: &Snapshot) {
    let [strips, below] = Layout::vertical([Constraint::Length(5), Constraint::Min(3)]).areas(area);
    draw_strips(frame, strips, model, snapshot);
    let [sensors, latency] =
        Layout::horizontal([Constraint::Percentage(50), Constraint::Percentage(50)]).areas(below);
    let rows = snapshot.sensors.iter().map(|sensor| {
        let (rate, age) = (format!("{:>6.1} Hz", sensor.rate_hz), format!("{:>6.0} ms", sensor.age_s * 1e3));
        Row::new([sensor.topic.clone(), sensor.kind.clone(), rate, age])
    });
    let widths =
        [Constraint::Min(16), Constraint::Length(12), Constraint::Length(10), Constraint::Length(10)];
    frame.render_widget(Table::new(rows, widths).block(Block::bordered().title("sensors")), sensors);
    let mut lines = Vec::new();
    if let Some(summary) = &snapshot.latency {
        let named = STAGES.iter().zip(&summary.stages).chain([(&"all", &summary.whole)]);
        lines.extend(named.map(|(name, stage)| {
            Line::from(format!("{name:<22}{:>7.1}{:>8.1} ms", stage.p50_ms, stage.p99_ms))
        }));
    }
    let block = Block::bordered().title("latency, p50 and p99");
    frame.render_widget(Paragraph::new(lines).block(block), latency);
}

/// One line an axis: each cell has the color of the behavior in control, with a mark where a halt stops the axis.
fn draw_strips(frame: &mut Frame<'_>, area: Rect, model: &Model, snapshot: &Snapshot) {
    let block = Block::bordered().title("control over the last two minutes");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let width = inner.width.saturating_sub(9) as usize;
    let samples: Vec<&Sample> = model.strips().samples().collect();
    let names: Vec<&str> = model.strips().names().collect();
    let color = |sample: &Sample, axis: usize| {
        let name = names.get(usize::try_from(sample.owner[axis]).ok()?)?;
        let index = snapshot.behaviors.iter().position(|behavior| behavior.name == *name)?;
        Some(COLORS[index % COLORS.len()])
    };
    let mut lines = Vec::new();
    for (axis, label) in [(0, "linear"), (1, "lateral"), (2, "angular")] {
        let mut spans = vec![Span::from(format!("{label:<9}")).dim()];
        for cell in 0..width.min(samples.len()) {
            let cells = width.min(samples.len());
            let sample = samples[cell * samples.len() / cells];
            let symbol = if sample.halted[axis] { "▄" } else { "█" };
            spans.push(match color(sample, axis) {
                Some(color) => Span::from(symbol).fg(color),
                None => Span::from("·").dim(),
            });
        }
        lines.push(Line::from(spans));
    }
    frame.render_widget(Paragraph::new(lines), inner);
}

fn draw_log(frame: &mut Frame<'_>, area: Rect, model: &Model) {
    let count = area.height.saturating_sub(2) as usize;
    let newest: Vec<_> = model.events().events().rev().take(count).collect();
    let lines = newest.into_iter().rev().map(|event| {
        let color = match event.kind {
            EventKind::Halt | EventKind::Contact | EventKind::Failure => Color::Red,
            EventKind::Late => Color::Yellow,
            EventKind::HandOver => Color::Blue,
            EventKind::Release | EventKind::Operator => Color::Reset,
        };
        let time = format!("{:>9.2} s  ", model.seconds(event.at));
        Line::from(vec![Span::from(time).dim(), Span::from(event.text.clone()).fg(color)])
    });
    let block = Block::bordered().title("log");
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
}

fn draw_topic(frame: &mut Frame<'_>, area: Rect, model: &Model, screen: &Screen) {
    let [list, message] = Layout::horizontal([Constraint::Length(44), Constraint::Min(20)]).areas(area);
    let topics = model.setup().0.topics;
    let height = list.height.saturating_sub(2) as usize;
    let first = screen.topic.saturating_sub(height.saturating_sub(1));
    let lines = topics.iter().enumerate().skip(first).take(height).map(|(index, [name, _])| {
        let line = Line::from(name.clone());
        if index == screen.topic { line.reversed() } else { line }
    });
    let lines: Vec<_> = lines.collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title("topics")), list);
    let lines: Vec<Line<'_>> = screen.echo.iter().map(|line| Line::from(line.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title("newest message")), message);
}
