//! STOP keys from the terminal's bytes to the latch: no state of the decoder and no blocked screen loses one.

use std::io::Write;
use std::os::fd::OwnedFd;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use crate::pty::Session;
use nix::sys::stat::Mode as FileMode;
use nix::unistd::mkfifo;
use quadfrog::realtime::channel::StopLatch;
use quadfrog::recording::player::Player;
use quadfrog::recording::record::Record;
use quadfrog::telemetry::Mode;
use quadfrog_console::input::{KeyReader, NumberedEvent, SpaceBarIsText, TerminalEvent, read_terminal};

/// The STOP keys as terminals send them: plain, with Alt, Ctrl and Shift, in xterm's, rxvt's and kitty's encodings.
const STOPS: [&[u8]; 18] = [
    b" ",
    b"\x03",
    b"\0",
    b"\x1b ",
    b"\x1b\x03",
    b"\x1b\0",
    b"\x1b[24~",
    b"\x1b[24;2~",
    b"\x1b[24;5~",
    b"\x1b[24;8~",
    b"\x1b\x1b[24~",
    b"\x1b[24$",
    b"\x1b[24^",
    b"\x1b[24@",
    b"\x1b[32;5u",
    b"\x1b[99;5u",
    b"\x1b[27;5;32~",
    b"\x1b[27;6;99~",
];

/// Pieces of garbage around a STOP: complete and unfinished sequences, pastes, mouse reports, characters.
const PIECES: [&[u8]; 30] = [
    b"\x1b",
    b"\x1b\x1b",
    b"\x1b[",
    b"\x1b[[",
    b"\x1bO",
    b"\x1bP",
    b"\x1b]11;",
    b"\x1b[2",
    b"\x1b[24",
    b"\x1b[24;",
    b"\x1b[200~",
    b"\x1b[200",
    b"\x1b[201~",
    b"\x1b[M",
    b"\x1b[Mab",
    b"\x1b[<0;3;",
    b"\x1b[<64;10;10M",
    b"\x1b[?62;",
    b"\x1b[1;5A",
    b"\x1b[A",
    b"\x1b[Z",
    b"\x1b[15~",
    b"g",
    b"A",
    b"\r",
    b"\t",
    b"\x7f",
    b"\xc3",
    b"\xe2\x82",
    b"\xf0\x9f\x90",
];

/// Random numbers by SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % bound as u64) as usize
    }

    /// Garbage without a STOP of one byte.
    fn garbage(&mut self) -> Vec<u8> {
        let mut bytes = Vec::new();
        for _ in 0..self.below(6) {
            match self.below(4) {
                0 => bytes.extend((0..self.below(4)).map(|_| self.0 as u8).filter(|b| ![0, 3, b' '].contains(b))),
                _ => bytes.extend(PIECES[self.below(PIECES.len())]),
            }
        }
        bytes
    }
}

fn reader(stop: &StopLatch) -> KeyReader {
    KeyReader::new(false, Some(stop.clone()), SpaceBarIsText::default())
}

fn drop_input(_: NumberedEvent) {}

#[test]
fn no_stop_is_lost_in_any_stream_at_any_split() {
    let mut random = Random(13);
    let mut splits = 0_u64;
    for number in 0..10_000 {
        let (before, key, after) = (random.garbage(), STOPS[random.below(STOPS.len())], random.garbage());
        let stream = [&before[..], key, &after].concat();
        let pressed = before.len() + key.len();
        for split in 0..=stream.len() {
            // With a pause at the split that ends a lone Esc, and without one.
            for pause in [false, true] {
                let stop = StopLatch::default();
                let mut reader = reader(&stop);
                let mut stops = 0;
                for (at, byte) in stream.iter().enumerate() {
                    if at == split && pause {
                        reader.idle(drop_input);
                    }
                    if at + 1 == pressed {
                        stops = stop.count();
                    }
                    reader.take(&[*byte], drop_input);
                    if at + 1 == pressed {
                        assert!(stop.count() > stops, "stream {number}, split {split}, pause {pause}: {stream:?}");
                    }
                }
                splits += 1;
            }
        }
    }
    println!("{splits} streams with their splits");
}

