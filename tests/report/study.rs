//! Derived quantities of a jump, measured from made-up ticks with known answers.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Vector3;
use quadfrog::optimize::ask::Direction;
use quadfrog::recording::record::{Record, SessionInfo, Stamped};
use quadfrog::recording::writer::Writer;
use quadfrog::report::jump::{JumpCurves, JumpQuantities, force_angle_rad};
use quadfrog::report::recorded::{RecordedTrial, Recordings};
use quadfrog::report::study::{ReportedStudy, TrialChoice, groups, mean_and_deviation, mean_best_so_far};
use quadfrog::report::{study_page, table, text};
use quadfrog::robot::description::RobotDescription;
use quadfrog::telemetry::Tick;
use quadfrog::trial::{
    Approval, JudgedBy, JumpParameters, ParameterInfo, Proposal, ProposalSource, ProposedParameter, SKIPPED, Task,
    TrialRecord, Verdict,
};

/// Ticks from -0.2 s: on the ground until 0.3 s but for a lift of 5 ms at 0.1 s, in the air until 0.8 s, then landed.
fn ticks() -> Vec<Tick> {
    (0..1400)
        .map(|number: u64| {
            let time_s = number as f64 * 1e-3 - 0.2;
            let mut tick = Tick { number, trial: Some(4), trial_time_s: time_s, ..Tick::default() };
            let lifted = (0.1..0.105).contains(&time_s);
            tick.estimate.contact = [!(lifted || (0.3..0.8).contains(&time_s)); 4];
            tick.estimate.velocity_world = Vector3::new(1.0, -1.0, if time_s < 0.2995 { 9.0 } else { 2.0 });
            tick.estimate.roll_pitch_yaw = Vector3::new(0.1, 0.2, 0.3);
            tick.estimate.position_world.z = if time_s < 0.0 { 0.2 } else { 0.25 };
            let push = time_s < 0.2995;
            tick.state.joint_torque_n_m[5] = if push { -20.0 } else { 30.0 };
            tick.state.joint_velocity_rad_s[5] = -4.0;
            tick.state.joint_torque_n_m[3] = 5.0;
            tick.state.joint_velocity_rad_s[3] = if push { 2.0 } else { 50.0 };
            // Brakes: its power is no part of the sum.
            tick.state.joint_torque_n_m[1] = 7.0;
            tick.state.joint_velocity_rad_s[1] = -9.0;
            tick
        })
        .collect()
}

#[test]
fn takeoff_is_the_first_flight_and_splits_push_and_landing() {
    let jump = JumpQuantities::of(&ticks()).unwrap();
    assert!((jump.takeoff_s - 0.3).abs() < 1e-9, "{jump:?}");
    assert!((jump.takeoff_speed_m_s - 6f64.sqrt()).abs() < 1e-12);
    assert!((jump.takeoff_angle_rad - 2f64.atan2(2f64.sqrt())).abs() < 1e-12);
    assert_eq!(jump.push_torque_n_m, [5.0, 7.0, 20.0]);
    assert_eq!(jump.landing_torque_n_m, [5.0, 7.0, 30.0]);
    assert_eq!(jump.joint_power_w, [10.0, 0.0, 80.0]);
    assert_eq!(jump.push_power_w, 90.0);
    let standing: Vec<Tick> = ticks().into_iter().filter(|tick| tick.trial_time_s < 0.29).collect();
    assert_eq!(JumpQuantities::of(&standing), None);
    assert_eq!(JumpQuantities::of(&[]), None);
}

#[test]
fn the_force_angle_is_that_of_the_amplitudes() {
    let jump = JumpParameters { f0_hz: 1.0, f1_hz: 0.0, fx_n: 140.0, fy_n: 0.0, fz_n: 239.0 };
    assert!((force_angle_rad(&jump, Task::Forward).to_degrees() - 59.64).abs() < 0.01);
    let twist = JumpParameters { fx_n: 0.0, fy_n: 150.0, fz_n: 150.0, ..jump };
    for task in [Task::LateralLeft, Task::LateralRight, Task::TwistCcw, Task::TwistCw] {
        assert!((force_angle_rad(&twist, task).to_degrees() - 45.0).abs() < 1e-9);
    }
}

