//! The screen at every size and in every state: mode, STOP and the next step are always shown.

use crate::support;
use crate::support::{Console, VIEWS, assert_shows, line_with, tick, trial};
use quadfrog::recording::record::{LogLevel, LogRecord, Record};
use quadfrog::telemetry::{Mode, Phase};
use quadfrog::trial::{ExperimentStage, Verdict};
use quadfrog_console::message::{Msg, ReplayStatus};
use quadfrog_console::model::Notice;
use quadfrog_console::settings::ConsoleSettings;
use quadfrog_console::theme::{Colours, Glyphs, Role, Theme};

const SIZES: [(u16, u16); 3] = [(80, 24), (120, 40), (200, 60)];

#[test]
fn mode_backend_stop_and_next_step_are_on_every_screen() {
    let leads = [
        (Mode::Offline, "Waiting for the robot"),
        (Mode::Disarmed, "Press A to arm"),
        (Mode::StandUp, "Standing up"),
        (Mode::Ready, "Press g twice to jump."),
        (Mode::Countdown, "any key cancels"),
        (Mode::Jump, "Jumping"),
        (Mode::Settle, "Landed"),
        (Mode::SitDown, "Sitting down"),
        (Mode::Damped, "k acknowledges"),
        (Mode::Fault, "k acknowledges"),
    ];
    for (columns, rows) in SIZES {
        for (mode, lead) in leads {
            for view in VIEWS {
                let mut console = Console::proposed();
                console.press(&[view]);
                console.mode(mode);
                let screen = console.screen(columns, rows);
                let first = screen.lines().next().unwrap_or_default();
                assert!(first.contains(mode.name()) && first.contains("SIM"), "{first}");
                assert!(screen.lines().nth(1).is_some_and(|line| line.contains("STOP  Space F12")), "{screen}");
                let last = screen.lines().last().unwrap_or_default();
                assert!(last.contains(lead), "{mode:?} {columns}x{rows}: {last}");
            }
        }
    }
}

#[test]
fn a_long_reason_does_not_hide_the_key_that_acknowledges() {
    let mut console = Console::proposed();
    console.mode(Mode::Fault);
    console.model.session.stopped_because = "roll 1.200 rad exceeds 1.000 rad, ".repeat(5);
    let screen = console.screen(80, 24);
    assert!(screen.lines().last().is_some_and(|line| line.contains("k acknowledges")), "{screen}");
}

#[test]
fn no_dialog_covers_the_frame_the_answer_or_the_next_step() {
    for opening in ["g", "o", "m", ":", "?", "q", "Enter"] {
        for (columns, rows) in SIZES {
            let mut console = Console::ready();
            console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
            console.press(&[opening]);
            console.answer("override Fx = 120", true, "done");
            assert!(console.model.dialog.is_some(), "{opening}");
            let screen = console.screen(columns, rows);
            let lines: Vec<&str> = screen.lines().collect();
            assert!(lines[0].contains("READY") && lines[1].contains("STOP"), "{screen}");
            assert!(lines[lines.len() - 2].contains("override Fx = 120: done"), "{opening}: {screen}");
            assert!(!lines[lines.len() - 1].trim().is_empty(), "{opening}: {screen}");
        }
    }
}

#[test]
fn a_small_terminal_shows_mode_stop_and_the_size_needed() {
    let console = Console::ready();
    for (columns, rows) in [(59, 24), (80, 19), (40, 10), (20, 6)] {
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["READY", "STOP", "Space F12", "needed 60x20"]);
    }
}

/// Regression: below 60x20 no dialog was drawn, whose keys worked, nor what a stopped robot needs, nor that the numbers were old.
#[test]
fn a_small_terminal_shows_the_question_the_next_step_and_that_the_numbers_are_old() {
    let mut console = Console::ready();
    console.update(Msg::Resize(50, 12));
    // Both keys are refused at this size.
    assert!(!console.screen(50, 12).contains("Press g"), "{}", console.screen(50, 12));
    console.press(&["q"]);
    assert_shows(&console.screen(50, 12), &["Press y to quit. Any other key cancels."]);
    console.press(&["Esc"]);
    console.mode(Mode::Damped);
    assert_shows(&console.screen(50, 12), &["k acknowledges"]);
    assert!(!console.screen(50, 12).contains("OLD"));
    console.hang(1200);
    assert_shows(&console.screen(50, 12), &["OLD: nothing new for 1.2 s"]);
}

