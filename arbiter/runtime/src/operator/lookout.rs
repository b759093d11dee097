//! What somebody outside sees of a robot's decisions.

use std::time::{Duration, Instant};

use yamabico_core::message::{DecisionHeader, ProcessesHeader, Proposal, RosterHeader};
use yamabico_host::bus::{Bus, BusError, Subscriber, Waiter};

use crate::execution::{Roster, topics};
use yamabico_arbiter::decide::{Scene, Terms, Told};

/// How long a robot may take to say who it is.
const PATIENCE: Duration = Duration::from_secs(3);
/// From one look to the next.
const PAUSE: Duration = Duration::from_millis(5);

/// A running robot does not say what somebody wants to know.
#[derive(Debug, thiserror::Error)]
pub enum LookError {
    /// No such robot runs, or the bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// It says nothing.
    #[error("the robot does not say who works on it: it is coming up, ending, or it hangs")]
    NoRoster,
    /// It says something else.
    #[error("the robot's roster is of another version: build both from one version ({0})")]
    Roster(#[from] serde_json::Error),
    /// It decides nothing.
    #[error("the robot decides nothing: it is coming up, ending, or it hangs and its drive has braked")]
    NoDecision,
}

/// A view of a robot's decisions.
pub struct Lookout {
    roster: Roster,
    waiter: Waiter,
    decisions: Subscriber<DecisionHeader>,
    proposals: Vec<Subscriber<Proposal>>,
    processes: Subscriber<ProcessesHeader>,
    scene: Scene,
}

impl Roster {
    /// That of the robot on `bus`.
    ///
    /// # Errors
    /// It does not tell it in time.
    pub fn of_robot(bus: &Bus) -> Result<Roster, LookError> {
        let subscriber = bus.subscriber::<RosterHeader>(topics::ROSTER)?;
        let began = Instant::now();
        loop {
            if let Some(told) = subscriber.newest()? {
                return Ok(serde_json::from_slice(told.items())?);
            }
            if began.elapsed() > PATIENCE {
                return Err(LookError::NoRoster);
            }
            std::thread::sleep(PAUSE);
        }
    }
}

impl Lookout {
    /// Joins the running robot of this name.
    ///
    /// # Errors
    /// No such robot runs, or it does not say who works on it.
    pub fn join(robot: &str) -> Result<Lookout, LookError> {
        let bus = Bus::join(robot)?;
        let roster = Roster::of_robot(&bus)?;
        let behaviors = || roster.plugins.iter().filter_map(|plugin| Some((plugin, plugin.behavior?)));
        let proposals = behaviors().map(|(plugin, _)| bus.subscriber(&topics::proposal(&plugin.name)));
        let terms = behaviors().map(|(plugin, duties)| Terms {
            behavior: plugin.name.clone(),
            max_age_s: duties.max_age_s,
            max_evidence_age_s: duties.max_evidence_age_s,
            deadline_s: duties.deadline_s,
        });
        Ok(Lookout {
            waiter: bus.waiter(&[topics::DECISION])?,
            decisions: bus.subscriber(topics::DECISION)?,
            proposals: proposals.collect::<Result<_, _>>()?,
            processes: bus.subscriber(topics::PROCESSES)?,
            scene: Scene { terms: terms.collect(), ..Scene::default() },
            roster,
        })
    }

    /// Who works on the robot.
    pub fn roster(&self) -> &Roster {
        &self.roster
    }

    /// What is known besides the decision looked at last.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The newest decision that was not looked at yet, waited for if need be; `None` where none comes in time.
    ///
    /// # Errors
    /// The transport failed.
    pub fn look(&mut self, longest: Duration) -> Result<Option<Told>, BusError> {
        let began = Instant::now();
        loop {
            if let Some(told) = self.newest()? {
                return Ok(Some(told));
            }
            let Some(left) = longest.checked_sub(began.elapsed()) else { return Ok(None) };
            self.waiter.wait(left)?;
        }
    }

    /// The newest decision, after everybody had the time to say something that is not known yet.
    ///
    /// # Errors
    /// The robot decides nothing.
    pub fn look_around(&mut self, time: Duration) -> Result<Told, LookError> {
        let began = Instant::now();
        let mut newest = self.look(PATIENCE)?.ok_or(LookError::NoDecision)?;
        while let Some(left) = time.checked_sub(began.elapsed())
            && (self.scene.proposals.len() < self.proposals.len() || self.waits_for_processes())
        {
            newest = self.look(left)?.unwrap_or(newest);
        }
        Ok(newest)
    }

    /// Whether the supervisor has not told of its processes yet.
    fn waits_for_processes(&self) -> bool {
        self.scene.processes.is_empty() && self.roster.plugins.iter().any(|plugin| plugin.own_process)
    }

    fn newest(&mut self) -> Result<Option<Told>, BusError> {
        let told = self.decisions.newest()?;
        let told = told.map(|told| Told { header: *told.header(), verdicts: told.items().to_vec() });
        for subscriber in &self.proposals {
            let Some(proposal) = subscriber.newest()?.map(|proposal| *proposal.header()) else { continue };
            match self.scene.proposals.iter_mut().find(|known| known.behavior == proposal.behavior) {
                Some(known) => *known = proposal,
                None => self.scene.proposals.push(proposal),
            }
        }
        if let Some(processes) = self.processes.newest()? {
            self.scene.processes = processes.items().to_vec();
        }
        Ok(told)
    }
}
