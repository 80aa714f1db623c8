//! Sentences that a person confirms are never cut.

use crate::support::{Console, assert_shows, line_with, session, trial};
use quadfrog::engine::ObserverStatus;
use quadfrog::recording::record::{ArmingCheckRecord, LogLevel, LogRecord, Record, SessionInfo};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::{ArmingCheck, ArmingCheckState, Mode};
use quadfrog::trial::{Backend, ExperimentStage, ProposalSource, QueuedPoint, SearchStatus, Verdict};
use quadfrog_console::action::{ACTIONS, Action};
use quadfrog_console::message::{Effect, ExportedRows, Msg, ReplayStatus};
use quadfrog_console::model::View;
use quadfrog_console::model::dialog::Dialog;
use quadfrog_console::text::{as_csv, as_markdown};
use strum::VariantArray;

const SENTENCE: &str = "no person within 2 m of the robot, the remote control in the hand of the operator, and its stop \
                        combination known to everybody who is in the room and who has read the page on safe handling";

/// Every check with a long sentence, as hardware has them.
pub fn long_checks() -> Console {
    let mut console = Console::proposed();
    console.record(Record::Session(SessionInfo { backend: Some(Backend::Hardware), ..session() }));
    let item = |check: &ArmingCheck| ArmingCheckRecord {
        check: *check,
        found: String::new(),
        needed: format!("{} begins, {SENTENCE}, {} ends", check.name(), check.name()),
        state: ArmingCheckState::Waiting,
    };
    console.record(Record::ArmingChecks(ArmingCheck::VARIANTS.iter().map(item).collect()));
    console
}

/// The words inside the box of a dialog, in their order.
fn words_of_the_dialog(screen: &str) -> String {
    let inside = |line: &str| {
        let (from, to) = (line.find('│')?, line.rfind('│')?);
        (from < to).then(|| line[from + '│'.len_utf8()..to].to_owned())
    };
    screen.lines().filter_map(inside).collect::<Vec<_>>().join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_arming_check_can_be_read_whole_at_every_size() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let mut console = long_checks();
        console.update(Msg::Resize(columns, rows));
        console.press(&["6", "P"]);
        let mut read = String::new();
        for _ in 0..40 {
            read.push_str(&words_of_the_dialog(&console.screen(columns, rows)));
            read.push(' ');
            console.press(&["PgDn"]);
        }
        assert!(!read.contains(".."), "a sentence is cut");
        for check in ArmingCheck::VARIANTS {
            for part in ["begins,", "ends"] {
                assert!(
                    read.contains(&format!("{} {part}", check.name())),
                    "{} {part} at {columns}x{rows}",
                    check.name()
                );
            }
        }
        let widest = console
            .screen(columns, rows)
            .lines()
            .filter(|line| line.contains('┌'))
            .map(|l| l.trim().chars().count())
            .max();
        assert!(widest >= Some(usize::from(columns.min(120)) - 4), "the width of the terminal is used: {widest:?}");
    }
}

/// A page of 80x24 holds fewer lines than the checks have: the item that `x` would confirm is visible without paging.
#[test]
fn the_chosen_check_is_visible() {
    let mut console = long_checks();
    console.press(&["6", "P"]);
    for _ in 0..6 {
        let screen = console.screen(80, 24);
        assert!(screen.lines().any(|line| line.contains("│ >")), "{screen}");
        console.press(&["Down"]);
    }
}

#[test]
fn long_notes_and_causes_continue_at_a_word() {
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.note = SENTENCE.split_whitespace().collect::<Vec<_>>().join(" ");
    console.record(Record::Trial(row.clone()));
    for keys in [&["2", "Enter"][..], &["m"]] {
        console.press(keys);
        for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
            for _ in 0..3 {
                console.press(&["PgDn"]);
            }
            let words = words_of_the_dialog(&console.screen(columns, rows));
            assert!(words.contains(&row.note), "{columns}x{rows}: {words}");
        }
        console.press(&["Esc"]);
    }
}

