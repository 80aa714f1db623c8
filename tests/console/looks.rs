//! Colours for dark and light backgrounds, the terminal's report of its background, and frames that appear whole.

use std::path::Path;
use std::time::Duration;

use crate::pty::Session;
use portable_pty::CommandBuilder;
use quadfrog_console::input::{Decoder, TerminalEvent};
use quadfrog_console::theme::{Background, Colours, Glyphs, Role, Theme};
use ratatui::style::Color;

/// Least contrast of text: WCAG 2.2, criterion 1.4.3.
const LEAST_CONTRAST: f64 = 4.5;

/// Relative luminance, WCAG 2.2.
fn luminance(rgb: [u8; 3]) -> f64 {
    let [r, g, b] = rgb.map(|part| {
        let part = f64::from(part) / 255.0;
        if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
    });
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

fn contrast(a: [u8; 3], b: [u8; 3]) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Red, green and blue of a colour, of the 256 as xterm has them.
fn rgb(colour: Color) -> [u8; 3] {
    match colour {
        Color::Rgb(r, g, b) => [r, g, b],
        Color::Indexed(index @ 16..=231) => {
            let level = |step: u8| if step == 0 { 0 } else { 55 + 40 * step };
            let index = index - 16;
            [level(index / 36), level(index / 6 % 6), level(index % 6)]
        }
        Color::Indexed(index @ 232..) => [8 + 10 * (index - 232); 3],
        other => panic!("{other:?} is the terminal's own colour"),
    }
}

/// Usual backgrounds: black and white, and those of VS Code, One Dark, Dracula, Gruvbox, Solarized and GNOME Terminal.
const DARK: [[u8; 3]; 6] = [[0, 0, 0], [30, 30, 30], [40, 44, 52], [40, 42, 54], [40, 40, 40], [0, 43, 54]];
const LIGHT: [[u8; 3]; 4] = [[255, 255, 255], [253, 246, 227], [245, 245, 245], [250, 250, 250]];

const TEXT: [Role; 8] =
    [Role::Quiet, Role::Heading, Role::Good, Role::Warning, Role::Bad, Role::SeriesA, Role::SeriesB, Role::Ghost];

fn themes() -> impl Iterator<Item = (Theme, &'static [[u8; 3]])> {
    [Colours::True, Colours::Indexed].into_iter().flat_map(|colours| {
        let theme = |background| Theme { background, ..Theme::new(colours, Glyphs::Braille) };
        [(theme(Background::Dark), &DARK[..]), (theme(Background::Light), &LIGHT[..])]
    })
}

#[test]
fn text_is_legible_on_usual_dark_and_light_backgrounds() {
    for (theme, backgrounds) in themes() {
        for role in TEXT {
            let text = rgb(theme.style(role).fg.expect("a colour"));
            for background in backgrounds {
                let found = contrast(text, *background);
                assert!(found >= LEAST_CONTRAST, "{theme:?} {role:?} on {background:?}: {found:.2}");
            }
        }
        for role in [Role::Alarm, Role::Hardware] {
            let style = theme.style(role);
            let found = contrast(rgb(style.fg.expect("a colour")), rgb(style.bg.expect("a colour")));
            assert!(found >= LEAST_CONTRAST, "{theme:?} {role:?}: {found:.2}");
        }
    }
}

#[test]
fn curves_are_legible_on_the_shaded_phases() {
    for (theme, _) in themes() {
        for shade in [Role::ShadeImpulse, Role::ShadeFlight, Role::ShadeLanding] {
            let shade = rgb(theme.style(shade).bg.expect("a colour"));
            for role in TEXT {
                let found = contrast(rgb(theme.style(role).fg.expect("a colour")), shade);
                assert!(found >= LEAST_CONTRAST, "{theme:?} {role:?} on {shade:?}: {found:.2}");
            }
        }
    }
}

/// The inputs of bytes that arrive at once, then a pause.
fn decoded(bytes: &[u8]) -> Vec<TerminalEvent> {
    let (mut decoder, mut inputs) = (Decoder::new(false), Vec::new());
    bytes.iter().for_each(|byte| decoder.take(*byte, &mut inputs));
    decoder.idle(&mut inputs);
    inputs
}

fn key(name: &str) -> TerminalEvent {
    TerminalEvent::Key(name.parse().expect("a key"))
}

#[test]
fn the_report_of_the_background_is_read_in_every_usual_form() {
    for (report, background) in [
        (&b"\x1b]11;rgb:0000/0000/0000\x1b\\"[..], Background::Dark),
        (b"\x1b]11;rgb:1e1e/1e1e/1e1e\x07", Background::Dark),
        (b"\x1b]11;rgb:0000/2b2b/3636\x07", Background::Dark),
        (b"\x1b]11;rgb:ffff/ffff/ffff\x1b\\", Background::Light),
        (b"\x1b]11;rgb:fd/f6/e3\x1b\\", Background::Light),
        (b"\x1b]11;rgba:ffff/ffff/ffff/8000\x07", Background::Light),
    ] {
        assert_eq!(decoded(report), [TerminalEvent::Background(background)], "{report:?}");
    }
    // None of these is a colour.
    for report in
        [&b"\x1b]11;rgb:ffff/ffff\x07"[..], b"\x1b]11;rgb:zz/zz/zz\x07", b"\x1b]10;rgb:0/0/0\x07", b"\x1b]11;\x07"]
    {
        assert_eq!(decoded(report), [], "{report:?}");
    }
}

#[test]
fn keys_around_the_report_of_the_background_are_kept() {
    let light = TerminalEvent::Background(Background::Light);
    assert_eq!(decoded(b"a\x1b]11;rgb:ff/ff/ff\x1b\\b"), [key("a"), light.clone(), key("b")]);
    assert_eq!(decoded(b"\x1b]11;rgb:ff/ff/ff\x07\x1b[A"), [light, key("Up")]);
    assert_eq!(decoded(b"\x1b]g"), [key("Alt-]"), key("g")], "Alt and ] is a key");
    assert_eq!(decoded(b"\x1b]"), [key("Alt-]")]);
    assert_eq!(decoded(b"\x1b]11;rgb:\r"), [key("Enter")], "a broken report ends at a key that is no part of one");
}

#[test]
fn a_report_that_never_ends_hides_no_key_that_stops() {
    for (bytes, name) in [(&b" "[..], "Space"), (b"\x03", "Ctrl-C"), (b"\x1b[24~", "F12")] {
        for report in [&b"\x1b]"[..], b"\x1b]1", b"\x1b]11;rgb:ffff/", b"\x1b]11;rgb:ffff/ffff/ffff\x1b"] {
            let stops = |event: &TerminalEvent| matches!(event, TerminalEvent::Key(key) if key.stops());
            let found = decoded(&[report, bytes].concat());
            assert!(found.iter().any(stops), "{name} after {report:?}: {found:?}");
        }
    }
}

const SIZE: (u16, u16) = (100, 30);
const QUESTION: &[u8] = b"\x1b]11;?";
/// Foreground of labels for a dark and for a light background, of the 256 colours.
const DARK_GREY: &[u8] = b"38;5;248";
const LIGHT_GREY: &[u8] = b"38;5;240";

/// A console on a terminal of 256 colours.
fn opened(folder: &Path, arguments: &[&str]) -> Session {
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["--output", "recordings"]);
    command.args(arguments);
    command.env_remove("COLORTERM");
    command.env_remove("COLORFGBG");
    Session::run(folder, SIZE, command)
}

