//! Truncated, damaged and foreign files: everything readable is played and recovered, the rest is reported.

use crate::recording as support;
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
use quadfrog::recording::record::{Record, Stamped, Transition};
use quadfrog::recording::recover::recover;
use quadfrog::recording::writer::Writer;
use quadfrog::telemetry::Mode;
use quadfrog::trial::TrialRecord;
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

fn is_session(played: &Played) -> bool {
    matches!(played, Played::Record(stamped) if matches!(stamped.record, Record::Session(_)))
}

fn play_damaged(path: &Path) -> Result<(Vec<Played>, Option<String>), RecordingError> {
    let mut player = Player::open(path)?;
    let mut played: Vec<_> = player.by_ref().collect();
    assert!(is_session(&played.remove(0)));
    Ok((played, player.damage().map(|damage| damage.to_string())))
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
        let recovered = recover(&path);
        if let Ok(player) = Player::open(&path) {
            prop_assert_eq!(player.session(), &session());
            // In the order of time, as everything is, with holes. Of the session's own message the event index has a copy.
            let (mut everything, mut count) = (whole().everything.iter(), 0);
            for played in player.filter(|played| !is_session(played)) {
                prop_assert!(everything.any(|recorded| *recorded == played), "{played:?} was never recorded");
                count += 1;
            }
            // Regression: less was recovered than is played.
            let recovered = recovered.unwrap();
            prop_assert!(recovered.messages > count, "{count} played, {recovered:?}");
            prop_assert!(Player::open(&recovered.path).unwrap().count() as u64 > count);
        }
    }
}

#[test]
fn a_session_whose_own_chunk_is_damaged_opens_from_the_event_index() {
    let Whole { finished, everything, .. } = whole();
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    let chunk = summary.chunk_indexes.iter().min_by_key(|chunk| chunk.message_start_time).unwrap();
    let mut bytes = finished.clone();
    bytes[(chunk.chunk_start_offset + chunk.chunk_length - 8) as usize] ^= 0x55;
    let folder = tempfile::tempdir().unwrap();
    let mut player = Player::open(file(folder.path(), "session.mcap", &bytes)).unwrap();
    assert_eq!(player.session(), &session());
    let played: Vec<_> = player.by_ref().collect();
    assert!(!played.iter().any(is_session));
    assert_equal(&played[played.len() - 500..], &everything[everything.len() - 500..]);
    let damage = player.damage().unwrap().to_string();
    assert!(damage.contains("1 of ") && damage.contains("chunks are damaged and left out"), "{damage}");
}

/// Regression: a bit in the length of a chunk, which the player takes from the index, lost everything after it.
#[test]
fn a_finished_file_with_a_wrong_length_in_the_head_of_a_chunk_is_recovered_whole() {
    let Whole { finished, everything, .. } = whole();
    let mut bytes = finished.clone();
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    bytes[summary.chunk_indexes[3].chunk_start_offset as usize + 2] ^= 0x10;
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "session.mcap", &bytes);
    assert_equal(&play_damaged(&path).unwrap().0, everything);
    let recovered = recover(&path).unwrap();
    assert_eq!(recovered.lost, None);
    let (again, damage) = play_damaged(&recovered.path).unwrap();
    assert_eq!(damage, None);
    assert_equal(&again, everything);
}

/// Regression: a file whose first chunk is damaged was refused, although its index has the channels and its end the session.
#[test]
fn a_finished_file_with_a_damaged_first_chunk_is_recovered() {
    let Whole { finished, .. } = whole();
    let mut bytes = finished.clone();
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    let first = summary.chunk_indexes.iter().min_by_key(|chunk| chunk.chunk_start_offset).unwrap();
    bytes[(first.chunk_start_offset + first.chunk_length - 8) as usize] ^= 0x55;
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "session.mcap", &bytes);
    let mut player = Player::open(&path).unwrap();
    let played: Vec<_> = player.by_ref().collect();
    let recovered = recover(&path).unwrap();
    assert!(recovered.lost.unwrap().starts_with("1 of "));
    let mut again = Player::open(&recovered.path).unwrap();
    assert_eq!((again.session(), again.events()), (player.session(), player.events()));
    let others: Vec<_> = again.by_ref().filter(|played| !is_session(played)).collect();
    assert_equal(&others, &played);
    assert_eq!(again.damage(), None);
}