/// The answers are the last line of a question: a long cause may not push them out.
#[test]
fn a_long_cause_leaves_the_answers_visible() {
    let mut console = Console::review(Mode::Damped, Verdict::Fall);
    let mut row = trial(0, None, Some(Verdict::Fall));
    row.cause = SENTENCE.into();
    console.record(Record::Trial(row));
    console.press(&["a"]);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        let words = words_of_the_dialog(&screen);
        let cause = SENTENCE.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.contains(&cause), "{screen}");
        assert_shows(&screen, &["Cancel  Enter, or any other key     y accept"]);
    }
}

fn table() -> Console {
    let mut console = Console::ready();
    console.judged(9);
    console.press(&["2"]);
    console
}

#[test]
fn an_export_of_a_filtered_table_says_what_it_leaves_out_and_offers_all() {
    let mut console = table();
    assert_eq!(console.press(&["e"]), [Effect::Export(ExportedRows::All)], "nothing is left out");
    console.press(&["F"]);
    assert_eq!(console.press(&["e"]), []);
    let screen = console.screen(80, 24);
    assert_shows(
        &screen,
        &["The table shows 3 of 9 trials", "write all 9 trials", "write the 3 as shown and leave 6 out"],
    );
    assert_eq!(console.press(&["a"]), [Effect::Export(ExportedRows::All)]);
    assert_eq!(console.press(&["e", "s"]), [Effect::Export(ExportedRows::Shown)]);
    assert_eq!(console.press(&["e", "Enter"]), []);
    assert_eq!(console.said(), "cancelled: nothing was written");
    assert_eq!(as_csv(&console.model, ExportedRows::All).lines().count(), 10);
    assert_eq!(as_csv(&console.model, ExportedRows::Shown).lines().count(), 4);
    // All trials are in the order of their numbers, whatever the table is sorted by.
    console.press(&["F", "F", "F", "F", "S"]);
    let all = as_csv(&console.model, ExportedRows::All);
    let numbers: Vec<&str> = all.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
    assert_eq!(numbers, ["0", "1", "2", "3", "4", "5", "6", "7", "8"]);
}

/// The CSV is data, the Markdown is read.
#[test]
fn the_markdown_has_six_digits_and_the_csv_all() {
    let mut console = table();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.value = Some(1.549_158_564_216_723_6);
    console.record(Record::Trial(row));
    assert_shows(&as_csv(&console.model, ExportedRows::All), &["1.5491585642167236"]);
    let markdown = as_markdown(&console.model, ExportedRows::All);
    assert!(markdown.contains("| 1.54916 |") && !markdown.contains("1.549158"), "{markdown}");
}

/// Regression: at every width eight sentences of the help were cut.
#[test]
fn the_help_shows_every_sentence_whole() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let mut console = Console::ready();
        console.model.size = (columns, rows);
        console.press(&["?"]);
        let mut read = String::new();
        for _ in 0..200 {
            read.push_str(&words_of_the_dialog(&console.screen(columns, rows)));
            read.push(' ');
            console.press(&["Down"]);
        }
        for action in &ACTIONS {
            let words = action.help.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(read.contains(&words), "{words} at {columns}x{rows}");
        }
    }
}

/// Regression: at 80 columns the ends of the sentences were cut, and with them the reasons for which an action is refused.
#[test]
fn the_list_of_actions_shows_every_sentence_whole() {
    for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
        let mut console = Console::ready();
        console.press(&[":"]);
        let mut read = String::new();
        for _ in 0..ACTIONS.len() {
            read.push_str(&words_of_the_dialog(&console.screen(columns, rows)));
            read.push(' ');
            console.press(&["Down"]);
        }
        assert!(!read.contains(".."), "a sentence is cut at {columns}x{rows}");
        for action in &ACTIONS {
            let help = action.help.split_whitespace().collect::<Vec<_>>().join(" ");
            // In place of the help of an action that is not possible stands the reason.
            let whole = [help.as_str(), "("].iter().any(|text| read.contains(&format!("{} {text}", action.name)));
            assert!(whole, "{} at {columns}x{rows}:\n{read}", action.name);
        }
    }
}

