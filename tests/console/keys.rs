//! Keys in, requests out, on every screen.

use crate::support::{Console, VIEWS, assert_shows, proposal, requests, session, trial};
use quadfrog::recording::record::{Record, SessionInfo, StageRecord};
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Backend, ExperimentStage, Proposal, ProposalSource, TrialRecord, Verdict};
use quadfrog_console::action::{ACTIONS, Action};
use quadfrog_console::keymap::{Key, Keymap};
use quadfrog_console::message::{Effect, Msg};
use quadfrog_console::model::View;
use quadfrog_console::model::dialog::Dialog;
use quadfrog_console::settings::{ConsoleSettings, DEFAULT};
use quadfrog_console::theme::Role;
use strum::VariantArray;

fn approval(trial: u32, revision: u32) -> Vec<OperatorRequest> {
    vec![OperatorRequest::Approve { trial, revision }]
}

#[test]
fn a_jump_needs_two_presses_at_two_moments() {
    let mut console = Console::ready();
    assert_eq!(console.press(&["g"]), []);
    assert!(console.screen(80, 24).contains("Jump?"));
    // 100 ms later: too soon, and it starts the pause again.
    assert_eq!(console.press(&["g"]), []);
    console.wait(650);
    assert_eq!(console.press(&["g"]), [], "750 ms after the press before");
    console.wait(750);
    assert_eq!(console.requests(&["g"]), approval(0, 0));
    assert!(console.model.dialog.is_none());
}

/// A key that is held down repeats itself for the first time after up to 660 ms.
#[test]
fn a_key_that_is_held_down_never_approves() {
    let mut console = Console::ready();
    console.press(&["g"]);
    console.wait(560);
    for _ in 0..200 {
        assert_eq!(console.press(&["g"]), []);
        console.wait(0);
    }
}

#[test]
fn every_key_but_the_approving_one_cancels_an_approval() {
    for key in ["Enter", "Esc", "y", "A", "a", "1", "Tab", "Up", "F5"] {
        let mut console = Console::ready();
        console.press(&["g"]);
        console.wait(1000);
        assert_eq!(console.press(&[key]), [], "{key}");
        assert!(console.model.dialog.is_none(), "{key} leaves the question open");
        assert_eq!(console.said(), "cancelled: no jump", "{key}");
    }
}

#[test]
fn an_approval_is_of_the_card_that_was_seen() {
    let mut console = Console::ready();
    console.press(&["g"]);
    console.wait(1000);
    console.record(Record::Proposal(proposal(0, 1)));
    assert!(console.model.dialog.is_none(), "the card has changed under the question");
    assert_eq!(console.press(&["g"]), [], "this is the first press for the new card");
    console.wait(900);
    assert_eq!(console.requests(&["g"]), approval(0, 1));
}

#[test]
fn an_approval_ends_with_readiness() {
    for mode in [Mode::Damped, Mode::Fault, Mode::SitDown, Mode::Disarmed] {
        let mut console = Console::ready();
        console.press(&["g"]);
        console.mode(mode);
        console.wait(1000);
        assert_eq!(console.requests(&["g"]), [], "{mode:?}");
    }
}

#[test]
fn stop_works_on_every_screen_and_over_every_dialog() {
    for stop in ["Space", "F12", "Ctrl-C", "Alt-Space", "Ctrl-Space", "Ctrl-F12", "Alt-F12", "Ctrl-Alt-C"] {
        for &mode in Mode::ALL {
            for view in VIEWS {
                let mut console = Console::proposed();
                console.press(&[view]);
                console.mode(mode);
                assert!(console.press(&[stop]).contains(&Effect::Stop), "{stop} in {mode:?}, view {view}");
            }
        }
        for opening in ["g", "o", "m", ":", "?", "q", "Enter"] {
            if stop == "Space" && ["m", ":"].contains(&opening) {
                continue;
            }
            let mut console = Console::ready();
            console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
            console.press(&[opening]);
            assert!(console.model.dialog.is_some(), "{opening} opens a dialog");
            assert!(console.press(&[stop]).contains(&Effect::Stop), "{stop} over the dialog of {opening}");
        }
    }
}