/// Regression: messages of a channel that the file does not describe were left out without a word.
#[test]
fn messages_of_unknown_channels_are_counted_as_lost() {
    let folder = tempfile::tempdir().unwrap();
    let head = mcap::records::MessageHeader { channel_id: 77, sequence: 0, log_time: 1, publish_time: 1 };
    let record = |opcode: u8, body: &[u8]| [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat();
    let message = [&head.channel_id.to_le_bytes()[..], &[0; 4 + 8 + 8], b"{}"].concat();
    let records = record(mcap::records::op::MESSAGE, &message);
    let chunk = [
        &[0; 16][..],
        &(records.len() as u64).to_le_bytes(),
        &crc32fast::hash(&records).to_le_bytes(),
        &[0; 4],
        &(records.len() as u64).to_le_bytes(),
        &records,
    ];
    let bytes = [&whole().part[..], &record(mcap::records::op::CHUNK, &chunk.concat())].concat();
    let recovered = recover(file(folder.path(), "session.mcap.part", &bytes)).unwrap();
    let lost = recovered.lost.unwrap();
    assert!(lost.ends_with("1 message is of unknown channels and left out"), "{lost}");
}

/// Regression: 1,000 messages were "a message", of no time, and not named beside a damaged chunk; `recover` was advised, which copies
/// them as they are.
#[test]
fn messages_that_cannot_be_read_are_counted_with_the_first_time() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let [session, stage] =
        ["/session", "/opt/stage"].map(|topic| writer.add_channel(0, topic, "protobuf", &Default::default()).unwrap());
    let mut write = |channel_id, time_ns, data: &[u8]| {
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: time_ns, publish_time: time_ns };
        writer.write_to_known_channel(&header, data).unwrap();
    };
    write(session, 0, &[]);
    (0..1_000).for_each(|number| write(stage, (number + 5) * MS, &[0xff]));
    writer.flush().unwrap();
    let header = mcap::records::MessageHeader { channel_id: stage, sequence: 0, log_time: 2_000 * MS, publish_time: 0 };
    writer.write_to_known_channel(&header, &[]).unwrap();
    writer.finish().unwrap();
    let mut bytes = writer.into_inner().into_inner();
    let damage = |bytes: &[u8]| {
        let mut player = Player::open(file(folder.path(), "session.mcap", bytes)).unwrap();
        player.by_ref().for_each(drop);
        player.seek(0);
        player.by_ref().for_each(drop);
        player.damage().unwrap()
    };
    let messages = damage(&bytes);
    let expected = "1000 messages cannot be read, the first at 0.005 s: not a message of its schema";
    let parts = &messages.parts;
    assert!(parts.starts_with(expected) && parts.ends_with("; perhaps of a newer version"), "{messages}");
    assert!(!messages.is_recoverable);
    let last = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes[1].clone();
    bytes[(last.chunk_start_offset + last.chunk_length - 8) as usize] ^= 0x55;
    let both = damage(&bytes);
    let parts = &both.parts;
    assert!(parts.contains("1000 messages cannot be read") && parts.contains("1 of 2 chunks are damaged"), "{both}");
    assert!(both.is_recoverable);
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
    let proto = include_str!("../../proto/frog.proto");
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

/// The bytes of the attachment with the copies of the events.
fn copies(finished: &[u8]) -> std::ops::Range<usize> {
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    let index = summary.attachment_indexes.iter().find(|index| index.name == "events.binpb").unwrap();
    index.offset as usize..(index.offset + index.length) as usize
}

#[test]
fn a_finished_file_lists_its_events_without_its_chunks() {
    // Every chunk but the first, which holds the channels, is destroyed: the events are still all there.
    let Whole { finished, everything, .. } = whole();
    let mut bytes = finished.clone();
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    for chunk in &summary.chunk_indexes[1..] {
        let from = chunk.chunk_start_offset as usize + 64;
        bytes[from..from + 64].iter_mut().for_each(|byte| *byte ^= 0x55);
    }
    let folder = tempfile::tempdir().unwrap();
    let whole = Player::open(file(folder.path(), "whole.mcap", finished)).unwrap();
    let player = Player::open(file(folder.path(), "session.mcap", &bytes)).unwrap();
    assert!(player.events().len() > 10 && player.markers().len() > 1);
    assert_eq!(player.events(), whole.events());
    assert_eq!(player.markers(), whole.markers());
    let recorded =
        |played: &&Played| matches!(played, Played::Record(stamped) if !matches!(stamped.record, Record::Counters(_)));
    assert_eq!(player.events().len() - 1, everything.iter().filter(recorded).count(), "and the session's own record");
}

