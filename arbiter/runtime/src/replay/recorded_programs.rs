//! External programs that the files of a recording name: where they were when it was recorded.

use std::os::unix::fs::symlink;
use std::path::{Component, Path, PathBuf};

use yamabico_host::config::program_for;

/// An external program in an attached file or in a change of the task.
pub(super) struct RecordedProgram {
    /// Folder of the file that names it, relative to the root of the attached files.
    folder: PathBuf,
    /// The program and its arguments.
    pub words: Vec<String>,
}

/// Programs that the attached `files` and the changes `set` name.
pub(super) fn programs_of(files: &[(String, String)], set: &[String]) -> Vec<RecordedProgram> {
    let mut found = Vec::new();
    for (name, text) in files {
        let folder = Path::new(name).parent().unwrap_or(Path::new("")).to_owned();
        if let Ok(table) = text.parse::<toml::Table>() {
            collect(&table, &folder, &mut found);
            collect_without_exec(&table, &mut found);
        }
    }
    let changes = set.iter().filter_map(|set| words_of(set));
    found.extend(changes.map(|words| RecordedProgram { folder: PathBuf::new(), words }));
    found
}

fn collect(table: &toml::Table, folder: &Path, found: &mut Vec<RecordedProgram>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => collect(inner, folder, found),
            toml::Value::Array(words) if key == "exec" => {
                let words = words.iter().map(|word| word.as_str().unwrap_or_default().to_owned()).collect();
                found.push(RecordedProgram { folder: folder.to_owned(), words });
            }
            toml::Value::Array(items) => {
                items.iter().filter_map(toml::Value::as_table).for_each(|item| collect(item, folder, found));
            }
            _ => {}
        }
    }
}

/// Collects the programs that other keys stand for.
fn collect_without_exec(table: &toml::Table, found: &mut Vec<RecordedProgram>) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => collect_without_exec(inner, found),
            other => {
                let program = program_for(key, other.as_str().unwrap_or_default());
                let words = program.map(|words| words.map(str::to_owned).to_vec());
                found.extend(words.map(|words| RecordedProgram { folder: PathBuf::new(), words }));
            }
        }
    }
}

/// Words of the program in an assignment `behaviors.NAME.exec=[...]`; `None` if it sets something else.
pub(super) fn words_of(set: &str) -> Option<Vec<String>> {
    let mut found = Vec::new();
    collect(&set.parse::<toml::Table>().ok()?, Path::new(""), &mut found);
    found.into_iter().next().map(|program| program.words)
}

/// Word of a program with its path, if it is one, relative to `folder` made absolute.
pub(super) fn absolute_word(word: &str, folder: &Path) -> String {
    match word.contains('/') && Path::new(word).is_relative() {
        true => folder.join(word).to_string_lossy().into_owned(),
        false => word.to_owned(),
    }
}

impl RecordedProgram {
    /// Makes the relative paths of the program, which begin at the files' folder in `root`, lead there from their copy in
    /// `unpacked`. A folder is linked as a whole: an interpreter finds its environment beside it.
    ///
    /// # Errors
    /// A link cannot be made.
    pub fn link(&self, root: &Path, unpacked: &Path) -> std::io::Result<()> {
        for word in self.words.iter().filter(|word| word.contains('/') && Path::new(word).is_relative()) {
            let mut at = self.folder.clone();
            for part in Path::new(word).components() {
                match part {
                    Component::Normal(name) => at.push(name),
                    Component::ParentDir if at.pop() => continue,
                    Component::CurDir => continue,
                    // Outside of what was attached.
                    _ => break,
                }
                let copy = unpacked.join(&at);
                if copy.symlink_metadata().is_ok_and(|data| data.is_symlink()) {
                    break;
                }
                if !copy.exists() {
                    if let Some(parent) = copy.parent() {
                        std::fs::create_dir_all(parent)?;
                    }
                    symlink(root.join(&at), copy)?;
                    break;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_are_found_in_tables_lists_and_changes() {
        let text = "[behaviors.a]\nexec = [\"python3\", \"./a.py\"]\n[[inhibit]]\nby = \"a\"\n";
        let set = ["behaviors.b.exec=[\"bin/b\"]".to_owned(), "run.duration_s=3".to_owned()];
        let found = programs_of(&[("tasks/t.toml".into(), text.into())], &set);
        let words: Vec<_> = found.iter().map(|program| program.words.join(" ")).collect();
        assert_eq!(words, ["python3 ./a.py", "bin/b"]);
        assert_eq!(found[0].folder, Path::new("tasks"));
        assert_eq!(
            (absolute_word("bin/b", Path::new("/x")), absolute_word("b", Path::new("/x"))),
            ("/x/bin/b".into(), "b".into())
        );
        let text = "[behaviors.nav2]\nros2_twist = \"/cmd_vel\"\n[devices.base]\ndriver = \"ros2\"\n[devices.arm]\ndriver = \"sim\"\n";
        let found = programs_of(&[("t.toml".into(), text.into())], &[]);
        let words: Vec<_> = found.iter().map(|program| program.words.join(" ")).collect();
        assert_eq!(words, ["yamabico-ros2 twist", "yamabico-ros2 driver"]);
        assert!(words_of("run.duration_s=3").is_none() && words_of("nonsense").is_none());
    }

    #[test]
    fn relative_paths_lead_to_the_folder_of_the_recorded_run() {
        let base = std::env::temp_dir().join(format!("yamabico-programs-{}", std::process::id()));
        let (root, copy) = (base.join("root"), base.join("copy"));
        std::fs::create_dir_all(root.join("tasks/venv/bin")).unwrap();
        std::fs::create_dir_all(copy.join("tasks")).unwrap();
        for file in ["tasks/venv/bin/python", "tasks/a.py", "b.py"] {
            std::fs::write(root.join(file), file).unwrap();
        }
        let words =
            ["venv/bin/python", "./a.py", "../b.py", "../../outside", "-m"].map(str::to_owned).to_vec();
        let program = RecordedProgram { folder: "tasks".into(), words };
        program.link(&root, &copy).unwrap();
        program.link(&root, &copy).unwrap();
        for file in ["tasks/venv/bin/python", "tasks/a.py", "b.py"] {
            assert_eq!(std::fs::read_to_string(copy.join(file)).unwrap(), file);
        }
        std::fs::remove_dir_all(base).unwrap();
    }
}