/// Space types in a note, also while the robot is energised: the other STOP keys stop, and the frame says so in the colour
/// of STOP.
#[test]
fn a_text_field_takes_space_and_its_frame_names_the_keys_that_stop() {
    let noted = [OperatorRequest::Note { trial: 0, text: "ok y".into() }];
    for mode in [Mode::Review, Mode::Disarmed] {
        let mut console = Console::review(mode, Verdict::Accept);
        console.press(&["m"]);
        assert_eq!(requests(&console.press(&["o", "k", "Space", "y", "Enter"])), noted, "{mode:?}");
        for stop in ["F12", "Ctrl-C", "Alt-Space", "Ctrl-Space"] {
            let mut console = Console::review(mode, Verdict::Accept);
            console.press(&["m", "o"]);
            assert_eq!(console.press(&[stop]), [Effect::Stop], "{stop} in {mode:?}");
            assert!(matches!(console.model.dialog, Some(Dialog::Field { .. })), "the half-written note stays");
        }
        let mut console = Console::review(mode, Verdict::Accept);
        console.press(&["m"]);
        let screen = console.screen(80, 24);
        let energised = mode == Mode::Review;
        assert_eq!(screen.contains("Space types here. STOP: F12 or Ctrl-C"), energised, "{screen}");
        assert!(screen.contains("STOP  F12 Ctrl-C"), "Space types, so that it does not stop:\n{screen}");
        let corner = console.draw(80, 24).content().iter().find(|cell| cell.symbol() == "┌").cloned().unwrap();
        let alarm = console.model.theme.style(Role::Alarm);
        assert_eq!((Some(corner.fg), Some(corner.bg)) == (alarm.fg, alarm.bg), energised, "{corner:?}");
    }
}

#[test]
fn space_stops_where_a_number_is_typed() {
    for opening in [&["="][..], &["o", "1"], &["C"], &["2", "/"]] {
        let mut console = Console::review(Mode::Review, Verdict::Accept);
        if opening != ["="] {
            console = Console::ready();
            console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
        }
        if opening == ["C"] {
            console.stage(ExperimentStage::Finished, 0);
        }
        console.press(opening);
        assert!(console.model.dialog.is_some(), "{opening:?}");
        assert_eq!(console.press(&["Space"]), [Effect::Stop], "{opening:?}");
    }
}

#[test]
fn a_setting_makes_space_stop_in_a_text_field_of_an_energised_robot() {
    let note = |mode: Mode, keys: &[&str]| {
        let mut console = Console::review(mode, Verdict::Accept);
        console.model.space_always_stops = true;
        console.press(&["m"]);
        let effects = console.press(keys);
        (effects, console)
    };
    let noted = [OperatorRequest::Note { trial: 0, text: "ok y".into() }];
    let (effects, _) = note(Mode::Disarmed, &["o", "k", "Space", "y", "Enter"]);
    assert_eq!(requests(&effects), noted);
    let (effects, console) = note(Mode::Review, &["o", "k", "Space"]);
    assert_eq!(effects, [Effect::Stop]);
    assert!(matches!(console.model.dialog, Some(Dialog::Field { .. })), "the half-written note stays");
    let (effects, _) = note(Mode::Review, &["o", "k", "_", "y", "Enter"]);
    assert_eq!(requests(&effects), noted);
    let (effects, _) = note(Mode::Disarmed, &["F12"]);
    assert_eq!(effects, [Effect::Stop], "F12 is STOP in a field too");
}

#[test]
fn any_key_cancels_a_countdown_and_stop_stops_it() {
    for key in ["x", "g", "Enter", "Esc", "1", "q"] {
        let mut console = Console::ready();
        console.mode(Mode::Countdown);
        assert_eq!(console.requests(&[key]), [OperatorRequest::Cancel], "{key}");
    }
    let mut console = Console::ready();
    console.mode(Mode::Countdown);
    assert_eq!(console.press(&["Space"]), [Effect::Stop]);
}

