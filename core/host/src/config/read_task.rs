//! Reading of a task file.

use std::sync::Arc;
use std::time::Duration;

use super::checks::{check_positions, max_goal_m};
use super::exec::{ask, program_of};
use super::inputs::{Inputs, Sources, read_inputs};
use super::keys::{check_name, own_keys, read_keys, right_keys};
use super::paths::{Home, resolve_paths};
use super::read_robot::RobotDraft;
use super::source_map::{SourceMap, refusal};
use super::tables::{ArbiterKeys, BehaviorKeys, Isolation, Policy, TaskKeys};
use super::task::{Arbiter, BehaviorFile, GoalArea, Input, InputSource, Run, Task};
use super::wires::{Wired, WrittenWire, check_input_cycles, check_wires, read_wires};
use crate::settings::milliseconds;
use crate::{BehaviorSettings, Deadline, HostSettings};
use yamabico_core::behavior::{BehaviorFactory, BehaviorInfo, Setup, SlotInfo};
use yamabico_core::plugins::Plugins;
use yamabico_core::sensor::SensorInfo;
use yamabico_parameters::{Entry, Problem, Shape, Span, Table, check_table, instead, number};

/// Results of the checks of the files that devices and behaviors name.
pub(crate) struct NamedFiles {
    /// Behaviors with errors that are already reported or will be.
    pub refused: Vec<String>,
    /// Maximum absolute coordinate or length in the files, m; 0 without files.
    pub extent_m: f64,
    /// True if the robot is not the one that the task names.
    pub has_another_robot: bool,
}

