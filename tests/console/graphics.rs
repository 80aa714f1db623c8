//! The robot's picture in pixels, as the program sends it to a terminal that shows it, and everything that must remove it.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use crate::pty::{Session, Setup};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use portable_pty::CommandBuilder;
use quadfrog::recording::player::Player;
use quadfrog::robot::description::RobotDescription;
use quadfrog_console::app::{self, ConsoleOptions};
use quadfrog_console::feed::Feed;
use quadfrog_console::graphics::GraphicsChoice;
use quadfrog_console::model::RobotFacts;
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::theme::{Role, Theme, ThemeChoice};

const RECORDING: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/console/session.mcap");
const SIZE: (u16, u16) = (120, 40);
const CELL: (u16, u16) = (10, 20);
const COLOURS: (&str, &str) = ("COLORTERM", "truecolor");
/// Time after which a still picture would have been sent.
const A_WHILE: Duration = Duration::from_secs(2);
/// The bytes with which a picture begins, by protocol.
const BEGINS: [&[u8]; 3] = [b"\x1b_Ga=T", b"\x1bP0;1;0q", b"\x1b]1337;File="];
const REMOVES_KITTY: &[u8] = b"\x1b_Ga=d,d=I,";
/// File at whose appearance [`a_console_with_a_picture_one_of_whose_threads_panics`] has its defect.
const TRIGGER: &str = "panic-now";

/// A picture that was sent.
struct Sent {
    /// Begin and end among the bytes.
    bytes: std::ops::Range<usize>,
    /// Row and column of the cursor, from 1.
    place: (usize, usize),
    /// Columns and rows that the sequence names.
    cells: Option<(usize, usize)>,
    width: usize,
    /// Red, green, blue over black, row by row.
    pixels: Vec<[u8; 3]>,
}

fn find(bytes: &[u8], wanted: &[u8], from: usize) -> Option<usize> {
    bytes[from..].windows(wanted.len()).position(|window| window == wanted).map(|at| from + at)
}

/// The numbers of a control sequence before `at`, which ends there.
fn cursor_before(bytes: &[u8], at: usize) -> (usize, usize) {
    let begin = bytes[..at].windows(2).rposition(|window| window == b"\x1b[").expect("the place of the cursor");
    let text = std::str::from_utf8(&bytes[begin + 2..at]).expect("text");
    let (row, column) = text.strip_suffix('H').expect("the place of the cursor").split_once(';').expect("two numbers");
    (row.parse().expect("a row"), column.parse().expect("a column"))
}

/// The value of a key in `key=value` pairs.
fn value(controls: &str, separator: char, key: &str) -> Option<usize> {
    controls.split(separator).find_map(|pair| pair.strip_prefix(key)?.strip_prefix('=')?.parse().ok())
}

fn png(file: &[u8]) -> (usize, Vec<[u8; 3]>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().expect("a PNG file");
    let mut buffer = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut buffer).expect("its pixels");
    assert_eq!(info.color_type, png::ColorType::Rgba);
    let over_black =
        |pixel: &[u8]| std::array::from_fn(|part| (u16::from(pixel[part]) * u16::from(pixel[3]) / 255) as u8);
    (info.width as usize, buffer[..info.buffer_size()].chunks(4).map(over_black).collect())
}

/// Pixels of sixel, over black.
fn sixel(text: &str) -> (usize, Vec<[u8; 3]>) {
    let mut characters = text.chars().peekable();
    let numbers = |characters: &mut std::iter::Peekable<std::str::Chars>| {
        let mut found = vec![0_usize];
        while let Some(c) = characters.next_if(|c| c.is_ascii_digit() || *c == ';') {
            match c.to_digit(10) {
                Some(digit) => *found.last_mut().unwrap() = 10 * found.last().unwrap() + digit as usize,
                None => found.push(0),
            }
        }
        found
    };
    assert_eq!(characters.next(), Some('"'));
    let raster = numbers(&mut characters);
    let (width, height) = (raster[2], raster[3]);
    let mut pixels = vec![[0; 3]; width * height];
    let mut colours = BTreeMap::new();
    let (mut x, mut y, mut colour) = (0, 0, [0; 3]);
    while let Some(c) = characters.next() {
        match c {
            '#' => match numbers(&mut characters)[..] {
                [index] => colour = colours[&index],
                [index, 2, red, green, blue] => {
                    let part = |percent: usize| (percent as f64 * 2.55).round() as u8;
                    colours.insert(index, [part(red), part(green), part(blue)]);
                }
                ref other => panic!("{other:?} after #"),
            },
            '$' => x = 0,
            '-' => (x, y) = (0, y + 6),
            _ => {
                let (count, c) = match c {
                    '!' => (numbers(&mut characters)[0], characters.next().expect("a run")),
                    c => (1, c),
                };
                let bits = u32::from(c) - u32::from('?');
                assert!(bits < 64, "{c:?}");
                for x in x..x + count {
                    (0..6).filter(|row| bits >> row & 1 == 1).for_each(|row| pixels[(y + row) * width + x] = colour);
                }
                x += count;
            }
        }
    }
    (width, pixels)
}