#[test]
fn feet_are_measured_from_the_beginning_of_the_impulse() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let curves = JumpCurves::of(&ticks(), &robot, 0.1);
    for foot in &curves.foot_height_m {
        let at = |time: f64| foot.iter().rfind(|point| point[0] <= time).unwrap()[1];
        assert!(at(0.5).abs() < 1e-12 && (at(-0.05) + 0.05).abs() < 1e-12);
        assert!((foot[0][0] + 0.1).abs() < 1.5e-3, "begins at {}", foot[0][0]);
    }
    assert!(curves.torque_n_m[2].iter().any(|point| point[1] == 30.0));
    assert_eq!(JumpCurves::of(&ticks()[..100], &robot, 0.1), JumpCurves::default());
}

fn row(trial: u32, verdict: Verdict, value: f64) -> TrialRecord {
    let parameters = vec![("f0".to_owned(), 1.0), ("Fx".to_owned(), 100.0), ("Fz".to_owned(), 200.0)];
    let value = (verdict != Verdict::Void).then_some(value);
    TrialRecord { trial, verdict: Some(verdict), value, parameters: parameters.into(), ..TrialRecord::default() }
}

fn study(seed: u32, rows: Vec<TrialRecord>) -> ReportedStudy {
    let info = |name: &str, unit: &str, low, high| ParameterInfo { name: name.into(), unit: unit.into(), low, high };
    ReportedStudy {
        place: "study".into(),
        name: format!("forward-seed{seed}"),
        task: Some(Task::Forward),
        seed: Some(seed),
        robot: "go1, simulated".into(),
        direction: Direction::Maximize,
        unit: "m".into(),
        jumps: 1,
        f1_hz: 0.0,
        parameters: vec![info("f0", "Hz", 0.75, 1.75), info("Fx", "N", 0.0, 150.0), info("Fz", "N", 150.0, 350.0)],
        best: Some(1),
        other_gains_of_best: String::new(),
        confirmation: None,
        fixed: Vec::new(),
        model_best: None,
        limits: None,
        recordings: Recordings::default(),
        changed: Vec::new(),
        configuration: Vec::new(),
        rows,
    }
}

fn rows() -> Vec<TrialRecord> {
    let confirmed = TrialRecord { source: ProposalSource::Confirm, ..row(5, Verdict::Accept, 9.0) };
    vec![
        row(0, Verdict::Fall, 0.0),
        row(1, Verdict::Accept, 0.5),
        row(2, Verdict::Void, 0.0),
        row(3, Verdict::Accept, 0.4),
        row(4, Verdict::Accept, 0.7),
        confirmed,
    ]
}

#[test]
fn best_so_far_counts_accepted_trials_alone() {
    let best = study(0, rows()).best_so_far();
    assert!(best[0].is_nan());
    assert_eq!(best[1..], [0.5, 0.5, 0.7]);
    let (first, second) =
        (study(0, rows()), study(1, vec![row(0, Verdict::Accept, 0.1), row(1, Verdict::Accept, 0.3)]));
    let mean = mean_best_so_far(&[&first, &second]);
    assert_eq!(mean.len(), 1, "{mean:?}");
    assert_eq!(mean[0].0, 2);
    assert!((mean[0].1 - 0.4).abs() < 1e-12 && (mean[0].2 - 0.02f64.sqrt()).abs() < 1e-12);
    assert_eq!(mean_and_deviation(&[3.0]), (3.0, 0.0));
    // Regression: the deviation of no values was 0.
    let (mean, deviation) = mean_and_deviation(&[]);
    assert!(mean.is_nan() && deviation.is_nan());
}

