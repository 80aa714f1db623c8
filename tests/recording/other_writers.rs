//! Copies of recordings by other programs for MCAP, files of other programs, and files after one another.

use std::fs;

use crate::recording as support;
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