#[test]
fn the_first_interrupt_stops_and_the_second_quits() {
    let mut console = Console::ready();
    assert_eq!(console.press(&["Ctrl-C"]), [Effect::Stop]);
    assert_eq!(console.press(&["Ctrl-C"]), [Effect::Quit]);
    let mut console = Console::ready();
    console.press(&["Ctrl-C"]);
    console.wait(2000);
    assert_eq!(console.press(&["Ctrl-C"]), [Effect::Stop], "two seconds later it is a first one again");
}

#[test]
fn quitting_asks_while_the_robot_is_armed_or_a_trial_waits() {
    assert_eq!(Console::proposed().press(&["q"]), [Effect::Quit]);
    for mut console in [Console::ready(), Console::review(Mode::Disarmed, Verdict::Fall)] {
        assert_eq!(console.press(&["q"]), []);
        assert_eq!(console.press(&["Enter"]), [], "Cancel is the default");
        console.press(&["q"]);
        assert_eq!(console.press(&["y"]), [Effect::Quit]);
    }
}

#[test]
fn verdicts_are_legal_in_review_alone() {
    let verdicts = [
        ("a", OperatorRequest::Judge(Verdict::Accept)),
        ("f", OperatorRequest::Judge(Verdict::Fall)),
        ("v", OperatorRequest::Judge(Verdict::Void)),
        ("r", OperatorRequest::Rerun { trial: None }),
    ];
    for (key, intent) in verdicts {
        for mode in [Mode::Review, Mode::Damped, Mode::Disarmed] {
            let mut console = Console::review(mode, Verdict::Accept);
            let mut sent = console.requests(&[key]);
            if key == "f" {
                // The suggested verdict is accept.
                assert_eq!(sent, []);
                assert!(console.screen(80, 24).contains("Did the robot fall?"), "{}", console.screen(80, 24));
                sent = console.requests(&["y"]);
            }
            assert_eq!(sent.as_slice(), std::slice::from_ref(&intent), "{key} in {mode:?}");
        }
        let mut console = Console::ready();
        assert_eq!(console.press(&[key]), [], "{key} with a proposal on the table");
        assert!(console.said().contains("no trial waits"), "{}", console.said());
    }
}

#[test]
fn undo_is_offered_while_the_session_says_so() {
    let mut console = Console::ready();
    assert_eq!(console.press(&["u"]), []);
    console.record(Record::Stage(StageRecord { stage: ExperimentStage::Proposed, trial: 0, can_undo: true, jumps: 0 }));
    assert_eq!(console.requests(&["u"]), [OperatorRequest::Undo]);
}

#[test]
fn an_override_is_checked_and_leaves_on_enter() {
    let mut console = Console::ready();
    assert_eq!(console.press(&["o", "Down", "1", "2", "0", ".", "5"]), [], "nothing is sent while it is typed");
    let sent = console.requests(&["Enter"]);
    assert_eq!(sent, [OperatorRequest::Override { parameter: "Fx".into(), value: 120.5 }]);

    let mut console = Console::ready();
    assert_eq!(console.press(&["o", "Down", "1", "8", "0", "Enter"]), []);
    assert!(console.screen(80, 24).contains("Fx = 180 N is outside 0 to 150 N"), "{}", console.screen(80, 24));
    assert_eq!(console.press(&["Esc", "Esc"]), [], "and nothing was sent");

    // 1 % and 10 % of the range of Fx, 150 N, from 75 N.
    let mut console = Console::ready();
    let sent = console.requests(&["o", "Down", "Right", "PgUp", "Left", "Right", "Enter"]);
    let [OperatorRequest::Override { parameter, value }] = sent.as_slice() else { panic!("{sent:?}") };
    assert_eq!(parameter, "Fx");
    assert!((value - 91.5).abs() < 1e-9, "{value}");

    // Steps end at the bound.
    let mut console = Console::ready();
    let keys: Vec<&str> = ["o", "Down"].into_iter().chain(["PgUp"; 12]).chain(["Enter"]).collect();
    assert_eq!(console.requests(&keys), [OperatorRequest::Override { parameter: "Fx".into(), value: 150.0 }]);
}

