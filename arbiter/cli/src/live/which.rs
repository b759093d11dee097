//! Which running robot a command is for.

use clap::Args;
use yamabico_host::bus::Bus;
use yamabico_parameters::instead;

/// One of the running robots.
#[derive(Args)]
pub struct Which {
    /// Name of the robot; not needed where only one runs.
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
}

impl Which {
    /// The robot of that name, or the only one that runs.
    ///
    /// # Errors
    /// No such robot runs; without a name, none or several run.
    pub fn choose(&self) -> Result<String, String> {
        choose(self.robot.as_deref(), &Bus::running())
    }
}

fn choose(name: Option<&str>, running: &[String]) -> Result<String, String> {
    match (name, running) {
        (Some(name), running) if running.iter().any(|robot| robot == name) => Ok(name.to_owned()),
        (None, [only]) => Ok(only.clone()),
        (_, []) => {
            let which = name.map_or("no robot".to_owned(), |name| format!("no robot `{name}`"));
            Err(format!("{which} is running; start one with `yamabico run --live FILE`"))
        }
        (Some(name), running) => {
            let instead = instead(name, running.iter().map(String::as_str), "running robot");
            Err(format!("no robot `{name}` is running: {instead}"))
        }
        (None, several) => {
            Err(format!("several robots are running: name one of them with --robot: {}", several.join(", ")))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_robot_is_named_unless_it_is_the_only_one() {
        let run = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert_eq!(choose(None, &run(&["kame"])).as_deref(), Ok("kame"));
        assert_eq!(choose(Some("kame"), &run(&["kame", "tora"])).as_deref(), Ok("kame"));
        assert!(choose(None, &[]).unwrap_err().contains("run --live"));
        assert!(choose(Some("kame"), &[]).unwrap_err().contains("`kame`"));
        assert!(choose(None, &run(&["kame", "tora"])).unwrap_err().contains("kame, tora"));
        assert!(choose(Some("kane"), &run(&["kame", "tora"])).unwrap_err().contains("did you mean `kame`?"));
    }
}
