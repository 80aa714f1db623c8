//! Texts of 80 columns and 24 rows that a reader without the manual understands.

use crate::support::{Console, assert_shows, line_with, proposal, session, tick, trial};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::recording::record::{Record, SessionInfo};
use quadfrog::telemetry::{Mode, Phase};
use quadfrog::trial::{
    Approval, ExperimentStage, FallRisk, FixedParameter, JudgedBy, ParameterInfo, ParameterInsight, PointRecord,
    PredictedTrial, ProposalInsight, ProposalSource, ProposedParameter, QueuedPoint, REMOVED, SearchStatus,
    SearchedParameter, Task, TrialRecord, Verdict,
};
use quadfrog_console::message::{Msg, RejudgeNews};

/// A finished study with two points that were repeated.
fn repeated(unit: &str, confidence: Option<f64>) -> Console {
    let mut console = Console::ready();
    let mut info = session();
    info.unit = unit.to_owned();
    console.record(Record::Session(info));
    console.record(Record::Trial(trial(12, Some(Verdict::Accept), None)));
    console.stage(ExperimentStage::Finished, 20);
    let point = |trials: Vec<u32>, without_fall, mean, confidence| PointRecord {
        parameters: vec![("f0".into(), 1.25)].into(),
        trials,
        without_fall,
        mean,
        deviation: Some(0.05),
        contender: true,
        confidence,
    };
    console.record(Record::Points(vec![
        point(vec![12, 20], 2, 0.442, confidence),
        point((30..40).collect(), 9, -0.41, None),
    ]));
    console
}

/// Regression: `2/2  0.442 m ±0.000` stood below "Study finished" without a word.
#[test]
fn the_numbers_of_repeated_points_have_names_at_80_columns() {
    let screen = repeated("m", Some(0.96)).screen(80, 24);
    assert_shows(&line_with(&screen, "landed"), &[" point landed mean, std m  leads"]);
    assert_shows(&screen, &["*#12   2/2    0.442 ±0.050 96 %", " #30   9/10   -0.410 ±0.050\n"]);
    let screen = repeated("rad", None).screen(80, 24);
    assert_shows(&screen, &[" point landed mean, std rad\n", "*#12   2/2    0.442 ±0.050 leads\n"]);
    // On a wide terminal each line has its words.
    assert_shows(&repeated("m", Some(0.96)).screen(200, 60), &["2/2 landed  0.442 m ±0.050  leads, 96 %"]);
    // Regression: the lines of all points looked like statistics of the best.
    assert_shows(&screen, &["* best 0.520 rad (#12)"]);
    let title = "repeated points; *: that of the best";
    assert_shows(&repeated("m", Some(0.96)).screen(200, 60), &["* best 0.520 m (#12)", title, "*#12", " #30"]);
    // A study without repeats has no such line.
    let mut console = repeated("m", None);
    console.record(Record::Points(Vec::new()));
    let screen = console.screen(80, 24);
    assert!(!screen.contains("mean, std") && screen.contains(" best 0.520 m (#12)"), "{screen}");
}

/// Regression: `columns (x)` and `by number (s)` went as the counts grew.
#[test]
fn the_keys_in_the_heading_of_trials_stay_while_the_counts_grow() {
    let keys = "by number (s), all (F), columns (x)";
    let mut console = Console::ready();
    console.press(&["2"]);
    for count in [3, 30, 300, 999] {
        console.judged(count);
        // Regression: the counts of verdicts gave way to the words of the keys.
        assert_shows(&console.screen(80, 24), &["accept, ", "fall, ", "void; ", keys]);
        assert_shows(&console.screen(120, 40), &["void; ", keys]);
    }
    // The order with the longest name.
    for _ in 0..20 {
        console.press(&["s"]);
        let heading = line_with(&console.screen(80, 24), "Trials ─");
        assert!(heading.contains("333 void; by ") || heading.contains("333 void; s by "), "{heading}");
    }
    console.press(&["S", "F"]);
    assert_shows(&console.screen(80, 24), &["reversed, F only accept, x columns"]);
}

