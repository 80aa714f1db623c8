//! Keys of the views in, screen out: charts, trial table, mouse, replay.

use std::path::Path;

use crate::support::{Console, assert_shows, line_with, session, tick, trial};
use quadfrog::recording::player::Player;
use quadfrog::recording::record::{Record, StageRecord, Transition};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{Mode, Phase, Snapshot};
use quadfrog::trial::{Displacement, DrawnRange, ExperimentStage, JumpRow, SKIPPED, TrialRecord, Verdict};
use quadfrog_console::feed::Feed;
use quadfrog_console::message::{Effect, ExportedRows, Mouse, Msg, ReplayStatus};
use quadfrog_console::model::View;
use quadfrog_console::model::dialog::Dialog;
use quadfrog_console::model::session::SessionModel;
use quadfrog_console::settings::{BellCause, ConsoleSettings, DEFAULT};
use quadfrog_console::text;
use quadfrog_console::theme::{Colours, Glyphs, Theme};
use strum::VariantArray;

/// A console after the jumps of some trials, each a second after the one before; roll depends on the trial.
fn jumped(trials: &[u32]) -> Console {
    let mut console = Console::ready();
    for (index, number) in trials.iter().enumerate() {
        let from_ms = 1_000 + 2_000 * index as u64;
        for time_ms in (0..1_000).step_by(5) {
            let phase = match time_ms {
                0..200 => Phase::Stance,
                200..400 => Phase::Impulse,
                400..700 => Phase::Flight,
                _ => Phase::Landing,
            };
            let jump = Some((*number, time_ms as f64 / 1e3 - 0.2, phase));
            let roll = 0.01 * f64::from(*number) + 0.1 * (time_ms as f64 / 200.0).sin();
            console.tick(tick(from_ms + time_ms, roll, jump));
        }
        console.record(Record::Trial(trial(*number, Some(Verdict::Accept), None)));
    }
    console
}

#[test]
fn frozen_charts_stand_still_and_every_view_says_for_how_long() {
    let mut console = jumped(&[0]);
    console.press(&["z"]);
    let before = console.screen(80, 24);
    console.ticks(5_000..9_000, |_| 0.2);
    console.wait(12_300);
    let after = console.screen(80, 24);
    assert!(after.contains("FROZEN -12.3 s"), "{after}");
    let charts = |screen: &str| screen.lines().skip(3).take(14).collect::<Vec<_>>().join("\n");
    assert_eq!(charts(&before), charts(&after));
    for view in ["2", "3", "4", "5", "6"] {
        console.press(&[view]);
        assert!(console.screen(80, 24).contains("FROZEN"), "view {view}");
    }
    console.press(&["1", "z"]);
    let running = console.screen(80, 24);
    assert!(!running.contains("FROZEN") && charts(&running) != charts(&before), "{running}");
    assert!(running.contains("the charts show the present"), "{running}");
}

/// Regression: arming the simulated robot, which no question precedes, left the charts frozen.
#[test]
fn arming_ends_frozen_charts() {
    let mut console = Console::proposed();
    console.press(&["z"]);
    assert!(console.screen(80, 24).contains("FROZEN"));
    console.press(&["A"]);
    let armed = console.screen(80, 24);
    assert!(!armed.contains("FROZEN"), "{armed}");
}

/// Regression: charts that were frozen before stood still through arming, countdown and jump.
#[test]
fn an_approval_ends_frozen_charts() {
    let mut console = Console::ready();
    console.press(&["z"]);
    let frozen = console.screen(80, 24);
    assert!(frozen.contains("the charts are frozen; z shows the present") && frozen.contains("FROZEN"), "{frozen}");
    console.press(&["g"]);
    console.wait(1_000);
    assert!(console.screen(80, 24).contains("FROZEN"), "the question alone");
    console.press(&["g"]);
    let approved = console.screen(80, 24);
    assert!(!approved.contains("FROZEN"), "{approved}");
}

#[test]
fn the_cursor_reads_the_values_of_its_time() {
    let mut console = Console::ready();
    console.ticks(0..8_000, |time_ms| time_ms as f64 * 1e-5);
    assert!(console.screen(80, 24).contains("roll +0.080 rad"));
    // Each step is a hundredth of the window of 8 s.
    console.press(&["Left", "Left", "Left", "Left", "Left"]);
    let screen = console.screen(80, 24);
    assert!(screen.contains("roll +0.076 rad") && screen.contains("cursor -0.40 s"), "{screen}");
    console.press(&["Right", "Right", "Right", "Right", "Right", "Right"]);
    assert!(console.screen(80, 24).contains("cursor 0.00 s"), "not beyond the newest sample");
}