/// Too small for the views, the terminal still has room for a jump: the whole proposal, the answer and the next step.
#[test]
fn a_compact_terminal_shows_the_trial_the_answer_and_the_next_step_whole() {
    for (columns, rows) in [(60, 20), (79, 24), (80, 23), (200, 20)] {
        let mut console = Console::ready();
        console.model.size = (columns, rows);
        let long = "a long answer, of which no word may be missing: ".repeat(2) + "the end";
        console.model.message = Some(Notice {
            level: LogLevel::Warning,
            text: long.clone(),
            stop: false,
            answer: false,
            own: false,
            at: console.model.clock,
        });
        let screen = console.screen(columns, rows);
        assert_shows(
            &screen,
            &["READY", "STOP", "Space F12", "Trial #0", "f0", "Fx", "Fz", "Press g twice to jump", "skip"],
        );
        let words: String = screen.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(&long), "{columns}x{rows}: {screen}");
        console.press(&["g"]);
        assert_shows(&console.screen(columns, rows), &["Jump?", "Press g again to jump"]);
        console.press(&["Esc"]);
        // A proposal that is longer than the panel cannot be approved.
        let info = &mut console.model.session.info;
        let one = info.parameters[0].clone();
        info.parameters.extend(std::iter::repeat_n(one, 12));
        console.press(&["g"]);
        assert!(console.said().contains("the proposal must be visible"), "{columns}x{rows}: {}", console.said());
    }
}

#[test]
fn no_size_makes_drawing_fail() {
    for glyphs in [Glyphs::Braille, Glyphs::Ascii] {
        for view in VIEWS {
            let mut console = Console::with(ConsoleSettings::built_in(), Theme::new(Colours::None, glyphs));
            console.ticks(0..9000, |time_ms| (time_ms as f64 / 300.0).sin());
            console.record(Record::Session(support::session()));
            console.judged(30);
            console.press(&[view]);
            for (columns, rows) in [(1, 1), (0, 0), (3, 200), (300, 2), (80, 24), (81, 25), (300, 100), (500, 24)] {
                console.screen(columns, rows);
            }
        }
    }
}

#[test]
fn ascii_is_ascii_on_every_screen() {
    for view in VIEWS {
        for opening in ["", "g", "o", ":", "?"] {
            let theme = Theme::new(Colours::None, Glyphs::Ascii);
            let mut console = Console::with(ConsoleSettings::built_in(), theme);
            console.record(Record::Session(support::session()));
            console.record(Record::Proposal(support::proposal(3, 0)));
            console.judged(3);
            console.stage(ExperimentStage::Proposed, 3);
            console.ticks(0..9000, |time_ms| (time_ms as f64 / 300.0).sin());
            console.mode(Mode::Ready);
            console.press(&[view]);
            if !opening.is_empty() {
                console.press(&[opening]);
            }
            let screen = console.screen(120, 40);
            assert!(screen.is_ascii(), "view {view}, dialog {opening}:\n{screen}");
        }
    }
}

#[test]
fn the_review_shows_the_measured_values_and_the_suggested_verdict() {
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["Trial #0: judge it", "0.420 m", "rise +0.300 m", "suggested verdict: accept", "a accept (suggested)"],
    );
    console = Console::review(Mode::Damped, Verdict::Fall);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["DAMPED", "suggested verdict: fall (roll", "f fall (suggested)", "fall?"]);
}

#[test]
fn a_sweeping_chart_changes_only_near_its_cursor() {
    let mut console = Console::ready();
    console.ticks(0..20_000, |time_ms| 0.2 * (time_ms as f64 / 300.0).sin());
    let before = console.screen(80, 24);
    console.ticks(20_000..20_100, |time_ms| 0.2 * (time_ms as f64 / 300.0).sin());
    let after = console.screen(80, 24);
    let changed = before.chars().zip(after.chars()).filter(|(a, b)| a != b).count();
    assert!(changed < 60, "{changed} of 1920 characters changed in a tenth of a second");
    assert!(changed > 0);
}