/// Regression: the values of a study in m, of one in m/s and of one in m per jump had one mean.
#[test]
fn studies_of_another_unit_or_of_several_jumps_are_groups_of_their_own() {
    let studies = [
        study(0, vec![row(0, Verdict::Accept, 0.6)]),
        ReportedStudy { unit: "m/s".into(), ..study(1, vec![row(0, Verdict::Accept, 1.4)]) },
        ReportedStudy { jumps: 3, ..study(2, vec![row(0, Verdict::Accept, 0.3)]) },
        study(3, vec![row(0, Verdict::Accept, 0.8)]),
    ];
    let names = |studies| groups(studies).into_iter().map(|group| group.name_with_unit()).collect::<Vec<_>>();
    assert_eq!(
        names(&studies),
        ["forward of one jump in m", "forward of one jump in m/s", "forward of jumps in a row in m"]
    );
    assert_eq!(names(&studies[..2]), ["forward in m", "forward in m/s"]);
    assert_eq!(names(&studies[2..]), ["forward of jumps in a row (m)", "forward of one jump (m)"]);
    assert_eq!(names(&studies[..1]), ["forward (m)"]);
    let page = study_page::page(&studies[..3], &[], "0.1.0 (test)");
    let shown = text::render(&page, 200);
    assert!(!shown.contains("+-"), "{shown}");
    let figures: Vec<&str> = page.figures().map(|figure| figure.name.as_str()).collect();
    for name in ["forward-of-one-jump-in-m-s-convergence", "forward-of-jumps-in-a-row-in-m-convergence"] {
        assert!(figures.contains(&name), "{figures:?}");
    }
    let both = study_page::page(&[studies[0].clone(), studies[3].clone()], &[], "0.1.0 (test)");
    assert!(text::render(&both, 200).contains("0.700 +- 0.141"));
}

/// Regression: the table of the best value so far had a column `0 trials` with nothing in it, or a column `1 trials`.
#[test]
fn the_best_so_far_is_left_out_before_the_first_counted_trial() {
    let shown = |rows| text::render(&study_page::summary(&study(0, rows)), 80);
    let none = shown(vec![row(0, Verdict::Void, 0.0)]);
    assert!(!none.contains("0 trials") && !none.contains("Best value of a single trial so far"), "{none}");
    assert!(none.contains("Studies. 1 trial, 0 counted") && none.contains("No trial of forward"), "{none}");
    let one = shown(vec![row(0, Verdict::Accept, 0.5)]);
    assert!(one.contains("Best value of a single trial so far") && !one.contains("trials\n"), "{one}");
}

/// Regression: no page said how many trials ran with changed values or were re-runs.
#[test]
fn the_page_counts_overrides_and_reruns_that_ran() {
    let row =
        |trial, source, cause: &str| TrialRecord { source, cause: cause.into(), ..row(trial, Verdict::Void, 0.0) };
    let rows = vec![
        row(0, ProposalSource::Operator, ""),
        row(1, ProposalSource::Operator, SKIPPED),
        row(2, ProposalSource::Rerun, ""),
        row(3, ProposalSource::Rerun, ""),
        row(4, ProposalSource::Sampler, ""),
        // Regression: one whose values were queued from the form of overrides was listed and not counted.
        TrialRecord {
            gains: vec![("kp".to_owned(), 310.0)].into(),
            proposed: vec![("kp".to_owned(), 400.0)].into(),
            ..row(5, ProposalSource::Queued, "")
        },
        // Regression: a point that was typed in the form and queued was not counted at all.
        row(6, ProposalSource::Queued, ""),
    ];
    let shown = text::render(&study_page::summary(&study(0, rows)), 80);
    let shown = shown.replace('\n', " ");
    assert!(
        shown.contains("2 trials with parameters or gains that an operator has set, 2 re-runs, 1 queued point."),
        "{shown}"
    );
    let shown = text::render(&study_page::summary(&study(0, vec![row(0, ProposalSource::Sampler, "")])), 80);
    assert!(!shown.contains("re-run"), "{shown}");
}

/// Regressions: the table of the studies was split at 80 columns, and repeats that confirm the best were among the accepted.
#[test]
fn the_table_of_studies_fits_80_columns_and_counts_repeats_apart() {
    let studies = [study(0, rows()), ReportedStudy { unit: "rad".into(), ..study(12, rows()) }];
    for studies in [&studies[..1], &studies] {
        let page = study_page::page(studies, &[], "0.1.0 (test)");
        let shown = text::render(&page, 80);
        let results =
            &shown[shown.find("Studies.").unwrap()..shown.find("Best value of a single trial so far").unwrap()];
        assert_eq!(results.matches("accepted").count(), 1, "{results}");
        assert!(results.lines().all(|line| line.chars().count() <= 80), "{results}");
        let row = results.lines().find(|line| line.starts_with("forward, seed 0")).unwrap();
        let numbers: Vec<&str> = row.split_whitespace().skip_while(|word| word.parse::<u32>() != Ok(6)).collect();
        // Trials, accepted, falls, repeats, void.
        assert_eq!(numbers[..5], ["6", "3", "1", "1", "1"], "{results}");
        let (trials, counted) = (6 * studies.len(), 4 * studies.len());
        assert!(results.contains(&format!("{trials} trials, {counted} counted")), "{results}");
    }
}

