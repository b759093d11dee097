//! Recordings: events, the state at any time, playback, damaged files.

use std::time::Duration;

use yamabico_view::model::EventKind;
use yamabico_view::recording::{Player, Recording, RecordingError};

use crate::fixture::{CONTACT_S, DURATION_S, Folder, HALT_S, HAND_OVER_S};

#[test]
fn a_recording_tells_its_events_and_the_state_at_any_time() {
    let folder = Folder::new("events");
    let mut recording = Recording::open(&folder.record()).unwrap();
    assert!((recording.duration_s() - (DURATION_S - 0.02)).abs() < 1e-6 && recording.broken_off().is_none());
    let begin = recording.begin();
    let events: Vec<_> = recording
        .events()
        .map(|event| (event.kind, (event.at.seconds_after(begin) + 0.02).round(), event.text.as_str()))
        .collect();
    let expected = [
        (EventKind::HandOver, 0.0, "wall-follower took linear+angular"),
        (EventKind::Halt, HALT_S.0, "sonar-halt halts linear+angular: 0.41 m ahead"),
        (
            EventKind::Release,
            HALT_S.1,
            "sonar-halt released linear+angular after 2.0 s; wall-follower drives",
        ),
        (EventKind::HandOver, HAND_OVER_S, "avoider took linear+angular from wall-follower"),
        (EventKind::Contact, CONTACT_S, "contact at (4.80, 0.00)"),
    ];
    assert_eq!(events, expected);

    let halted = recording.at(HALT_S.0 + 1.0).unwrap();
    let text = halted.explanation().unwrap().to_string();
    assert!(text.contains("halts linear+lateral+angular: 0.41 m ahead"), "{text}");
    let snapshot = halted.snapshot();
    assert_eq!((snapshot.mode, snapshot.behaviors.len()), ("halted", 3));
    assert!((snapshot.scene.truth.as_ref().unwrap().x - 0.4 * 6.02).abs() < 0.01);
    assert!((snapshot.sensors[0].rate_hz - 5.0).abs() < 0.5, "{:?}", snapshot.sensors);
    assert_eq!(snapshot.pictures[0].topic, "sensors/front");
    let picture = halted.pictures().get("sensors/front", None).unwrap();
    assert_eq!((picture.media_type, picture.header.width), ("image/png", 32));
    assert_eq!(halted.setup().0.map, [[[0.0, 1.0], [9.0, 1.0]]]);
    let driving = recording.at(19.0).unwrap().snapshot();
    let avoider = driving.behaviors.iter().find(|behavior| behavior.name == "avoider").unwrap();
    assert!(avoider.drives && (avoider.control_share - 0.5).abs() < 0.1, "{avoider:?}");
    assert!(recording.at(f64::NAN).is_ok() && recording.at(1e9).is_ok());
}

#[test]
fn a_recording_plays_at_any_pace_and_jumps_to_events() {
    let folder = Folder::new("play");
    let mut player = Player::new(Recording::open(&folder.record()).unwrap()).unwrap();
    player.play(10.0).unwrap();
    for _ in 0..5 {
        player.step(Duration::from_millis(100)).unwrap();
    }
    assert!((player.position_s() - 5.0).abs() < 0.1 && player.is_playing(), "{}", player.position_s());
    player.step(Duration::from_millis(100)).unwrap();
    assert_eq!(player.model().snapshot().mode, "halted");
    let contact = player.jump(true, &|event| event.kind == EventKind::Contact).unwrap().unwrap();
    assert!((player.position_s() - contact.at.seconds_after(player.recording().begin())).abs() < 1e-9);
    let halt = player.jump(false, &|event| event.kind == EventKind::Halt).unwrap().unwrap();
    assert!(halt.text.contains("sonar-halt") && player.model().snapshot().mode == "halted");
    assert!(player.jump(false, &|event| event.kind == EventKind::Late).unwrap().is_none());
    // The state is the same, played or jumped to.
    player.seek(8.0).unwrap();
    let jumped = player.model().snapshot();
    player.seek(7.0).unwrap();
    player.play(1.0).unwrap();
    player.step(Duration::from_secs(1)).unwrap();
    assert_eq!(player.model().snapshot().behaviors, jumped.behaviors);
    // A decision every 20 ms, a sample every 60 ms.
    assert_eq!(player.model().strips().samples().count(), 134);
    player.seek(19.5).unwrap();
    player.step(Duration::from_secs(3)).unwrap();
    assert!(!player.is_playing(), "it pauses at the end");
    player.play(f64::INFINITY).unwrap();
    assert!(player.position_s() < 0.1 && player.pace() == 1.0, "it begins again");
}

#[test]
fn damaged_and_foreign_files_are_read_as_far_as_possible_or_refused() {
    let folder = Folder::new("damaged");
    let whole = std::fs::read(folder.record()).unwrap();
    let open = |name: &str, bytes: &[u8]| {
        let path = folder.0.join(name);
        std::fs::write(&path, bytes).unwrap();
        Recording::open(&path)
    };
    let cut = open("cut.mcap", &whole[..whole.len() * 7 / 10]).unwrap();
    assert!(cut.broken_off().is_some() && cut.duration_s() > 5.0, "{}", cut.duration_s());
    for (name, bytes) in
        [("empty.mcap", &b""[..]), ("text.mcap", b"not a recording"), ("head.mcap", &whole[..40])]
    {
        let error = open(name, bytes).map(|_| ()).unwrap_err();
        assert!(matches!(error, RecordingError::NoRecording { .. }), "{name}: {error}");
    }
    let missing = Recording::open(&folder.0.join("missing.mcap")).map(|_| ()).unwrap_err();
    assert!(matches!(missing, RecordingError::NotReadable { .. }), "{missing}");
    // No damage may end in a panic.
    for i in 0..60 {
        let mut damaged = whole.clone();
        for k in 0..40 {
            let at = (i * 7919 + k * 104_729) % damaged.len();
            damaged[at] = damaged[at].wrapping_add(1 + k as u8);
        }
        if let Ok(mut recording) = open("damaged.mcap", &damaged) {
            let _ = recording.at(10.0).map(|model| model.snapshot());
        }
    }
}