#[test]
fn the_phases_of_a_jump_are_named_under_the_charts() {
    let mut console = Console::ready();
    for time_ms in (0..7_000).step_by(5) {
        let jump = match time_ms {
            2_000..2_500 => Some(Phase::Impulse),
            2_500..3_000 => Some(Phase::Flight),
            3_000..3_800 => Some(Phase::Landing),
            _ => None,
        };
        let trial = jump.map(|phase| (0, (time_ms as f64 - 2_000.0) / 1e3, phase));
        console.tick(tick(time_ms, 0.0, trial));
    }
    let screen = console.screen(120, 40);
    assert!(screen.lines().any(|line| line.contains("│─│─│")), "{screen}");
}

#[test]
fn colours_follow_the_terminal_and_no_color() {
    use quadfrog_console::theme::{ColourChoice, GlyphChoice};
    let theme = |pairs: &[(&str, &str)]| {
        let pairs: Vec<(String, String)> = pairs.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
        Theme::detect(ColourChoice::Auto, GlyphChoice::Auto, |name| {
            pairs.iter().find(|(known, _)| known == name).map(|(_, value)| value.clone())
        })
    };
    assert_eq!(theme(&[("TERM", "xterm-256color"), ("LANG", "en_US.UTF-8")]).colours, Colours::Indexed);
    assert_eq!(theme(&[("TERM", "xterm"), ("COLORTERM", "truecolor")]).colours, Colours::True);
    assert_eq!(theme(&[("TERM", "xterm"), ("NO_COLOR", "1"), ("COLORTERM", "truecolor")]).colours, Colours::None);
    assert_eq!(theme(&[("TERM", "linux"), ("LANG", "C.UTF-8")]).glyphs, Glyphs::Dots);
    assert_eq!(theme(&[("TERM", "xterm"), ("LANG", "C")]).glyphs, Glyphs::Ascii);
    assert_eq!(theme(&[("TERM", "xterm"), ("LC_ALL", "C"), ("LANG", "en_US.UTF-8")]).glyphs, Glyphs::Ascii);
    assert_eq!(theme(&[("TERM", "xterm"), ("LANG", "de_DE.utf8")]).glyphs, Glyphs::Braille);
}

#[test]
fn without_colours_no_cell_is_coloured() {
    use ratatui::style::Color;
    let mut console = Console::with(ConsoleSettings::built_in(), Theme::new(Colours::None, Glyphs::Braille));
    console.record(Record::Session(support::session()));
    console.mode(Mode::Fault);
    for cell in console.draw(120, 40).content() {
        assert_eq!((cell.fg, cell.bg), (Color::Reset, Color::Reset));
    }
}

/// Regression: a report of twenty minutes ago looked like the newest event.
#[test]
fn an_old_report_is_grey_and_has_its_age() {
    let mut console = Console::ready();
    let slow = LogRecord { level: LogLevel::Warning, source: "recorder".into(), message: "the disk is slow".into() };
    console.record(Record::Log(slow));
    let shown = |console: &Console| line_with(&console.screen(80, 24), "the disk");
    assert_eq!(shown(&console).trim(), "the disk is slow");
    console.wait(59_000);
    assert_eq!(shown(&console).trim(), "the disk is slow");
    console.wait(125_000);
    assert_eq!(shown(&console).trim(), "3 min ago: the disk is slow");
    let (buffer, row) = (console.draw(80, 24), 22);
    assert_eq!(buffer[(1, row)].modifier, console.model.theme.style(Role::Quiet).add_modifier);
}

/// Regression: the keys that had no room were left out without a mark.
#[test]
fn the_line_of_keys_says_where_the_others_are() {
    let mut console = Console::ready();
    console.update(Msg::Replay(ReplayStatus::default()));
    let last = |console: &Console, columns| console.screen(columns, 24).lines().last().unwrap_or_default().to_owned();
    assert!(last(&console, 80).ends_with("? more"), "{}", last(&console, 80));
    assert!(last(&console, 200).ends_with("q quit"), "{}", last(&console, 200));
    // The suggested verdict of a stopped trial comes before the key of the help.
    let stopped = Console::review(Mode::Damped, Verdict::Void);
    assert!(last(&stopped, 80).ends_with("k acknowledges: test · v void (suggested)"), "{}", last(&stopped, 80));
}