#[test]
fn zooming_halves_and_doubles_the_window_from_1_to_60_s() {
    let mut console = Console::ready();
    assert!(console.screen(80, 24).contains("8 s sweep"));
    console.press(&["+"]);
    assert!(console.screen(80, 24).contains("4 s sweep"));
    console.press(&["+", "+", "+", "+"]);
    assert!(console.screen(80, 24).contains(" 1 s sweep"));
    console.press(&["-"; 10]);
    assert!(console.screen(80, 24).contains("60 s sweep"));
}

#[test]
fn sweep_and_scroll_draw_the_same_samples_at_different_places() {
    let mut console = jumped(&[0]);
    let sweep = console.screen(120, 40);
    console.press(&["w"]);
    let scroll = console.screen(120, 40);
    assert!(sweep.contains("8 s sweep") && scroll.contains("8 s scroll"));
    let newest = |screen: &str| line_with(screen, "─│──").find("─│──");
    assert!(newest(&sweep) < newest(&scroll), "a jump just seen is at the right edge when scrolling:\n{scroll}");
}

#[test]
fn the_keys_of_the_series_change_what_is_drawn() {
    let mut console = jumped(&[0]);
    let shows = |console: &Console, texts: &[&str]| assert_shows(&console.screen(80, 24), texts);
    shows(&console, &["roll ", "pitch ", "FL foot", "RR foot"]);
    console.press(&["t"]);
    shows(&console, &["height ", "oscillator ", "FL force", "RR force"]);
    console.press(&["t"]);
    shows(&console, &["x ", "x velocity ", "yaw ", "z velocity "]);
    console.press(&["t"]);
    shows(&console, &["FR_hip torque", "FL_calf torque"]);
    console.press(&["t"]);
    shows(&console, &["Joints", "limits are not known", "Robot"]);
    console.press(&["t"]);
    shows(&console, &["Robot"]);
    assert!(!console.screen(80, 24).contains("Joints"));
    console.press(&["t"]);
    shows(&console, &["roll "]);
    // The dialog: roll off, height on; the charts behind it follow at once.
    console.press(&["T"]);
    shows(&console, &["Series of the charts", "[x] roll", "[ ] height"]);
    console.press(&["x", "Down", "Down", "Down", "Down", "Down", "Down", "x", "Enter"]);
    let screen = console.screen(80, 24);
    assert!(!screen.contains("roll ") && screen.contains("height "), "{screen}");
    // The last one cannot be switched off.
    let all_off = ["x", "Down"].repeat(73);
    console.press(&[&["T"], &all_off[..], &["Home"], &all_off, &["Enter"]].concat());
    assert!(!console.model.live.series.is_empty());
}

#[test]
fn charts_without_room_are_counted() {
    let mut console = Console::ready();
    console.press(&[&["T"], &["Down"; 6][..], &["x", "Down"].repeat(6), &["Esc"]].concat());
    assert_eq!(console.model.live.series.len(), 12);
    assert!(console.screen(80, 24).contains("4 more have no room"), "{}", console.screen(80, 24));
    assert!(!console.screen(120, 60).contains("no room"));
}

#[test]
fn joints_contact_and_wireframe_are_there_at_every_size() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let mut console = jumped(&[0]);
        let robot = quadfrog::robot::description::RobotDescription::embedded("go1").expect("the robot");
        console.model.robot = Some(robot);
        let mut newest = tick(9_000, 0.0, None);
        newest.state.joint_torque_n_m[1] = -20.0;
        newest.limited = 0b10;
        newest.estimate.contact = [true, false, true, false];
        console.update(Msg::Snapshot(Box::new(Snapshot { tick: newest, ..console.model.snapshot })));
        console.press(&["t"; 4]);
        let screen = console.screen(columns, rows);
        assert!(screen.contains("FR● FL○ RR● RL○"), "{screen}");
        let thigh = line_with(&screen, "FR_thigh");
        assert!(thigh.contains("-20.0!") && thigh.contains('█'), "{thigh}");
        for joint in ["FR_hip", "FL_calf", "RR_thigh", "RL_calf"] {
            assert!(screen.contains(joint), "no {joint}:\n{screen}");
        }
    }
}

#[test]
fn a_ghost_lies_under_the_jump_that_runs() {
    let mut console = jumped(&[0, 1]);
    let without = console.screen(120, 40);
    console.press(&["c"]);
    assert_eq!(
        console.said(),
        "trial 1 is laid under the charts of a jump; c on another row of Trials compares the two"
    );
    console.press(&["2", "Home", "1"]);
    assert_ne!(console.screen(120, 40), without);
    console.press(&["c"]);
    assert_eq!(console.model.live.ghost, None, "the same key takes it away");
}