/// Regression: the list opened at its end, and in a simulation it offered to confirm what nobody asks for.
#[test]
fn the_checks_of_a_simulation_begin_at_the_top_and_confirm_nothing() {
    let mut console = Console::proposed();
    let state = |check: &ArmingCheck| match check.needed_in_simulation() {
        true => ArmingCheckState::Passed,
        false => ArmingCheckState::NotNeeded,
    };
    let item = |check: &ArmingCheck| ArmingCheckRecord {
        check: *check,
        found: String::new(),
        needed: "not needed in simulation".to_owned(),
        state: state(check),
    };
    console.record(Record::ArmingChecks(ArmingCheck::VARIANTS.iter().map(item).collect()));
    console.press(&["P"]);
    let screen = console.screen(80, 24);
    let first = screen.lines().position(|line| line.contains("Arming checks: 3 passed (1-")).expect("its first page");
    assert!(screen.lines().nth(first + 1).is_some_and(|line| line.contains("ok   ")), "{screen}");
    assert!(!screen.contains("│ >") && screen.contains("n/a"), "{screen}");
    assert_eq!(console.requests(&["x"]), []);
    assert_eq!(console.said(), "the simulator needs no confirmation");
    console.press(&["Down", "Esc", "5"]);
    assert_shows(&console.screen(80, 24), &["3 passed (P)", "24 more: P shows all"]);
}

/// Regression: of a standing robot Health showed the tilt of the one that had lain on its back before it was armed.
#[test]
fn a_check_that_is_not_needed_shows_its_value_only_before_arming() {
    let mut console = Console::ready();
    console.record(Record::ArmingChecks(vec![ArmingCheckRecord {
        check: ArmingCheck::Upright,
        found: "tilted 3.14 rad".into(),
        needed: "at most 0.20 rad".into(),
        state: ArmingCheckState::NotNeeded,
    }]));
    for keys in [&["5"][..], &["P"]] {
        console.press(keys);
        for mode in [Mode::Ready, Mode::Disarmed, Mode::Jump] {
            console.mode(mode);
            let line = line_with(&console.screen(120, 40), "n/a  upright");
            assert_eq!(line.contains("tilted 3.14 rad"), mode == Mode::Disarmed, "{mode:?}: {line}");
        }
    }
}

/// Regression: "2 not yet" stood over a page on which one was seen; the test of STOP came last.
#[test]
fn what_the_operator_has_to_do_is_on_the_first_page() {
    let mut console = Console::proposed();
    console.model.session.info = SessionInfo { backend: Some(Backend::Hardware), ..session() };
    let item = |check: &ArmingCheck| ArmingCheckRecord {
        check: *check,
        found: "found".into(),
        needed: "something".into(),
        state: if *check == ArmingCheck::StopTested { ArmingCheckState::Waiting } else { ArmingCheckState::Passed },
    };
    console.record(Record::ArmingChecks(ArmingCheck::VARIANTS.iter().map(item).collect()));
    console.press(&["P"]);
    let line = line_with(&console.screen(80, 24), "STOP tested");
    assert_shows(&line, &["you  STOP tested", "found (needed: something)"]);
}

/// Regression: at 60x20 the title of the arming checks was cut after "checked".
#[test]
fn the_title_of_the_arming_checks_is_whole_in_a_narrow_terminal() {
    let mut console = long_checks();
    console.mode(Mode::Ready);
    console.press(&["P"]);
    let count = ArmingCheck::VARIANTS.len();
    let screen = console.screen(60, 20);
    let title = line_with(&screen, "Checks at ");
    assert_shows(&title, &[&format!(": {count} of {count} not yet (2-12 of ")]);
    assert!(title.contains(") \u{2500}"), "{screen}");
    let screen = console.screen(120, 40);
    assert_shows(&line_with(&screen, "Arming checks at "), &["PgUp PgDn"]);
}

