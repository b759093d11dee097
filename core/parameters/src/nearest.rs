//! Suggestions for misspelled names.

/// Returns the name most similar to `wrong`, or `None` if no name is similar. A name is similar if at most a third of its
/// letters differ, or if it begins with `wrong` and is at most twice as long.
pub fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace('_', "-");
    let wrong = plain(wrong);
    let distance = |name: &str| {
        let name = plain(name);
        let (long, short) = (name.len().max(wrong.len()), name.len().min(wrong.len()));
        let begins = name.starts_with(&wrong) || wrong.starts_with(&name);
        let letters = strsim::damerau_levenshtein(&wrong, &name);
        let is_near = letters < long && (3 * letters <= long.max(3) || (begins && 2 * short >= long));
        is_near.then_some(letters)
    };
    let near = names.into_iter().filter_map(|name| Some((distance(name)?, name)));
    near.min_by_key(|(distance, _)| *distance).map(|(_, name)| name)
}

/// Returns "did you mean ...?" if one of `names` is similar to `wrong`, else a list of all names. `what` is the kind of
/// thing that they name.
pub fn instead<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>, what: &str) -> String {
    let mut names: Vec<&str> = names.into_iter().collect();
    if let Some(name) = nearest(wrong, names.iter().copied()) {
        return format!("did you mean `{name}`?");
    }
    names.sort_unstable();
    names.dedup();
    match names.as_slice() {
        [] => format!("no {what} is available"),
        [one] => format!("the only {what} is `{one}`"),
        many => format!("available: {}", quoted(many)),
    }
}

/// Joins the names as `a`, `b`, `c`.
pub fn quoted(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelled_name_is_found() {
        let names = ["priority", "period_ms", "max_age_ms", "critical"];
        assert_eq!(nearest("prioritty", names), Some("priority"));
        assert_eq!(nearest("max_age", names), Some("max_age_ms"));
        assert_eq!(nearest("max-age-ms", names), Some("max_age_ms"));
        assert_eq!(nearest("gain", names), None);
        assert_eq!(nearest("front-sonr", ["front", "front-sonar"]), Some("front-sonar"));
        assert_eq!(nearest("rnu", ["new", "run", "reset"]), Some("run"));
    }

    #[test]
    fn names_that_are_not_similar_are_not_suggested() {
        assert_eq!(nearest("foo", ["footprint", "run", "goto"]), None);
        assert_eq!(nearest("missing", ["mapping", "hallway"]), None);
        assert_eq!(nearest("", ["a", "b"]), None);
    }

    #[test]
    fn without_a_similar_name_all_are_listed() {
        assert_eq!(instead("zzz", ["b", "a"], "sensor"), "available: `a`, `b`");
        assert_eq!(instead("zzz", [], "sensor"), "no sensor is available");
    }
}