/// Regression: `s` sorted by `judged_by`, which 80 columns do not show.
#[test]
fn the_order_passes_over_columns_that_have_no_room() {
    let orders = |columns: u16, rows: u16| {
        let mut console = Console::ready();
        console.update(Msg::Resize(columns, rows));
        for number in 0..3 {
            let row = trial(number, Some(Verdict::Accept), None);
            console.record(Record::Trial(TrialRecord { judged_by: Some(JudgedBy::Operator), ..row }));
        }
        console.press(&["2"]);
        let order = |console: &mut Console| {
            console.press(&["s"]);
            let heading = line_with(&console.screen(columns, rows), "Trials ─").to_owned();
            heading.split("; by ").nth(1).and_then(|rest| rest.split(" (").next()).unwrap_or_default().to_owned()
        };
        (0..20).map(|_| order(&mut console)).collect::<std::collections::BTreeSet<_>>()
    };
    let narrow = orders(80, 24);
    assert!(!narrow.contains("judged_by") && narrow.contains("Fz") && narrow.contains("cause"), "{narrow:?}");
    assert!(orders(200, 60).contains("judged_by"));
}

/// Regression: under `--approve falls-only` the first line lost the number of the best trial at 80 columns.
#[test]
fn the_first_line_names_the_best_trial_beside_the_rule_of_approval() {
    for task in [Task::Forward, Task::LateralRight] {
        let mut console = Console::ready();
        let info = SessionInfo { approve: Approval::FallsOnly, task: Some(task), ..session() };
        console.record(Record::Session(info));
        console.judged(14);
        console.record(Record::Trial(trial(14, Some(Verdict::Accept), None)));
        console.record(Record::Proposal(proposal(15, 0)));
        console.stage(ExperimentStage::Proposed, 15);
        let first = console.screen(80, 24).lines().next().unwrap_or_default().to_owned();
        assert_shows(&first, &["FALLS", task.name(), "#15", "best 0.540 m (#14)", "REC 00:00"]);
        assert_shows(&console.screen(120, 40), &["APPROVE FALLS-ONLY", "trial #15", "(#14)"]);
    }
}

/// Regression: at 60x20, which has no table, the last line named the keys of the selected row of Trials.
#[test]
fn a_compact_terminal_names_no_key_of_a_row() {
    let mut console = Console::ready();
    console.judged(3);
    console.press(&["2"]);
    assert_shows(console.screen(80, 24).lines().last().unwrap_or_default(), &["Enter open"]);
    let lines: Vec<String> = console.screen(60, 20).lines().map(str::to_owned).collect();
    let last = lines[18..].join(" ");
    assert!(!last.contains("open") && !last.contains("judge") && last.contains("Press g twice to jump"), "{last}");
}

/// Regression: the details of a trial had the note below the first page, and the table cuts note and cause at 80 columns.
#[test]
fn one_key_shows_note_and_cause_whole() {
    let mut console = Console::ready();
    let note = "the left hind foot stood on the cable, so that the robot turned to the right at the end of its landing";
    let cause =
        "by the operator: the cable was pulled; looked like accept: landed and settled, after a long slip of one foot";
    let row = trial(0, Some(Verdict::Fall), Some(Verdict::Accept));
    let gains = vec![("kp".to_owned(), 400.0), ("kd".to_owned(), 8.0), ("k_att".to_owned(), 200.0)].into();
    console.record(Record::Trial(TrialRecord { note: note.into(), cause: cause.into(), gains, ..row }));
    console.press(&["2", "Home", "Enter"]);
    let screen = console.screen(80, 24).replace('│', " ");
    let words = screen.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_shows(&words, &[note, "the cable was pulled", "after a long slip of one foot"]);
}

/// Regression: the times of the stages took two lines once they had two digits.
#[test]
fn the_times_of_the_stages_have_one_line_at_80_columns() {
    let mut console = Console::ready();
    console.press(&["5"]);
    for (stages_ns, shown) in
        [([12_300, 25_000, 13_000], "12, 25, 13 us"), ([100_000, 250_000, 130_000], "100, 250, 130 us")]
    {
        let [read_ns, decide_ns, write_ns] = stages_ns;
        let mut snapshot = console.model.snapshot;
        (snapshot.tick.stages.read_ns, snapshot.tick.stages.decide_ns) = (read_ns, decide_ns);
        snapshot.tick.stages.write_ns = write_ns;
        console.update(Msg::Snapshot(Box::new(snapshot)));
        let screen = console.screen(80, 24);
        assert_shows(&screen, &[&format!("read, decide, write {shown} ")]);
        let at = screen.lines().position(|line| line.starts_with("read, decide, write")).expect("the line");
        assert!(!screen.lines().nth(at + 1).unwrap_or_default().starts_with("    "), "{screen}");
    }
}