#[test]
fn any_two_trials_are_compared_in_live() {
    let mut console = jumped(&[0, 1, 2]);
    console.press(&["2", "Home", "c", "End", "c"]);
    assert_shows(
        console.said(),
        &["A is trial 0, B is trial 2: 1 shows both in Live; there Left and Right move the cursor"],
    );
    assert!(line_with(&console.screen(80, 24), "   0A").contains("accept"));
    console.press(&["1"]);
    let screen = console.screen(120, 40);
    assert!(screen.contains("A #0 line, B #2 dotted, at +0.00 s"), "{screen}");
    // At the start of the impulse, 0.2 s in: 0.1 sin 1 = 0.084; B is 0.02 above A.
    assert!(line_with(&screen, "roll").contains("A +0.084 B +0.104 rad"), "{screen}");
    // 1 s of both is the window; a step is a hundredth of it.
    console.press(&["Right"; 20]);
    let screen = console.screen(120, 40);
    assert!(screen.contains("at +0.20 s"), "{screen}");
    console.press(&["c"]);
    assert!(!console.screen(120, 40).contains("dotted"));
    // The same trial twice is no comparison.
    console.press(&["2", "End", "c", "c"]);
    assert_eq!(console.said(), "no trial is laid under the charts");
}

/// Regression: at 80 columns the torques of two trials ended in `-0.03..`, and the cause of B's verdict was missing.
#[test]
fn two_trials_at_80_columns_have_whole_numbers_and_both_causes() {
    let mut console = Console::ready();
    for number in [0, 2] {
        for time_ms in (0..1_000).step_by(5) {
            let phase = if time_ms < 400 { Phase::Impulse } else { Phase::Landing };
            let mut tick =
                tick(1_000 + 2_000 * u64::from(number) + time_ms, 0.0, Some((number, time_ms as f64 / 1e3, phase)));
            tick.state.joint_torque_n_m = [-10.034; 12];
            console.tick(tick);
        }
        let cause = format!("cause {number}, landed and settled on a mat");
        console.record(Record::Trial(TrialRecord { cause, ..trial(number, Some(Verdict::Accept), None) }));
    }
    console.press(&["2", "Home", "c", "End", "c", "1"]);
    let in_sets = |console: &mut Console| {
        (0..4)
            .map(|_| {
                console.press(&["t"]);
                console.screen(80, 24)
            })
            .find(|screen| screen.contains("FR_hip"))
            .expect("torques")
    };
    let screen = in_sets(&mut console);
    assert_shows(&line_with(&screen, "FR_hip"), &["FR_hip -10.034/-10.034"]);
    assert!(!line_with(&screen, "FR_hip").contains(".."), "{screen}");
    console.update(Msg::Replay(ReplayStatus::default()));
    let replayed = console.screen(80, 24);
    assert_shows(&replayed, &["Two trials", "A: cause 0", "B: cause 2"]);
}

/// Regression: beside another trial a void one had the value that was measured, and the charts of the feet the contact of A alone.
#[test]
fn a_void_trial_has_no_value_beside_another_one() {
    let mut console = jumped(&[0, 1, 2]);
    let mut void = trial(0, Some(Verdict::Void), Some(Verdict::Accept));
    void.measured.as_mut().unwrap().dy_m = -0.0004;
    let waiting = trial(2, None, Some(Verdict::Accept));
    for row in [void, trial(1, Some(Verdict::Accept), None), waiting] {
        console.record(Record::Trial(row));
    }
    console.update(Msg::Replay(ReplayStatus::default()));
    let cells = |console: &Console, label: &str| {
        let screen = console.screen(120, 40);
        let line = screen.lines().skip(3).find_map(|line| line.split_once(&format!(" {label} "))).expect(label);
        line.1.split_whitespace().take(2).map(str::to_owned).collect::<Vec<_>>()
    };
    console.press(&["2", "Home", "c", "Down", "c", "1"]);
    assert_eq!(cells(&console, "J m"), ["-", "0.410"]);
    assert_eq!(cells(&console, "dx m"), ["+0.420", "+0.420"]);
    assert_eq!(cells(&console, "dy m"), ["+0.000", "-0.010"]);
    assert_eq!(cells(&console, "air s"), ["0.250", "0.250"]);
    let heading = line_with(&console.screen(120, 40), "FR foot z");
    assert!(!heading.contains(['●', '○']), "{heading}");
    // A trial that waits for its verdict has what was measured.
    console.press(&["Esc", "2", "Home", "Down", "c", "End", "c", "1"]);
    assert_eq!(cells(&console, "J m"), ["0.410", "0.420"]);
}