/// The pictures among the bytes sent to a terminal.
fn pictures(bytes: &[u8]) -> Vec<Sent> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(begin) = BEGINS.iter().filter_map(|begin| find(bytes, begin, at)).min() {
        let place = cursor_before(bytes, begin);
        let text = |from: usize, to: usize| std::str::from_utf8(&bytes[from..to]).expect("text");
        let end;
        let (cells, (width, pixels)) = if bytes[begin + 1] == b'P' {
            end = find(bytes, b"\x1b\\", begin).expect("the end of the picture");
            (None, sixel(text(begin + BEGINS[1].len(), end)))
        } else if bytes[begin + 1] == b']' {
            end = find(bytes, b"\x07", begin).expect("the end of the picture");
            let (controls, data) = text(begin + BEGINS[2].len(), end).split_once(':').expect("controls and data");
            let file = BASE64.decode(data).expect("base 64");
            assert_eq!(value(controls, ';', "size"), Some(file.len()));
            (value(controls, ';', "width").zip(value(controls, ';', "height")), png(&file))
        } else {
            let (mut data, mut from, mut cells) = (String::new(), begin, None);
            loop {
                let stop = find(bytes, b"\x1b\\", from).expect("the end of a part");
                let (controls, part) = text(from + 3, stop).split_once(';').expect("controls and data");
                assert!(part.len() <= 4096, "a part has {} characters", part.len());
                assert_eq!(value(controls, ',', "q"), Some(2), "no answer among the keys: {controls}");
                cells = cells.or(value(controls, ',', "c").zip(value(controls, ',', "r")));
                data.push_str(part);
                from = stop + 2;
                if value(controls, ',', "m") == Some(0) {
                    end = stop;
                    break;
                }
            }
            (cells, png(&BASE64.decode(data).expect("base 64")))
        };
        found.push(Sent { bytes: begin..end, place, cells, width, pixels });
        at = end;
    }
    found
}

/// A replay of a recorded session, paused, in a terminal.
fn paused(arguments: &[&str], cell: (u16, u16), variables: &[(&str, &str)]) -> (tempfile::TempDir, Session) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["replay", RECORDING]);
    command.args(arguments);
    let mut session = Session::run_in(folder.path(), &Setup { size: SIZE, cell, variables }, command);
    session.wait_for(&["REPLAY"]);
    session.send("p");
    session.wait_for(&["paused"]);
    (folder, session)
}

fn kitty() -> (tempfile::TempDir, Session) {
    let (folder, session) = paused(&["--graphics", "kitty"], CELL, &[COLOURS]);
    wait_for_picture(&session, 0);
    (folder, session)
}

/// Waits for a whole picture after the first `from` bytes.
fn wait_for_picture(session: &Session, from: usize) {
    let whole = |begin: &&[u8]| {
        let bytes = session.sent_bytes();
        // A frame ends with the end of its synchronized update.
        find(&bytes, begin, from).is_some_and(|at| find(&bytes, b"\x1b[?2026l", at).is_some())
    };
    session.wait_until("a picture is sent", || BEGINS.iter().any(whole));
}

fn sends_no_picture(session: &Session) {
    std::thread::sleep(A_WHILE);
    assert!(pictures(&session.sent_bytes()).is_empty());
}

/// Rows and columns, from 0, of the cells of the robot's panel with characters.
fn characters(session: &Session) -> Vec<(usize, usize)> {
    let screen = session.screen();
    let lines: Vec<Vec<char>> = screen.lines().map(|line| line.chars().collect()).collect();
    let left =
        |line: &Vec<char>| line.iter().collect::<String>().split("Robot ").next().map(|text| text.chars().count());
    let has = |line: &Vec<char>| line.iter().collect::<String>().contains("Robot ");
    let top = lines.iter().position(has).expect("the panel of the robot");
    let left = left(&lines[top]).expect("its column");
    let table = |line: &[char]| line.iter().find(|c| **c != ' ') == Some(&'#');
    let below = lines.iter().enumerate().skip(top + 1).take_while(|(_, line)| !table(line));
    let cells = below.flat_map(|(row, line)| {
        line.iter().enumerate().skip(left).filter(|(_, c)| **c != ' ').map(move |(column, _)| (row, column))
    });
    cells.collect()
}

