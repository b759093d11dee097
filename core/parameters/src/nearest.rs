//! Suggestions for misspelled names.

/// Returns the name most similar to `wrong`, or `None` if no name is similar.
pub fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |name: &str| name.to_lowercase().replace('_', "-");
    let wrong = plain(wrong);
    let closeness = |name: &str| {
        let name = plain(name);
        let long_enough = wrong.len() >= 3 && name.len() >= 3;
        if name == wrong {
            return 2.0;
        }
        let begins = long_enough && (name.starts_with(&wrong) || wrong.starts_with(&name));
        let letters = strsim::jaro_winkler(&wrong, &name)
            .min(0.2 + strsim::normalized_damerau_levenshtein(&wrong, &name));
        if begins { letters.max(0.8) } else { letters }
    };
    names
        .into_iter()
        .map(|name| (closeness(name), name))
        .filter(|(closeness, _)| *closeness > 0.75)
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, name)| name)
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
    }

    #[test]
    fn without_a_similar_name_all_are_listed() {
        assert_eq!(instead("zzz", ["b", "a"], "sensor"), "available: `a`, `b`");
        assert_eq!(instead("zzz", [], "sensor"), "no sensor is available");
    }
}