#[test]
fn copies_of_events_that_are_missing_or_damaged_or_of_another_file_are_not_used() {
    let Whole { finished, part, .. } = whole();
    let folder = tempfile::tempdir().unwrap();
    let expected = Player::open(file(folder.path(), "whole.mcap", finished)).unwrap();
    let at = copies(finished);
    let (mut flipped, mut unguarded) = (finished.clone(), finished.clone());
    flipped[at.start + 200] ^= 1;
    // Without its checksum an attachment could say anything.
    unguarded[at.start + 200] ^= 1;
    unguarded[at.end - 4..at.end].fill(0);
    let other = folder.path().join("other.mcap");
    let (ticks, records) = study(2);
    write(&other, &in_order(&ticks, &records));
    let other = fs::read(other).unwrap();
    let foreign = [part, &other[copies(&other)]].concat();
    for (name, bytes) in [("flipped", &flipped), ("unguarded", &unguarded), ("missing", part), ("foreign", &foreign)] {
        let player = Player::open(file(folder.path(), name, bytes)).unwrap();
        assert_eq!(player.events(), expected.events(), "{name}");
        assert_eq!(player.markers(), expected.markers(), "{name}");
    }
}

#[test]
fn a_recovered_file_lists_its_own_events() {
    let folder = tempfile::tempdir().unwrap();
    let finished = &whole().finished;
    let recovered = recover(file(folder.path(), "session.mcap", finished)).unwrap();
    let bytes = fs::read(&recovered.path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes.iter().filter(|index| index.name == "events.binpb").count(), 1);
    let mut damaged = bytes.clone();
    for chunk in &summary.chunk_indexes[1..] {
        damaged[chunk.chunk_start_offset as usize + 100] ^= 1;
    }
    let expected = Player::open(&recovered.path).unwrap();
    let player = Player::open(file(folder.path(), "damaged.mcap", &damaged)).unwrap();
    assert_eq!(player.events(), expected.events());
}

/// The bytes of the chunk with the most data, and of its checksum: after opcode, length, two times and its length.
fn largest_chunk(finished: &[u8]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    let chunk = summary.chunk_indexes.iter().max_by_key(|chunk| chunk.chunk_length).unwrap();
    let start = chunk.chunk_start_offset as usize;
    (start..start + chunk.chunk_length as usize, start + 9 + 24..start + 9 + 28)
}

#[test]
fn a_chunk_without_a_checksum_is_decoded_before_it_is_believed() {
    let Whole { finished, everything, .. } = whole();
    let folder = tempfile::tempdir().unwrap();
    let (chunk, checksum) = largest_chunk(finished);
    // Only the checksum is gone: everything is there, and the missing checksum is reported.
    let mut bytes = finished.clone();
    bytes[checksum.clone()].fill(0);
    let (played, damage) = play_damaged(&file(folder.path(), "unguarded.mcap", &bytes)).unwrap();
    assert!(damage.unwrap().contains("1 chunk without a checksum"));
    assert_equal(&played, everything);
    // Flips anywhere in it, too: what cannot be decoded is left out, and nothing of it is played.
    let data = checksum.end + 4 + 4 + 8..chunk.end;
    let mut found = 0;
    for place in 0..20 {
        let at = data.start + (data.len() - 1) * place / 20;
        bytes[at..at + 2].iter_mut().for_each(|byte| *byte ^= 0xff);
        let mut player = Player::open(file(folder.path(), "session.mcap", &bytes)).unwrap();
        let missing = everything.len() + 1 - player.by_ref().count();
        assert!(player.damage().is_some());
        let lost: Vec<_> = player.lost().collect();
        assert_eq!(lost.len(), usize::from(missing > 0));
        if let [lost] = lost.as_slice() {
            assert!((50..300).contains(&missing), "{missing} are missing");
            assert_eq!(player.lost_ns(), lost.to_ns - lost.from_ns);
            found += 1;
        }
        bytes[at..at + 2].iter_mut().for_each(|byte| *byte ^= 0xff);
    }
    assert!(found >= 10, "{found} of 20 flips make the chunk undecodable");
}