/// Regression: "Arming checks: checked at" named the checks twice.
#[test]
fn the_time_of_the_arming_checks_stands_beside_their_name() {
    let mut console = Console::ready();
    for keys in [&["P"][..], &["Esc", "5"]] {
        console.press(keys);
        for (columns, rows) in [(80, 24), (120, 40), (200, 60)] {
            let screen = console.screen(columns, rows);
            assert!(!screen.contains("checked at"), "{screen}");
            let line = screen.lines().find(|line| line.contains("Arming")).unwrap_or_default();
            assert_shows(line, &[" at ", ": 1 passed"]);
        }
    }
}

/// Regression: the legend explained the line of a proposal after the end of the study, where none was drawn.
#[test]
fn the_legend_of_the_optimizer_explains_the_line_that_is_drawn() {
    let mut console = Console::ready();
    console.judged(4);
    console.press(&["3"]);
    let legend = |console: &Console| line_with(&console.screen(80, 24), "* best");
    assert_shows(&legend(&console), &["│ proposal"]);
    console.stage(ExperimentStage::Finished, 4);
    assert!(!legend(&console).contains("proposal"), "{}", legend(&console));
    // The reasons of the last proposal stay.
    let reasons = ParameterInsight {
        name: "Fx".into(),
        proposed: 75.0,
        at: vec![0.0, 75.0, 150.0],
        good: vec![0.1, 0.4, 0.1],
        bad: vec![0.2, 0.2, 0.2],
        importance: None,
    };
    console.record(Record::Insight(ProposalInsight { trial: 3, parameters: vec![reasons], ..Default::default() }));
    assert_shows(&legend(&console), &["│ last proposal"]);
}

/// Regression: the second row of the last line began at the edge of a terminal of 60 columns.
#[test]
fn both_rows_of_the_next_step_have_a_margin_in_a_small_terminal() {
    for (console, count) in [(Console::ready(), 1), (Console::review(Mode::Ready, Verdict::Accept), 2)] {
        let screen = console.screen(60, 20);
        let rows: Vec<&str> = screen.lines().skip(18).collect();
        assert_eq!(rows.iter().filter(|row| !row.is_empty()).count(), count, "{screen}");
        assert!(rows.iter().all(|row| row.is_empty() || row.starts_with(' ')), "{screen}");
    }
}

/// Regression: a box in which text is typed changed its width with each answer.
#[test]
fn a_text_box_keeps_its_width() {
    let mut console = Console::ready();
    console.record(Record::Trial(trial(0, Some(Verdict::Accept), None)));
    let width = |console: &Console| {
        let screen = console.screen(120, 40);
        let top = screen.lines().find(|line| line.contains('┌'))?.to_owned();
        Some(top.split_once('┌')?.1.split_once('┐')?.0.chars().count())
    };
    for (open, typed) in [("m", "a note"), ("o", "9999")] {
        console.press(&[open]);
        let opened = width(&console);
        assert!(opened.is_some());
        console.enter(typed);
        assert_eq!(width(&console), opened);
        console.press(&["F5"]);
        assert_eq!(width(&console), opened);
        console.enter(&typed.repeat(20));
        assert_eq!(width(&console), opened, "{}", console.screen(120, 40));
        console.press(&["Esc", "Esc"]);
    }
}