/// Regression: a trial that waits for its verdict was counted, and no column had it.
#[test]
fn the_table_of_studies_says_how_many_trials_have_no_verdict() {
    let caption = |rows| text::render(&study_page::page(&[study(0, rows)], &[], "0.1.0 (test)"), 80);
    let waiting = |trial| TrialRecord { verdict: None, ..row(trial, Verdict::Accept, 0.5) };
    assert!(caption(vec![waiting(0)]).contains("Studies. 1 trial, 0 counted, 1 without a verdict: repeats"));
    let two = vec![row(0, Verdict::Accept, 0.5), row(1, Verdict::Fall, 0.0)];
    assert!(caption(two).contains("Studies. 2 trials, 2 counted: repeats"));
}

#[test]
fn the_origins_of_verdicts_are_a_line_of_ranges() {
    let judged = |trial: u32, judged_by| TrialRecord { judged_by, ..row(trial, Verdict::Accept, 0.5) };
    let (operator, rule) = (Some(JudgedBy::Operator), Some(JudgedBy::Rule));
    let by = [operator, operator, operator, rule, operator, operator, None, rule, operator];
    let rows: Vec<TrialRecord> = (0..).zip(by).map(|(trial, by)| judged(trial, by)).collect();
    let line = "Judged by the operator: trials 0 to 2, 4, 5, 8; by a rule of the program: trials 3, 7\n";
    assert_eq!(table::origins(&rows), line);
    assert_eq!(table::origins(&rows[3..4]), "Judged by a rule of the program: trial 3\n");
    assert_eq!(table::origins(&rows[6..7]), "", "of an earlier version");
}

#[test]
fn chosen_trials_are_found_or_left_out() {
    let study = study(0, rows());
    let label = |choice: TrialChoice| choice.of(&study).map(|(_, label)| label);
    assert_eq!(label(TrialChoice::Best).as_deref(), Some("best, trial 1"));
    assert_eq!(label(TrialChoice::First).as_deref(), Some("first, trial 0, fall"));
    assert_eq!(label(TrialChoice::Last).as_deref(), Some("last, trial 4"));
    assert_eq!(label(TrialChoice::LastFall).as_deref(), Some("last fall, trial 0"));
    assert_eq!(label(TrialChoice::Number(3)).as_deref(), Some("trial 3"));
    assert_eq!(label(TrialChoice::Number(17)), None);
}

#[test]
fn a_page_of_a_study_names_missing_ticks_and_draws_the_others() {
    let mut study = study(0, rows());
    let choices = [TrialChoice::Best, TrialChoice::First, TrialChoice::LastFall];
    let without = study_page::page(std::slice::from_ref(&study), &choices, "0.1.0 (test)");
    assert!(text::render(&without, 80).contains("No recording of this study exists"));
    let robot = RobotDescription::embedded("go1").unwrap();
    study.recordings.files.push("session.mcap".into());
    study.recordings.trials.insert(1, RecordedTrial::of(&ticks(), &robot).unwrap());
    let page = study_page::page(std::slice::from_ref(&study), &choices, "0.1.0 (test)");
    let shown = text::render(&page, 80).replace('\n', " ");
    assert!(shown.contains("Ticks of 1 of 6 trials are recorded; those of trial 0 are missing"), "{shown}");
    let motion = page.figures().find(|figure| figure.name == "forward-motion").unwrap();
    assert_eq!(motion.panels.len(), 6);
    assert!(motion.panels.iter().all(|panel| panel.series.len() == 1 && panel.series[0].label == "best, trial 1"));
    // Regression: a trial that ended in its countdown has ticks for `quadfrog export` and had none here.
    study.recordings.with_ticks.extend([0, 1]);
    let page = study_page::page(std::slice::from_ref(&study), &choices, "0.1.0 (test)");
    let shown = text::render(&page, 80).replace('\n', " ");
    assert!(shown.contains("Ticks of 2 of 6 trials are recorded"), "{shown}");
    assert!(shown.contains("The ticks of trial 0 end before the impulse"), "{shown}");
    // Regression: a trial in which the program was killed had ticks like any other.
    study.recordings.in_part.insert(0);
    let page = study_page::page(std::slice::from_ref(&study), &choices, "0.1.0 (test)");
    let shown = text::render(&page, 80).replace('\n', " ");
    assert!(shown.contains("Ticks of 2 of 6 trials are recorded, of trial 0 in part"), "{shown}");
    assert_eq!([0, 1, 2].map(|trial| study.ticks_of(trial)), ["in part", "yes", "no"]);
}

