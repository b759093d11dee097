//! The code in the documents is code that is compiled, run or checked.

use std::path::Path;

use yamabico::plugins::plugins;
use yamabico_host::config::{Overrides, load};

const TEMPLATE: &str = include_str!("../templates/behavior/main.rs");
const README: &str = include_str!("../../../README.md");
const TUTORIAL: &str = include_str!("../docs/own-behavior.md");

/// Returns the code blocks of a document in `language`.
fn blocks<'a>(document: &'a str, language: &str) -> Vec<&'a str> {
    let fence = format!("```{language}\n");
    document.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap_or_default()).collect()
}

#[test]
fn rust_in_documents_is_part_of_the_template_that_is_compiled_and_tested() {
    for (name, document, count) in [("README.md", README, 1), ("own-behavior.md", TUTORIAL, 6)] {
        let blocks = blocks(document, "rust");
        assert_eq!(blocks.len(), count, "{name}");
        for block in blocks {
            assert!(
                TEMPLATE.contains(block.trim_end()),
                "{name}: not in templates/behavior/main.rs:\n{block}"
            );
        }
    }
}

#[test]
fn the_task_in_the_readme_is_valid() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs").canonicalize().unwrap();
    let folder = std::env::temp_dir().join(format!("yamabico-readme-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let robots = format!("{}/robots/", configs.display());
    for block in blocks(README, "toml") {
        let path = folder.join("task.toml");
        std::fs::write(&path, block.replace("robots/", &robots)).unwrap();
        let loaded = load(&path, &Overrides::default(), &plugins());
        assert!(loaded.is_ok(), "{}", loaded.err().unwrap());
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn the_readme_fits_on_a_page_and_its_links_lead_somewhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    assert!(README.lines().count() <= 100);
    let documents =
        [("", README), ("", include_str!("../../../ARCHITECTURE.md")), ("arbiter/cli/docs", TUTORIAL)];
    for (folder, document) in documents {
        let targets = document.split("](").skip(1).filter_map(|rest| rest.split(')').next());
        for target in targets.filter(|target| !target.starts_with("http")) {
            assert!(root.join(folder).join(target).exists(), "no {target}");
        }
    }
}
