//! The sources speak one language: American spelling, MAX and MIN for bounds, docs that open with a noun or a verb.

use std::path::{Path, PathBuf};

/// British spellings, in any case and inside identifiers.
const BRITISH: [&str; 23] = [
    "behaviour",
    "colour",
    "grey",
    "centre",
    "metre",
    "neighbour",
    "localis",
    "normalis",
    "recognis",
    "optimis",
    "quantis",
    "regularis",
    "initialis",
    "symmetris",
    "vectoris",
    "labell",
    "travell",
    "modell",
    "favour",
    "artefact",
    "catalogue",
    "anticlockwise",
    "skirting",
];

/// Words that contain one of these but are no British spelling, and names in files of known answers.
const ALLOWED: &[&str] = &[
    "frametree",
    "optimistic",
    "normalised_vp",
    "left_of_centre",
    "left of centre",
    "right of centre",
    "localisation lost",
    "\"centred\"",
    "row_at_centre",
    "of(\"skirting\")",
];

/// First words with which no doc comment opens: the noun or the verb comes first.
const RIDDLES: [&str; 11] = [
    "What ", "Whose ", "Of ", "Who ", "Whoever ", "Where ", "How ", "Whether ", "Those ", "That of ",
    "Nobody ",
];

#[test]
fn the_spelling_is_american() {
    let mut found = Vec::new();
    for (path, line, text) in lines(&["rs", "md", "toml", "py"]) {
        let mut lower = text.to_lowercase();
        for allowed in ALLOWED {
            lower = lower.replace(*allowed, "");
        }
        if let Some(word) = BRITISH.iter().find(|word| lower.contains(**word)) {
            found.push(format!("{}:{line}: {word}", path.display()));
        }
    }
    assert!(found.is_empty(), "write it the American way:\n{}", found.join("\n"));
}

#[test]
fn bounds_are_named_max_and_min() {
    let starts = |text: &str, prefix: &str| {
        let names = text.split(|c: char| !c.is_alphanumeric() && c != '_');
        names.into_iter().any(|name| name.starts_with(prefix))
    };
    let found: Vec<_> = lines(&["rs", "py"])
        .into_iter()
        .filter(|(_, _, text)| starts(text, concat!("MO", "ST_")) || starts(text, concat!("LEA", "ST_")))
        .map(|(path, line, text)| format!("{}:{line}: {}", path.display(), text.trim()))
        .collect();
    assert!(found.is_empty(), "name bounds MAX_ or MIN_:\n{}", found.join("\n"));
}

#[test]
fn docs_open_with_a_noun_or_a_verb() {
    let mut found = Vec::new();
    let mut before = (PathBuf::new(), String::new());
    let mut docs = 0;
    for (path, line, text) in lines(&["rs"]) {
        let trimmed = text.trim_start();
        let doc = trimmed.strip_prefix("/// ").or_else(|| trimmed.strip_prefix("//! "));
        let continues = before.0 == path && (before.1.starts_with("///") || before.1.starts_with("//!"));
        if let Some(doc) = doc.filter(|_| !continues) {
            docs += 1;
            if RIDDLES.iter().any(|riddle| doc.starts_with(riddle)) {
                found.push(format!("{}:{line}: {doc}", path.display()));
            }
        }
        before = (path, trimmed.to_owned());
    }
    assert!(docs > 1000, "only {docs} doc comments were read");
    assert!(found.is_empty(), "{} of {docs} docs open with a riddle:\n{}", found.len(), found.join("\n"));
}

/// Every line of the sources with these extensions: path from the root, number from 1, text.
fn lines(extensions: &[&str]) -> Vec<(PathBuf, usize, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the root");
    let mut found = Vec::new();
    visit(root, root, extensions, &mut found);
    assert!(found.len() > 1000, "only {} lines were read", found.len());
    found
}

fn visit(root: &Path, folder: &Path, extensions: &[&str], found: &mut Vec<(PathBuf, usize, String)>) {
    let skipped = ["target", "vectors", "out"];
    let entries = std::fs::read_dir(folder).expect("a folder");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        if path.is_dir()
            && !name.starts_with('.')
            && !skipped.contains(&name.as_str())
            && !name.contains("venv")
        {
            visit(root, &path, extensions, found);
        } else if path.extension().and_then(|e| e.to_str()).is_some_and(|e| extensions.contains(&e))
            && name != "language.rs"
            && let Ok(text) = std::fs::read_to_string(&path)
        {
            let path = path.strip_prefix(root).expect("below the root").to_owned();
            found.extend(text.lines().enumerate().map(|(i, line)| (path.clone(), i + 1, line.to_owned())));
        }
    }
}
