//! Every recorded field is played back bit for bit, those of ticks with single precision, in the order of time, from any moment.

use crate::recording as support;
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

/// Neighbouring ticks with the same commands but for the sign of a zero, a torque that was limited, and more.
#[test]
fn a_command_that_changes_in_its_smallest_part_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("commands.mcap");
    let mut ticks: Vec<Tick> = (0..3000).map(moving_tick).collect();
    for (index, tick) in ticks.iter_mut().enumerate() {
        tick.command.motor[2].position_rad = if index % 700 < 350 { 0.0 } else { -0.0 };
        tick.command.motor[5].kp_joint = [20.0, f64::NAN, 30.0][index / 1000];
        tick.torque_demanded[1] = single(tick.torque_demanded[1] + f64::from(u8::from(index % 3 == 0)));
        tick.limited = u16::from(index % 3 == 0);
    }
    let expected = in_order(&ticks, &[]);
    write(&path, &expected);
    assert_same(&play(&path), &expected);
    // From any moment, and with ticks left out.
    let mut player = Player::open(&path).unwrap();
    for start in [1, 349, 350, 1001, 2345] {
        player.seek(start * MS);
        assert_same(&[player.next().unwrap()], &[Played::Tick(Box::new(ticks[start as usize]))]);
        player.seek_sparse(start * MS, 2_900 * MS, 7);
        let wanted = ticks[start as usize..].iter().filter(|tick| tick.number % 7 == 0 || tick.number >= 2900);
        assert_same(
            &player.by_ref().collect::<Vec<_>>(),
            &wanted.copied().map(Box::new).map(Played::Tick).collect::<Vec<_>>(),
        );
    }
}

#[test]
fn numbers_of_a_tick_have_single_precision() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rounded.mcap");
    let huge = 1.234_567_890_123_456_7e300;
    let numbers = [
        0.1,
        -1.0 / 3.0,
        f64::from(f32::MAX),
        16_777_217.0,
        f64::MAX,
        huge,
        1e-42_f32.into(),
        1.0,
        2.5,
        0.0,
        -0.0,
        3.0,
    ];
    let mut tick = Tick::default();
    tick.state.joint_velocity_rad_s = numbers;
    tick.torque_demanded = numbers;
    tick.estimate.roll_pitch_yaw.z = 0.1;
    write(&path, &[Played::Tick(Box::new(tick))]);
    let [Played::Tick(found)] = &play(&path)[..] else { panic!("one tick was written") };
    for found in [found.state.joint_velocity_rad_s, found.torque_demanded] {
        for (found, number) in found.into_iter().zip(numbers) {
            let expected = if number.abs() <= f64::from(f32::MAX) { single(number) } else { found };
            assert_eq!(found.to_bits(), expected.to_bits(), "{number}");
            assert!((found / number - 1.0).abs() <= 2_f64.powi(-24) || number == 0.0, "{number} is {found}");
        }
    }
    assert_eq!(found.estimate.roll_pitch_yaw.z, single(0.1));
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
    write(&path, &[Played::Tick(Box::new(tick))]);
    let [Played::Tick(found)] = &play(&path)[..] else { panic!("one tick was written") };
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