#[test]
fn a_summary_without_a_checksum_is_not_believed() {
    let Whole { finished, everything, .. } = whole();
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = finished.clone();
    let footer = bytes.len() - 8 - 20;
    let summary = u64::from_le_bytes(bytes[footer..footer + 8].try_into().unwrap()) as usize;
    bytes[footer + 16..footer + 20].fill(0);
    // The times of the chunks in the index.
    for at in (summary..footer - 40).filter(|&at| finished[at] == 8 && finished[at + 3..at + 9] == [0; 6]) {
        bytes[at + 9..at + 25].fill(0x11);
    }
    assert_ne!(bytes[summary..footer], finished[summary..footer]);
    let (played, damage) = play_damaged(&file(folder.path(), "session.mcap", &bytes)).unwrap();
    assert_eq!(damage, None, "all of the data is there");
    assert_equal(&played, everything);
}

#[test]
fn wrong_times_of_a_chunk_without_an_index_reach_no_years() {
    let Whole { part, finished, everything } = whole();
    let folder = tempfile::tempdir().unwrap();
    let whole = Player::open(file(folder.path(), "whole.mcap", finished)).unwrap();
    assert_eq!(whole.duration_ns() / MS, 3_999);
    let (chunk, _) = largest_chunk(finished);
    for time in [9, 17] {
        let mut bytes = part.clone();
        bytes[chunk.start + time + 7] ^= 0x40;
        let path = file(folder.path(), "session.mcap.part", &bytes);
        assert_eq!(Player::open(&path).unwrap().duration_ns(), whole.duration_ns());
        assert_equal(&play_damaged(&path).unwrap().0, everything);
        // Its content is damaged, too.
        bytes[chunk.start + 200] ^= 1;
        let path = file(folder.path(), "session.mcap.part", &bytes);
        let mut player = Player::open(&path).unwrap();
        assert_eq!(player.duration_ns(), whole.duration_ns());
        assert!(player.by_ref().count() < everything.len() + 1);
        assert_eq!(player.lost().len(), 1);
    }
}

#[test]
fn the_time_of_lost_chunks_is_counted() {
    let Whole { finished, everything, .. } = whole();
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = finished.clone();
    let summary = mcap::Summary::read(finished).unwrap().unwrap();
    for chunk in &summary.chunk_indexes[10..13] {
        bytes[(chunk.chunk_start_offset + chunk.chunk_length / 2) as usize] ^= 1;
    }
    let mut player = Player::open(file(folder.path(), "session.mcap", &bytes)).unwrap();
    assert_eq!((player.lost().len(), player.lost_ns()), (0, 0), "found when they are played");
    let ticks = |played: &Played| matches!(played, Played::Tick(_));
    let played = player.by_ref().filter(ticks).count();
    let missing = everything.iter().filter(|played| ticks(played)).count() - played;
    assert_eq!(player.lost().len(), 3);
    // A tick lasts 1 ms.
    let lost_ms = player.lost_ns() / 1_000_000;
    assert!(lost_ms.abs_diff(missing as u64) <= 5, "{lost_ms} ms and {missing} ticks");
    player.seek(0);
    player.by_ref().for_each(drop);
    assert_eq!(player.lost().len(), 3, "each is counted once");
    let damage = player.damage().unwrap().to_string();
    assert!(damage.contains(&format!("{:.3} s", player.lost_ns() as f64 / 1e9)), "{damage}");
}

#[test]
fn a_pipe_and_a_device_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.mcap");
    nix::unistd::mkfifo(&pipe, nix::sys::stat::Mode::S_IRWXU).unwrap();
    for path in [pipe.as_path(), Path::new("/dev/zero"), folder.path()] {
        for error in [Player::open(path).err().unwrap(), recover(path).err().unwrap()] {
            assert!(matches!(error, RecordingError::NotAFile { .. }), "{error}");
            assert!(error.to_string().contains("not a regular file"), "{error}");
        }
    }
}