#[test]
fn letters_are_not_typed_into_an_override() {
    let mut console = Console::ready();
    console.press(&["o", "9", "k", "q", "0"]);
    assert_eq!(console.requests(&["Enter"]), [], "the letters are asked about");
    assert_eq!(console.requests(&["Enter"]), [], "90 Hz is outside of the bounds");
    assert!(console.screen(80, 24).contains("f0 = 90 Hz is outside"), "{}", console.screen(80, 24));
}

#[test]
fn a_refusal_is_reported_with_its_reason_and_logged() {
    let mut console = Console::ready();
    console.answer("override Fx = 120", false, "the trial runs already");
    let text = "override Fx = 120: refused: the trial runs already";
    assert!(console.screen(80, 24).contains(text));
    console.press(&["6"]);
    assert!(console.screen(120, 24).contains(&format!("W operator  {text}")), "{}", console.screen(120, 24));
}

#[test]
fn a_stopped_robot_is_acknowledged_with_k_alone() {
    for mode in [Mode::Damped, Mode::Fault] {
        let mut console = Console::proposed();
        console.mode(mode);
        for key in ["Enter", "Esc", "y", "a", "Tab"] {
            assert_eq!(console.requests(&[key]), [], "{key} in {mode:?}");
        }
        let mut console = Console::proposed();
        console.mode(mode);
        assert_eq!(console.requests(&["k"]), [OperatorRequest::Acknowledge]);
    }
    let mut console = Console::proposed();
    assert_eq!(console.press(&["k"]), []);
}

/// Regression: the form closed without a word, and Enter, meant for it, acknowledged the stop.
#[test]
fn stop_over_a_form_says_that_its_values_are_not_applied_and_enter_acknowledges_nothing() {
    let mut console = Console::ready();
    assert_eq!(console.press(&["o", "Down", "1", "2", "0", "F12"]), [Effect::Stop]);
    assert_eq!(console.said(), "STOP: damping. The form was closed, its values are not applied");
    console.mode(Mode::Damped);
    assert_eq!(console.requests(&["Enter"]), [], "meant for the form");
    assert_eq!(console.requests(&["Esc", "k"]), [OperatorRequest::Acknowledge]);
    let mut unchanged = Console::ready();
    unchanged.press(&["o", "F12"]);
    assert_eq!(unchanged.said(), "STOP: damping");
}

/// Regression: a dialog that stays open over a stop, or one of another person's, offered its own keys alone.
#[test]
fn every_open_dialog_says_first_that_the_robot_was_stopped() {
    for (mode, word) in [(Mode::Damped, "STOPPED"), (Mode::Fault, "FAULT")] {
        for keys in [&["?"][..], &[":"], &["P"], &["N"], &["R"], &["T"], &["2", "Enter"], &["q"]] {
            let mut console = Console::review(Mode::Review, Verdict::Accept);
            console.press(keys);
            assert!(console.model.dialog.is_some(), "{keys:?}");
            console.mode(mode);
            let way = if keys.len() > 1 { "" } else { "Esc, then " };
            let step = console.next_step();
            assert!(step.starts_with(&format!("{word}: {way}k acknowledges. ")), "{keys:?}: {step}");
            let sent = if keys.len() > 1 { console.requests(&["k"]) } else { console.requests(&["Esc", "k"]) };
            assert_eq!(sent, [OperatorRequest::Acknowledge], "{keys:?}");
        }
    }
}

/// Regression: at 80 columns the last line of a stopped robot's dialog was cut, or kept the keys that move and dropped the one that acts.
#[test]
fn the_acting_keys_of_a_dialog_over_a_stop_are_whole_at_80_columns() {
    for (key, acts) in [(":", "Enter does it"), ("T", "x switches it on or off")] {
        let mut console = Console::review(Mode::Review, Verdict::Accept);
        console.press(&[key]);
        console.mode(Mode::Damped);
        let screen = console.screen(80, 24);
        let last = screen.lines().last().unwrap();
        assert!(last.contains("k acknowledges. ") && last.contains(acts) && !last.contains(".."), "{key}: {last}");
    }
}

