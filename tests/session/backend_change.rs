//! Hardware begins with weak jumps: a study of another backend is refused, and the largest forces grow with accepted trials.

use crate::support;
use std::path::Path;

use quadfrog::config::Config;
use quadfrog::engine::{EngineError, Options, check_backend, open_experiment, stored_study};
use quadfrog::optimize::ask::{SamplerConfig, SamplerKind};
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Storage, Study, StudyOptions};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::automatic;
use quadfrog::session::experiment::{Experiment, ExperimentPlan};
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::{SimConfig, Simulator};
use quadfrog::telemetry::TrialEnd;
use quadfrog::trial::{Backend, HopEnvelope, ParameterInfo, Task, Verdict};
use support::{BOUNDS, accept, plan, run, skip, study};

fn options(folder: &Path, backend: Backend) -> Options {
    let robot = RobotDescription::embedded("go1").unwrap();
    let options = Options::new(Config::load(None).unwrap(), robot, backend, Task::Forward);
    Options { folder: Some(folder.to_owned()), ..options }
}

fn open(options: &Options) -> Result<Experiment, EngineError> {
    open_experiment(options, Durability::Buffered, "")
}

/// Regression: twelve simulated trials were continued on the robot without a word, the first at 310 N.
#[test]
fn a_simulated_study_is_continued_on_hardware_by_the_flag_alone() {
    let folder = tempfile::tempdir().unwrap();
    accept(&mut open(&options(folder.path(), Backend::Simulator)).unwrap());
    let hardware = options(folder.path(), Backend::Hardware);
    for refusal in [check_backend(&hardware).unwrap_err(), open(&hardware).err().unwrap()] {
        let text = refusal.to_string();
        for part in ["forward-seed0", "made on sim (go1)", "runs on hardware (go1)", "--accept-backend-change"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    let accepted = Options { accept_backend_change: true, ..options(folder.path(), Backend::Hardware) };
    let experiment = open(&accepted).unwrap();
    assert_eq!(experiment.rows().count(), 1);
    for parameter in experiment.proposal().unwrap().parameters.iter().filter(|p| p.name.starts_with('F')) {
        let (_, low, high) = BOUNDS.into_iter().find(|(name, ..)| *name == parameter.name).unwrap();
        let most = low + 0.4 * (high - low);
        assert!(parameter.value <= most, "{} = {}: simulated trials do not widen it", parameter.name, parameter.value);
    }
    // Regression: bounds beyond it were taken, and the sampler proposed a value outside of them.
    let mut experiment = experiment;
    let refusal = experiment.narrow_bounds("Fz", 300.0, 350.0).unwrap_err().to_string();
    assert!(refusal.contains("Fz = 300 N is beyond the hop envelope, at present 230 N"), "{refusal}");
    experiment.narrow_bounds("Fz", 200.0, 350.0).unwrap();
    drop(experiment);
    open(&hardware).expect("accepted before");
    // And back: what the simulator adds is of another machine again.
    let simulated = options(folder.path(), Backend::Simulator);
    let refusal = open(&simulated).err().unwrap().to_string();
    assert!(refusal.contains("made on hardware (go1), this session runs on sim (go1)"), "{refusal}");
    open(&Options { accept_backend_change: true, ..simulated }).unwrap();
    assert!(matches!(open(&hardware), Err(EngineError::OtherBackend { .. })));
}

/// Regression: `quadfrog optimize --resume` accepted the jump of a robot that waited for its verdict, and so widened the hop envelope.
#[test]
fn a_jump_of_the_robot_waits_for_a_person_in_a_session_of_the_simulator() {
    let folder = tempfile::tempdir().unwrap();
    let mut measured = open(&options(folder.path(), Backend::Hardware)).unwrap();
    run(&mut measured, TrialEnd::Settled);
    assert_eq!(measured.verdict_without_person(), Some(Verdict::Accept), "on the robot itself");
    measured.keep_measurement().unwrap();
    drop(measured);
    let simulated = Options { accept_backend_change: true, ..options(folder.path(), Backend::Simulator) };
    let mut experiment = open(&simulated).unwrap();
    assert_eq!(experiment.under_review().map(|row| row.suggested), Some(Some(Verdict::Accept)));
    assert_eq!(experiment.verdict_without_person(), None);
    let settings = simulated.config.settings(&simulated.robot, Task::Forward, Backend::Simulator).unwrap();
    let simulator = Simulator::new(&simulated.robot, &SimConfig::default()).unwrap();
    let refusal = automatic::run(&mut experiment, &mut Rollout::new(simulator, &settings), |_, _| {}).unwrap_err();
    assert!(refusal.to_string().contains("trial 0 waits for the verdict of a person"), "{refusal}");
    assert!(experiment.under_review().is_some_and(|row| row.verdict.is_none()));
}

/// Regression: a trial without a measurement but with a value by hand was judged void without a person.
#[test]
fn a_value_by_hand_waits_for_a_person() {
    let mut experiment = support::experiment(9);
    run(&mut experiment, TrialEnd::Settled);
    assert_eq!(experiment.verdict_without_person(), Some(Verdict::Accept));
    experiment.set_hand_value(Some(0.25)).unwrap();
    assert_eq!(experiment.verdict_without_person(), None);
}

#[test]
fn a_study_of_an_earlier_version_counts_as_simulated_and_another_robot_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    drop(open(&options(folder.path(), Backend::Hardware)).unwrap());
    check_backend(&options(folder.path(), Backend::Hardware)).expect("its own study");
    let a1 = RobotDescription::embedded("a1").unwrap();
    let other = Options { robot: a1, ..options(folder.path(), Backend::Hardware) };
    let refusal = check_backend(&other).unwrap_err().to_string();
    assert!(refusal.contains("made on hardware (go1)") && refusal.contains("runs on hardware (a1)"), "{refusal}");
    let journal = folder.path().join("study.log");
    let lines = std::fs::read_to_string(&journal).unwrap();
    // The name of the hardware before there was a second robot.
    std::fs::write(&journal, lines.replace("\"hardware\"", "\"go1\"")).unwrap();
    assert_ne!(std::fs::read_to_string(&journal).unwrap(), lines);
    check_backend(&options(folder.path(), Backend::Hardware)).expect("its own study, by its earlier name");
    let earlier: String =
        lines.lines().filter(|line| !line.contains("\"backend\"")).map(|l| format!("{l}\n")).collect();
    assert_ne!(lines, earlier);
    std::fs::write(&journal, earlier).unwrap();
    let refusal = check_backend(&options(folder.path(), Backend::Hardware)).unwrap_err().to_string();
    assert!(refusal.contains("made on sim (go1)"), "{refusal}");
}

fn on_hardware(kind: SamplerKind) -> Experiment {
    let mut study = study(Storage::Memory);
    let sampler = SamplerConfig { kind, ..study.options().sampler.clone() };
    study = Study::open(Storage::Memory, StudyOptions { sampler, ..study.options().clone() }).unwrap();
    let envelope = Some(HopEnvelope { start: 0.4, step: 0.1 });
    Experiment::open(ExperimentPlan { backend: Backend::Hardware, envelope, ..plan(30) }, study).unwrap()
}

fn largest(accepted: u32, name: &str) -> f64 {
    let (_, low, high) = BOUNDS.into_iter().find(|(known, ..)| *known == name).unwrap();
    low + (0.4 + 0.1 * f64::from(accepted)).min(1.0) * (high - low)
}

#[test]
fn the_forces_of_every_sampler_grow_with_accepted_trials_only() {
    for &kind in SamplerKind::ALL {
        let mut experiment = on_hardware(kind);
        let mut accepted = 0;
        let mut reached: f64 = 0.0;
        for number in 0..24 {
            for p in experiment.proposal().unwrap().parameters {
                let within = !p.name.starts_with('F') || p.value <= largest(accepted, &p.name);
                assert!(within, "{kind:?}, {accepted} accepted: {} = {}", p.name, p.value);
                reached = reached.max(if p.name == "Fz" { p.value } else { 0.0 });
            }
            match number % 3 {
                0 => {
                    run(&mut experiment, TrialEnd::Settled);
                    experiment.judge(Verdict::Fall, false).unwrap();
                }
                1 => skip(&mut experiment),
                _ => {
                    accept(&mut experiment);
                    accepted += 1;
                }
            }
        }
        assert!(reached > largest(2, "Fz"), "{kind:?} uses the wider envelope: {reached}");
    }
}

/// Taking back an accepted verdict takes back its widening.
#[test]
fn values_beyond_the_envelope_are_refused_with_the_reason() {
    let mut experiment = on_hardware(SamplerKind::Random);
    let refusal = experiment.set_parameter("Fz", 300.0).unwrap_err().to_string();
    assert!(
        refusal.contains("Fz = 300 N is beyond the hop envelope, at present 230 N (40 % of the bounds)"),
        "{refusal}"
    );
    assert!(experiment.fix("Fz", 300.0, 3).is_err());
    assert!(experiment.enqueue(&[("Fx".into(), 100.0)]).is_err());
    experiment.set_parameter("Fz", 230.0).unwrap();
    experiment.set_parameter("f0", 1.75).unwrap();
    accept(&mut experiment);
    experiment.set_parameter("Fz", 250.0).unwrap();
    experiment.undo().unwrap();
    experiment.judge(Verdict::Fall, false).unwrap();
    assert!(experiment.set_parameter("Fz", 250.0).is_err());
}

/// The share acts on the magnitude of a force with both signs.
#[test]
fn the_envelope_holds_on_both_sides_of_a_second_direction() {
    for (bounds, allowed, beyond) in [
        ([-50.0, 100.0], [-20.0, 40.0], [-21.0, 41.0]),
        ([0.0, 100.0], [-40.0, 40.0], [-41.0, 41.0]),
        ([-50.0, -20.0], [-32.0, 32.0], [-33.0, 33.0]),
    ] {
        let mut plan = ExperimentPlan {
            backend: Backend::Hardware,
            envelope: Some(HopEnvelope { start: 0.4, step: 0.1 }),
            ..plan(30)
        };
        let [low, high] = bounds;
        plan.parameters.push(ParameterInfo { name: "Fy".into(), unit: "N".into(), low, high });
        plan.widest.push(ParameterInfo { name: "Fy".into(), unit: "N".into(), low: -200.0, high: 200.0 });
        let base = study(Storage::Memory);
        let ranges = plan.parameters.iter().map(|p| (p.name.clone(), Range::linear(p.low, p.high)));
        let options = StudyOptions { space: Space::new(ranges).unwrap(), ..base.options().clone() };
        let mut experiment = Experiment::open(plan, Study::open(Storage::Memory, options).unwrap()).unwrap();
        for _ in 0..8 {
            let point = experiment.proposal().unwrap().parameters;
            let fy = point.iter().find(|p| p.name == "Fy").unwrap().value;
            assert!((allowed[0]..=allowed[1]).contains(&fy), "{bounds:?}: drawn {fy}");
            skip(&mut experiment);
        }
        // Wider bounds of the operator change nothing.
        experiment.narrow_bounds("Fy", -200.0, 200.0).unwrap();
        for value in allowed {
            experiment.set_parameter("Fy", value).unwrap();
        }
        for value in beyond {
            let refusal = experiment.set_parameter("Fy", value).unwrap_err().to_string();
            assert!(refusal.contains("Fy") && refusal.contains("beyond the hop envelope"), "{bounds:?}: {refusal}");
            assert!(experiment.enqueue(&[("Fy".into(), value)]).is_err());
            assert!(experiment.fix("Fy", value, 2).is_err());
        }
    }
}

/// A point that another program has queued cannot run.
#[test]
fn a_queued_point_beyond_the_envelope_is_not_approved() {
    let mut study = study(Storage::Memory);
    study.enqueue(&[("Fz".into(), 320.0)], &[]).unwrap();
    let envelope = Some(HopEnvelope { start: 0.4, step: 0.1 });
    let plan = ExperimentPlan { backend: Backend::Hardware, envelope, ..plan(5) };
    let mut experiment = Experiment::open(plan, study).unwrap();
    let proposal = experiment.proposal().unwrap();
    let refusal = experiment.approve(proposal.trial, proposal.revision).unwrap_err().to_string();
    assert!(refusal.contains("beyond the hop envelope"), "{refusal}");
    experiment.set_parameter("Fz", 200.0).unwrap();
    let proposal = experiment.proposal().unwrap();
    experiment.approve(proposal.trial, proposal.revision).unwrap();
}

/// Regression: a re-run was held to the widest bounds of safety.toml only.
#[test]
fn a_rerun_is_held_to_the_present_bounds() {
    let mut experiment = support::experiment(9);
    experiment.set_parameter("Fz", 340.0).unwrap();
    let strong = accept(&mut experiment);
    experiment.narrow_bounds("Fz", 150.0, 250.0).unwrap();
    let refusal = experiment.repeat(strong.trial).unwrap_err().to_string();
    assert!(refusal.contains("Fz = 340 N is outside its bounds 150 to 250 N"), "{refusal}");
    experiment.narrow_bounds("Fz", 150.0, 350.0).unwrap();
    experiment.repeat(strong.trial).unwrap();
    experiment.narrow_bounds("Fz", 150.0, 250.0).unwrap();
    let proposal = experiment.proposal().unwrap();
    let refusal = experiment.approve(proposal.trial, proposal.revision).unwrap_err().to_string();
    assert!(refusal.contains("outside its bounds 150 to 250 N"), "{refusal}");
}

/// Regression: a study of lengths was continued with `rate = true`, and its sampler compared m with m/s.
#[test]
fn a_study_is_not_continued_with_another_unit_of_the_objective() {
    let unit_of = |folder: &Path, toml: &str| {
        let config = folder.join("config");
        std::fs::create_dir_all(&config).unwrap();
        std::fs::write(config.join("control.toml"), toml).unwrap();
        let config = Config::load(Some(&config)).unwrap();
        Options { config, accept_backend_change: true, ..options(folder, Backend::Simulator) }
    };
    let folder = tempfile::tempdir().unwrap();
    drop(open(&options(folder.path(), Backend::Simulator)).unwrap());
    let journal = folder.path().join("study.log");
    let before = std::fs::read_to_string(&journal).unwrap();
    let by_rate = unit_of(folder.path(), "[tasks.forward]\nrate = true\n");
    for refusal in [check_backend(&by_rate).unwrap_err(), open(&by_rate).err().unwrap()] {
        let text = refusal.to_string();
        for part in ["forward-seed0", "in m,", "in m/s", "[tasks.forward] of control.toml", "begin a new study"] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    assert_eq!(std::fs::read_to_string(&journal).unwrap(), before);
    // And the other way round.
    let folder = tempfile::tempdir().unwrap();
    drop(open(&unit_of(folder.path(), "[tasks.forward]\nrate = true\n")).unwrap());
    drop(open(&unit_of(folder.path(), "[tasks.forward]\nrate = true\n")).expect("its own study"));
    let refusal = open(&options(folder.path(), Backend::Simulator)).err().unwrap();
    assert!(matches!(refusal, EngineError::OtherUnit { asked: "m", .. }), "{refusal}");
}

/// Regression: a study that another program had renamed or deleted was begun anew in its journal.
#[test]
fn a_study_that_is_continued_is_there_by_its_present_name() {
    let folder = tempfile::tempdir().unwrap();
    accept(&mut open(&options(folder.path(), Backend::Simulator)).unwrap());
    let journal = folder.path().join("study.log");
    let renamed = std::fs::read_to_string(&journal).unwrap().replace("\"forward-seed0\"", "\"weekend\"");
    std::fs::write(&journal, &renamed).unwrap();
    let stored = stored_study(&journal).unwrap();
    assert_eq!(stored.name.as_deref(), Some("weekend"));
    let lost = Options { study: Some("forward-seed0".into()), ..options(folder.path(), Backend::Simulator) };
    for refusal in [check_backend(&lost).unwrap_err(), open(&lost).err().unwrap()] {
        assert!(refusal.to_string().contains("no such study in it; its studies: weekend"), "{refusal}");
    }
    assert_eq!(std::fs::read_to_string(&journal).unwrap(), renamed);
    let continued = Options { study: stored.name, ..options(folder.path(), Backend::Simulator) };
    assert_eq!(open(&continued).unwrap().rows().count(), 1);
}