/// Regression: Live showed a parameter that the operator had fixed like one that the sampler had proposed.
#[test]
fn live_says_that_a_parameter_is_fixed() {
    let mut console = Console::ready();
    let fixed = |value, trials| {
        let fixed = Some(FixedParameter { value, trials });
        let fx = SearchedParameter { name: "Fx".into(), low: 0.0, high: 150.0, least: 0.0, most: 200.0, fixed };
        Record::Search(SearchStatus { budget: 20, parameters: vec![fx], ..SearchStatus::default() })
    };
    console.record(fixed(75.0, 3));
    for (columns, rows) in [(60, 20), (80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        assert_shows(&line_with(&screen, " Fx  "), &["75.00 N   fixed, 3 more"]);
        assert!(!line_with(&screen, " Fz  ").contains("fixed"), "{screen}");
    }
    // The present proposal has another value, as a queued point has.
    console.record(fixed(90.0, 3));
    assert!(!console.screen(80, 24).contains("fixed"), "{}", console.screen(80, 24));
}

/// Regression: a line of the queue ended with two dots.
#[test]
fn a_queued_point_is_shown_whole_in_a_narrow_queue() {
    let mut console = Console::ready();
    let point = |trial| QueuedPoint {
        trial,
        source: ProposalSource::Rerun,
        parent: Some(3),
        parameters: vec![("f0".into(), 1.3), ("Fx".into(), 90.25), ("Fz".into(), 240.125)].into(),
        gains: vec![("kp".into(), 450.0), ("kd".into(), 9.5), ("kd_joint".into(), 0.85)].into(),
    };
    let queue = (8..28).map(point).collect();
    console.record(Record::Search(SearchStatus { budget: 20, queue, ..SearchStatus::default() }));
    for (columns, rows) in [(60, 20), (80, 24)] {
        console.press(&["N"]);
        for trial in 8..28 {
            let screen = console.screen(columns, rows);
            let box_rows: Vec<&str> = screen.lines().filter_map(|line| line.split('│').nth(1)).collect();
            let text = box_rows.join(" ").split_whitespace().collect::<Vec<_>>().join(" ");
            let whole = format!(
                "#{trial} re-run of #3 f0 1.300 Hz, Fx 90.25 N, Fz 240.1 N, kp 450.0 N/m, kd 9.500 N s/m, kd_joint 0.850 N m s/rad"
            );
            assert!(text.contains(&whole) && !text.contains(".. "), "{whole}:\n{screen}");
            console.press(&["Down"]);
        }
        console.press(&["Esc"]);
    }
    console.record(Record::Search(SearchStatus::default()));
    console.press(&["N"]);
    let screen = console.screen(60, 20);
    let text = screen.lines().filter_map(|line| line.split('│').nth(1)).collect::<Vec<_>>().join(" ");
    assert_shows(&text.split_whitespace().collect::<Vec<_>>().join(" "), &["in the form of o those of the form."]);
}

/// Regression: the header named a trial that was removed from the queue.
#[test]
fn the_header_of_a_finished_study_names_the_last_trial_that_ran() {
    let mut console = Console::ready();
    console.judged(2);
    let removed = TrialRecord { cause: REMOVED.into(), value: None, ..trial(2, Some(Verdict::Void), None) };
    console.record(Record::Trial(removed));
    console.stage(ExperimentStage::Finished, 2);
    let header = |columns| console.screen(columns, 24).lines().next().unwrap_or_default().to_owned();
    assert_shows(&header(80), &["trial #1 "]);
    assert_shows(&header(120), &["trial #1 "]);
    console.stage(ExperimentStage::Proposed, 3);
    assert_shows(&console.screen(80, 24), &["trial #3 "]);
}

/// Regression: the verdict of a trial of another program was cut to `o comple..`.
#[test]
fn the_verdict_of_a_trial_of_another_program_is_whole() {
    let mut console = Console::ready();
    for number in 0..2 {
        let row = trial(number, Some(Verdict::Accept), None);
        console.record(Record::Trial(TrialRecord { source: ProposalSource::OtherProgram, ..row }));
    }
    console.press(&["2"]);
    for (columns, rows) in [(80, 24), (120, 40)] {
        assert_shows(&console.screen(columns, rows), &["* complete", "o complete"]);
    }
}

/// Regression: the last sentence of the form was cut, more so once values were changed.
#[test]
fn the_form_of_overrides_is_whole_at_60_columns_and_20_rows() {
    let mut console = Console::ready();
    console.press(&["o"]);
    assert_shows(
        &console.screen(60, 20),
        &["This does not move the robot: it is approved like any", "other proposal."],
    );
    for value in ["1.4", "80", "250.5"] {
        console.enter(value);
        console.press(&["Down"]);
    }
    console.enter("7");
    console.press(&["Esc"]);
    let screen = console.screen(60, 20);
    assert_shows(
        &screen,
        &["was 1.250", "was 75.00", "was 250", "7 was dropped: kp stays 400.0 N/m.", "drops its values."],
    );
    assert_shows(&screen, &["> kp", "k_att"]);
}

/// Regression: view Override had dashes in place of the values of the trial that counted down or ran.
#[test]
fn the_values_of_the_running_trial_are_in_view_override() {
    let mut console = Console::ready();
    console.press(&["4"]);
    console.stage(ExperimentStage::Running, 0);
    console.mode(Mode::Countdown);
    for (columns, rows) in [(80, 24), (120, 40)] {
        let screen = console.screen(columns, rows);
        assert_shows(&screen, &["Trial #0 runs, source: sampler"]);
        for (name, value) in [("f0  ", "1.250"), ("Fx  ", "75.00"), ("Fz  ", "250.0"), ("kp  ", "400.0")] {
            assert_shows(&line_with(&screen, &format!("{name}  ")), &[value]);
        }
        assert_shows(&screen, &["The proposal cannot be changed now"]);
    }
}

/// Regression: the sign beside the number of a trial was not explained.
#[test]
fn the_sign_of_a_trial_under_the_charts_is_explained() {
    let mut console = Console::ready();
    for time_ms in (0..1_000).step_by(5) {
        console.tick(tick(time_ms, 0.1, Some((0, time_ms as f64 / 1e3 - 0.5, Phase::Impulse))));
    }
    console.judged(1);
    console.press(&["2"]);
    assert!(!console.screen(120, 40).contains('~'), "{}", console.screen(120, 40));
    console.press(&["Home", "c"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["Trials, ~ under the charts ", ">  0~ "]);
    console.press(&["?"]);
    assert_shows(&console.screen(120, 100), &["under the charts, ~ in Trials"]);
}

/// Regression: `~` marked the first and the second of two compared trials, which the charts call A and B.
#[test]
fn two_compared_trials_are_marked_as_the_charts_name_them() {
    let mut console = Console::ready();
    for trial in 0..2 {
        for time_ms in (0..1_000).step_by(5) {
            let jump = Some((trial, time_ms as f64 / 1e3 - 0.5, Phase::Impulse));
            console.tick(tick(u64::from(trial) * 2_000 + time_ms, 0.1, jump));
        }
    }
    console.judged(3);
    console.press(&["2", "Home", "c", "Down", "c"]);
    let screen = console.screen(120, 40);
    assert_shows(&screen, &["Trials, A and B compared ", "   0A ", ">  1B ", "   2  "]);
    assert!(!screen.contains('~'), "{screen}");
}

/// Regression: at 80x24 the proposal lost its last lines without a mark: a changed gain, the falls near it, the hop envelope.
#[test]
fn a_proposal_at_80_columns_is_whole_or_says_what_has_no_room() {
    let mut console = Console::ready();
    console.judged(3);
    let mut proposal = proposal(3, 1);
    proposal.gains.iter_mut().for_each(|gain| gain.value += 1.0);
    let (nearest_fall, nearest_fall_trial) = (Some(0.12), Some(1));
    proposal.risk = Some(FallRisk { nearest_fall, nearest_fall_trial, falls: 1, neighbours: 3 });
    console.record(Record::Proposal(proposal.clone()));
    console.stage(ExperimentStage::Proposed, 3);
    console.record(Record::Search(SearchStatus { budget: 20, hop_share: Some(0.4), ..SearchStatus::default() }));
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["f0", "Fx", "Fz", " kp ", " kd ", " kd_joint", " k_att", "nearest fall #1"]);
    assert_shows(&screen, &["hop envelope: 40 % of force"]);
    assert!(!screen.contains("no room"), "{screen}");
    // More than the panel has room for.
    let more = (0..6).map(|number| ProposedParameter { name: format!("p{number}"), value: 1.0, proposed: 1.0 });
    proposal.parameters.extend(more);
    proposal.revision = 2;
    console.record(Record::Proposal(proposal));
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["p0", "p5", " 4 more have no room"]);
    assert!(!screen.contains("hop envelope"), "{screen}");
}