#[test]
fn the_protocols_show_the_same_picture_in_the_place_of_the_characters() {
    let (_folder, cells) = paused(&["--graphics", "cells"], CELL, &[COLOURS]);
    std::thread::sleep(A_WHILE);
    let expected = characters(&cells);
    let sent: Vec<Sent> = ["kitty", "sixel", "iterm2"]
        .iter()
        .map(|protocol| {
            let (_folder, session) = paused(&["--graphics", protocol], CELL, &[COLOURS]);
            wait_for_picture(&session, 0);
            assert!(
                characters(&session).is_empty(),
                "{protocol}: no character below the picture:\n{}",
                session.screen()
            );
            let mut sent = pictures(&session.sent_bytes());
            assert_eq!(sent.len(), 1);
            println!("{protocol} at {SIZE:?}: {} bytes", sent[0].bytes.len());
            sent.remove(0)
        })
        .collect();
    let (columns, rows) = sent[0].cells.expect("columns and rows");
    assert_eq!(sent[2].cells, sent[0].cells);
    let shared = sent.iter().map(|picture| picture.pixels.len()).min().expect("three");
    for picture in &sent {
        assert_eq!(picture.place, sent[0].place);
        assert_eq!(picture.width, columns * usize::from(CELL.0));
        let height = picture.pixels.len() / picture.width;
        assert!((rows * usize::from(CELL.1) - 5..=rows * usize::from(CELL.1)).contains(&height));
        let differ = |(a, b): (&[u8; 3], &[u8; 3])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > 3);
        let differences = picture.pixels[..shared].iter().zip(&sent[0].pixels).filter(|pair| differ(*pair)).count();
        assert_eq!(differences, 0);
    }
    // Every character has pixels in its cell or in one beside it.
    let kitty = &sent[0];
    let lit = |row: usize, column: usize| {
        let (row, column) = (row + 1 - kitty.place.0, column + 1 - kitty.place.1);
        let (y, x) = (row * usize::from(CELL.1), column * usize::from(CELL.0));
        let (y, x) = (y.saturating_sub(10)..y + 30, x.saturating_sub(5)..x + 15);
        y.flat_map(|y| x.clone().map(move |x| (x, y)))
            .filter(|(x, _)| *x < kitty.width)
            .any(|(x, y)| kitty.pixels.get(y * kitty.width + x).is_some_and(|pixel| *pixel != [0; 3]))
    };
    let dark: Vec<_> = expected.iter().filter(|(row, column)| !lit(*row, *column)).collect();
    assert!(expected.len() > 50 && dark.is_empty(), "{dark:?}\n{}", cells.screen());
    // The near legs are bright and end below the trunk.
    let theme = Theme::new(quadfrog_console::theme::Colours::True, quadfrog_console::theme::Glyphs::Braille);
    let lowest = |role| {
        let (red, green, blue) = theme.rgb(role);
        let last = kitty.pixels.iter().rposition(|pixel| *pixel == [red, green, blue]);
        last.unwrap_or_else(|| panic!("no pixel of {role:?}")) / kitty.width
    };
    assert!(lowest(Role::Text) > lowest(Role::SeriesA));
}

#[test]
fn a_picture_is_sent_once_and_again_only_when_it_was_removed() {
    let (_folder, mut session) = kitty();
    std::thread::sleep(A_WHILE);
    assert_eq!(pictures(&session.sent_bytes()).len(), 1, "sent once");
    assert!(!session.sent(REMOVES_KITTY));
    // A dialog, another view, the whole screen again, another size.
    for (keys, back) in [("?", "\x1b"), ("2", "1"), ("\x0c", ""), ("", "")] {
        let from = session.bytes();
        match keys {
            "" => session.resize(130, 40),
            _ => session.send(keys),
        }
        session.wait_until("it is removed", || session.sent_after(from, REMOVES_KITTY));
        if !back.is_empty() {
            std::thread::sleep(A_WHILE);
            assert!(BEGINS.iter().all(|begin| !session.sent_after(from, begin)), "not beside {keys:?}");
            session.send(back);
        }
        wait_for_picture(&session, from);
    }
    // Time for the end of the picture at the new size.
    let last = pictures(&session.sent_bytes()).pop().expect("a picture");
    assert!(last.place.1 + last.cells.expect("cells").0 - 1 == 130, "at the right edge: {:?}", last.place);
    session.send("q");
    session.wait();
    let bytes = session.sent_bytes();
    let leaves = find(&bytes, b"\x1b[?1049l", 0).expect("the other screen");
    assert!(find(&bytes[..leaves], REMOVES_KITTY, last.bytes.end).is_some(), "removed before the screen is left");
}

