//! Every recorded field is played back bit for bit, in the order of time, from any moment.

#[path = "support/recording.rs"]
mod support;

use proptest::prelude::*;
use quadfrog::recording::RecordingError;
use quadfrog::recording::player::{Marker, MarkerKind, Played, Player};
use quadfrog::recording::record::{LogRecord, Record, Stamped};
use quadfrog::recording::writer::Writer;
use quadfrog::telemetry::{Mode, Tick};
use support::*;

fn config() -> ProptestConfig {
    ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn every_tick_comes_back(ticks in prop::collection::vec(any_tick(), 1..8)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ticks.mcap");
        let expected = in_order(&ticks, &[]);
        write(&path, &expected);
        assert_same(&play(&path), &expected);
    }

    #[test]
    fn every_record_comes_back(records in prop::collection::vec((any_record(), any::<u32>()), 1..12)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.mcap");
        let stamped = |(record, time): (Record, u32)| Stamped { time_ns: u64::from(time), record };
        let expected = in_order(&[], &records.into_iter().map(stamped).collect::<Vec<_>>());
        write(&path, &expected);
        assert_same(&play(&path), &expected);
    }

    #[test]
    fn a_small_skew_between_ticks_and_records_is_put_right(late in prop::collection::vec(0..400_usize, 1..40)) {
        // Records that reach the file up to 0.4 s after the ticks of their time, across chunks too.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("skew.mcap");
        let ticks: Vec<_> = (0..1500).map(moving_tick).collect();
        let mut writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
        let mut records = Vec::new();
        for (index, tick) in ticks.iter().enumerate() {
            writer.tick(tick).unwrap();
            if index % 25 == 0 && let Some(late) = late.get(index / 25) {
                let text = format!("line {index}");
                let log = LogRecord { level: quadfrog::recording::record::LogLevel::Info, source: "test".into(), message: text };
                // Each at an instant of its own: records of the very same nanosecond have no order.
                let time_ns = tick.time_ns.saturating_sub(*late as u64 * MS) + 500 + index as u64;
                records.push(Stamped { time_ns, record: Record::Log(log) });
                writer.record(records.last().unwrap()).unwrap();
            }
        }
        writer.finish().unwrap();
        assert_same(&play(&path), &in_order(&ticks, &records));
    }

    #[test]
    fn playing_from_anywhere_gives_the_rest(moments in prop::collection::vec(0..5500_u64, 1..6)) {
        let (path, everything) = shared_study();
        let mut player = Player::open(path).unwrap();
        for ms in moments {
            let from = ms * MS + 1;
            player.seek(from);
            let expected: Vec<_> = everything.iter().filter(|played| played.time_ns() >= from).take(700).cloned().collect();
            let found: Vec<_> = player.by_ref().take(700).collect();
            assert_same(&found, &expected);
        }
    }
}

/// A study of 5 s in a file that all tests of this program share.
fn shared_study() -> (&'static std::path::Path, &'static [Played]) {
    static STUDY: std::sync::OnceLock<(tempfile::TempDir, std::path::PathBuf, Vec<Played>)> =
        std::sync::OnceLock::new();
    let (_, path, everything) = STUDY.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("study.mcap");
        let (ticks, records) = study(5);
        let everything = in_order(&ticks, &records);
        write(&path, &everything);
        (folder, path, everything)
    });
    (path, everything)
}

#[test]
fn the_payload_of_a_nan_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("nan.mcap");
    let patterns = [0x7ff0_0000_dead_beef, 0xfff8_0000_0000_0001, 0x7ff8_0000_0000_0000_u64];
    let mut tick = Tick::default();
    for (joint, pattern) in patterns.into_iter().cycle().take(12).enumerate() {
        tick.state.joint_velocity_rad_s[joint] = f64::from_bits(pattern);
        tick.command.motor[joint].kp_joint = f64::from_bits(pattern);
    }
    tick.theta_rad = f64::from_bits(patterns[0]);
    write(&path, &[Played::Tick(tick)]);
    let [Played::Tick(found)] = play(&path)[..] else { panic!("one tick was written") };
    assert_eq!(found.state.joint_velocity_rad_s.map(f64::to_bits), tick.state.joint_velocity_rad_s.map(f64::to_bits));
    assert_eq!(found.command.motor.map(|m| m.kp_joint.to_bits()), tick.command.motor.map(|m| m.kp_joint.to_bits()));
    assert_eq!(found.theta_rad.to_bits(), patterns[0]);
}

#[test]
fn the_player_knows_the_session_its_length_and_its_markers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("markers.mcap");
    let (mut ticks, records) = study(6);
    for tick in &mut ticks[5900..] {
        tick.mode = Mode::Fault;
    }
    write(&path, &in_order(&ticks, &records));
    let player = Player::open(&path).unwrap();
    assert_eq!(player.session(), &session());
    assert_eq!(player.start_utc_ns(), START_UTC_NS);
    assert_eq!(player.duration_ns(), 5999 * MS);
    let trial = |trial, ms: u64| Marker { time_ns: ms * MS, kind: MarkerKind::Trial(trial) };
    let fault = Marker { time_ns: 5900 * MS, kind: MarkerKind::Fault };
    assert_eq!(player.markers(), [trial(0, 1000), trial(1, 3000), trial(2, 5000), fault]);
}

#[test]
fn attachments_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("attached.mcap");
    let attachments: [(&str, &str, &[u8]); 2] =
        [("config.toml", "application/toml", b"[gains]\nkp = 400.0\n"), ("go1.urdf", "application/xml", b"<robot/>")];
    Writer::create(&path, &session(), START_UTC_NS, &attachments).unwrap().finish().unwrap();
    let mut player = Player::open(&path).unwrap();
    for (name, _, bytes) in attachments {
        assert_eq!(player.attachment(name).unwrap().as_deref(), Some(bytes), "{name}");
    }
    assert_eq!(player.attachment("keymap.toml").unwrap(), None);
}

#[test]
fn a_recording_has_its_name_only_when_it_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/folder/session.mcap");
    let part = folder.path().join("new/folder/session.mcap.part");
    let mut writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
    assert!(part.exists() && !path.exists());
    let begun = writer.bytes();
    assert_eq!(std::fs::metadata(&part).unwrap().len(), begun);
    for number in 0..10 {
        writer.tick(&moving_tick(number)).unwrap();
    }
    writer.flush().unwrap();
    assert_eq!(writer.ticks(), 10);
    assert!(writer.bytes() > begun);
    assert_eq!(std::fs::metadata(&part).unwrap().len(), writer.bytes());
    // A second recording of the same name would take the first one's place.
    let second = Writer::create(&path, &session(), START_UTC_NS, &[]);
    assert!(matches!(second, Err(RecordingError::Exists { path: in_the_way }) if in_the_way == part));
    assert_eq!(writer.finish().unwrap(), path);
    assert!(path.exists() && !part.exists());
    let third = Writer::create(&path, &session(), START_UTC_NS, &[]);
    assert!(matches!(third, Err(RecordingError::Exists { path: in_the_way }) if in_the_way == path));
    let unnamed = Writer::create(folder.path().join("session.bag"), &session(), START_UTC_NS, &[]);
    assert!(matches!(unnamed, Err(RecordingError::Name { .. })));
}