#[test]
fn an_observer_and_a_replay_send_nothing() {
    let all = ["A", "g", "o", "O", "n", "a", "f", "v", "r", "u", "m", "=", "D", "k", "C", "Enter"];
    let mut observer = Console::new();
    observer.record(Record::Session(SessionInfo { observe: true, ..session() }));
    observer.record(Record::Proposal(proposal(0, 0)));
    observer.stage(ExperimentStage::Proposed, 0);
    let mut replay = Console::proposed();
    replay.update(Msg::Replay(quadfrog_console::message::ReplayStatus {
        playing: true,
        speed: 1.0,
        time_ns: 0,
        duration_ns: 1,
        ..Default::default()
    }));
    for (name, console) in [("observer", &mut observer), ("replay", &mut replay)] {
        for &mode in Mode::ALL {
            console.mode(mode);
            for stage in ExperimentStage::ALL {
                console.stage(stage, 0);
                for key in all {
                    let sent = console.requests(&[key]);
                    // An observer's STOP stops the robot, so an observer may acknowledge it.
                    let stopped = name == "observer" && matches!(mode, Mode::Damped | Mode::Fault);
                    let acknowledges = usize::from(stopped && key == "k");
                    let expected = &[OperatorRequest::Acknowledge][..acknowledges];
                    assert_eq!(sent, expected, "{name}, {key} in {mode:?}, {stage:?}");
                }
            }
        }
    }
    assert_eq!(replay.press(&["Space"]), [], "there is no robot to stop");
    assert_eq!(observer.press(&["Space"]), [Effect::Stop], "an observer may stop the robot");
}

#[test]
fn energising_keys_do_nothing_in_the_wrong_mode() {
    for &mode in Mode::ALL {
        let mut console = Console::proposed();
        console.mode(mode);
        let armed = console.requests(&["A"]);
        assert_eq!(armed.contains(&OperatorRequest::Arm), mode == Mode::Disarmed, "A in {mode:?}");
        let mut console = Console::proposed();
        console.mode(mode);
        console.press(&["g"]);
        console.wait(900);
        let sent = console.requests(&["g"]);
        let approved = sent.iter().any(|intent| matches!(intent, OperatorRequest::Approve { .. }));
        assert_eq!(approved, mode == Mode::Ready, "g g in {mode:?}");
    }
}

#[test]
fn the_palette_gives_reasons_and_never_moves_the_robot_with_enter() {
    let mut console = Console::proposed();
    console.press(&[":", "a", "p", "p", "r", "o", "v", "e"]);
    let screen = console.screen(80, 24);
    assert!(screen.contains("(the robot is not standing: press A first)"), "{screen}");
    console.press(&["Esc"]);
    assert_eq!(console.press(&[":", "a", "r", "m", "Enter"]), [], "arming is asked again");
    assert_eq!(console.press(&["Enter"]), []);
    console.press(&[":", "a", "r", "m", "Enter"]);
    assert_eq!(console.requests(&["y"]), [OperatorRequest::Arm]);
}

#[test]
fn pasted_text_is_never_read_as_keys() {
    let mut console = Console::ready();
    assert_eq!(console.update(Msg::Paste("ggA q".into())), []);
    assert!(console.model.dialog.is_none());
    let mut console = Console::review(Mode::Review, Verdict::Accept);
    console.press(&["m"]);
    console.update(Msg::Paste("slid on the mat\n".into()));
    let sent = console.requests(&["Enter"]);
    assert_eq!(sent, [OperatorRequest::Note { trial: 0, text: "slid on the mat".into() }]);
}

#[test]
fn numbers_and_tab_change_the_view() {
    let mut console = Console::proposed();
    for (key, view) in VIEWS.into_iter().zip(View::VARIANTS) {
        console.press(&[key]);
        assert_eq!(console.model.view, *view);
    }
    console.press(&["Tab"]);
    assert_eq!(console.model.view, View::Live);
    console.press(&["Shift-Tab"]);
    assert_eq!(console.model.view, View::Log);
}