#[test]
fn a_sparse_seek_gives_every_fifth_tick_and_changes_of_the_mode_before_its_end_and_every_tick_after_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (ticks, mut records) = study(4);
    let changed_ns = 1_503 * MS;
    let fall = Transition { from: Mode::Settle, to: Mode::Damped, cause: "pitch".to_owned() };
    records.push(Stamped { time_ns: changed_ns, record: Record::Transition(fall) });
    let everything = in_order(&ticks, &records);
    write(&path, &everything);
    let mut player = Player::open(&path).unwrap();
    player.seek_sparse(1_000 * MS, 3_000 * MS, 5);
    let played: Vec<_> = player.collect();
    let expected = everything.iter().filter(|played| match played {
        Played::Tick(tick) => {
            let shown = tick.number % 5 == 0 || tick.time_ns == changed_ns;
            tick.time_ns >= 1_000 * MS && (shown || tick.time_ns >= 3_000 * MS)
        }
        Played::Record(stamped) => stamped.time_ns >= 1_000 * MS,
    });
    assert_equal(&played, &expected.cloned().collect::<Vec<_>>());
}

#[test]
fn an_event_that_is_too_large_for_a_copy_is_read_from_its_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (ticks, mut records) = study(2);
    records.push(Stamped { time_ns: 1_500 * MS, record: Record::FaultTicks(ticks[1_000..1_200].to_vec()) });
    let everything = in_order(&ticks, &records);
    write(&path, &everything);
    let bytes = fs::read(&path).unwrap();
    assert!(copies(&bytes).len() < 200 * 1000, "the ticks of the fault are not in the copies");
    let player = Player::open(&path).unwrap();
    let events = everything.iter().filter_map(|played| match played {
        Played::Record(stamped) if !matches!(stamped.record, Record::Counters(_)) => Some(stamped),
        _ => None,
    });
    assert!(player.events()[1..].iter().eq(events), "each once, in the order of time");
}

/// Regression: of several events of one channel and one time, such as the rows of a continued session, `recover` wrote none that only
/// the copies had.
#[test]
fn events_of_one_time_in_a_damaged_chunk_are_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.mcap");
    let mut writer = Writer::create(&path, &session(), START_UTC_NS, &[]).unwrap();
    for trial in [0, 1, 2, 2] {
        let row = TrialRecord { trial, ..TrialRecord::default() };
        writer.record(&Stamped { time_ns: 1_000 * MS, record: Record::Trial(row) }).unwrap();
        writer.flush().unwrap();
    }
    writer.finish().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let mut chunks = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes;
    chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
    bytes[(chunks[3].chunk_start_offset + chunks[3].chunk_length - 8) as usize] ^= 0x55;
    let path = file(folder.path(), "session.mcap", &bytes);
    let mut player = Player::open(&path).unwrap();
    player.by_ref().for_each(drop);
    assert_eq!(player.lost().len(), 1);
    let recovered = recover(&path).unwrap();
    let again = Player::open(&recovered.path).unwrap();
    assert_eq!(again.events().len(), 5, "the session's own and four rows");
    assert_eq!(again.events(), player.events());
}

/// Regression: an attachment after a damaged one was not found.
#[test]
fn a_damaged_attachment_hides_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let attached: [(&str, &str, &[u8]); 2] =
        [("config.toml", "application/toml", b"kp = 400.0\n"), ("robot.toml", "application/toml", b"legs = 4\n")];
    Writer::create(&path, &session(), START_UTC_NS, &attached).unwrap().finish().unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let at = bytes.windows(10).position(|bytes| bytes == b"kp = 400.0").unwrap();
    bytes[at] ^= 1;
    let mut player = Player::open(file(folder.path(), "session.mcap", &bytes)).unwrap();
    assert_eq!(player.attachment("robot.toml").unwrap().as_deref(), Some(&b"legs = 4\n"[..]));
    // The damaged one may have had the name.
    for name in ["config.toml", "nothing.toml"] {
        assert!(player.attachment(name).unwrap_err().to_string().contains("CRC"), "{name}");
    }
}

/// Regression: of a file that lacked nothing but its index the copy said that it was not whole.
#[test]
fn a_recording_that_lacks_its_index_alone_is_recovered_whole() {
    let Whole { finished, everything, .. } = whole();
    let folder = tempfile::tempdir().unwrap();
    let recovered = recover(file(folder.path(), "session.mcap", &finished[..finished.len() - 1])).unwrap();
    assert_eq!(recovered.lost, None);
    assert_eq!(Player::open(&recovered.path).unwrap().lost_before_recovery(), Vec::<String>::new());
    assert_equal(&play_damaged(&recovered.path).unwrap().0, everything);
}