/// Regression: from trial 1000 on the numbers took the room of the columns behind them, which shifted.
#[test]
fn columns_stay_where_they_are_behind_large_numbers_of_trials() {
    let mut console = Console::ready();
    for number in [999, 1000, 10000] {
        console.record(Record::Trial(TrialRecord { value: Some(0.5), ..trial(number, Some(Verdict::Accept), None) }));
    }
    for view in ["1", "2"] {
        console.press(&[view]);
        for (columns, rows) in [(80, 24), (120, 40)] {
            let screen = console.screen(columns, rows);
            let values: Vec<Option<usize>> = ["  999 ", " 1000 ", "10000 "]
                .iter()
                .map(|number| line_with(&screen, &format!("{number} ")).find("75.00"))
                .collect();
            assert!(values[0].is_some() && values.iter().all(|value| *value == values[0]), "{values:?}\n{screen}");
        }
    }
}

/// Regression: at 120 columns Live cut the confidence of the leading point, 97 %, to `leads, 9`.
#[test]
fn the_confidence_of_the_leading_point_is_whole_at_every_width() {
    for (confidence, shown) in [(0.97, "97 %"), (0.9999, "100 %")] {
        let console = repeated("rad", Some(confidence));
        for columns in 80..=200 {
            let screen = console.screen(columns, 40);
            assert_shows(&line_with(&screen, "*#12 "), &[shown]);
        }
    }
}