#[test]
fn suspending_is_refused_while_the_robot_is_armed() {
    assert_eq!(Console::proposed().press(&["Ctrl-Z"]), [Effect::Suspend]);
    let mut console = Console::ready();
    assert_eq!(console.update(Msg::Suspend), []);
    assert!(console.said().contains("the robot is armed; D sits it down"), "{}", console.said());
}

/// A suspended program does not damp the robot that it has just stopped.
#[test]
fn suspending_is_refused_while_anything_is_sent_to_a_real_robot() {
    for &mode in Mode::ALL {
        let mut console = Console::proposed();
        console.record(Record::Session(SessionInfo { backend: Some(Backend::Hardware), ..session() }));
        console.mode(mode);
        let suspends = console.update(Msg::Suspend) == [Effect::Suspend];
        assert_eq!(suspends, matches!(mode, Mode::Offline | Mode::Observe), "{mode:?}: {}", console.said());
        assert!(suspends || console.said().contains("sends the robot nothing, not even damping"), "{}", console.said());
    }
}

#[test]
fn the_bell_rings_when_the_operator_is_needed() {
    let mut console = Console::ready();
    console.stage(ExperimentStage::Running, 0);
    console.record(Record::Trial(trial(0, None, None)));
    assert_eq!(console.stage(ExperimentStage::Review, 0), [Effect::Bell]);
    assert_eq!(console.stage(ExperimentStage::Review, 0), [], "once");
}

#[test]
fn every_action_has_a_name_a_key_and_a_line_of_help() {
    let keymap = ConsoleSettings::built_in().keymap;
    assert_eq!(ACTIONS.len(), Action::VARIANTS.len());
    for (index, info) in ACTIONS.iter().enumerate() {
        assert_eq!(Action::VARIANTS[index], info.action, "the table has the order of the actions");
        assert!(!info.help.is_empty() && !info.keys.is_empty(), "{}", info.name);
        assert!(ACTIONS[..index].iter().all(|other| other.name != info.name && other.action != info.action));
        let keys: Vec<String> = keymap.keys(info.action).map(|key| key.to_string()).collect();
        assert_eq!(keys, info.keys, "console.toml and the table of actions disagree on {}", info.name);
    }
}

#[test]
fn key_names_are_read_as_they_are_shown() {
    for name in
        ["g", "A", "?", "=", "-", "+", "Space", "Enter", "Esc", "Tab", "Shift-Tab", "PgUp", "F12", "Ctrl-C", "Alt-x"]
    {
        let key: Key = name.parse().expect(name);
        assert_eq!(key.to_string(), name);
    }
    for wrong in ["", "F13", "Hyper-x", "Ctrl-", "gg"] {
        assert!(wrong.parse::<Key>().is_err(), "{wrong}");
    }
}

fn keymap_of(choices: &[(&str, &[&str])]) -> Result<Keymap, String> {
    let owned: Vec<(&str, Vec<String>)> =
        choices.iter().map(|(name, keys)| (*name, keys.iter().map(|key| (*key).to_owned()).collect())).collect();
    Keymap::new(owned.iter().map(|(name, keys)| (*name, keys.as_slice()))).map_err(|error| error.to_string())
}