#[test]
fn a_stop_key_ends_an_unfinished_sequence_or_paste_and_the_next_keys_work() {
    for before in PIECES {
        for key in STOPS {
            let stop = StopLatch::default();
            let mut reader = reader(&stop);
            let mut inputs = Vec::new();
            reader.take(&[before, key, b"q"].concat(), |counted| inputs.push(counted.event));
            assert!(stop.is_set(), "{before:?} {key:?}");
            assert_eq!(
                inputs.last(),
                Some(&TerminalEvent::Key("q".parse().unwrap())),
                "{before:?} {key:?}: {inputs:?}"
            );
        }
    }
}

#[test]
fn keys_clicks_and_pastes_are_decoded_as_terminals_send_them() {
    use quadfrog_console::message::Mouse::{Click, WheelDown, WheelUp};
    for (bytes, name) in [
        ("a", "a"),
        ("A", "A"),
        ("\r", "Enter"),
        ("\t", "Tab"),
        ("\x1b[Z", "Shift-Tab"),
        ("\x7f", "Backspace"),
        ("\x1b[A", "Up"),
        ("\x1bOA", "Up"),
        ("\x1b[B", "Down"),
        ("\x1b[C", "Right"),
        ("\x1b[D", "Left"),
        ("\x1b[H", "Home"),
        ("\x1b[1~", "Home"),
        ("\x1b[F", "End"),
        ("\x1b[4~", "End"),
        ("\x1b[2~", "Ins"),
        ("\x1b[3~", "Del"),
        ("\x1b[5~", "PgUp"),
        ("\x1b[6~", "PgDn"),
        ("\x1bOP", "F1"),
        ("\x1b[[A", "F1"),
        ("\x1b[11~", "F1"),
        ("\x1b[15~", "F5"),
        ("\x1b[17~", "F6"),
        ("\x1b[23~", "F11"),
        ("\x0c", "Ctrl-L"),
        ("\x1a", "Ctrl-Z"),
        ("\x1bx", "Alt-x"),
        ("\x1b[1;5A", "Ctrl-Up"),
        ("\x1b[27;5;114~", "Ctrl-R"),
        ("ä", "ä"),
        ("€", "€"),
        ("🐸", "🐸"),
    ] {
        let mut inputs = Vec::new();
        KeyReader::new(false, None, SpaceBarIsText::default())
            .take(bytes.as_bytes(), |counted| inputs.push(counted.event));
        assert_eq!(inputs, [TerminalEvent::Key(name.parse().expect(name))], "{bytes:?}");
    }
    let decoded = |bytes: &[u8]| {
        let mut inputs = Vec::new();
        KeyReader::new(true, None, SpaceBarIsText::default()).take(bytes, |counted| inputs.push(counted.event));
        inputs
    };
    assert_eq!(decoded(b"\x1b[<0;3;4M"), [TerminalEvent::Mouse(Click { column: 2, row: 3 })]);
    assert_eq!(
        decoded(b"\x1b[<64;1;1M\x1b[<65;1;1M"),
        [TerminalEvent::Mouse(WheelUp), TerminalEvent::Mouse(WheelDown)]
    );
    assert_eq!(decoded(b"\x1b[<0;3;4m\x1b[<35;3;4M\x1b[I\x1b[4;768;1024t"), [], "a release, a move, focus, an answer");
    // Primary device attributes: 4 is sixel.
    assert_eq!(
        decoded(b"\x1b[?1;2c\x1b[?62;4;22c\x1b[?4c"),
        [TerminalEvent::Sixel(false), TerminalEvent::Sixel(true), TerminalEvent::Sixel(false)]
    );
    assert_eq!(decoded(b"\x1b[200~g g\x1b[A\r\x1b[201~"), [TerminalEvent::Paste("g g\x1b[A\r".into())]);
    let mut inputs = Vec::new();
    let mut lone = KeyReader::new(false, None, SpaceBarIsText::default());
    lone.take(b"\x1b", |counted| inputs.push(counted.event));
    assert_eq!(inputs, []);
    lone.idle(|counted| inputs.push(counted.event));
    assert_eq!(inputs, [TerminalEvent::Key("Esc".parse().unwrap())]);
}

