//! Tables of the runs through buildings: each run that failed, all together, and by property.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::Run;
use super::bands::{bands, rank, values};
use super::encounter::Encounter;
use crate::report::{Table, number, optional, percent};
use crate::statistics::percentile;

/// Returns the tables of these runs.
pub fn tables(runs: &[Run]) -> Vec<Table> {
    let mut tables = vec![failures(runs), summary(runs)];
    for has_map in [true, false] {
        if runs.iter().any(|run| run.has_map == has_map) {
            tables.push(by_property(runs, has_map));
        }
    }
    tables
}

fn task(has_map: bool) -> &'static str {
    if has_map { "with a map" } else { "without a map" }
}

fn failures(runs: &[Run]) -> Table {
    let columns = [
        "seed",
        "task",
        "end",
        "x, m",
        "of, m",
        "floor",
        "width, m",
        "contacts driven into",
        "touched by a person",
    ];
    let mut table = Table::new("Runs that did not arrive, or had a contact", &columns);
    for run in runs.iter().filter(|run| !run.has_arrived || !run.encounters.is_empty()) {
        let bearings = |driven: bool| {
            let of = run.encounters.iter().filter(|encounter| encounter.is_driven_into() == driven);
            of.map(|encounter| describe(*encounter)).collect::<Vec<_>>().join(", ")
        };
        table.row([
            run.seed.into(),
            task(run.has_map).into(),
            if run.has_arrived { "arrived" } else { "stuck" }.into(),
            number(run.end_x_m, 1),
            number(run.properties.distance_m, 1),
            value_of(run, "floor").into(),
            number(run.properties.width_m, 2),
            bearings(true).into(),
            bearings(false).into(),
        ]);
    }
    table
}

fn describe(encounter: Encounter) -> String {
    match encounter {
        Encounter::Solid => "solid".to_owned(),
        Encounter::IntoPerson { bearing_deg } => format!("person at {bearing_deg:.0} deg"),
        Encounter::TouchedByPerson { bearing_deg } => format!("{bearing_deg:.0} deg"),
    }
}

fn value_of(run: &Run, name: &str) -> String {
    values(&run.properties)
        .into_iter()
        .find_map(|(of, value)| (of == name).then_some(value))
        .unwrap_or_default()
}

fn summary(runs: &[Run]) -> Table {
    let columns = [
        "task",
        "runs",
        "arrived",
        "arrived, %",
        "stuck",
        "drove into something",
        "into people",
        "touched by people",
        "median time, s",
        "min clearance, m",
    ];
    let mut table = Table::new("Summary", &columns);
    for has_map in [true, false] {
        let of: Vec<&Run> = runs.iter().filter(|run| run.has_map == has_map).collect();
        if of.is_empty() {
            continue;
        }
        let arrived = of.iter().filter(|run| run.has_arrived).count();
        let into_people = |run: &Run| {
            run.encounters
                .iter()
                .filter(|encounter| matches!(encounter, Encounter::IntoPerson { .. }))
                .count()
        };
        let times: Vec<f64> = of.iter().filter(|run| run.has_arrived).map(|run| run.time_s).collect();
        let clearance_m = of.iter().filter_map(|run| run.clearance_m).reduce(f64::min);
        table.row([
            task(has_map).into(),
            of.len().into(),
            arrived.into(),
            percent(arrived as f64, of.len() as f64),
            (of.len() - arrived).into(),
            of.iter().map(|run| run.driven_into()).sum::<usize>().into(),
            of.iter().map(|run| into_people(run)).sum::<usize>().into(),
            of.iter().map(|run| run.touched()).sum::<usize>().into(),
            if times.is_empty() { number(f64::NAN, 1) } else { number(percentile(&times, 0.5), 1) },
            optional(clearance_m, 3),
        ]);
    }
    table
}

/// Returns a row for each value or band of each property.
fn by_property(runs: &[Run], has_map: bool) -> Table {
    let columns = [
        "property",
        "value",
        "buildings",
        "arrived",
        "arrived, %",
        "drove into something",
        "touched by people",
    ];
    let mut table = Table::new(format!("By property, {}", task(has_map)), &columns);
    let mut groups: BTreeMap<(usize, &str, String), Vec<&Run>> = BTreeMap::new();
    for run in runs.iter().filter(|run| run.has_map == has_map) {
        for (name, band) in bands(&run.properties) {
            groups.entry((rank(name), name, band)).or_default().push(run);
        }
    }
    for ((_, name, band), runs) in groups {
        let arrived = runs.iter().filter(|run| run.has_arrived).count();
        table.row([
            name.into(),
            band.into(),
            runs.len().into(),
            arrived.into(),
            percent(arrived as f64, runs.len() as f64),
            runs.iter().map(|run| run.driven_into()).sum::<usize>().into(),
            runs.iter().map(|run| run.touched()).sum::<usize>().into(),
        ]);
    }
    table
}

/// Returns a line for each run, with the properties of its building.
pub fn csv(runs: &[Run]) -> String {
    let mut text = String::new();
    if let Some(run) = runs.first() {
        let names: Vec<String> = values(&run.properties).into_iter().map(|(name, _)| name).collect();
        let own = "seed,task,arrived,time_s,end_x_m,driven_into,touched,min_clearance_m,contacts";
        let _ = writeln!(text, "{own},{}", names.join(","));
    }
    for run in runs {
        let contacts: Vec<String> = run.encounters.iter().map(|encounter| describe(*encounter)).collect();
        let clearance = run.clearance_m.map_or(String::new(), |m| format!("{m:.3}"));
        let values: Vec<String> = values(&run.properties).into_iter().map(|(_, value)| value).collect();
        let _ = writeln!(
            text,
            "{},{},{},{:.1},{:.2},{},{},{clearance},{},{}",
            run.seed,
            task(run.has_map),
            run.has_arrived,
            run.time_s,
            run.end_x_m,
            run.driven_into(),
            run.touched(),
            contacts.join("; "),
            values.join(",")
        );
    }
    text
}
