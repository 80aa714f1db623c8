//! Recordings with right checksums and hostile contents: mutations never repair a checksum, and do not reach what it guards.

use std::fs::{self, File};
use std::os::unix::fs::FileExt as _;

use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::recover::recover;

use super::{MB, count_alloc, targets};

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Opcodes of the records: the MCAP specification, "Records".
const FOOTER: u8 = 2;
const CHANNEL: u8 = 4;
const MESSAGE: u8 = 5;
const CHUNK: u8 = 6;
const MESSAGE_INDEX: u8 = 7;
const SECOND_NS: u64 = 1_000_000_000;

const SESSION: u16 = 0;
const STAGE: u16 = 1;
const COUNTERS: u16 = 2;
const FAULT: u16 = 3;
const TOPICS: [&str; 4] = ["/session", "/opt/stage", "/robot/counters", "/fault"];

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| sum >> 1 ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
}

fn message(channel: u16, log_time: u64, data: &[u8]) -> Vec<u8> {
    let time = log_time.to_le_bytes();
    record(MESSAGE, &[&channel.to_le_bytes()[..], &[0; 4], &time, &time, data].concat())
}

/// A chunk of records without compression, and the list of its one channel.
fn chunk(start: u64, end: u64, channel: u16, records: &[u8]) -> Vec<u8> {
    let length = (records.len() as u64).to_le_bytes();
    let times = [start.to_le_bytes(), end.to_le_bytes()].concat();
    let body = [&times[..], &length, &crc32(records).to_le_bytes(), &[0; 4], &length, records].concat();
    [record(CHUNK, &body), record(MESSAGE_INDEX, &[channel as u8, 0, 0, 0, 0, 0])].concat()
}

/// An unfinished recording with its session and these chunks.
fn recording(chunks: &[Vec<u8>]) -> Vec<u8> {
    let channel = |(number, topic): (u16, &&str)| {
        record(CHANNEL, &[&number.to_le_bytes()[..], &[0; 2], &text(topic), &text("protobuf"), &[0; 4]].concat())
    };
    let mut first: Vec<u8> = (0..).zip(&TOPICS).flat_map(channel).collect();
    first.extend(message(SESSION, 0, &[]));
    [MAGIC.to_vec(), chunk(0, 0, SESSION, &first), chunks.concat()].concat()
}

/// Plays a recording; returns what was played, the damage, and the most memory, bytes.
fn played(bytes: &[u8], each: impl FnMut(Played)) -> (String, usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap.part");
    fs::write(&path, bytes).unwrap();
    count_alloc::most_memory(|| {
        let mut player = Player::open(&path).unwrap();
        player.by_ref().for_each(each);
        player.damage().unwrap().to_string()
    })
}

/// Regression: a fault of 4 million empty ticks, 1 kB when compressed, was decoded whole and took 6 GB.
#[test]
fn the_ticks_of_a_fault_are_decoded_one_at_a_time() {
    let empty = [0x0a, 0].repeat(4_000_000);
    let bytes = recording(&[chunk(1, 1, FAULT, &message(FAULT, 1, &empty))]);
    let (damage, memory) = played(&bytes, drop);
    assert!(damage.contains("1 message cannot be read, at 0.000 s: a fault's tick is missing"), "{damage}");
    assert!(memory < 64 * MB, "{memory} bytes");
    let ((), memory) = count_alloc::most_memory(|| targets::player(&bytes));
    assert!(memory < 128 * MB, "{memory} bytes");
    targets::clean();
}

/// Regression: a million empty events, 20 kB when compressed, took a gigabyte.
#[test]
fn events_beyond_a_number_are_left_out_and_reported() {
    let stages = |second: u64| {
        let time = second * SECOND_NS;
        chunk(time, time, STAGE, &message(STAGE, time, &[]).repeat(60_000))
    };
    let bytes = recording(&(1..20).map(stages).collect::<Vec<_>>());
    let mut count = 0;
    let (damage, memory) = played(&bytes, |_| count += 1);
    assert_eq!(count, 19 * 60_000 + 1, "all are played");
    assert!(
        damage.contains("holds more than 262144 events; those after 5.000 s are left out: damaged, or not written by"),
        "{damage}"
    );
    assert!(memory < 400 * MB, "{memory} bytes");
}

/// Regression: all chunks of one time were read ahead, a gigabyte for 20 kB.
#[test]
fn messages_of_one_time_are_read_ahead_up_to_a_number() {
    let counters = chunk(1, 1, COUNTERS, &message(COUNTERS, 1, &[]).repeat(60_000));
    let (mut count, mut last_ns) = (0, 0);
    let (_, memory) = played(&recording(&vec![counters; 19]), |played| {
        assert!(played.time_ns() >= last_ns);
        (count, last_ns) = (count + 1, played.time_ns());
    });
    assert_eq!(count, 19 * 60_000 + 1, "nothing is left out");
    assert!(memory < 400 * MB, "{memory} bytes");
}