#[test]
fn the_program_takes_the_colours_for_the_background_that_the_terminal_reports() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = opened(folder.path(), &[]);
    session.wait_until("it asks for the background", || session.sent(QUESTION));
    session.send("\x1b]11;rgb:ffff/ffff/ffff\x1b\\2");
    session.wait_for(&["Press A to arm"]);
    session.wait_until("light colours", || session.sent(LIGHT_GREY));
    session
        .wait_until("the key behind the report opened Trials", || !session.screen().contains("no judged trial near"));
    let before = session.bytes();
    session.send("W");
    session.wait_for(&["colours for a dark background"]);
    session.wait_until("dark colours", || session.sent_after(before, DARK_GREY));
    // The operator's choice stays, whatever the terminal reports afterwards.
    let before = session.bytes();
    session.send("\x1b]11;rgb:ffff/ffff/ffff\x1b\\");
    session.send("1");
    session.wait_for(&["no judged trial near"]);
    assert!(!session.sent_after(before, LIGHT_GREY));
    assert!(session.quit().success());
}

#[test]
fn a_terminal_that_reports_no_background_keeps_dark_colours_and_its_keys() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = opened(folder.path(), &[]);
    session.wait_for(&["Press A to arm"]);
    assert!(session.sent(QUESTION) && session.sent(DARK_GREY) && !session.sent(LIGHT_GREY));
    session.send("5");
    session.wait_for(&["Arming checks"]);
    assert!(session.quit().success());
}

#[test]
fn a_chosen_theme_asks_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    for (arguments, grey) in [(["--theme", "light"], LIGHT_GREY), (["--theme", "dark"], DARK_GREY)] {
        let mut session = opened(folder.path(), &arguments);
        session.wait_for(&["Press A to arm"]);
        session.wait_until("its colours", || session.sent(grey));
        assert!(!session.sent(QUESTION), "{arguments:?}");
        assert!(session.quit().success());
    }
}

#[test]
fn every_frame_is_a_synchronized_update_except_over_a_slow_link() {
    let (begin, end) = (&b"\x1b[?2026h"[..], &b"\x1b[?2026l"[..]);
    let folder = tempfile::tempdir().expect("a folder");
    let mut session = opened(folder.path(), &[]);
    session.wait_for(&["Press A to arm"]);
    std::thread::sleep(Duration::from_millis(500));
    assert!(session.quit().success());
    let output = session.sent_bytes();
    let marks = |mark: &[u8]| output.windows(mark.len()).filter(|window| *window == mark).count();
    assert!(marks(begin) > 3, "{} frames", marks(begin));
    // The restoration ends an update, too.
    assert_eq!(marks(end), marks(begin) + 1);
    let text = String::from_utf8_lossy(&output).into_owned();
    let outside: String =
        text.split("\x1b[?2026h").map(|part| part.split_once("\x1b[?2026l").map_or("", |(_, rest)| rest)).collect();
    assert!(!outside.contains("DISARMED") && !outside.contains("STOP"), "drawn outside of an update: {outside:?}");

    let mut session = opened(folder.path(), &["--low-bandwidth"]);
    session.wait_for(&["Press A to arm"]);
    assert!(!session.sent(begin));
    assert!(session.quit().success());
}