/// Regression: during a fault a confirmation was answered as done, and the row went on saying that it was not.
#[test]
fn a_list_of_an_earlier_time_takes_no_confirmation() {
    let mut console = long_checks();
    console.mode(Mode::Disarmed);
    console.press(&["P"]);
    assert_eq!(console.requests(&["x"]).len(), 1);
    console.mode(Mode::Fault);
    assert_eq!(console.requests(&["x"]), []);
    assert_shows(console.said(), &["not confirmed: the list is of an earlier time"]);
    // Without a list nothing is of an earlier time.
    console.record(Record::ArmingChecks(Vec::new()));
    assert_eq!(console.requests(&["x"]).len(), 1);
}

/// Regression: before the first answer of the robot the heading named a time of checks that had not been, and no count.
#[test]
fn the_title_of_arming_checks_that_have_not_been_names_no_time() {
    let mut console = Console::new();
    console.record(Record::Session(session()));
    console.mode(Mode::Offline);
    let health = {
        console.press(&["5"]);
        console.screen(120, 40)
    };
    assert_shows(&line_with(&health, "Arming checks"), &["not yet (P)"]);
    console.press(&["P"]);
    assert_shows(&line_with(&console.screen(120, 40), "Arming checks: "), &["Arming checks: not yet"]);
}

/// Regressions: an empty box, a list without its length, an old answer below a dialog, a footer without the paging keys.
#[test]
fn lists_say_how_long_they_are_and_that_nothing_matches() {
    let mut console = Console::ready();
    console.press(&[":"]);
    console.enter("xylophone");
    assert_shows(&console.screen(80, 24), &["no action matches"]);
    console.press(&["Esc", "T"]);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["Series of the charts (1-", "Up Down Home End)"]);
    console.press(&["End"]);
    assert!(!console.screen(80, 24).contains("(1-"), "{}", console.screen(80, 24));
    console.press(&["Esc", "?"]);
    assert_shows(&console.next_step(), &["Up Down PgUp PgDn Home End scroll, Esc Enter q close."]);
}

#[test]
fn an_old_answer_from_before_a_dialog_does_not_stand_below_it() {
    let mut console = Console::ready();
    let line = " colours for a light background\n";
    console.press(&["W"]);
    assert_shows(&console.screen(80, 24), &[line]);
    console.press(&["o"]);
    assert!(!console.screen(80, 24).contains("colours for a light background\n"), "{}", console.screen(80, 24));
    // What comes while the dialog is open is shown.
    console.answer("override Fx = 120", false, "the trial runs already");
    let refusal = "refused: the trial runs already";
    assert_shows(&console.screen(80, 24), &[refusal]);
    // The refusal of an earlier request is no answer to the next dialog; a warning of the session stays.
    console.press(&["Esc"]);
    console.answer("override Fx = 120", false, "the trial runs already");
    assert_shows(&console.screen(80, 24), &[refusal]);
    console.press(&["o"]);
    assert!(!console.screen(80, 24).contains(refusal), "{}", console.screen(80, 24));
    console.press(&["Esc"]);
    let warning = LogRecord { level: LogLevel::Warning, source: "recorder".into(), message: "the disk is slow".into() };
    console.record(Record::Log(warning));
    console.press(&["o"]);
    assert_shows(&console.screen(80, 24), &["the disk is slow"]);
}

