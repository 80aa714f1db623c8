//! A limit that a jump trips is the outcome of its parameters; void is for causes outside of them.

#[path = "support/go1.rs"]
mod go1;
#[path = "support/experiment.rs"]
mod support;

use go1::Lockstep;
use quadfrog::config::Config;
use quadfrog::engine::{Options, open_experiment};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::rollout::Rollout;
use quadfrog::session::{automatic, objective};
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{Fault, TrialEnd, TrialSpec};
use quadfrog::trial::{Backend, JumpParameters, Task, TrialRecord, Verdict};
use support::{accept, approve, experiment, open, parameters, run, ticks};

const TOO_FAST: TrialEnd =
    TrialEnd::Fault(Fault::JointVelocity { joint: 2, measured_rad_s: 70.0, allowed_rad_s: 60.0 });

/// The limits of the motion are falls, learnt by the sampler; all other faults are void.
#[test]
fn limits_of_the_motion_are_falls_and_other_faults_are_void() {
    let (joint, measured_rad, allowed_rad) = (1, 3.0, 2.0);
    let limits = [
        Fault::JointPosition { joint, measured_rad, allowed_rad },
        Fault::JointVelocity { joint, measured_rad_s: 70.0, allowed_rad_s: 60.0 },
        Fault::JointTorque { joint, measured_nm: 50.0, allowed_nm: 40.0 },
        Fault::Tilt { measured_rad, allowed_rad },
    ];
    for fault in limits {
        let (verdict, cause) = objective::suggest(&TrialEnd::Fault(fault));
        assert_eq!((verdict, cause), (Verdict::Fall, format!("limit: {fault}")));
    }
    let others = [
        Fault::StateAge { age_ms: 30, allowed_ms: 20 },
        Fault::LinkLost { age_ms: 300, allowed_ms: 200 },
        Fault::OperatorLost { silent_ms: 1200 },
        Fault::OperatorLeft,
        Fault::MotorTemperature { joint, measured_c: 81.0, allowed_c: 80.0 },
        Fault::MotorMode { joint },
        Fault::Late { measured_ms: 11.0, allowed_ms: 10.0 },
        Fault::Reboot,
    ];
    for fault in others {
        assert_eq!(objective::suggest(&TrialEnd::Fault(fault)), (Verdict::Void, fault.to_string()));
    }
}

/// Regression: the trial was void, so the sampler did not learn from it.
#[test]
fn a_tripped_limit_counts_with_the_value_0() {
    let mut experiment = experiment(5);
    let spec = run(&mut experiment, TOO_FAST);
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!((row.suggested, row.value), (Some(Verdict::Fall), Some(0.0)), "{row:?}");
    experiment.judge(Verdict::Fall, false).unwrap();
    assert_eq!(experiment.counted(), 1);
}

/// Before the jump its parameters have done nothing.
#[test]
fn a_limit_before_the_jump_is_void() {
    let mut experiment = experiment(5);
    let spec = approve(&mut experiment);
    let mut countdown = ticks(spec.trial, 0.0);
    countdown.iter_mut().for_each(|tick| tick.trial_time_s = -0.5);
    experiment.ended(spec.trial, &TOO_FAST, &countdown, 2);
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!(row.suggested, Some(Verdict::Void));
    assert!(row.cause.starts_with("before the jump: limit: "), "{}", row.cause);
    experiment.judge(Verdict::Void, false).unwrap();
}

/// A fall needs no measurement: lost ticks do not hide it from the sampler.
#[test]
fn a_limit_with_lost_ticks_is_still_a_fall() {
    let mut experiment = experiment(5);
    let spec = approve(&mut experiment);
    experiment.ended(spec.trial, &TOO_FAST, &[], 900);
    assert_eq!(experiment.row(spec.trial).unwrap().suggested, Some(Verdict::Fall));
}

#[test]
fn voiding_a_tripped_limit_needs_a_reason_that_is_kept() {
    for rerun in [false, true] {
        let mut experiment = experiment(5);
        let spec = run(&mut experiment, TOO_FAST);
        let before = experiment.under_review().cloned();
        for reason in ["", "  "] {
            let refusal = experiment.void_because(reason, rerun).unwrap_err().to_string();
            assert!(refusal.contains("70.0 rad/s exceeds 60.0 rad/s") && refusal.contains("reason"), "{refusal}");
        }
        assert!(experiment.judge(Verdict::Void, rerun).is_err());
        assert_eq!(experiment.under_review().cloned(), before, "a refusal changes nothing");
        experiment.void_because("the tether held it", rerun).unwrap();
        let row = experiment.row(spec.trial).unwrap();
        assert_eq!((row.verdict, row.value), (Some(Verdict::Void), None));
        assert!(
            row.cause.starts_with("by the operator: the tether held it; looked like fall: limit: "),
            "{}",
            row.cause
        );
        experiment.undo().unwrap();
        assert!(experiment.judge(Verdict::Void, false).is_err(), "a reason is asked for again");
    }
}