/// Regression: neither the operator nor the rule of approval nor the proposed value of an override stood in a report.
#[test]
fn a_report_names_the_operators_and_the_values_that_they_have_set() {
    let folder = tempfile::tempdir().unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let files =
        [("Anna", Approval::Each), ("Berta", Approval::FallsOnly), ("", Approval::Each)].map(|(operator, approve)| {
            let path = folder.path().join(format!("session{operator}.mcap"));
            let info = SessionInfo { operator: operator.into(), approve, ..SessionInfo::default() };
            let mut writer = Writer::create(&path, &info, 0, &[]).unwrap();
            let fx = ProposedParameter { name: "Fx".into(), value: 100.0, proposed: 41.25 };
            // Another trial has run with another value than that of its proposal.
            let other = ProposedParameter { name: "Fz".into(), value: 190.0, proposed: 180.0 };
            for (trial, p) in [(1, fx), (3, other)] {
                let record = Record::Proposal(Proposal { trial, parameters: vec![p], ..Proposal::default() });
                writer.record(&Stamped { time_ns: 1_000_000, record }).unwrap();
            }
            writer.finish().unwrap();
            path
        });
    let mut study = study(0, rows());
    study.recordings = Recordings::read(&files, &BTreeMap::new(), &robot);
    let page = study_page::page(std::slice::from_ref(&study), &[], "0.1.0 (test)");
    let shown = text::render(&page, 200);
    assert!(
        shown.contains("study (operator Anna, --approve each; operator Berta, --approve falls-only); quadfrog 0.1.0"),
        "{shown}"
    );
    let (_, table) = shown.split_once("Values that an operator has set in place of the proposed ones.").unwrap();
    let rows: Vec<&str> = table.lines().skip(3).take_while(|line| !line.is_empty()).collect();
    assert_eq!(rows.len(), 1, "{shown}");
    assert!(rows[0].contains("Fx (N)") && rows[0].contains("41.250") && rows[0].ends_with("100.000"), "{}", rows[0]);
    study.recordings = Recordings::default();
    let shown = text::render(&study_page::page(&[study], &[], "0.1.0 (test)"), 200);
    assert!(shown.contains("study; quadfrog") && !shown.contains("Values that an operator"), "{shown}");
}

/// Regression: parameters below 0.001 were 0.000, and a study without robot or unit had a comma or a space at its end.
#[test]
fn a_study_of_another_program_is_shown_with_its_digits_and_without_empty_parts() {
    let parameter = |name: &str, low, high| ParameterInfo { name: name.into(), unit: String::new(), low, high };
    let ran = TrialRecord { parameters: vec![("lr".into(), 2.5e-5), ("x".into(), 0.5)].into(), ..rows().remove(4) };
    let other = ReportedStudy {
        name: "min".into(),
        task: None,
        seed: None,
        robot: String::new(),
        parameters: vec![parameter("lr", 1e-6, 0.1), parameter("x", 0.0, 1.0)],
        best: Some(4),
        ..study(0, vec![ran])
    };
    let shown = text::render(&study_page::page(&[other], &[], "0.1.0 (test)"), 200);
    assert!(shown.contains("0.00002500") && shown.contains("0.500"), "{shown}");
    assert!(shown.contains("searched last over lr 0.000001 to 0.1, x 0 to 1.\n"), "{shown}");
    assert!(!shown.contains("min,"), "{shown}");
}

/// Regression: a line break in the name of a parameter of another program broke the line of the best trial.
#[test]
fn the_best_trial_is_one_line_whatever_its_parameters_are_called() {
    let best = TrialRecord { parameters: vec![("two\nlines".into(), 0.5)].into(), ..rows().remove(4) };
    let line = table::best_line(Some(&best), None, &Vec::new().into(), "m", &HashMap::new());
    assert!(line.starts_with("Best: trial 4  two lines 0.5 ") && line.lines().count() == 1, "{line}");
}