#[test]
fn a_trial_without_a_trace_cannot_be_a_ghost() {
    let mut console = jumped(&[1]);
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.press(&["2", "Home", "c"]);
    let elsewhere = "trial 0 was recorded in another session: quadfrog replay recordings/forward shows it";
    assert_eq!(console.said(), elsewhere);
    // Elsewhere than in Trials the best trial is laid under the charts.
    let mut resumed = Console::ready();
    resumed.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    resumed.press(&["c"]);
    assert_eq!(resumed.said(), elsewhere);
}

/// Regression: after `--resume` the review charts lacked the best trial although its recording exists.
#[test]
fn the_best_trial_of_an_earlier_session_is_laid_under_the_charts_once_it_is_read() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    let jump = |time_ms: u64| tick(time_ms, 0.1, Some((0, time_ms as f64 / 1e3 - 0.5, Phase::Impulse)));
    let ticks = (0..1_000).step_by(5).map(jump).collect();
    console.update(Msg::EarlierJump { trial: 0, ticks });
    console.press(&["c"]);
    // Regression: with one jump in memory a comparison was promised that it cannot give.
    assert_eq!(console.said(), "trial 0 is laid under the charts of a jump");
}

/// Twelve trials: accept, fall, void in turn.
fn twelve() -> Console {
    let mut console = Console::ready();
    console.judged(12);
    console.press(&["2"]);
    console
}

fn numbers(console: &Console) -> Vec<u32> {
    console.model.trial_rows().iter().map(|row| row.trial).collect()
}

#[test]
fn sorting_puts_what_has_no_value_last_both_ways() {
    let mut console = twelve();
    let odd = TrialRecord { value: Some(f64::NAN), ..trial(12, Some(Verdict::Accept), None) };
    console.record(Record::Trial(odd));
    console.press(&["s"]);
    assert!(console.screen(80, 24).contains("by value (s)"), "{}", console.screen(80, 24));
    assert_eq!(numbers(&console)[..4], [9, 6, 3, 0]);
    assert_eq!(numbers(&console)[8..], [2, 5, 8, 11, 12], "voids and what is no number");
    console.press(&["S"]);
    assert!(console.screen(80, 24).contains("by value reversed"));
    assert_eq!(numbers(&console)[4..8], [0, 3, 6, 9]);
    assert_eq!(numbers(&console)[8..], [2, 5, 8, 11, 12], "still last");
}

#[test]
fn the_sorting_key_goes_through_all_shown_columns() {
    let mut console = twelve();
    console.update(Msg::Resize(200, 60));
    let mut seen = Vec::new();
    for _ in 0..8 {
        console.press(&["s"]);
        let line = line_with(&console.screen(200, 60), "; by ");
        let by = line.split("; by ").nth(1).and_then(|rest| rest.split(" (").next()).expect("a column").to_owned();
        seen.push(by);
    }
    // Without a verdict of known origin the table has no column of origins.
    assert_eq!(seen, ["value", "verdict", "f0", "Fx", "Fz", "source", "cause", "number"]);
}

#[test]
fn columns_are_chosen_in_a_dialog_and_in_the_settings() {
    let mut console = twelve();
    assert!(console.screen(80, 24).contains("Fx N"));
    console.press(&["x"]);
    assert!(console.screen(80, 24).contains("Columns of the trial table"));
    console.press(&["x", "Down", "x", "Enter"]);
    let screen = console.screen(80, 24);
    assert!(!screen.contains("Fx N") && screen.contains("dx m"), "{screen}");
    assert!(line_with(&screen, "   0 ").contains("+0.420"), "{screen}");

    let mut table: toml::Table = DEFAULT.parse().expect("the defaults");
    table.insert("trial_columns".into(), vec!["apex", "value"].into());
    table.insert("chart_series".into(), vec!["height"].into());
    let settings = ConsoleSettings::from_table(&table).expect("columns that exist");
    let mut console = Console::with(settings, Theme::new(Colours::None, Glyphs::Ascii));
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    console.press(&["2"]);
    let screen = console.screen(80, 24);
    assert!(screen.contains("rise m") && !screen.contains("verdict  source"), "{screen}");
    for (key, wrong) in [("trial_columns", "colour"), ("chart_series", "mood")] {
        let mut table: toml::Table = DEFAULT.parse().expect("the defaults");
        table.insert(key.into(), vec![wrong].into());
        let error = ConsoleSettings::from_table(&table).expect_err(wrong).to_string();
        assert!(error.contains(key) && error.contains(wrong) && error.contains("is not one of"), "{error}");
        table.insert(key.into(), toml::Value::Array(Vec::new()));
        assert!(ConsoleSettings::from_table(&table).is_err(), "no column at all");
    }
}

