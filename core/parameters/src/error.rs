//! Error of a parameter value.

/// Words with which a problem continues the sentence that its key begins: "`gate_m` must be ...".
const VERBS: [&str; 16] = [
    "is",
    "are",
    "were",
    "covers",
    "has",
    "have",
    "must",
    "cannot",
    "lies",
    "needs",
    "names",
    "equals",
    "exceeds",
    "extends",
    "duplicates",
    "refers",
];

/// Parameter with an invalid value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}{}", self.sentence(&self.subject()), self.remedy.iter().map(|remedy| format!("; {remedy}")).collect::<String>())]
pub struct ParameterError {
    /// Dotted key to change; empty for the whole table.
    pub key: String,
    /// Description of the error: a sentence, or the rest of one that begins with the key, such as "must be above min_m".
    pub problem: String,
    /// Remedy, unless the description contains it.
    pub remedy: Option<String>,
}

impl ParameterError {
    /// Creates the error `problem` of `key`.
    pub fn new(key: impl Into<String>, problem: impl Into<String>) -> ParameterError {
        ParameterError { key: key.into(), problem: problem.into(), remedy: None }
    }

    /// Sets the remedy.
    pub fn remedy(self, remedy: impl Into<String>) -> ParameterError {
        ParameterError { remedy: Some(remedy.into()), ..self }
    }

    /// Returns the problem as a sentence about `subject`, such as the key or the file that contains it.
    pub fn sentence(&self, subject: &str) -> String {
        let first = self.problem.split(' ').next().unwrap_or("");
        match (subject, VERBS.contains(&first)) {
            ("", _) => self.problem.clone(),
            (subject, true) => format!("{subject} {}", self.problem),
            (subject, false) => format!("{subject}: {}", self.problem),
        }
    }

    fn subject(&self) -> String {
        if self.key.is_empty() { String::new() } else { format!("`{}`", self.key) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_problem_continues_the_sentence_or_follows_a_colon() {
        let text = |key: &str, problem: &str| ParameterError::new(key, problem).to_string();
        assert_eq!(text("max_m", "must be above min_m"), "`max_m` must be above min_m");
        assert_eq!(text("files", "no image is named so"), "`files`: no image is named so");
        assert_eq!(text("", "must have a table"), "must have a table");
        let missing = ParameterError::new("map", "is missing").remedy("add map = \"FILE\"");
        assert_eq!(missing.to_string(), "`map` is missing; add map = \"FILE\"");
    }
}