/// Sixel and iTerm2 have no identifiers: the cells are erased.
#[test]
fn pictures_without_identifiers_are_erased_with_their_cells() {
    for protocol in ["sixel", "iterm2"] {
        let (_folder, mut session) = paused(&["--graphics", protocol], CELL, &[COLOURS]);
        wait_for_picture(&session, 0);
        let sent = pictures(&session.sent_bytes()).remove(0);
        let from = session.bytes();
        session.send("?");
        session.wait_for(&["Keys ("]);
        let bytes = session.sent_bytes();
        let (row, column) = sent.place;
        let rows = (sent.pixels.len() / sent.width).div_ceil(usize::from(CELL.1));
        for row in row..row + rows {
            let erase = format!("\x1b[{row};{column}H\x1b[{}X", sent.width / usize::from(CELL.0));
            assert!(find(&bytes, erase.as_bytes(), from).is_some(), "{protocol}: row {row} is erased");
        }
    }
}

#[test]
fn suspending_and_a_panic_remove_the_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let setup = Setup { size: SIZE, cell: CELL, variables: &[COLOURS] };
    let mut session = Session::shell(folder.path(), &setup);
    session.send(&format!("{} replay {RECORDING} --graphics kitty\r", env!("CARGO_BIN_EXE_quadfrog")));
    session.wait_for(&["REPLAY"]);
    session.send("p");
    session.wait_for(&["paused"]);
    wait_for_picture(&session, 0);
    let from = session.bytes();
    session.send("\x1a");
    session.wait_for(&["Stopped"]);
    assert!(session.sent_after(from, REMOVES_KITTY));
    let from = session.bytes();
    session.send("fg\r");
    wait_for_picture(&session, from);
    session.send("q");
    session.wait_until("the prompt", || session.screen().trim_end().ends_with("shell>"));
    session.send("exit\r");
    session.wait();

    let mut command = CommandBuilder::new(std::env::current_exe().expect("this program"));
    command.args([
        "--ignored",
        "--exact",
        "graphics::a_console_with_a_picture_one_of_whose_threads_panics",
        "--nocapture",
    ]);
    let mut session = Session::run_in(folder.path(), &setup, command);
    session.wait_for(&["REPLAY"]);
    session.send("p");
    wait_for_picture(&session, 0);
    let picture = pictures(&session.sent_bytes()).remove(0);
    std::fs::write(folder.path().join(TRIGGER), "").expect("writes");
    assert!(!session.wait().success());
    let bytes = session.sent_bytes();
    let leaves = find(&bytes, b"\x1b[?1049l", 0).expect("the other screen");
    assert!(find(&bytes[..leaves], REMOVES_KITTY, picture.bytes.end).is_some(), "removed before the screen is left");
    assert!(session.sent(b"an injected defect"));
}

#[test]
#[ignore = "run by another test in a terminal"]
fn a_console_with_a_picture_one_of_whose_threads_panics() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/console/session.mcap");
    let mut settings = ConsoleSettings::built_in();
    settings.graphics = GraphicsChoice::Kitty;
    // In the present folder, that of the test which waits for the picture.
    let defect = || {
        while !Path::new(TRIGGER).exists() {
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("an injected defect");
    };
    std::thread::Builder::new().name("injected".into()).spawn(defect).expect("a thread");
    let feed = Feed::replay(Player::open(file).expect("the recorded session"));
    let robot = RobotFacts { description: RobotDescription::embedded("go1").ok(), ..RobotFacts::default() };
    let options = ConsoleOptions::new(settings, None, ThemeChoice::Auto, false, false).with_robot(robot);
    let ended = app::run(feed, options);
    panic!("{}", ended.expect_err("the console ends with an error"));
}