#[test]
fn the_filter_the_best_and_a_number_find_rows() {
    let mut console = twelve();
    assert_eq!(numbers(&console), (0..12).collect::<Vec<_>>());
    console.press(&["F"]);
    assert_eq!(numbers(&console), [0, 3, 6, 9]);
    console.press(&["s"]);
    assert_eq!(numbers(&console), [9, 6, 3, 0], "sorted and filtered");
    console.press(&["F"]);
    assert_eq!(numbers(&console), [1, 4, 7, 10]);
    console.press(&["F"]);
    assert_eq!(numbers(&console), [2, 5, 8, 11]);
    // The proposals that were skipped, which the heading counts.
    let mut skipped = trial(12, Some(Verdict::Void), None);
    skipped.cause = SKIPPED.into();
    console.record(Record::Trial(skipped));
    console.press(&["F"]);
    assert_eq!(numbers(&console), [12]);
    assert_shows(&console.screen(120, 40), &["1 not run", "only not run (F)"]);
    console.press(&["F", "b"]);
    assert_eq!(numbers(&console), [9, 6, 3, 0], "each was the best so far");
    console.press(&["b", "/", "7", "Enter"]);
    assert_eq!(console.model.trial_table.selected, Some(7));
    console.press(&["/", "9", "9", "Enter"]);
    assert!(console.screen(80, 24).contains("there is no trial 99"), "{}", console.screen(80, 24));
}

#[test]
fn details_show_all_values_of_a_trial() {
    let mut console = Console::ready();
    let first = TrialRecord { note: "slid on the mat".into(), ..trial(0, Some(Verdict::Void), Some(Verdict::Fall)) };
    console.record(Record::Trial(first));
    let ranges = vec![DrawnRange { name: "Fx".into(), low: 0.0, high: 150.0 }];
    let again =
        TrialRecord { parent: Some(0), hand_value: Some(0.37), ranges, ..trial(1, Some(Verdict::Accept), None) };
    for (time_ns, stage) in [(61_000_000_000, ExperimentStage::Running), (64_500_000_000, ExperimentStage::Review)] {
        console.model.snapshot.tick.time_ns = time_ns;
        console.stage(stage, 1);
    }
    console.record(Record::Trial(again));
    console.press(&["2", "Home", "Enter"]);
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &[
            "Trial #0",
            "void",
            "suggested      fall",
            "cause          roll 1.200 rad exceeds 1.000 rad",
            "75.00000 N",
            "slid on the mat",
        ],
    );
    console.press(&["Down"]);
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["Trial #1", "of #0", "by hand", "0.3700 m", "at 01:01 of the session, took 3.5 s", "from 0 to 150 N)"],
    );
    assert!(line_with(&screen, "attempt").contains('2'), "{screen}");
}

#[test]
fn a_row_is_copied_and_the_table_is_written_as_shown() {
    let mut console = twelve();
    console.press(&["Home"]);
    let effects = console.press(&["y"]);
    assert_eq!(effects, [Effect::CopyTrial(0)]);
    let row = text::as_text(&console.model.session.trials.records[&0], &console.model);
    assert!(row.starts_with("trial 0\tf0=1.25\tFx=75\tFz=250\tJ=0.4 m\taccept"), "{row}");
    assert_eq!(console.press(&["e"]), [Effect::Export(ExportedRows::All)]);
    console.press(&["F", "F"]);
    let csv = text::as_csv(&console.model, ExportedRows::Shown);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 5, "a heading and the four falls that the filter shows");
    assert!(lines[0].starts_with("trial,f0,Fx,Fz,value") && lines[1].starts_with("1,1.25,75,250,0,"), "{csv}");
    let columns = |line: &str| line.split(',').count();
    assert!(lines.iter().all(|line| columns(line) == columns(lines[0])), "{csv}");
    assert!(lines[0].ends_with(",jumps"), "{csv}");
    let markdown = text::as_markdown(&console.model, ExportedRows::Shown);
    assert!(markdown.starts_with("| trial | f0 |") && markdown.lines().nth(1).is_some_and(|l| l.contains(" --- |")));
    assert!(!markdown.contains("jumps") && !markdown.contains('{'), "no column of JSON: {markdown}");
}