/// Reads the tree of the file `home`. `robot` is `None` if its file could not be read.
pub(crate) fn read_task(
    home: Home<'_>,
    tree: &Table,
    robot: Option<RobotDraft>,
    files: &NamedFiles,
    plugins: &Plugins,
    problems: &mut Vec<Problem>,
) -> Option<Task> {
    let top = Span { source: home.source, start: 0, end: 0 };
    let keys: TaskKeys = read_keys(tree, top, "a task file", problems);
    let drafts = read_behaviors(tree, home, plugins, problems);
    if let Some(entry) = tree.entry("behaviors").filter(|_| drafts.is_empty()) {
        problems.push(
            Problem::new(entry.key_span, "this task has no behaviors")
                .label("the robot would never move")
                .help(instead("", plugins.behaviors.iter().map(|plugin| &*plugin.info().name), "behavior")),
        );
    }
    let known: Vec<(String, Option<Arc<dyn BehaviorFactory>>)> =
        drafts.iter().map(|draft| (draft.entry.key.clone(), draft.plugin.clone())).collect();
    let sources = Sources {
        robot: robot.as_ref(),
        behaviors: &known,
        task_of_another_robot: files.has_another_robot.then_some(home.source),
    };
    let mut behaviors = Vec::new();
    let mut input_spans = Vec::new();
    for draft in &drafts {
        let Some(plugin) = &draft.plugin else { continue };
        let before = problems.len();
        let Inputs { connected: inputs, left_out, notes } =
            read_inputs(draft.entry, plugin.info(), &sources, problems);
        for input in &inputs {
            let span =
                draft.table.span_of(&format!("inputs.{}", input.slot)).unwrap_or(draft.entry.node.span);
            input_spans.push((draft.entry.key.clone(), input.source.clone(), span));
        }
        let inputs_are_right = problems.len() == before;
        let behavior = draft.behavior(plugin, inputs, robot.as_ref(), &keys.arbiter, home);
        let behavior = BehaviorFile { notes, ..behavior };
        draft.check_switches(problems);
        draft.check_rank(&keys.arbiter, problems);
        draft.check_axes(plugin.info(), robot.as_ref(), problems);
        draft.check_ages(&behavior, tree, robot.as_ref(), problems);
        check_positions(draft.table, &plugin.info().parameters, files.extent_m, problems);
        let is_described = |input: &Input| match &input.source {
            InputSource::Sensor(_) => sensor_of(input, robot.as_ref()).is_some(),
            InputSource::Output { .. } | InputSource::Operator | InputSource::Arbiter => true,
        };
        let named = draft.table.table("inputs").map_or(0, |inputs| inputs.entries.len());
        let is_read = |slot: &SlotInfo| behavior.inputs.iter().any(|input| input.slot == slot.name);
        let is_connected = inputs_are_right
            && behavior.inputs.iter().all(is_described)
            && behavior.inputs.len() + left_out >= named
            && plugin.info().inputs.iter().all(|slot| !slot.required || is_read(slot))
            && !files.refused.contains(&draft.entry.key);
        let is_right = draft.is_right && is_connected && problems.len() == before;
        if robot.is_some()
            && is_right
            && draft.exec.is_empty()
            && let Err(error) = behavior.build()
        {
            problems.push(refusal(draft.entry, &error));
        }
        behaviors.push(behavior);
    }
    check_priorities(&drafts, keys.arbiter.policy, problems);
    check_input_cycles(&input_spans, problems);
    let inhibit = read_wires(tree, "inhibit");
    let suppress = read_wires(tree, "suppress");
    let wired: Vec<Wired> = drafts.iter().map(Draft::wired).collect();
    let duration = keys.run.duration_s.map(|seconds| milliseconds(seconds * 1e3));
    check_wires(&[inhibit.as_slice(), &suppress].concat(), &wired, duration, problems);
    behaviors.sort_by(|a, b| b.settings.priority.cmp(&a.settings.priority).then_with(|| a.name.cmp(&b.name)));
    let period = arbiter_period(&keys.arbiter);
    let step = keys.run.step_ms.map_or(period, milliseconds);
    // Tolerance for a period written in decimals.
    if step > period + Duration::from_micros(1) {
        problems.push(step_too_long(tree, step, period));
    }
    let plain = |wires: Vec<WrittenWire>| wires.into_iter().map(|written| written.wire).collect();
    Some(Task {
        path: home.path.to_owned(),
        name: home.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        robot: robot?.finish()?,
        run: Run {
            duration,
            goal: keys.run.goal.map(|goal| GoalArea {
                x_m: goal.x_m,
                y_m: goal.y_m,
                tolerance_m: goal.tolerance_m,
            }),
            step: step.min(period),
        },
        max_goal_m: max_goal_m(files.extent_m),
        arbiter: Arbiter {
            period,
            policy: keys.arbiter.policy,
            latency_slows: keys.arbiter.latency_slows,
            scheduling: keys.arbiter.scheduling.scheduling(),
        },
        behaviors,
        inhibit: plain(inhibit),
        suppress: plain(suppress),
        source_map: SourceMap::default(),
    })
}

/// Valid parts of a behavior.
struct Draft<'a> {
    entry: &'a Entry,
    table: &'a Table,
    keys: BehaviorKeys,
    own: toml::Table,
    plugin: Option<Arc<dyn BehaviorFactory>>,
    exec: Vec<String>,
    is_right: bool,
}

fn read_behaviors<'a>(
    tree: &'a Table,
    home: Home<'_>,
    plugins: &Plugins,
    problems: &mut Vec<Problem>,
) -> Vec<Draft<'a>> {
    let entries = tree.table("behaviors").map_or(&[][..], |table| table.entries.as_slice());
    entries.iter().filter_map(|entry| read_behavior(entry, home, plugins, problems)).collect()
}

