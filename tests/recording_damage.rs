//! Truncated, damaged and foreign files: everything readable is played and recovered, the rest is reported.

#[path = "support/recording.rs"]
mod support;

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use mcap::read::ChunkReader;
use mcap::records::Record as McapRecord;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use proptest::prelude::*;
use quadfrog::recording::RecordingError;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::record::Record;
use quadfrog::recording::recover::recover;
use quadfrog::recording::writer::Writer;
use support::*;

/// A study of 4 s: the bytes of its file before and after finishing, and its content.
struct Whole {
    finished: Vec<u8>,
    part: Vec<u8>,
    everything: Vec<Played>,
}

fn whole() -> &'static Whole {
    static WHOLE: OnceLock<Whole> = OnceLock::new();
    WHOLE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("whole.mcap");
        let (ticks, records) = study(4);
        let everything = in_order(&ticks, &records);
        let attachment: [(&str, &str, &[u8]); 1] = [("config.toml", "application/toml", b"kp = 400.0\n")];
        let mut writer = Writer::create(&path, &session(), START_UTC_NS, &attachment).unwrap();
        write_all(&mut writer, &everything);
        writer.flush().unwrap();
        let part = fs::read(folder.path().join("whole.mcap.part")).unwrap();
        writer.finish().unwrap();
        Whole { finished: fs::read(&path).unwrap(), part, everything }
    })
}

/// Counts the ticks and records in the complete chunks of `bytes` with the MCAP library's reader.
fn in_complete_chunks(bytes: &[u8]) -> usize {
    let options = LinearReaderOptions::default().with_emit_chunks(true).with_skip_end_magic(true);
    let mut reader = LinearReader::new_with_options(options);
    let (mut unread, mut topics, mut count) = (bytes, HashMap::new(), 0);
    while let Some(Ok(event)) = reader.next_event() {
        let (opcode, data) = match event {
            LinearReadEvent::Record { opcode, data } => (opcode, data),
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = unread.split_at(wanted.min(unread.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                unread = later;
                continue;
            }
        };
        let McapRecord::Chunk { header, data } = mcap::parse_record(opcode, data).unwrap() else { continue };
        for record in ChunkReader::new(header, &data).unwrap() {
            match record.unwrap() {
                McapRecord::Channel(channel) => drop(topics.insert(channel.id, channel.topic)),
                McapRecord::Message { header, .. } => {
                    let others = ["/robot/joint_states", "/robot/joint_cmd", "/robot/pose", "/tf", "/marker"];
                    count += usize::from(!others.contains(&topics[&header.channel_id].as_str()));
                }
                _ => {}
            }
        }
    }
    count
}

/// Like `assert_same` by `==`, which is quicker: there is no NaN and no -0.0 in this study.
fn assert_equal(found: &[Played], expected: &[Played]) {
    assert_eq!(found.len(), expected.len(), "another number of ticks and records");
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!(found == expected, "number {index} differs\n   found: {found:?}\nexpected: {expected:?}");
    }
}