#[test]
fn a_rewound_replay_starts_from_an_empty_session() {
    let mut console = Console::review(Mode::Damped, Verdict::Fall);
    console.update(Msg::Rewound);
    assert_eq!(format!("{:?}", console.model.session), format!("{:?}", SessionModel::default()));
}

#[test]
fn csv_cells_with_commas_and_quotes_are_quoted() {
    let mut console = Console::ready();
    let row = TrialRecord { note: "slid, \"a bit\"".into(), ..trial(0, Some(Verdict::Accept), None) };
    console.record(Record::Trial(row));
    let csv = text::as_csv(&console.model, ExportedRows::Shown);
    assert!(csv.contains("\"slid, \"\"a bit\"\"\""), "{csv}");
}

#[test]
fn the_mouse_is_off_until_it_is_asked_for_and_never_commands() {
    let mut console = twelve();
    console.update(Msg::Resize(80, 24));
    let click = |column, row| Msg::Mouse(Mouse::Click { column, row });
    console.update(click(2, 2));
    assert_eq!(console.model.view, View::Trials, "off");
    assert_eq!(console.press(&["M"]), [Effect::Mouse(true)]);
    // Tabs.
    let tabs = console.screen(80, 24).lines().nth(2).expect("tabs").to_owned();
    for (view, name) in View::VARIANTS.iter().copied().zip(["Live", "Trials", "Optimizer", "Override", "Health", "Log"])
    {
        let column = tabs.find(name).expect(name) as u16;
        assert_eq!(console.update(click(column, 2)), []);
        assert_eq!(console.model.view, view);
    }
    // Rows of the table, as they stand on the screen.
    console.press(&["2"]);
    let screen = console.screen(80, 24);
    for number in [0_u32, 5, 11] {
        let row = screen
            .lines()
            .position(|line| line.get(1..).is_some_and(|line| line.starts_with(&format!("{number:>3} "))))
            .expect("its row");
        console.update(click(10, row as u16));
        assert_eq!(console.model.selected_trial().map(|trial| trial.trial), Some(number));
    }
    // The wheel.
    console.press(&["Home"]);
    console.update(Msg::Mouse(Mouse::WheelDown));
    assert_eq!(console.model.trial_table.selected, Some(3));
    console.update(Msg::Mouse(Mouse::WheelUp));
    assert_eq!(console.model.trial_table.selected, Some(0));
    // Wherever it is clicked, in whatever mode: nothing leaves for the robot.
    for &mode in Mode::ALL {
        console.mode(mode);
        for key in ["1", "2", "4"] {
            console.press(&[key]);
            for row in 0..24 {
                for column in (0..80).step_by(4) {
                    assert_eq!(console.update(click(column, row)), [], "{mode:?} at {column}, {row}");
                }
            }
        }
    }
    assert_eq!(console.press(&["M"]), [Effect::Mouse(false)]);
}

#[test]
fn the_mouse_leaves_dialogs_alone() {
    let mut console = Console::ready();
    console.press(&["M", "g"]);
    console.update(Msg::Mouse(Mouse::Click { column: 2, row: 2 }));
    assert!(matches!(console.model.dialog, Some(Dialog::Approve { .. })));
}

#[test]
fn each_cause_rings_the_bell_only_where_the_settings_name_it() {
    let all = [BellCause::Fault, BellCause::Fall, BellCause::Verdict, BellCause::Proposal];
    for named in all {
        let mut console = Console::ready();
        console.model.bell = vec![named];
        let fault = Transition { from: Mode::Ready, to: Mode::Fault, cause: "test".into() };
        let effects = [
            (BellCause::Fault, console.record(Record::Transition(fault))),
            (BellCause::Fall, console.record(Record::Trial(trial(0, None, Some(Verdict::Fall))))),
            (BellCause::Verdict, console.stage(ExperimentStage::Review, 0)),
            (BellCause::Proposal, console.stage(ExperimentStage::Proposed, 1)),
        ];
        let rung: Vec<_> =
            effects.iter().filter(|(_, effects)| effects.contains(&Effect::Bell)).map(|(cause, _)| *cause).collect();
        assert_eq!(rung, [named]);
    }
}

#[test]
fn the_first_screen_names_every_key_that_a_newcomer_needs() {
    let console = Console::proposed();
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &[
            "STOP  Space F12",
            "Press A to arm",
            "o override",
            "g approve the jump; again after 0.8 s: countdown and jump",
            "a accept   f fall   v void   r re-run",
            "q quit",
            "? all keys",
        ],
    );
}