/// Regression: Enter in a form without changes read as a failure, and numbers of one had plurals.
#[test]
fn an_unchanged_form_and_a_single_trial_read_well() {
    let mut console = Console::ready();
    console.press(&["o", "Enter"]);
    assert_eq!(console.said(), "no value was changed: the proposal stays as it is");
    assert_eq!(OperatorRequest::Continue(1).to_string(), "continue for 1 trial");
    assert_eq!(OperatorRequest::Continue(5).to_string(), "continue for 5 trials");
    let fix = OperatorRequest::Fix { parameter: "Fx".into(), value: 60.0, trials: 1 };
    assert_eq!(fix.to_string(), "fix Fx = 60 for 1 trial");
    assert_eq!(OperatorRequest::ConfirmBest { repeats: 1 }.to_string(), "confirm the best with 1 repeat");
}

/// Regression: the queue of a replay offered the keys that move and remove, and refused them.
#[test]
fn the_queue_of_a_replay_offers_no_key_that_is_refused() {
    let mut console = Console::ready();
    let point = QueuedPoint { trial: 3, source: ProposalSource::Operator, ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: vec![point], ..SearchStatus::default() }));
    console.press(&["N"]);
    assert_shows(&console.next_step(), &["Left Right move it, x removes"]);
    console.update(Msg::Replay(ReplayStatus::default()));
    assert_eq!(console.next_step(), "Up Down Home End choose, Esc Enter q close.");
}

/// Regression: the list of actions did not page, and nothing said that it goes on.
#[test]
fn the_list_of_actions_pages_and_has_a_position() {
    let mut console = Console::ready();
    console.press(&[":"]);
    let count = ACTIONS.len();
    assert_shows(&console.screen(80, 24), &[&format!("Actions (1 of {count}")]);
    console.press(&["PgDn"]);
    assert_shows(&console.screen(80, 24), &[&format!("Actions (11 of {count}")]);
    console.press(&["PgUp", "PgUp"]);
    assert_shows(&console.screen(80, 24), &[&format!("Actions (1 of {count}")]);
    for _ in 0..20 {
        console.press(&["PgDn"]);
    }
    assert_shows(&console.screen(80, 24), &[&format!("Actions ({count} of {count}")]);
}

/// Regression: in a wide terminal the texts of the series were cut.
#[test]
fn the_list_of_series_is_as_wide_as_its_texts() {
    let mut console = Console::ready();
    console.press(&["T"]);
    let screen = console.screen(200, 60);
    assert_shows(&screen, &["Series of the charts"]);
    assert!(!words_of_the_dialog(&screen).contains(".."), "{screen}");
}

/// Regression: a key without a meaning in the queue or in the form of the overrides had no answer.
#[test]
fn a_key_without_a_meaning_is_answered_with_the_keys_that_work() {
    let mut console = Console::ready();
    console.press(&["N", "z"]);
    assert_shows(&console.screen(80, 24), &["z does nothing here; Esc Enter q do"]);
    let point = QueuedPoint { trial: 3, source: ProposalSource::Operator, ..QueuedPoint::default() };
    console.record(Record::Search(SearchStatus { queue: vec![point], ..SearchStatus::default() }));
    assert_eq!(console.press(&["z"]), []);
    assert_shows(&console.screen(80, 24), &["z does nothing here; Up Down Left Right Home End x Esc Enter q do"]);
    console.press(&["Esc", "o", "Home"]);
    let keys = "a number, arrows, PgUp PgDn, Enter, Q and Esc do";
    assert_shows(&console.screen(80, 24), &[&format!("Home does nothing here; {keys}")]);
    console.press(&["1", "F5"]);
    assert_shows(&console.screen(80, 24), &["F5 does nothing here; a number, Left Right, Backspace, Enter and Esc do"]);
    // The typed number stays.
    console.press(&["2", "Esc", "Esc"]);
    assert_eq!(console.said(), "cancelled: nothing was changed");
}