#[test]
fn rebinding_refuses_collisions_and_stop() {
    let keymap = keymap_of(&[("accept", &["Y", "F2"])]).expect("free keys");
    assert_eq!(keymap.action("F2".parse().unwrap()), Some(Action::Accept));
    assert_eq!(keymap.action("a".parse().unwrap()), None);
    let message = keymap_of(&[("accept", &["f"])]).expect_err("taken by fall");
    assert!(message.contains("`accept`") && message.contains("`fall`"), "{message}");
    let message = keymap_of(&[("stop", &["s"])]).expect_err("STOP stays");
    assert!(message.contains("Space and F12"), "{message}");
    for stop in ["Alt-Space", "Ctrl-Space", "Ctrl-F12", "Alt-Ctrl-C"] {
        let message = keymap_of(&[("accept", &[stop])]).expect_err("STOP with any modifier");
        assert!(message.contains("STOP with any modifier"), "{message}");
    }
    assert!(keymap_of(&[("acept", &["y"])]).is_err());
    assert!(keymap_of(&[("accept", &[])]).is_err());
    assert!(keymap_of(&[("accept", &["Hyper-y"])]).is_err());
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let with = |key: &str, value: toml::Value| {
        let mut table: toml::Table = DEFAULT.parse().expect("the defaults");
        table.insert(key.into(), value);
        ConsoleSettings::from_table(&table).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(with("frames_per_second", 10.into()), Ok(()));
    for (key, value) in [
        ("frames_per_second", toml::Value::from(0)),
        ("chart_window_s", 0.5.into()),
        ("colours", "pink".into()),
        ("glyphs", "runes".into()),
        ("theme", "grey".into()),
        ("bell", vec!["noon"].into()),
    ] {
        let message = with(key, value).expect_err(key);
        assert!(message.contains(key), "{message}");
    }
}

/// Two presses without sight of the proposal would make the robot jump.
#[test]
fn a_terminal_too_small_for_the_card_neither_approves_nor_arms() {
    let mut console = Console::ready();
    console.update(Msg::Resize(60, 15));
    console.press(&["g"]);
    console.wait(1000);
    assert_eq!(console.requests(&["g"]), []);
    assert!(console.said().contains("enlarge the terminal to 60x20"), "{}", console.said());
    let screen = console.screen(60, 15);
    assert!(screen.contains("no key arms or jumps") && screen.contains("enlarge the terminal to 60x20"), "{screen}");
    assert_eq!(console.press(&["Space"]), [Effect::Stop]);
    console.mode(Mode::Disarmed);
    assert_eq!(console.requests(&["A"]), []);
}

/// A tripped limit is an outcome of the parameters, a fall: voiding it needs a reason.
#[test]
fn voiding_a_tripped_limit_asks_for_the_reason() {
    for (key, rerun) in [("v", false), ("r", true)] {
        let mut console = Console::review(Mode::Fault, Verdict::Fall);
        let cause = "limit: FR_calf at 70.0 rad/s exceeds 60.0 rad/s".to_owned();
        console.record(Record::Trial(TrialRecord { cause, ..trial(0, None, Some(Verdict::Fall)) }));
        assert_eq!(console.requests(&[key]), []);
        assert_shows(&console.screen(80, 24), &["Why is trial #0 void?", "it tripped a limit"]);
        assert_eq!(console.requests(&["Enter"]), [], "an empty reason is refused");
        let sent = console.requests(&["t", "e", "t", "h", "e", "r", "Enter"]);
        assert_eq!(sent, [OperatorRequest::VoidBecause { reason: "tether".into(), rerun }]);
    }
    // A fall may be voided with one key.
    assert_eq!(Console::review(Mode::Damped, Verdict::Fall).requests(&["v"]), [OperatorRequest::Judge(Verdict::Void)]);
}

/// Regression: the form stayed open over the exchange of its proposal by a queued point under the same number, and Enter set the old
/// values in that.
#[test]
fn a_form_and_a_question_about_a_proposal_close_when_it_is_exchanged() {
    for keys in [&["o", "Right"][..], &["Q"]] {
        let mut console = Console::ready();
        console.press(keys);
        assert!(console.model.dialog.is_some(), "{keys:?}: {}", console.said());
        // A new number alone changes nothing of it.
        console.record(Record::Proposal(proposal(1, 0)));
        assert!(console.model.dialog.is_some(), "{keys:?}: {}", console.said());
        let queued = Proposal { source: ProposalSource::Operator, ..proposal(1, 1) };
        console.record(Record::Proposal(queued));
        assert!(console.model.dialog.is_none(), "{keys:?}");
        assert_eq!(console.said(), "the question was closed: the situation has changed");
        assert_eq!(console.requests(&["Esc"]), []);
    }
}