/// The recorded session, played as the program plays it.
struct Played {
    console: Console,
    feed: Feed,
}

impl Played {
    fn new() -> Played {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/console/session.mcap");
        let mut played =
            Played { console: Console::new(), feed: Feed::replay(Player::open(file).expect("the recorded session")) };
        played.wait(0);
        played
    }

    /// Lets time pass.
    fn wait(&mut self, milliseconds: u64) {
        for msg in self.feed.poll(milliseconds * 1_000_000) {
            self.console.update(msg);
        }
    }

    fn press(&mut self, key: &str) {
        for effect in self.console.press(&[key]) {
            let Effect::Replay(command) = effect else { panic!("{key}: {effect:?}") };
            self.feed.control_replay(command);
        }
        self.wait(0);
    }

    fn time_ms(&self) -> u64 {
        self.console.model.replay.as_ref().expect("a replay").time_ns / 1_000_000
    }
}

#[test]
fn a_replay_plays_pauses_steps_and_changes_its_speed() {
    let mut played = Played::new();
    played.wait(1_000);
    assert_eq!(played.time_ms(), 1_000);
    assert!(played.console.screen(80, 24).contains("p pauses"));
    played.press("p");
    played.wait(1_000);
    assert_eq!(played.time_ms(), 1_000, "paused");
    assert!(played.console.screen(80, 24).contains("paused") && played.console.screen(80, 24).contains("p plays"));
    played.press(".");
    assert_eq!(played.time_ms(), 1_005, "a tick of the charts");
    played.press(",");
    played.press(",");
    assert_eq!(played.time_ms(), 995);
    played.press("p");
    played.press(">");
    played.wait(1_000);
    assert_eq!(played.time_ms(), 2_995, "twice the speed");
    assert!(played.console.screen(80, 24).contains(" x2"));
    played.press("<");
    played.press("<");
    played.wait(1_000);
    assert_eq!(played.time_ms(), 3_495, "half of it");
    assert!(played.console.screen(80, 24).contains(" x0.5"));
}

#[test]
fn markers_take_a_replay_from_trial_to_trial_and_to_the_end() {
    let mut played = Played::new();
    played.press("p");
    let mut times = vec![played.time_ms()];
    for _ in 0..20 {
        played.press("]");
        times.push(played.time_ms());
    }
    // After the last marker it stays there; another key goes to the end.
    assert_eq!(played.console.said(), "no further trial or fault");
    played.press(")");
    times.push(played.time_ms());
    times.dedup();
    assert!(times.len() == 4 && times.is_sorted(), "{times:?}");
    assert_eq!(played.console.model.session.trials.records.len(), 3, "all trials at the end");
    played.press("[");
    let marker = played.time_ms();
    assert!(times.contains(&marker) && marker < times[times.len() - 1]);
    (0..20).for_each(|_| played.press("["));
    assert_eq!((played.time_ms(), played.console.said()), (times[1], "no earlier trial or fault"));
    played.press("(");
    assert_eq!(played.time_ms(), 0);
    assert_eq!(played.console.model.session.trials.records.len(), 0, "what was not yet, is not shown");
    // From the end, playing starts over.
    played.press(")");
    played.press("p");
    played.wait(500);
    assert_eq!(played.time_ms(), 500);
}

/// Regression: every reading of the newest tick counted as news, so a control thread that hangs was never shown.
#[test]
fn the_numbers_of_a_control_thread_that_hangs_are_shown_as_old() {
    let mut console = Console::ready();
    console.wait(1_000);
    assert!(!console.screen(120, 40).contains("OLD"));
    console.hang(700);
    assert_shows(&console.screen(120, 40), &["OLD: nothing new for 0.7 s"]);
    console.wait(10);
    assert!(!console.screen(120, 40).contains("OLD"));
}

/// Ticks of a trial with two of three jumps, 0.8 m and 0.3 m high each.
fn jumping_in_a_row() -> Console {
    let mut console = Console::ready();
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Running, trial: 0, can_undo: false, jumps: 3 }));
    console.mode(Mode::Jump);
    for time_ms in (0..1_300).step_by(5) {
        let phase = match time_ms % 1_000 {
            0..300 => Phase::Impulse,
            300..700 => Phase::Flight,
            _ => Phase::Landing,
        };
        let mut tick = tick(1_000 + time_ms, 0.0, Some((0, time_ms as f64 / 1e3, phase)));
        tick.estimate.position_world.x = 0.8e-3 * time_ms as f64;
        tick.estimate.position_world.z = if phase == Phase::Flight { 0.5 } else { 0.2 };
        console.tick(tick);
    }
    console
}

