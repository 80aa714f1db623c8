//! The live view: a running session as viewers of Foxglove's protocol see it.

use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::path::Path;

use crate::guard;
use crate::program::{Program, assert_shows};
use crate::pty::Session;
use crate::python_reader::read_by_python;
use quadfrog::recording::player::{Played, Player};
use quadfrog::recording::session_files::recordings_in;
use serde_json::Value;

const SIZE: (u16, u16) = (120, 40);

/// Starts a session with a live view; returns its folder, itself, and the port.
fn shown(arguments: &[&str]) -> (tempfile::TempDir, Session, u16) {
    let folder = tempfile::tempdir().unwrap();
    // Free a moment ago.
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let session = Session::start(folder.path(), SIZE, &[&["--live", &port.to_string()], arguments].concat());
    session.wait_until("it listens", || TcpStream::connect(("127.0.0.1", port)).is_ok());
    (folder, session, port)
}

fn viewed(port: u16) -> Option<Value> {
    read_by_python("view_live.py", Path::new(&port.to_string()))
}

/// The numbers of the recorded ticks of the only study in a folder.
fn recorded(folder: &Path) -> BTreeSet<u64> {
    let study = std::fs::read_dir(folder).unwrap().next().unwrap().unwrap().path();
    let files = recordings_in(&study);
    files
        .iter()
        .flat_map(|file| Player::open(file).unwrap())
        .filter_map(|played| match played {
            Played::Tick(tick) => Some(tick.number),
            Played::Record(_) => None,
        })
        .collect()
}

fn end(mut session: Session) {
    session.send("qy");
    session.wait();
}

#[test]
fn a_viewer_in_python_gets_the_topics_of_the_recording() {
    let (folder, mut session, port) = shown(&[]);
    let found = viewed(port);
    session.wait_for(&["Press A to arm"]);
    session.send("5");
    session.wait_for(&["live view", &format!("127.0.0.1:{port}")]);
    end(session);
    let Some(found) = found else { return };
    assert_eq!(found["protocol"], "foxglove.sdk.v1");
    assert_eq!(found["info"]["capabilities"], serde_json::json!([]), "view only");
    assert_eq!(found["refusal"]["op"], "status");
    assert!(found["refusal"]["message"].as_str().unwrap().contains("view only"));
    let recorded_ticks = recorded(folder.path());
    let study = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    let start_utc_ns = Player::open(study.join("session.mcap")).unwrap().start_utc_ns();
    assert_eq!(found["session"], serde_json::json!({ "backend": "sim", "start_utc_ns": start_utc_ns }));
    for tick in found["ticks"].as_array().unwrap() {
        let [number, time, time_ns] = [&tick[0], &tick[1], &tick[2]].map(|value| value.as_u64().unwrap());
        assert!(recorded_ticks.contains(&number), "tick {number} is recorded too");
        assert_eq!(time, start_utc_ns + time_ns, "one clock");
    }
    let topics: Vec<&str> = found["topics"].as_array().unwrap().iter().map(|topic| topic.as_str().unwrap()).collect();
    for topic in ["/robot/tick", "/robot/joint_states", "/tf", "/scene/robot", "/opt/trial", "/log", "/fault"] {
        assert!(topics.contains(&topic), "{topic}");
    }
}

#[test]
fn an_observer_that_records_nothing_is_shown_too() {
    // A robot that never answers.
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = silent.local_addr().unwrap().to_string();
    let elsewhere = tempfile::tempdir().unwrap();
    let model = guard::model(elsewhere.path());
    // In place of the user's own configuration of the tests, which is refused on hardware.
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../config");
    let robot = ["--robot", "go1", "--address", &address, "--model", model.to_str().unwrap(), "--config", config];
    let (folder, session, port) = shown(&[&["--observe"], &robot[..]].concat());
    let found = viewed(port);
    end(session);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
    let Some(found) = found else { return };
    assert!(found["counts"]["/robot/tick"].as_u64().unwrap() >= 50);
}