fn read_behavior<'a>(
    entry: &'a Entry,
    home: Home<'_>,
    plugins: &Plugins,
    problems: &mut Vec<Problem>,
) -> Option<Draft<'a>> {
    let table = entry.node.as_table()?;
    let before = problems.len();
    check_name(&entry.key, entry.key_span, problems);
    let named = table.entry("type");
    let name = named.and_then(|named| named.node.as_text()).unwrap_or(&entry.key);
    let exec = program_of(table, home);
    let plugin = match exec.as_slice() {
        [] => plugins.behavior(name).cloned(),
        program => ask(program, entry, problems),
    };
    if plugin.is_none() && exec.is_empty() {
        let span = named.map_or(entry.key_span, |named| named.node.span);
        let names = plugins.behaviors.iter().map(|plugin| &*plugin.info().name);
        let mut help = instead(name, names, "behavior");
        if named.is_none() {
            help.push_str(" (to give the table another name, set type = \"...\")");
        }
        problems.push(Problem::new(span, format!("unknown behavior `{name}`")).label("unknown").help(help));
    }
    let common = schemars::schema_for!(BehaviorKeys).to_value();
    let own = plugin.as_ref().map(|plugin| plugin.info().parameters.clone());
    let mut shapes = vec![Shape::new(&common)];
    shapes.extend(own.as_ref().map(Shape::new));
    let mut found = Vec::new();
    check_table(table, entry.node.span, &shapes, &format!("behavior `{}`", entry.key), &mut found);
    if plugin.is_none() {
        // The parameters of an unknown behavior cannot be checked.
        found.retain(|problem| !problem.message.starts_with("unknown key"));
    }
    let keys = right_keys(table, entry.node.span, &found, problems);
    problems.append(&mut found);
    let own = own.map(|own| {
        let mut keys = own_keys(table, &common, &own);
        resolve_paths(table, &own, home, &mut keys, problems);
        keys
    });
    let own = own.unwrap_or_default();
    Some(Draft { entry, table, keys, own, plugin, exec, is_right: problems.len() == before })
}