/// Regression: at 80x24 no view showed the standings of a running confirmation; Live said that they have no room.
#[test]
fn the_standings_of_a_running_confirmation_are_shown_at_80x24() {
    let mut console = repeated("m", Some(0.97));
    let mut changed = proposal(21, 0);
    changed.gains[..3].iter_mut().for_each(|gain| gain.value *= 1.1);
    console.record(Record::Proposal(changed));
    console.stage(ExperimentStage::Proposed, 21);
    console.record(Record::Search(SearchStatus { budget: 20, confirming: Some(7), ..SearchStatus::default() }));
    assert_shows(&console.screen(80, 24), &["confirming the best: 7 left", "2 points have no room: view 3"]);
    console.press(&["3"]);
    let screen = console.screen(80, 24);
    assert_shows(&screen, &["Repeated points", "2/2 landed  0.442 m ±0.050  leads, 97 %", "9/10 landed"]);
    // The panels whose place it takes have no legend.
    assert!(!screen.contains("TPE") && !screen.contains("g good"), "{screen}");
    console.record(Record::Search(SearchStatus { budget: 20, ..SearchStatus::default() }));
    assert_shows(&console.screen(80, 24), &["TPE"]);
}

/// Regression: below 60x20, where no dialog is drawn, values were typed into a form that nothing showed.
#[test]
fn a_terminal_that_shows_no_dialog_opens_no_field() {
    let finished = || {
        let mut console = Console::ready();
        console.judged(5);
        console.stage(ExperimentStage::Finished, 5);
        console
    };
    let review = || Console::review(Mode::Ready, Verdict::Accept);
    let tripped = || {
        let mut console = Console::review(Mode::Ready, Verdict::Fall);
        console.record(Record::Trial(tripped_trial()));
        console
    };
    let cases: [(&dyn Fn() -> Console, &str); 7] = [
        (&review, "="),
        (&review, "m"),
        (&Console::ready, "o"),
        (&finished, "K"),
        (&finished, "C"),
        (&tripped, "v"),
        (&Console::ready, ":"),
    ];
    for (console, key) in cases {
        for (columns, rows, opens) in [(40, 10, false), (59, 20, false), (60, 20, true)] {
            let mut console = console();
            console.update(Msg::Resize(columns, rows));
            console.press(&[key]);
            assert_eq!(console.model.dialog.is_some(), opens, "{key} at {columns}x{rows}: {}", console.said());
            if !opens {
                let refused =
                    format!("{key} is not possible: enlarge the terminal to 60x20: what is typed must be visible");
                assert_eq!(console.said(), refused);
            }
        }
    }
    // Nothing of the value reaches the session.
    let mut console = review();
    console.update(Msg::Resize(40, 10));
    assert_eq!(console.requests(&["=", "0", ".", "5", "Enter"]), []);
}

