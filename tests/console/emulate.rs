//! The prompt of the emulated robot.

use std::io::{BufRead, BufReader, Write};
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

/// Regressions: after a line that is not UTF-8 no fault was taken any more, without a word; a line without an end was kept whole, up to
/// the end of the memory.
#[test]
fn faults_are_taken_after_a_line_that_is_none() {
    let mut emulate = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
    emulate.args(["emulate", "--bind", "127.0.0.1:0"]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut emulator = emulate.spawn().unwrap();
    let long = [b'x'; 3000];
    let input = [b"loss 5\n\xff\xfe\n".as_slice(), &long, b"\nloss 7\n"].concat();
    emulator.stdin.as_mut().unwrap().write_all(&input).unwrap();
    let (said, lines) = channel();
    let output = BufReader::new(emulator.stdout.take().unwrap());
    std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| said.send(line)));
    let done = std::iter::from_fn(|| lines.recv_timeout(Duration::from_secs(30)).ok());
    let done: Vec<String> = done.filter(|line| line.starts_with("done: ")).take(2).collect();
    emulator.kill().unwrap();
    emulator.wait().unwrap();
    assert_eq!(done, ["done: loss 5", "done: loss 7"]);
}