impl Draft<'_> {
    fn wired(&self) -> Wired {
        Wired {
            name: self.entry.key.clone(),
            span: self.span("critical"),
            critical: self.keys.critical,
            plugin: self.plugin.clone(),
        }
    }

    /// Returns the span of `key`, or of the table if it is not set.
    fn span(&self, key: &str) -> Span {
        self.table.entry(key).map_or(self.entry.node.span, |entry| entry.node.span)
    }

    fn behavior(
        &self,
        factory: &Arc<dyn BehaviorFactory>,
        inputs: Vec<Input>,
        robot: Option<&RobotDraft>,
        arbiter: &ArbiterKeys,
        home: Home<'_>,
    ) -> BehaviorFile {
        let keys = &self.keys;
        let sensors: Vec<(String, SensorInfo)> = inputs
            .iter()
            .filter_map(|input| Some((input.slot.clone(), sensor_of(input, robot)?.clone())))
            .collect();
        let fastest = sensors.iter().map(|(_, sensor)| sensor.period_s).fold(f64::INFINITY, f64::min);
        let own_period_ms = match keys.period_ms {
            Some(period_ms) => period_ms,
            None if fastest.is_finite() && fastest > 0.0 => fastest * 1e3,
            None => 1e3 / arbiter.rate_hz.max(1.0),
        };
        let deadline = match keys.deadline_ms {
            Some(deadline_ms) => Deadline::new(milliseconds(deadline_ms)),
            None => Deadline::of_period_ms(own_period_ms),
        };
        let period = match keys.period_ms {
            Some(period_ms) => Some(milliseconds(period_ms)),
            None if keys.critical => Some(deadline.default_period()),
            // Nothing else would ever call it.
            None => inputs.is_empty().then(|| arbiter_period(arbiter)),
        };
        BehaviorFile {
            name: self.entry.key.clone(),
            factory: Arc::clone(factory),
            table: self.own.clone(),
            setup: Setup {
                name: self.entry.key.clone(),
                robot: robot.map(|robot| robot.robot.clone()).unwrap_or_default(),
                folder: home.folder().to_owned(),
                sensors,
                connected: Some(inputs.iter().map(|input| input.slot.clone()).collect()),
            },
            inputs,
            notes: Vec::new(),
            settings: BehaviorSettings {
                priority: keys.priority.unwrap_or(0),
                critical: keys.critical,
                enabled: keys.enabled,
                period,
                budget: keys.budget_ms.map(milliseconds),
                max_age: milliseconds(keys.max_age_ms.unwrap_or(arbiter.max_age_ms)),
                max_evidence_age: milliseconds(
                    keys.max_evidence_age_ms.unwrap_or(arbiter.max_evidence_age_ms),
                ),
                latency_budget: keys.latency_budget_ms.or(arbiter.latency_budget_ms).map(milliseconds),
                hold: milliseconds(keys.hold_ms),
                dwell: milliseconds(keys.dwell_ms),
                sleeps_while_inhibited: keys.sleeps_while_inhibited,
                host: HostSettings {
                    isolation: if self.exec.is_empty() { keys.isolation } else { Isolation::Process },
                    deadline,
                    scheduling: keys.scheduling.scheduling(),
                    exec: self.exec.clone(),
                },
            },
        }
    }

    fn check_switches(&self, problems: &mut Vec<Problem>) {
        if self.keys.critical && !self.keys.enabled {
            problems.push(
                Problem::new(
                    self.span("enabled"),
                    format!("`{}` is critical but not enabled", self.entry.key),
                )
                .label("the robot would never move")
                .also(self.span("critical"), "critical")
                .help("remove one of the two keys"),
            );
        }
    }

    /// Checks that the behavior cannot starve the arbiter of computing time.
    fn check_rank(&self, arbiter: &ArbiterKeys, problems: &mut Vec<Problem>) {
        let (Some(own), arbiters) = (self.keys.scheduling.fifo, arbiter.scheduling.fifo.unwrap_or(0)) else {
            return;
        };
        if own >= arbiters {
            problems.push(
                Problem::new(
                    self.span("scheduling"),
                    format!("`{}` could starve the arbiter of computing time", self.entry.key),
                )
                .label(match arbiters {
                    0 => "the behavior is real-time, the arbiter is not".to_owned(),
                    arbiters => format!("its real-time priority is {own}, the arbiter's is {arbiters}"),
                })
                .help(format!("set scheduling.fifo of [arbiter] to more than {own}")),
            );
        }
    }

    fn check_axes(&self, plugin: &BehaviorInfo, robot: Option<&RobotDraft>, problems: &mut Vec<Problem>) {
        let Some(drive) = robot.and_then(|robot| robot.drive.as_ref()) else { return };
        if !plugin.claims.is_empty() && plugin.claims.intersection(drive.axes).is_empty() {
            problems.push(
                Problem::new(self.entry.node.span, format!("`{}` can never win", self.entry.key))
                    .label(format!(
                        "it drives {} only, but this robot's drive has {}",
                        plugin.claims, drive.axes
                    ))
                    .help("remove the behavior, or use a robot with such a drive"),
            );
        }
    }

    /// Checks maximum ages against the periods of the connected sensors.
    fn check_ages(
        &self,
        behavior: &BehaviorFile,
        tree: &Table,
        robot: Option<&RobotDraft>,
        problems: &mut Vec<Problem>,
    ) {
        let sensors = || behavior.setup.sensors.iter().map(|(_, sensor)| sensor);
        let oldest_s = |sensor: &SensorInfo| sensor.period_s + sensor.latency_s;
        let fastest = sensors().min_by(|a, b| oldest_s(a).total_cmp(&oldest_s(b)));
        let slowest = sensors().max_by(|a, b| oldest_s(a).total_cmp(&oldest_s(b)));
        let checks = [
            ("max_age_ms", behavior.settings.max_age, fastest),
            ("max_evidence_age_ms", behavior.settings.max_evidence_age, slowest),
        ];
        for (key, age, sensor) in checks {
            let Some(sensor) = sensor else { continue };
            if age >= Duration::try_from_secs_f64(oldest_s(sensor)).unwrap_or(Duration::MAX) {
                continue;
            }
            let arbiters = tree
                .span_of(&format!("arbiter.{key}"))
                .filter(|_| tree.table("arbiter").is_some_and(|t| t.entry(key).is_some()));
            let written = self.table.entry(key).map(|entry| entry.node.span).or(arbiters);
            let place = robot.and_then(|robot| robot.sensors.iter().find(|draft| draft.name == sensor.name));
            let oldest_ms = number(oldest_s(sensor) * 1e3);
            let age_ms = number(age.as_secs_f64() * 1e3);
            let mut problem = Problem::new(
                written.unwrap_or(self.entry.node.span),
                format!("most proposals of `{}` would be refused as too old", self.entry.key),
            )
            .label(format!(
                "{key} is {age_ms} ms, but measurements of `{}` reach an age of {oldest_ms} ms: its period plus latency",
                sensor.name
            ))
            .help(format!("raise {key} above {oldest_ms} ms, or use a faster sensor"));
            if let Some(place) = place {
                problem = problem.also(place.span, format!("`{}` is defined here", sensor.name));
            }
            problems.push(problem);
        }
        let timeout = behavior.settings.host.deadline.proposal_timeout();
        if let Some(period) = self.keys.period_ms.map(milliseconds).filter(|period| *period > timeout) {
            problems.push(
                Problem::new(
                    self.span("deadline_ms"),
                    format!(
                        "`deadline_ms` of `{}` is shorter than the time between two calls",
                        self.entry.key
                    ),
                )
                .label(format!("its period is {} ms", number(period.as_secs_f64() * 1e3)))
                .help("raise it, or remove it: the default is three periods"),
            );
        }
    }
}