fn file(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

fn play_damaged(path: &Path) -> Result<(Vec<Played>, Option<String>), RecordingError> {
    let mut player = Player::open(path)?;
    let mut played: Vec<_> = player.by_ref().collect();
    assert!(matches!(&played.remove(0), Played::Record(stamped) if matches!(stamped.record, Record::Session(_))));
    Ok((played, player.damage()))
}

fn cut_at(length: usize, of: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "session.mcap.part", &of[..length]);
    // The library's reader counts the session's first message too.
    let expected = in_complete_chunks(&of[..length]).checked_sub(1);
    match (play_damaged(&path), expected) {
        (Ok((played, damage)), Some(expected)) => {
            assert_eq!(played.len(), expected, "cut after {length} bytes");
            assert_equal(&played, &whole().everything[..expected]);
            let damage = damage.expect("a truncated file is damaged");
            assert!(damage.starts_with(&path.display().to_string()), "{damage}");
            let recovered = recover(&path).unwrap();
            assert_eq!(recovered.path, folder.path().join("session.mcap"));
            let ticks = played.iter().filter(|played| matches!(played, Played::Tick(_))).count();
            assert_eq!(recovered.ticks, ticks as u64);
            let (again, damage) = play_damaged(&recovered.path).unwrap();
            assert_eq!(damage, None);
            assert_equal(&again, &played);
            let mut player = Player::open(&recovered.path).unwrap();
            assert_eq!(player.attachment("config.toml").unwrap().as_deref(), Some(&b"kp = 400.0\n"[..]));
            assert_eq!(fs::read(&path).unwrap(), &of[..length], "the old file is left as it was");
            assert!(matches!(recover(&path), Err(RecordingError::Exists { .. })));
        }
        (Err(RecordingError::Empty { .. } | RecordingError::TooShort { .. }), None) => {
            assert!(matches!(recover(&path), Err(RecordingError::Empty { .. } | RecordingError::TooShort { .. })));
        }
        (found, expected) => {
            panic!("cut after {length} bytes: {expected:?} expected, {:?}", found.map(|(p, _)| p.len()))
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_file_cut_anywhere_plays_and_recovers_every_complete_chunk(place in 0.0..1.0_f64) {
        let bytes = &whole().part;
        cut_at((place * bytes.len() as f64) as usize, bytes);
    }

    #[test]
    fn a_finished_file_cut_in_its_index_loses_nothing(place in 0.0..1.0_f64) {
        let Whole { finished, part, .. } = whole();
        cut_at(part.len() + (place * (finished.len() - part.len()) as f64) as usize, finished);
    }

    #[test]
    fn a_file_cut_near_its_beginning_is_reported(length in 0..20_000_usize) {
        cut_at(length, &whole().part);
    }

    #[test]
    fn wrong_bytes_are_never_played(places in prop::collection::vec((0.0..1.0_f64, 1..=255_u8), 1..4)) {
        // A checksum guards every chunk: everything played was recorded.
        let mut bytes = whole().finished.clone();
        for (place, flip) in places {
            let at = 8 + (place * (bytes.len() - 8) as f64) as usize;
            bytes[at] ^= flip;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = file(folder.path(), "session.mcap", &bytes);
        if let Ok((played, _)) = play_damaged(&path) {
            // In the order of time, as everything is, with holes.
            let mut everything = whole().everything.iter();
            for played in &played {
                prop_assert!(everything.any(|recorded| recorded == played), "{played:?} was never recorded");
            }
        }
        let _ = recover(&path); // must not panic
    }
}

#[test]
fn a_damaged_chunk_is_left_out_and_reported() {
    let Whole { finished, everything, .. } = whole();
    let mut bytes = finished.clone();
    // The largest chunk holds ticks.
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    let chunk = summary.chunk_indexes.iter().max_by_key(|chunk| chunk.chunk_length).unwrap();
    let middle = (chunk.chunk_start_offset + chunk.chunk_length / 2) as usize;
    bytes[middle..middle + 8].iter_mut().for_each(|byte| *byte ^= 0x55);
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "session.mcap", &bytes);
    let (played, damage) = play_damaged(&path).unwrap();
    let missing = everything.len() - played.len();
    assert!((50..300).contains(&missing), "one chunk of ticks is missing, not {missing}");
    assert_equal(&played[..500], &everything[..500]);
    assert_equal(&played[played.len() - 500..], &everything[everything.len() - 500..]);
    let damage = damage.unwrap();
    assert!(damage.contains("1 of ") && damage.contains("chunks are damaged and left out"), "{damage}");
    let recovered = recover(&path).unwrap();
    assert_eq!(recovered.path, folder.path().join("session.recovered.mcap"));
    assert!(recovered.lost.unwrap().starts_with("1 of "));
    assert_equal(&play_damaged(&recovered.path).unwrap().0, &played);
}

#[test]
fn a_damaged_index_is_ignored() {
    // The index is where the finished file is longer; every byte of it is under a checksum.
    let Whole { finished, part, everything } = whole();
    let folder = tempfile::tempdir().unwrap();
    for part_of_it in [0.2, 0.5, 0.9, 0.99, 0.999] {
        let mut bytes = finished.clone();
        let at = part.len() + (part_of_it * (finished.len() - part.len()) as f64) as usize;
        bytes[at] ^= 0x10;
        let (played, damage) = play_damaged(&file(folder.path(), "session.mcap", &bytes)).unwrap();
        assert_eq!(damage, None, "all of the data is there");
        assert_equal(&played, everything);
    }
}

#[test]
fn a_damaged_beginning_is_reported() {
    let mut bytes = whole().part.clone();
    let proto = include_str!("../proto/frog.proto");
    bytes[2000 + proto.len()] ^= 0x10; // in the first chunk, after metadata and attachments
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "session.mcap.part", &bytes);
    let error = Player::open(&path).err().expect("its channels are not known");
    assert!(matches!(error, RecordingError::Head { .. }), "{error}");
    assert!(matches!(recover(&path), Err(RecordingError::Head { .. })));
}

#[test]
fn a_file_that_was_finished_and_never_renamed_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "session.mcap.part", &whole().finished);
    assert_eq!(play_damaged(&path).unwrap().1, None);
    let recovered = recover(&path).unwrap();
    assert_eq!(recovered.lost, None);
    assert_equal(&play_damaged(&recovered.path).unwrap().0, &whole().everything);
}

#[test]
fn a_file_with_a_hole_of_zeros_at_its_end_is_played_up_to_it() {
    // A power cut on some file systems: the length was written, the data was not.
    let part = &whole().part;
    let mut bytes = part[..part.len() / 2].to_vec();
    let expected = in_complete_chunks(&bytes) - 1;
    bytes.resize(part.len(), 0);
    let folder = tempfile::tempdir().unwrap();
    let (played, damage) = play_damaged(&file(folder.path(), "hole.mcap.part", &bytes)).unwrap();
    assert!(damage.is_some());
    // The truncated chunk has its full length of zeros, but a wrong checksum.
    assert_equal(&played, &whole().everything[..expected]);
}

#[test]
fn a_file_that_is_no_recording_is_rejected_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let open = |name: &str, bytes: &[u8]| {
        let path = file(folder.path(), name, bytes);
        let error = Player::open(&path).err().unwrap_or_else(|| panic!("{name} was opened"));
        let message = error.to_string();
        assert!(message.starts_with(&format!("{}: ", path.display())), "{message}");
        (error, message)
    };
    assert!(matches!(open("empty.mcap", b"").0, RecordingError::Empty { .. }));
    let (error, message) = open("notes.mcap", b"just some notes");
    assert!(matches!(error, RecordingError::NotMcap { .. }) && message.contains("6a 75 73 74"), "{message}");
    assert!(matches!(open("start.mcap", &whole().part[..5]).0, RecordingError::TooShort { .. }));
    assert!(matches!(open("begun.mcap", &whole().part[..700]).0, RecordingError::TooShort { .. }));

    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let channel = other.add_channel(0, "/camera", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    other.write_to_known_channel(&header, b"{}").unwrap();
    other.finish().unwrap();
    let (error, message) = open("camera.mcap", &other.into_inner().into_inner());
    assert!(matches!(error, RecordingError::NoSession { .. }) && message.contains("/session"), "{message}");

    let missing = Player::open(folder.path().join("missing.mcap")).err().unwrap();
    assert!(matches!(missing, RecordingError::Io { .. }) && missing.to_string().contains("missing.mcap"), "{missing}");
}
