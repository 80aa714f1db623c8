//! `quadfrog replay --follow` of a session that continues in the next file of its folder.

use std::path::Path;
use std::process::Stdio;

use crate::program::Program;
use crate::pty::Session;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::Player;
use quadfrog::recording::session_files::recordings_in;

fn follow(folder: &Path, file: &str) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", "--follow", file]);
    let mut session = Session::run(folder, (120, 40), command);
    session.wait_for(&["FOLLOWING"]);
    session.send("2");
    session.wait_for(&["note | cause"]);
    session
}

/// Whether the table has a judged row of a trial.
fn judged(session: &Session, trial: u32) -> bool {
    let of_trial = |line: &str| line.trim_start_matches(['>', ' ']).starts_with(&format!("{trial} "));
    session.screen().lines().any(|line| of_trial(line) && (line.contains("accept") || line.contains("fall")))
}

#[test]
fn the_next_file_of_the_folder_is_followed_after_the_first_one() {
    let program = Program::new();
    let folder = program.path("recordings");
    let arguments = ["--approve", "auto", "--seed", "0", "--trials", "2"];
    let mut live = Session::start(&folder, (100, 30), &arguments);
    let part = || {
        let studies = program.studies("recordings");
        studies.first().map(|study| study.join("session.mcap.part")).filter(|file| Player::open(file).is_ok())
    };
    live.wait_until("a recording has begun", || part().is_some());
    let file = part().unwrap();
    let study = file.parent().unwrap().to_owned();
    let mut follower = follow(&folder, file.to_str().unwrap());
    for trial in 0..2 {
        follower.wait_for_long("the trials of the first file", || judged(&follower, trial));
    }
    live.wait_for_long("the study is finished", || live.screen().contains("Study finished"));
    assert!(live.quit().success());
    assert!(!file.exists() && study.join("session.mcap").exists(), "finished under its own name");
    assert!(!judged(&follower, 2));
    // The study goes on in another program.
    let more = ["optimize", "--resume", study.to_str().unwrap(), "--trials", "4", "--record", "all"];
    let mut second = program.command(&more).stdout(Stdio::null()).spawn().unwrap();
    for trial in 2..4 {
        follower.wait_for_long("the trials of the second file", || judged(&follower, trial));
    }
    assert!(second.wait().unwrap().success());
    let names: Vec<_> = recordings_in(&study).iter().map(|file| file.file_name().unwrap().to_owned()).collect();
    assert_eq!(names, ["session.mcap", "session-2.mcap"]);
    follower.send("q");
    assert!(follower.wait().success(), "{}", follower.screen());
}
