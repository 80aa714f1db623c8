//! Valid inputs of the targets, and words that mutations insert.

use std::fs;

use quadfrog::recording::record::SessionInfo;
use quadfrog::recording::writer::Writer;
use quadfrog::robot::JointCommand;
use quadfrog::robot::go1::convert::low_cmd;
use quadfrog::robot::go1::packet::{CrcForm, LowCmd, LowState};
use quadfrog::robot::go2::convert::low_command;
use quadfrog::robot::go2::message::{ResponseMessage, StateMessage, motion_switcher};
use quadfrog::telemetry::{Mode, Tick};

use super::targets::CONFIG_FILES;

pub fn packets() -> Vec<Vec<u8>> {
    let mut state = LowState::zero();
    state.robot_time_ms = 1234_u32.into();
    state.remote.head = [0x55, 0x51];
    state.write_crc();
    let command = low_cmd(&JointCommand::damping(2.0), CrcForm::Plain).unwrap();
    vec![
        state.bytes().to_vec(),
        LowState::zero().bytes().to_vec(),
        command.bytes().to_vec(),
        LowCmd::braking(CrcForm::Sealed).bytes().to_vec(),
        StateMessage::zero().encode().to_vec(),
        low_command(&JointCommand::damping(2.0)).unwrap().bytes().to_vec(),
        motion_switcher::select_mode(7, "normal").encode(),
        ResponseMessage { id: 7, api: 1001, code: 0, data: "{\"name\":\"\"}".into(), binary: vec![1, 2] }.encode(),
    ]
}

/// Creation of a study, then lines of a study of Optuna that hold every operation.
pub fn journal() -> Vec<Vec<u8>> {
    let lines: Vec<&str> = include_str!("../golden/tpe/journal.log").lines().collect();
    lines[1..].chunks(5).map(|part| [&lines[..1], part].concat().join("\n").into_bytes()).collect()
}

/// A finished and an unfinished recording of 60 ticks.
pub fn player() -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.mcap");
    let session = SessionInfo { study: "fuzz".into(), ..SessionInfo::default() };
    let mut writer = Writer::create(&path, &session, 1, &[("config.toml", "application/toml", b"kp = 1\n")]).unwrap();
    for number in 0..60 {
        let trial = (number >= 30).then_some(1);
        writer
            .tick(&Tick { number, time_ns: number * 1_000_000, mode: Mode::Ready, trial, ..Tick::default() })
            .unwrap();
    }
    writer.flush().unwrap();
    let part = fs::read(folder.path().join("short.mcap.part")).unwrap();
    writer.finish().unwrap();
    vec![fs::read(&path).unwrap(), part]
}

pub fn urdf() -> Vec<Vec<u8>> {
    [include_str!("../../robots/go1/go1.urdf"), include_str!("../../robots/a1/a1.urdf")].map(Vec::from).to_vec()
}

/// Each file as a whole, and each of its tables.
pub fn config() -> Vec<Vec<u8>> {
    let texts = [
        include_str!("../../config/control.toml"),
        include_str!("../../config/safety.toml"),
        include_str!("../../config/optimize.toml"),
        include_str!("../../config/simulator.toml"),
        include_str!("../../config/console.toml"),
        include_str!("../../robots/go1/robot.toml"),
    ];
    let mut inputs = Vec::new();
    for (file, text) in (0..CONFIG_FILES.len() as u8).zip(texts) {
        let input = |text: &str| [&[file], text.as_bytes()].concat();
        inputs.push(input(text));
        inputs.extend(text.split("\n\n").map(input));
    }
    inputs
}

pub fn keys() -> Vec<Vec<u8>> {
    let streams: [&[u8]; 8] = [
        b"\x01gA\x1b[A\x1b[24~\x1b[200~pasted text\x1b[201~q",
        b"\x00\x1b[<0;10;12M\x1b[<0;10;12m\x1b[Mabc\x1bOP",
        b"\x03\x1b[32;5u\x1b[99;5u\x1b[27;5;32~\x1b[1;5A",
        "\x05äöü€🐸\x1b\x1b[Z".as_bytes(),
        b"\x07\x1b[[A\x1b]11;rgb:0/0/0\x07\x1bP",
        b"\x09\x1b[?62;c 0.5\r\t\x7f",
        b"\x01\x1b[200~unfinished",
        b"\xff\xc3\xe2\x82\xf0\x9f\x90",
    ];
    streams.map(<[u8]>::to_vec).to_vec()
}

/// Words of JSON, XML, TOML and of terminals' sequences, numbers at the edges of their types.
pub const WORDS: &[&[u8]] = &[
    b"1e308",
    b"-1e-320",
    b"NaN",
    b"-Infinity",
    b"1e999",
    b"9223372036854775808",
    b"-1",
    b"0",
    b"4294967296",
    b"18446744073709551615",
    b"null",
    b"true",
    b"{}",
    b"[]",
    b"\"\"",
    b"\\ud800",
    b"\\u0000",
    b"{\"a\":",
    b"[[[[",
    b"\n",
    b"<a>",
    b"</a>",
    b"<!--",
    b"-->",
    b"<![CDATA[",
    b"&lt;",
    b"&#0;",
    b"&a;",
    b"<?xml",
    b"xyz=\"nan 0 0\"",
    b"<link name=\"trunk\"/>",
    b"<joint name=\"j\" type=\"fixed\">",
    b"inf",
    b"nan",
    b"[a]",
    b"[[a]]",
    b"a.b = 1",
    b"'''",
    b"1979-05-27T07:32:00Z",
    b"0x7fffffffffffffff",
    b"# ",
    b" = ",
    b"\x1b",
    b"\x1b[",
    b"\x1b[200~",
    b"\x1b[201~",
    b"\x1b[M",
    b"\x1b[<",
    b"\x1bO",
    b";5u",
    b"24~",
    b"\x03",
    b" ",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\xfe\xef",
    b"\xa5",
    b"\"op_code\":",
    b"\"trial_id\":",
    b"\"study_id\":",
    b"\"state\":",
];