fn step_too_long(tree: &Table, step: Duration, period: Duration) -> Problem {
    let milliseconds = |duration: Duration| number(duration.as_secs_f64() * 1e3);
    let (step_ms, period_ms) = (milliseconds(step), milliseconds(period));
    let written = |group: &str, key: &str| Some(tree.table(group)?.entry(key)?.node.span);
    let span = written("run", "step_ms").unwrap_or_default();
    let problem = Problem::new(span, format!("`step_ms` = {step_ms} ms is longer than the arbiter's period"))
        .label(format!("the arbiter decides every {period_ms} ms"))
        .help(format!("set step_ms to at most {period_ms}, or remove it: the default is one period"));
    match written("arbiter", "rate_hz") {
        Some(rate) => problem.also(rate, format!("every {period_ms} ms")),
        None => problem,
    }
}

fn sensor_of<'a>(input: &Input, robot: Option<&'a RobotDraft>) -> Option<&'a SensorInfo> {
    let InputSource::Sensor(name) = &input.source else { return None };
    robot?.sensors.iter().find(|sensor| sensor.name == *name)?.info.as_ref()
}

fn check_priorities(drafts: &[Draft<'_>], policy: Policy, problems: &mut Vec<Problem>) {
    if policy == Policy::Blend {
        return;
    }
    // A behavior that never drives cannot contest an axis.
    let drives =
        |draft: &&Draft<'_>| draft.plugin.as_ref().is_none_or(|plugin| !plugin.info().claims.is_empty());
    let drafts: Vec<&Draft<'_>> = drafts.iter().filter(drives).collect();
    for (index, draft) in drafts.iter().enumerate() {
        let Some(priority) = draft.keys.priority else { continue };
        if let Some(first) = drafts[..index].iter().find(|other| other.keys.priority == Some(priority)) {
            let (name, other) = (&draft.entry.key, &first.entry.key);
            problems.push(
                Problem::new(
                    draft.span("priority"),
                    format!("`{name}` and `{other}` have the same priority"),
                )
                .label(format!("both have {priority}"))
                .also(first.span("priority"), format!("`{other}`"))
                .help("change one of them, or set policy = \"blend\" in [arbiter]"),
            );
        }
    }
}

/// Longest time from one command to the next.
fn arbiter_period(arbiter: &ArbiterKeys) -> Duration {
    Duration::from_secs_f64(1.0 / arbiter.rate_hz.max(1.0))
}
