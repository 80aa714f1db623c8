//! The samples of `recordings/samples`: whole, small, of the present format, and played.

use std::fs;
use std::path::{Path, PathBuf};

use crate::program::{Program, assert_shows};
use crate::pty::Session;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::Player;

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/samples")
}

fn recording(name: &str) -> String {
    samples().join(name).join("session.mcap").to_str().unwrap().to_owned()
}

fn bytes_below(folder: &Path) -> u64 {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.map(|path| if path.is_dir() { bytes_below(&path) } else { fs::metadata(path).unwrap().len() }).sum()
}

#[test]
fn the_samples_are_small_whole_and_of_the_present_format() {
    assert!(bytes_below(&samples()) < 2_000_000, "{} bytes", bytes_below(&samples()));
    let program = Program::new();
    for (name, ticks) in [("forward", "2255 ticks"), ("fall", "1278 ticks")] {
        assert_shows(&program.text(&["replay", "--check", &recording(name)]), &[ticks, "whole"]);
        let proto = Player::open(recording(name)).unwrap().attachment("frog.proto").unwrap().unwrap();
        let present = include_str!("../../proto/frog.proto");
        assert_eq!(String::from_utf8(proto).unwrap(), present, "make the samples again: sh recordings/samples/make.sh");
    }
    let best = program.text(&["study", "best", samples().join("forward").to_str().unwrap()]);
    assert_shows(&best, &["0.721"]);
}

/// Regression: in a fresh clone `quadfrog replay` denied every recording below its folder. The samples are copied: their own folder has
/// the studies, too, of everyone who has run the program in it.
#[test]
fn a_folder_above_the_samples_names_one_of_them() {
    let above = tempfile::tempdir().unwrap();
    for name in ["forward", "fall"] {
        let copy = above.path().join("samples").join(name);
        fs::create_dir_all(&copy).unwrap();
        fs::copy(recording(name), copy.join("session.mcap")).unwrap();
    }
    let refused = Program::new().refused(&["replay", above.path().to_str().unwrap()]);
    assert_shows(&refused, &["no session.mcap in it or in a folder directly below it", "for example ", "samples/fall"]);
}

#[test]
fn the_samples_are_replayed() {
    for (name, shown) in [("forward", ["of 20 count", "best 0.721 m (#12)"]), ("fall", ["fall", "pitch 1.0004 rad"])] {
        let folder = tempfile::tempdir().unwrap();
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.args(["replay", &recording(name)]);
        let mut session = Session::run(folder.path(), (120, 40), command);
        session.wait_for(&["REPLAY"]);
        session.wait_for(&shown);
        session.send("q");
        assert!(session.wait().success());
    }
}