/// Viewers that send nonsense, nothing, or take nothing.
#[test]
fn hostile_viewers_cost_the_recording_nothing() {
    let (folder, session, port) = shown(&["--approve", "auto", "--trials", "1"]);
    let connect = || TcpStream::connect(("127.0.0.1", port)).unwrap();
    let mut silent: Vec<TcpStream> = (0..4).map(|_| connect()).collect();
    let mut noise = connect();
    let _ = noise.write_all(&[0xff; 100_000]);
    let mut unnamed = connect();
    let handshake = "GET / HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
    write!(unnamed, "{handshake}\r\n").unwrap();
    let mut answer = [0; 12];
    unnamed.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 400", "no viewer: another protocol");
    // A viewer that subscribes to every topic and never reads.
    let mut greedy = connect();
    write!(greedy, "{handshake}Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n").unwrap();
    greedy.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 101");
    let wanted: Vec<Value> = (1..=21).map(|id| serde_json::json!({ "id": id, "channelId": id })).collect();
    let text = serde_json::json!({ "op": "subscribe", "subscriptions": wanted }).to_string();
    let length = u16::try_from(text.len()).unwrap().to_be_bytes();
    // A masked frame of text; a mask of zeros leaves it as it is.
    greedy.write_all(&[&[0x81, 0xfe], &length[..], &[0; 4], text.as_bytes()].concat()).unwrap();
    let study = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    // A key before it cancels the countdown.
    session.wait_for_long("the trial is judged", || session.screen().contains("1 of 1 count"));
    assert!(silent.iter_mut().all(|stream| stream.set_nodelay(true).is_ok()));
    end(session);
    let mut in_trial: Vec<u64> = Vec::new();
    for played in Player::open(study.join("session.mcap")).unwrap() {
        if let Played::Tick(tick) = played
            && tick.trial.is_some()
        {
            in_trial.push(tick.number);
        }
    }
    assert!(in_trial.len() > 1000);
    assert!(in_trial.windows(2).all(|pair| pair[1] == pair[0] + 1), "no tick of the trial is lost");
}

#[test]
fn an_address_in_use_or_of_other_machines_is_refused() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start(folder.path(), SIZE, &["--live", &port]);
    session.wait_for(&["another program listens there"]);
    assert_eq!(session.wait().exit_code(), 1);
    for (address, reason) in
        [("0.0.0.0:8765", "not an address of this machine alone"), ("nonsense", "give PORT or HOST:PORT")]
    {
        let mut session = Session::start(folder.path(), SIZE, &["--live", address]);
        session.wait_for(&[reason]);
        assert_eq!(session.wait().exit_code(), 2);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "no study is begun");
}

#[test]
fn without_live_nothing_listens_and_help_names_it() {
    let program = Program::new();
    assert_shows(&program.text(&["--help"]), &["--live"]);
    let (_folder, mut session) = Session::opened(SIZE, &[]);
    session.send("5");
    session.wait_for(&["not recorded"]);
    assert!(!session.screen().contains("live view"));
    let sockets = std::fs::read_to_string(format!("/proc/{}/net/tcp", session.pid())).unwrap();
    let open: BTreeSet<String> = std::fs::read_dir(format!("/proc/{}/fd", session.pid()))
        .unwrap()
        .filter_map(|entry| std::fs::read_link(entry.ok()?.path()).ok())
        .filter_map(|link| Some(link.to_str()?.strip_prefix("socket:[")?.strip_suffix(']')?.to_owned()))
        .collect();
    // Column 4 is the state, 0A a listener; column 10 the inode.
    let listens = |line: &str| {
        let columns: Vec<&str> = line.split_whitespace().collect();
        columns.get(3) == Some(&"0A") && columns.get(9).is_some_and(|inode| open.contains(*inode))
    };
    assert!(!sockets.lines().any(listens));
    end(session);
}
