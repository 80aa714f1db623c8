//! Copies of recordings by other programs for MCAP, files of other programs, and files after one another.

use std::fs;

use crate::recording as support;
use mcap::WriteOptions;
use quadfrog::recording::RecordingError;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::recover::recover;
use support::*;
use tempfile::TempDir;

/// A recording of 4 s with its content, in a folder.
fn recorded() -> (TempDir, Vec<u8>, Vec<Played>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("session.mcap");
    let (ticks, records) = study(4);
    let everything = in_order(&ticks, &records);
    write(&path, &everything);
    (folder, fs::read(path).unwrap(), everything)
}

/// Copies the messages of a file into chunks of another size.
fn copied(bytes: &[u8], chunk_bytes: u64) -> Vec<u8> {
    let options = WriteOptions::new().chunk_size(Some(chunk_bytes)).library("another program");
    let mut writer = options.create(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Regression: of a copy in other chunks the ticks were lost whose command is in the chunk before, "perhaps of a newer version".
#[test]
fn a_copy_in_other_chunks_has_every_tick() {
    let (folder, bytes, everything) = recorded();
    let copy = folder.path().join("copy.mcap");
    for chunk_bytes in [4_000, 300_000] {
        fs::write(&copy, copied(&bytes, chunk_bytes)).unwrap();
        assert_same(&play(&copy), &everything);
        let mut player = Player::open(&copy).unwrap();
        for from_ns in [2_345 * MS, 1_234 * MS] {
            player.seek(from_ns);
            let expected: Vec<_> = everything.iter().filter(|played| played.time_ns() >= from_ns).cloned().collect();
            assert_same(&player.by_ref().collect::<Vec<_>>(), &expected);
        }
    }
}

/// Regression: a recording with an unknown compression was "not a recording of quadfrog", and its recovery an empty file.
#[test]
fn a_compression_that_cannot_be_read_is_named() {
    let (folder, bytes, _) = recorded();
    let mut copy = copied(&bytes, 100_000);
    // The compression of a chunk, not that of its entry in the index, which a checksum guards.
    let index_at = mcap::read::footer(&copy).unwrap().summary_start as usize;
    let named = b"\x04\0\0\0zstd";
    let places = (0..index_at).filter(|place| copy[*place..].starts_with(named)).collect::<Vec<_>>();
    places.iter().for_each(|place| copy[place + 4..place + 8].copy_from_slice(b"pack"));
    assert!(places.len() > 1);
    let path = folder.path().join("copy.mcap");
    fs::write(&path, copy).unwrap();
    for error in [Player::open(&path).err().unwrap(), recover(&path).unwrap_err()] {
        assert!(error.to_string().contains("copy.mcap: no /session message of it can be read: "), "{error}");
        assert!(error.to_string().contains("compression pack cannot be read"), "{error}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left of the recovery");
}

/// Regression: the recovery of a file of another program was an empty file with exit status 0.
#[test]
fn a_file_of_another_program_is_not_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("camera.mcap");
    let mut other = mcap::Writer::new(std::io::Cursor::new(Vec::new())).unwrap();
    let channel_id = other.add_channel(0, "/camera", "json", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    other.write_to_known_channel(&header, b"{}").unwrap();
    other.finish().unwrap();
    fs::write(&path, other.into_inner().into_inner()).unwrap();
    assert!(matches!(recover(&path), Err(RecordingError::NoSession { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Regression: of two files after one another the second was dropped, and nothing was lost.
#[test]
fn a_file_behind_the_end_of_another_is_reported_as_lost() {
    let (folder, bytes, everything) = recorded();
    let path = folder.path().join("two.mcap");
    fs::write(&path, [&bytes[..], &bytes].concat()).unwrap();
    let text = format!("its last {0} of {1} bytes follow its end", bytes.len(), 2 * bytes.len());
    let mut player = Player::open(&path).unwrap();
    player.by_ref().for_each(drop);
    let damage = player.damage().unwrap();
    assert!(damage.is_recoverable && damage.parts.starts_with(&text), "{damage}");
    let recovered = recover(&path).unwrap();
    assert!(recovered.lost.as_ref().is_some_and(|lost| lost.starts_with(&text)), "{recovered:?}");
    assert_same(&play(&recovered.path), &everything);
}