/// A trial that tripped a limit: its void verdict needs a reason.
fn tripped_trial() -> TrialRecord {
    let row = trial(0, None, Some(Verdict::Fall));
    TrialRecord { cause: "limit: roll 1.200 rad exceeds 1.000 rad".into(), ..row }
}

/// Regression: at 80x24 the importances of `gp` had no room beside the title, and the legend explained them all the same.
#[test]
fn the_importance_of_a_parameter_has_room_at_80x24_and_its_legend_only_where_it_is_shown() {
    let with = |names: &[&str]| {
        let mut console = Console::ready();
        let parameters = session().parameters;
        let parameters = names.iter().map(|name| ParameterInfo { name: (*name).into(), ..parameters[0].clone() });
        let info = SessionInfo { sampler: Some(SamplerKind::Gp), parameters: parameters.collect(), ..session() };
        console.record(Record::Session(info));
        console.judged(4);
        let insight = |name: &&str| ParameterInsight {
            name: (*name).into(),
            proposed: 1.25,
            importance: Some(0.46),
            ..ParameterInsight::default()
        };
        let predicted = vec![PredictedTrial { trial: 0, value: 0.4, deviation: 0.02 }];
        let parameters = names.iter().map(insight).collect();
        console.record(Record::Insight(ProposalInsight { trial: 4, parameters, predicted, ..Default::default() }));
        console.press(&["3"]);
        console
    };
    let three = with(&["f0", "Fx", "k_att"]);
    for columns in 80..=200 {
        let screen = three.screen(columns, 24);
        assert_eq!(screen.matches("importance 46 %").count(), 3, "{screen}");
        assert_shows(&screen, &["importance: for best tenth"]);
    }
    assert_shows(&three.screen(200, 60), &["Predicted J over f0", "importance 46 %"]);
    let screen = with(&["f0", "Fx", "Fz", "kp", "kd", "k_att"]).screen(80, 24);
    assert!(!screen.contains("importance"), "{screen}");
}

/// Regression: in few columns the line below the size was cut to `STOP works, no key ar`.
#[test]
fn the_lines_of_a_very_narrow_terminal_are_whole() {
    let console = Console::ready();
    for columns in 12..60 {
        let screen = console.screen(columns, 100);
        let words = screen.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_shows(&words, &["link none: SIM", "STOP works, no key arms or jumps"]);
    }
}

/// Regression: the line of the best so far ended one trial before the next best.
#[test]
fn the_line_of_the_best_so_far_has_no_gap() {
    let mut console = Console::ready();
    console.judged(16);
    console.press(&["3"]);
    let screen = console.screen(120, 40);
    let lines: Vec<Vec<char>> = screen.lines().map(|line| line.chars().take(68).collect()).collect();
    let top = screen.lines().position(|line| line.contains("over trials")).expect("its heading");
    let below = screen.lines().position(|line| line.contains("#19")).expect("its numbers");
    let at = |column: usize, signs: &str| {
        lines[top + 1..below].iter().any(|line| line.get(column).is_some_and(|cell| signs.contains(*cell)))
    };
    let first = (0..68).find(|column| at(*column, "o")).expect("the first accepted trial");
    let last = (0..68).find(|column| at(*column, "*")).expect("the best");
    for column in first..=last {
        assert!(at(column, "─o*"), "nothing in column {column}:\n{screen}");
    }
}

/// Regression: the heading of trials that are judged again named the folder `n/examples/hardware_like`.
#[test]
fn the_heading_of_trials_judged_again_cuts_a_path_at_a_slash_with_a_sign() {
    for (configuration, shown) in [
        ("configurations/examples/hardware_like", "new by ../hardware_like: 0 of 5"),
        ("examples/strict", "new by examples/strict: 0 of 5"),
        ("examples/a-very-long-name-of-a-folder", "new by a-very-long-name-of-a-..: 0 of 5"),
    ] {
        let mut console = Console::ready();
        console.judged(5);
        console.press(&["2"]);
        let news = RejudgeNews::Begun { configuration: configuration.into(), unit: "m".into(), trials: 5 };
        console.update(Msg::Rejudged(news));
        assert_shows(&console.screen(80, 24), &[shown]);
    }
}