#[test]
fn auto_takes_the_protocol_that_the_environment_names() {
    let shows = |variables: &[(&str, &str)], protocol: usize| {
        let (_folder, session) = paused(&[], CELL, &[&[COLOURS], variables].concat());
        wait_for_picture(&session, 0);
        let others = (0..3).filter(|other| *other != protocol);
        assert!(session.sent(BEGINS[protocol]), "{variables:?}");
        assert!(!others.into_iter().any(|other| session.sent(BEGINS[other])), "{variables:?}");
        assert!(!session.sent(b"\x1b[c"), "nothing to ask");
    };
    shows(&[("TERM", "xterm-kitty")], 0);
    shows(&[("TERM", "foot")], 1);
    shows(&[("TERM_PROGRAM", "WezTerm")], 2);
}

#[test]
fn auto_takes_sixel_where_the_terminal_reports_it() {
    for (answer, shows) in [("\x1b[?62;4;22c", true), ("\x1b[?64;22c", false), ("", false)] {
        let (_folder, mut session) = paused(&[], CELL, &[COLOURS]);
        assert!(session.sent(b"\x1b[c"), "asked");
        session.send(answer);
        match shows {
            true => wait_for_picture(&session, 0),
            false => sends_no_picture(&session),
        }
        // The answer was no key.
        assert!(session.screen().contains("paused") && !session.screen().contains("no such"));
    }
}

#[test]
fn characters_stay_where_pixels_are_not_known_to_be_shown_or_not_wanted() {
    let kitty = [COLOURS, ("TERM", "xterm-kitty")];
    let within = |name: &'static str, value: &'static str| [&kitty[..], &[(name, value)]].concat();
    type Case<'a> = (&'a [&'a str], (u16, u16), Vec<(&'a str, &'a str)>);
    let cases: [Case; 8] = [
        (&[], CELL, within("TMUX", "/tmp/tmux-0/default,1,0")),
        (&[], CELL, within("STY", "1.session")),
        (&[], CELL, within("TERM", "tmux-256color")),
        (&[], (0, 0), kitty.to_vec()),
        (&["--graphics", "cells"], CELL, kitty.to_vec()),
        (&["--graphics", "kitty", "--ascii"], CELL, kitty.to_vec()),
        (&["--graphics", "kitty", "--color", "never"], CELL, kitty.to_vec()),
        (&["--graphics", "kitty", "--low-bandwidth"], CELL, kitty.to_vec()),
    ];
    let sessions = cases.map(|(arguments, cell, variables)| paused(arguments, cell, &variables));
    std::thread::sleep(A_WHILE);
    for (_folder, session) in &sessions {
        assert!(!session.sent(b"\x1b_G") && !session.sent(b"\x1bP") && !session.sent(b"\x1b]1337"));
        assert!(!session.sent(b"\x1b[c"), "no question either");
        assert!(!characters(session).is_empty());
    }
}

/// A trial is drawn in characters, the robot at rest before and after it in pixels, at 10 kbit/s at most.
#[test]
fn a_robot_that_moves_is_drawn_in_characters() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["--seed", "3", "--graphics", "kitty", "--output"]);
    command.arg(folder.path());
    let begun = std::time::Instant::now();
    let setup = Setup { size: SIZE, cell: CELL, variables: &[COLOURS] };
    let mut session = Session::run_in(folder.path(), &setup, command);
    session.wait_for(&["Press A to arm"]);
    wait_for_picture(&session, 0);
    let from = session.bytes();
    session.send("A");
    session.wait_for(&["STAND UP"]);
    session.wait_until("it is removed", || session.sent_after(from, REMOVES_KITTY));
    assert!(!characters(&session).is_empty());
    session.wait_for(&["READY"]);
    wait_for_picture(&session, from);
    let from = session.bytes();
    session.approve();
    session.wait_for_long("the jump", || session.screen().contains("JUMP"));
    assert!(!characters(&session).is_empty());
    assert!(BEGINS.iter().all(|begin| !session.sent_after(from, begin)), "no picture in the countdown");
    session.wait_for_long("the review", || session.screen().contains("REVIEW"));
    assert!(BEGINS.iter().all(|begin| !session.sent_after(from, begin)), "no picture in the jump");
    wait_for_picture(&session, from);
    std::thread::sleep(A_WHILE);
    let sent = pictures(&session.sent_bytes());
    let sizes: Vec<usize> = sent.iter().map(|picture| picture.bytes.len()).collect();
    let seconds = begun.elapsed().as_secs_f64();
    println!("pictures of {sizes:?} bytes in {seconds:.1} s");
    // The last one counts for the time after it.
    let before_last: usize = sizes.iter().rev().skip(1).sum();
    assert!(8.0 * before_last as f64 <= 10_000.0 * seconds, "{sizes:?} bytes in {seconds:.1} s");
    session.quit();
}