/// A session that ends before the verdict does not queue the same jump again.
#[test]
fn a_tripped_limit_without_a_verdict_is_a_fall_at_the_end_of_the_session() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = open(folder.path());
    accept(&mut session);
    let spec = run(&mut session, TOO_FAST);
    session.close_unreviewed().unwrap();
    session.close().unwrap();
    drop(session);
    let again = open(folder.path());
    let row = again.row(spec.trial).unwrap();
    assert_eq!((row.verdict, row.value), (Some(Verdict::Fall), Some(0.0)), "{row:?}");
    assert_eq!(again.proposal().unwrap().parent, None, "nothing is repeated");
    assert_ne!(parameters(&again), row.parameters.iter().map(|(_, value)| *value).collect::<Vec<_>>());
}

/// A jump beyond the motors, over the link of an emulated Go1.
#[test]
fn a_limit_that_an_emulated_robot_trips_is_a_fall() {
    let config = Config::load(None).unwrap();
    let settings = config.settings(&go1::description(), Task::Forward, Backend::Simulator).unwrap();
    let mut rollout = Rollout::new(Lockstep::new(&config.simulator, 0), &settings);
    let jump = JumpParameters { f0_hz: 0.8, f1_hz: 0.0, fx_n: 400.0, fy_n: 0.0, fz_n: 700.0 };
    let (end, ticks) = rollout.run(&TrialSpec { trial: 3, ..config.task(Task::Forward).trial(Task::Forward, jump) });
    assert!(objective::trips_limit(&end), "{end:?} after {} ticks", ticks.len());
    let (verdict, cause) = objective::suggest(&end);
    assert_eq!(verdict, Verdict::Fall);
    assert!(cause.starts_with("limit: ") && cause.contains("exceeds"), "{cause}");
}

/// Regression: with these bounds the Gaussian process proposed `f0 0.800 Fx 400 Fz 700` ten times in a row, each time void
/// by the velocity of a joint, and the study ended.
#[test]
fn the_gaussian_process_leaves_a_corner_that_trips_a_limit() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("safety.toml", "[parameters]\nf0 = [0.5, 5.0]\nFx = [0.0, 400.0]\nFz = [0.0, 700.0]\n");
    write("optimize.toml", "[bounds]\nf0 = [0.8, 5.0]\nFx = [0.0, 400.0]\nFz = [150.0, 700.0]\n");
    let mut config = Config::load(Some(folder.path())).unwrap();
    config.choose_sampler(SamplerKind::Gp);
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap();
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator).unwrap(), &settings);
    let options = Options { trials: Some(12), ..Options::new(config, robot, Backend::Simulator, Task::Forward) };
    let mut experiment = open_experiment(&options, Durability::Buffered, "").unwrap();
    let mut rows: Vec<TrialRecord> = Vec::new();
    automatic::run(&mut experiment, &mut rollout, |row, _| {
        println!("{:3} {:?} {:?} {:?} {}", row.trial, row.parameters, row.verdict, row.value, row.cause);
        rows.push(row.clone());
    })
    .unwrap();
    assert_eq!(experiment.counted(), 12);
    let limits = rows.iter().filter(|row| row.cause.starts_with("limit: ")).count();
    assert!(limits > 0 && rows.iter().all(|row| row.verdict != Some(Verdict::Void)), "{limits} limits");
    let apart = |a: &TrialRecord, b: &TrialRecord| {
        let ranges = [4.2, 400.0, 550.0];
        let shares =
            a.parameters.iter().zip(&*b.parameters).zip(ranges).map(|((a, b), range)| (a.1 - b.1).abs() / range);
        shares.fold(0.0, f64::max)
    };
    for pair in rows.windows(2).filter(|pair| pair[0].verdict == Some(Verdict::Fall)) {
        assert!(apart(&pair[0], &pair[1]) > 1e-3, "{:?} follows a fall there", pair[1].parameters);
    }
}