/// Regression: the arming checks and the lists of series and columns ignored a key without a meaning.
#[test]
fn a_key_without_a_meaning_is_answered_in_the_checks_and_in_the_lists() {
    let mut console = Console::proposed();
    for (view, open, keys) in [
        ("1", "P", "Up Down PgUp PgDn Home End Esc Enter q do"),
        ("1", "T", "Up Down PgUp PgDn Home End x Esc Enter q do"),
        ("2", "x", "Up Down PgUp PgDn Home End x Esc Enter q do"),
    ] {
        console.press(&[view, open, "z"]);
        assert_shows(&console.screen(80, 24), &[&format!("z does nothing here; {keys}")]);
        console.press(&["Down", "Esc"]);
    }
    console.model.session.info = SessionInfo { backend: Some(Backend::Hardware), ..session() };
    assert_eq!(console.requests(&["P", "z"]), []);
    assert_shows(&console.screen(80, 24), &["z does nothing here; Up Down x PgUp PgDn Home End Esc Enter q do"]);
    // Arming that is refused has its reason.
    console.mode(Mode::Ready);
    assert_eq!(console.requests(&["A"]), []);
    assert_shows(&console.screen(80, 24), &["not armed: "]);
}

/// Regressions: the form left the edges of the view uncovered at 80x24, where the cursor of the view stood beside its own; a long
/// number pushed its upper bound to the next line.
#[test]
fn the_form_of_the_override_has_the_only_cursor_and_whole_rows() {
    for view in ["1", "2", "4"] {
        let mut console = Console::ready();
        console.judged(2);
        console.press(&[view, "o"]);
        for (columns, rows) in [(60, 20), (80, 24), (120, 40), (200, 60)] {
            let screen = console.screen(columns, rows);
            assert_eq!(screen.matches('>').count(), 1, "{screen}");
            assert!(columns > 80 || line_with(&screen, "> f0").starts_with('\u{2502}'), "{screen}");
        }
        console.enter("1.234567890123456789");
        for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
            let row = line_with(&console.screen(columns, rows), "> f0");
            assert_shows(&row, &["456789  Hz", "0.750 [", "] 1.750"]);
        }
        // The cursor stays in sight, and what is cut is not taken for the whole number.
        assert_shows(&line_with(&console.screen(60, 20), "> f0"), &[" <456789  Hz"]);
        console.press(&["Home"]);
        assert_shows(&line_with(&console.screen(60, 20), "> f0"), &[" 1.23456> Hz", "] 1.750"]);
    }
}

/// Regression: the help of a replay listed the keys that command a robot.
#[test]
fn the_help_of_a_replay_lists_no_key_that_commands_the_robot() {
    let read = |observer: Option<ObserverStatus>| {
        let mut console = Console::ready();
        console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
        console.update(Msg::Replay(ReplayStatus { observer, ..ReplayStatus::default() }));
        console.press(&["?"]);
        let mut read = String::new();
        for _ in 0..60 {
            read.push_str(&console.screen(120, 40));
            console.press(&["Down"]);
        }
        read
    };
    let keys = |words: &str| words.split_whitespace().collect::<Vec<_>>().join(" ");
    let replay = keys(&read(None));
    let commands = [
        "STOP: damp all motors",
        "arm: the robot",
        "sit down",
        "approve the jump",
        "accept: it counts",
        "undo",
        "write a note",
    ];
    for command in commands {
        assert!(!replay.contains(command), "{command}");
    }
    let meant =
        ["Ctrl-C twice within 2 s: quit", "P arming checks", "N the queue", "p play or pause", "R tables", "q quit"];
    for key in meant {
        assert!(replay.contains(key), "{key}");
    }
    // An observer's STOP reaches the robot.
    let watched = keys(&read(Some(ObserverStatus::default())));
    assert!(watched.contains("STOP: damp all motors") && !watched.contains("approve the jump"));
}

