//! The thread that follows the robot or plays the recording, and publishes the state.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use yamabico_runtime::record::Tap;

use super::command::{Answer, Command, Job};
use super::foxglove::{Feed, Foxglove};
use super::hub::{Hub, SourceState};
use crate::live::LiveRobot;
use crate::model::Event;
use crate::recording::{Player, RecordingError};

/// Time between two looks at the robot's topics, and between two steps of a playback.
const STEP: Duration = Duration::from_millis(10);
/// Time between two states for the clients.
const PUBLISH_PERIOD: Duration = Duration::from_millis(100);

/// Follows the robot until `is_over`, for the page and for viewers.
pub(super) fn follow(mut robot: LiveRobot, hub: &Hub, viewers: Option<Arc<Foxglove>>, is_over: &AtomicBool) {
    let mut feed = viewers.map(|viewers| Feed::new(viewers, &mut robot));
    let mut published = Instant::now();
    while !is_over.load(Ordering::Relaxed) {
        robot.step(feed.as_mut().map(|feed| feed as &mut dyn Tap));
        if let Some(feed) = &mut feed {
            feed.update(&mut robot);
        }
        if published.elapsed() >= PUBLISH_PERIOD {
            published = Instant::now();
            robot.ask_for_overlays(hub.is_watched() || feed.as_ref().is_some_and(Feed::wants_overlays));
            let state = SourceState::Robot { is_running: robot.is_running() };
            hub.publish(robot.model(), robot.joins(), &state, None);
        }
        std::thread::sleep(STEP);
    }
}

/// Plays the recording until `is_over`.
pub(super) fn play(mut player: Player, hub: &Arc<Hub>, jobs: &Receiver<Job>, is_over: &AtomicBool) {
    let events: Vec<Event> = player.recording().events().cloned().collect();
    let (mut published, mut stepped) = (Instant::now() - PUBLISH_PERIOD, Instant::now());
    while !is_over.load(Ordering::Relaxed) {
        let mut has_news = false;
        while let Ok(job) = jobs.try_recv() {
            let answer = control(&mut player, &job.command);
            let _ = job.answer.send(answer);
            has_news = true;
        }
        let elapsed = stepped.elapsed();
        stepped = Instant::now();
        if let Err(error) = player.step(elapsed) {
            tracing::error!("{error}");
            player.pause();
        }
        if has_news || published.elapsed() >= PUBLISH_PERIOD {
            published = Instant::now();
            let state = SourceState::Recording {
                position_s: player.position_s(),
                pace: player.pace(),
                is_playing: player.is_playing(),
            };
            hub.publish(player.model(), player.seeks(), &state, Some(&events));
        }
        std::thread::sleep(STEP);
    }
}

fn control(player: &mut Player, command: &Command) -> Answer {
    let to_text = |error: RecordingError| error.to_string();
    match command {
        Command::Play { pace } => player.play(*pace).map_err(to_text).map(|()| "playing".to_owned()),
        Command::Pause => {
            player.pause();
            Ok("paused".to_owned())
        }
        Command::Seek { at_s } => {
            player.seek(*at_s).map_err(to_text).map(|()| format!("at {:.2} s", player.position_s()))
        }
        Command::Jump { forward, kind } => {
            let is_wanted = |event: &Event| kind.is_none_or(|kind| event.kind == kind);
            match player.jump(*forward, &is_wanted).map_err(to_text)? {
                Some(event) => Ok(event.text),
                None => Err(format!("no such event {} here", if *forward { "after" } else { "before" })),
            }
        }
        _ => Err("this is a recording, not a running robot".to_owned()),
    }
}