/// In a text field `Space` types, and every other STOP key stops. After a key that may have closed the field, `Space` is
/// STOP until the event loop has reported the field again.
#[test]
fn space_types_only_in_the_text_field_that_the_screen_has_reported() {
    let (stop, types) = (StopLatch::default(), SpaceBarIsText::default());
    let mut reader = KeyReader::new(false, Some(stop.clone()), types.clone());
    let mut keys = 0;
    let mut press = |bytes: &[u8]| reader.take(bytes, |counted| keys = counted.keys);
    press(b"m");
    types.report(0, true);
    press(b"a b\x7f \x1b[D ");
    assert_eq!(stop.count(), 0, "text, Backspace and Left leave the field open");
    for key in STOPS.iter().filter(|key| **key != b" ") {
        let before = stop.count();
        press(key);
        assert!(stop.count() > before, "{key:?}");
    }
    types.report(keys, true);
    let mut press = |bytes: &[u8]| reader.take(bytes, |counted| keys = counted.keys);
    let before = stop.count();
    press(b" ");
    assert_eq!(stop.count(), before, "the field was reported again");
    press(b"\r ");
    assert_eq!(stop.count(), before + 1, "Enter may have closed the field");
}

/// A terminal whose inputs are not read: a blocked console.
fn blocked() -> (OwnedFd, std::fs::File, StopLatch, Receiver<NumberedEvent>) {
    let (read, write) = nix::unistd::pipe().unwrap();
    (read, std::fs::File::from(write), StopLatch::default(), channel().1)
}

fn wait_for(what: &str, condition: impl Fn() -> bool) {
    let begun = Instant::now();
    while !condition() {
        assert!(begun.elapsed() < Duration::from_secs(30), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn the_thread_that_reads_the_terminal_stops_while_nothing_takes_its_inputs() {
    let (terminal, mut keys, stop, _untaken) = blocked();
    let (sender, _inputs) = channel();
    let key_reader = reader(&stop);
    let thread = std::thread::spawn(move || read_terminal(&terminal, key_reader, |input| sender.send(input).is_ok()));
    let mut random = Random(7);
    for _ in 0..1000 {
        let (before, key) = (random.garbage(), STOPS[random.below(STOPS.len())]);
        keys.write_all(&before).unwrap();
        let stops = stop.count();
        keys.write_all(key).unwrap();
        wait_for("the latch is set", || stop.count() > stops);
    }
    drop(keys);
    thread.join().unwrap().unwrap();
}

#[test]
fn every_stop_key_damps_from_any_state_of_the_terminal() {
    let (_folder, mut session) = Session::opened((100, 30), &[]);
    assert!(!session.sent(b"\x1b[?2004h"), "bracketed paste is on");
    for (opening, stop) in [
        ("", "\x1b "),
        ("", "\0"),
        ("", "\x1b[24;5~"),
        ("\x1b[", " "),
        ("\x1b[200~", " "),
        ("\x1b[200~a note", "\x1b[24~"),
        ("\x1b[200~z\x1b[200~", "\x1b\x03"),
        (":", "\x1b[24~"),
        ("?", " "),
        ("o1", " "),
    ] {
        session.send(opening);
        session.send(stop);
        session.wait_for(&["DAMPED"]);
        // Closes a palette; elsewhere nothing.
        session.send("\x1b");
        std::thread::sleep(Duration::from_millis(200));
        session.send("k");
        session.wait_for(&["DISARMED", "Press A to arm"]);
    }
    session.send("q");
    assert!(session.wait().success());
}

/// The export of the table waits for a reader of its file, and the event loop with it.
#[test]
fn space_stops_the_robot_while_the_event_loop_is_blocked() {
    let (folder, mut session) = Session::opened((100, 30), &[]);
    let study = std::fs::read_dir(folder.path()).unwrap().next().unwrap().unwrap().path();
    mkfifo(&study.join("trials.csv"), FileMode::S_IRWXU).unwrap();
    session.send("2A");
    session.wait_for(&["READY"]);
    session.send("e");
    std::thread::sleep(Duration::from_millis(300));
    session.send(" ");
    // Longer than the limit for a lost operator, so that a STOP by the event loop would come after it.
    std::thread::sleep(Duration::from_millis(2500));
    drop(std::fs::read(study.join("trials.csv")).unwrap());
    session.wait_for(&["DAMPED"]);
    session.send("kq");
    assert!(session.wait().success());
    let player = Player::open(study.join("session.mcap")).unwrap();
    let changes = player.events().iter().filter_map(|event| match &event.record {
        Record::Transition(change) => Some(change.clone()),
        _ => None,
    });
    let after: Vec<_> = changes.skip_while(|change| change.from != Mode::Ready).take(1).collect();
    assert_eq!(after[0].to, Mode::Damped, "{after:?}");
    assert!(after[0].is_stop(), "{after:?}");
}