/// Regression: when the stage changed, the list of actions was sorted anew under the mark, and Enter did something else.
#[test]
fn the_selected_action_stays_selected_when_others_become_possible() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    console.mode(Mode::Settle);
    console.press(&[":"]);
    let number = |console: &Console| {
        let screen = console.screen(80, 24);
        screen.split_once("Actions (").unwrap().1.split(' ').next().unwrap().parse::<usize>().unwrap()
    };
    let is_selected = |console: &Console| {
        matches!(console.model.dialog, Some(Dialog::Palette { selected: Some(Action::HealthView), .. }))
    };
    while !is_selected(&console) {
        console.press(&["Down"]);
    }
    let before = number(&console);
    console.record(Record::Trial(trial(0, None, Some(Verdict::Accept))));
    console.stage(ExperimentStage::Review, 0);
    console.mode(Mode::Review);
    assert!(number(&console) > before, "the verdicts stand above");
    assert_eq!(console.press(&["Enter"]), []);
    assert_eq!(console.model.view, View::Health);
}

/// Regression: when the first point of the queue ran, the keys moved and removed the one below the selected one.
#[test]
fn the_selected_point_stays_selected_when_the_first_one_runs() {
    let mut console = Console::ready();
    let queue = |console: &mut Console, trials: std::ops::Range<u32>| {
        let point = |trial| QueuedPoint { trial, source: ProposalSource::Operator, ..QueuedPoint::default() };
        let status = SearchStatus { queue: trials.map(point).collect(), ..SearchStatus::default() };
        console.record(Record::Search(status));
    };
    queue(&mut console, 5..9);
    console.press(&["N", "Down"]);
    queue(&mut console, 6..9);
    let moved = |trial| [OperatorRequest::MoveQueued { trial, earlier: false }];
    assert_eq!(console.requests(&["Right"]), moved(6));
    // The moved point has the number of the one with which it changed places.
    assert_eq!(console.requests(&["Right"]), moved(7));
    console.press(&["Home", "x"]);
    assert_shows(&console.next_step(), &["remove trial #6 from the queue"]);
    console.press(&["n"]);
    // The selected one itself runs: the next one is selected.
    queue(&mut console, 7..9);
    console.press(&["x"]);
    assert_shows(&console.next_step(), &["remove trial #7 from the queue"]);
}

/// Regression: the details ended after two pages, and after keys beyond the end as many of the other direction did nothing.
#[test]
fn the_end_of_long_details_is_reached() {
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.note = "word ".repeat(600) + "amphibian";
    console.record(Record::Trial(row));
    console.press(&["2", "Enter"]);
    console.press(&["PgDn"; 20]);
    let end = console.screen(80, 24);
    assert_shows(&end, &["amphibian", "rise, air"]);
    console.press(&["PgUp"]);
    assert_ne!(console.screen(80, 24), end);
}

/// Regression: texts with characters of two columns were cut without a sign.
#[test]
fn wide_characters_are_wrapped_and_cut_by_their_columns() {
    let sentence = "机器人在垫子上滑倒了，因为电缆挡住了它的右后腿。".repeat(4);
    let mut console = Console::ready();
    let mut row = trial(0, Some(Verdict::Accept), None);
    row.note.clone_from(&sentence);
    console.record(Record::Trial(row));
    let log = LogRecord { level: LogLevel::Warning, source: "操作员".into(), message: sentence.clone() };
    console.record(Record::Log(log));
    for (columns, rows) in [(80, 24), (120, 40)] {
        console.update(Msg::Resize(columns, rows));
        console.press(&["2", "Enter"]);
        let words = words_of_the_dialog(&console.screen(columns, rows)).replace(' ', "");
        assert!(words.contains(&sentence), "{words}");
        console.press(&["Esc", "m"]);
        let words = words_of_the_dialog(&console.screen(columns, rows)).replace(' ', "");
        assert!(words.contains(&sentence), "{words}");
        console.press(&["Esc", "6"]);
        let screen = console.screen(columns, rows);
        let line = line_with(&screen, "机 器 人");
        assert!(line.trim_end().ends_with(".."), "{line}");
        // The messages of both have the same column.
        let column = |line: &str, text: &str| line.find(text).map(|at| line[..at].chars().count());
        assert_eq!(column(&line, "机"), column(&line_with(&screen, "forward on go1"), "forward on go1"));
    }
}