#[test]
fn jumps_in_a_row_are_counted_while_they_run_with_the_values_of_the_last() {
    let console = jumping_in_a_row();
    assert_shows(&console.screen(120, 40), &["Jump 2 of 3; the last +0.80 m, rise 0.30 m.", "sit down"]);
}

/// A replay that goes to another time counts the jumps from there.
#[test]
fn the_jumps_of_another_time_of_a_replay_are_not_counted() {
    let mut console = jumping_in_a_row();
    console.update(Msg::Rewound);
    console.record(Record::Session(session()));
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Running, trial: 0, can_undo: false, jumps: 3 }));
    console.mode(Mode::Jump);
    console.tick(tick(3_100, 0.0, Some((0, 2.1, Phase::Impulse))));
    assert_shows(&console.screen(120, 40), &["Jump 1 of 3."]);
}

/// Sitting down between jumps drops the further ones; a single jump cannot be sat down.
#[test]
fn a_series_of_jumps_can_be_sat_down_and_a_single_jump_cannot() {
    assert_eq!(jumping_in_a_row().requests(&["D"]), [OperatorRequest::SitDown]);
    let mut single = Console::ready();
    single.stage(ExperimentStage::Running, 0);
    single.mode(Mode::Jump);
    assert_eq!(single.requests(&["D"]), []);
    assert!(single.said().contains("the robot is jumping"), "{}", single.said());
}

#[test]
fn the_details_and_the_exported_table_hold_touchdown_bounces_and_every_jump() {
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    let jump = |time_s: f64, value: f64| JumpRow { time_s, x_m: 0.4 * time_s, value, ..JumpRow::default() };
    let measured = row.measured.as_mut().unwrap();
    measured.flights = 3;
    measured.touchdown = Some(Displacement { time_s: 1.7, dx_m: 0.75, dy_m: 0.01, dyaw_rad: 0.02 });
    measured.jumps = vec![jump(0.0, 0.4), jump(1.0, 0.5)];
    console.record(Record::Trial(row));
    console.press(&["2", "Enter"]);
    let parts = [
        "at 1.700 s, +0.7500 m forward, +0.0100 m left, turned +0.0200 rad",
        "3 flights after the impulse",
        "0.00 s, x +0.000 m",
        "1.00 s, x +0.400 m",
    ];
    assert_shows(&console.screen(160, 50), &parts);
    let csv = text::as_csv(&console.model, ExportedRows::Shown);
    let (header, line) = csv.split_once("\r\n").unwrap();
    assert!(header.ends_with("flights,touchdown_dx_m,touchdown_dy_m,touchdown_dyaw_rad,jumps"), "{header}");
    assert!(line.contains(",3,0.75,0.01,0.02,") && line.contains("\"\"time_s\"\":1.0"), "{line}");
}

/// Regression: of a trial that was stopped in the air the details said that its feet were down.
#[test]
fn the_details_of_a_trial_that_was_stopped_in_the_air_name_no_feet_on_the_ground() {
    let details = |suggested: Verdict, flights: u32| {
        let mut console = Console::ready();
        let mut row = trial(0, Some(Verdict::Void), Some(suggested));
        row.measured.as_mut().unwrap().flights = flights;
        console.record(Record::Trial(row));
        console.press(&["2", "Enter"]);
        console.screen(160, 50)
    };
    assert_shows(&details(Verdict::Void, 1), &["none: the trial ended in the air"]);
    // A record of an earlier version, which counted no flight of such a trial.
    assert!(!details(Verdict::Void, 0).contains("touchdown"));
    assert_shows(&details(Verdict::Accept, 0), &["none after the impulse: the feet were down before its end"]);
}

/// Regression: a trial that was cancelled in its countdown was compared as a jump, without a line in any chart.
#[test]
fn a_trial_that_ended_before_its_impulse_is_not_laid_under_the_charts() {
    let mut console = jumped(&[0]);
    console.record(Record::Trial(trial(1, Some(Verdict::Void), None)));
    (5_000..5_400).step_by(5).for_each(|ms| {
        console.tick(tick(ms, 0.0, Some((1, ms as f64 / 1e3 - 8.0, Phase::Stance))));
    });
    console.press(&["2", "Home", "c", "End", "c"]);
    assert_eq!(console.said(), "trial 1 ended before its impulse: it has no jump for the charts");
    assert!(console.model.live.comparison.is_none());
}