/// A message that is read too late for its time is reported and not played.
#[test]
fn a_message_that_would_come_after_later_ones_is_left_out_and_reported() {
    let end = 5 * SECOND_NS;
    let counters = chunk(0, end, COUNTERS, &message(COUNTERS, end, &[]).repeat(60_000));
    let stage = chunk(0, end, STAGE, &message(STAGE, SECOND_NS, &[]));
    let mut last_ns = 0;
    let (damage, _) = played(&recording(&[vec![counters; 5], vec![stage]].concat()), |played| {
        assert!(played.time_ns() >= last_ns);
        last_ns = played.time_ns();
    });
    assert!(damage.contains("1 message cannot be read, at 1.000 s: more than 262144 messages of chunks"), "{damage}");
}

/// Regression: the number of messages in a chunk had no bound: 200,000 of no content took 200 MB.
#[test]
fn a_chunk_of_too_many_messages_is_left_out_and_reported() {
    let stages = chunk(SECOND_NS, SECOND_NS, STAGE, &message(STAGE, SECOND_NS, &[]).repeat(200_000));
    let mut count = 0;
    let (damage, memory) = played(&recording(&[stages]), |_| count += 1);
    assert_eq!(count, 1, "the session");
    assert!(damage.contains("1 of 2 chunks are damaged") && damage.contains("more than 65536 messages"), "{damage}");
    assert!(memory < 64 * MB, "{memory} bytes");
}

/// An event of over a mebibyte is not decoded: its lists could take 32 times its length.
#[test]
fn an_event_that_is_too_long_is_not_decoded() {
    // The field `parameters` of the session, empty.
    let long = [0x4a, 0].repeat(1 << 20);
    let bytes = recording(&[chunk(1, 1, SESSION, &message(SESSION, 1, &long))]);
    let (damage, memory) = played(&bytes, drop);
    assert!(damage.contains("a message of 2097152 bytes, more than 1048576"), "{damage}");
    assert!(memory < 64 * MB, "{memory} bytes");
}

/// Regression: a text of the index was allocated by the length that it names, 4 GB for a file of 92 bytes with right checksums.
#[test]
fn a_length_in_the_index_is_not_allocated() {
    let length = u32::MAX.to_le_bytes();
    let channel = record(CHANNEL, &[&[0; 4][..], &length].concat());
    // A chunk, an attachment and a metadata record in the index: numbers, and the first text or map.
    let of_index = |opcode: u8, numbers: usize| record(opcode, &[&vec![0; numbers][..], &length].concat());
    for index in [channel, of_index(8, 32), of_index(10, 40), of_index(13, 16)] {
        let start = (MAGIC.len() as u64).to_le_bytes();
        let footer = [&[FOOTER], &20_u64.to_le_bytes()[..], &start, &[0; 8]].concat();
        let sum = crc32(&[&index[..], &footer].concat()).to_le_bytes();
        let bytes = [MAGIC, &index, &footer, &sum, MAGIC].concat();
        let ((), memory) = count_alloc::most_memory(|| targets::player(&bytes));
        assert!(memory < MB, "{memory} bytes");
    }
    targets::clean();
}

/// Regression: of a sparse file a record of its whole nominal length, 1 TB, was allocated.
#[test]
fn a_record_of_a_sparse_file_is_not_allocated() {
    const LENGTH: u64 = 1 << 40;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let head = |opcode: u8| [MAGIC, &[opcode], &(LENGTH - MAGIC.len() as u64 - 9).to_le_bytes()].concat();
    // A chunk and an attachment; an index from the first record on.
    let footer = [&[FOOTER], &20_u64.to_le_bytes()[..], &8_u64.to_le_bytes(), &[0; 8], &[1; 4], MAGIC].concat();
    for (begin, end) in [(head(CHUNK), vec![]), (head(9), vec![]), (MAGIC.to_vec(), footer)] {
        let file = File::create(&path).unwrap();
        file.set_len(LENGTH).unwrap();
        file.write_all_at(&begin, 0).unwrap();
        file.write_all_at(&end, LENGTH - end.len() as u64).unwrap();
        let (opened, memory) = count_alloc::most_memory(|| (Player::open(&path).is_ok(), recover(&path).is_ok()));
        assert_eq!(opened, (false, false));
        assert!(memory < MB, "{memory} bytes");
    }
}
