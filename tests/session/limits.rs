//! A limit that a jump trips is the outcome of its parameters; void is for causes outside of them.

use crate::go1;
use crate::support;
use go1::Lockstep;
use quadfrog::config::Config;
use quadfrog::control::limit_key::limit_key;
use quadfrog::control::settings::ControlSettings;
use quadfrog::engine::{Options, STUDY_FILE, open_experiment, open_stored};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::optimize::study::Storage;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Placement, Robot, RobotError, RobotState};
use quadfrog::session::automatic::{self, JudgedTrial};
use quadfrog::session::objective;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::{CommanderSign, FallCause, Fault, SensorCheck, TrialEnd, TrialInhibit, TrialSpec};
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
        Fault::JointTorque { joint, measured_n_m: 50.0, allowed_n_m: 40.0 },
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
        let by = if rerun { "re-run by the operator" } else { "by the operator" };
        assert_eq!((row.verdict, row.value), (Some(Verdict::Void), None));
        assert!(
            row.cause.starts_with(&format!("{by}: the tether held it; looked like fall: limit: ")),
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

/// Regression: the row had the verdict although the journal could not be written.
#[test]
fn a_verdict_that_the_end_of_the_session_cannot_write_is_in_no_row() {
    for end in [TOO_FAST, TrialEnd::Stopped] {
        let folder = tempfile::tempdir().unwrap();
        let mut session = open(folder.path());
        let spec = run(&mut session, end);
        let before = session.row(spec.trial).cloned();
        let journal = folder.path().join("study.log");
        std::fs::rename(&journal, folder.path().join("elsewhere")).unwrap();
        std::fs::create_dir(&journal).unwrap();
        session.close_unreviewed().unwrap_err();
        assert_eq!(session.row(spec.trial).cloned(), before);
        assert_eq!(session.under_review().cloned(), before, "it waits for its verdict");
    }
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

fn settings(config: &Config, backend: Backend) -> ControlSettings {
    config.settings(&RobotDescription::embedded("go1").unwrap(), Task::Forward, backend).unwrap()
}

/// An end of a trial by each limit.
fn ends(settings: &ControlSettings) -> Vec<TrialEnd> {
    let (joint, measured_rad, allowed_rad) = (1, 3.0, 2.0);
    let (measured, allowed, measured_ms, allowed_ms) = (2.0, 1.0, 2.0, 1.0);
    let [stance_rad, flight_rad] = [settings.failsafe.stance_tilt_rad, settings.flight_tilt_rad];
    let mut faults = vec![
        Fault::JointPosition { joint, measured_rad, allowed_rad },
        Fault::JointVelocity { joint, measured_rad_s: 70.0, allowed_rad_s: 60.0 },
        Fault::JointTorque { joint, measured_n_m: 50.0, allowed_n_m: 40.0 },
        Fault::StateAge { age_ms: 30, allowed_ms: 20 },
        Fault::LinkLost { age_ms: 300, allowed_ms: 200 },
        Fault::Corrupt { count: 11, allowed: 10 },
        Fault::MotorTemperature { joint, measured_c: 81.0, allowed_c: 80.0 },
        Fault::Tilt { measured_rad, allowed_rad: stance_rad },
        Fault::Tilt { measured_rad, allowed_rad: settings.failsafe.tilt_rad },
        Fault::Late { measured_ms, allowed_ms },
        Fault::Slow { ticks: 5, measured_ms, allowed_ms },
        Fault::PoseTimeout { error_rad: 0.3 },
        Fault::OperatorLost { silent_ms: 1200 },
        Fault::Acceleration { measured_m_s2: 500.0, allowed_m_s2: 320.0, states: 6 },
        Fault::RobotClock { measured_ms, allowed_ms },
        Fault::OtherCommander { sign: CommanderSign::LostStates, measured, allowed },
        Fault::OtherCommander { sign: CommanderSign::ForeignTorque, measured, allowed },
        Fault::Suspended { suspended_ms: 60, allowed_ms: 50 },
        Fault::GuardSilent { silent_ms: 80, allowed_ms: 70 },
        Fault::RemoteSilent { silent_ms: 3001, allowed_ms: 3000 },
        Fault::LinkDelay { measured_ms, allowed_ms },
        Fault::FollowingError { joint, measured_rad, allowed_rad },
        Fault::RampTorque { joint, measured_n_m: 50.0, allowed_n_m: 40.0 },
    ];
    faults.extend(SensorCheck::ALL.iter().map(|&check| Fault::Sensors { check, measured, allowed }));
    let inhibits = [
        TrialInhibit::BatteryLow { measured_percent: 10.0, allowed_percent: 15.0 },
        TrialInhibit::MotorWarm { joint, measured_c: 71.0, allowed_c: 70.0 },
        TrialInhibit::MotorUnmeasured { joint, measured_c: 0.0, allowed_c: 1.0 },
        TrialInhibit::FootForces { measured_n: 10.0, least_n: 60.0, most_n: 180.0 },
        TrialInhibit::FootForces { measured_n: 190.0, least_n: 60.0, most_n: 180.0 },
        TrialInhibit::NotLevel { measured_rad, allowed_rad },
        TrialInhibit::NotAtStance { joint, measured_rad, allowed_rad },
        TrialInhibit::NotQuiet { measured_s: 0.1, needed_s: 0.3 },
        TrialInhibit::StatesOld { age_ms: 12, allowed_ms: 10 },
        TrialInhibit::StatesLost { measured_share: 0.02, allowed_share: 0.01 },
        TrialInhibit::TicksLate { measured_share: 0.02, allowed_share: 0.01 },
        TrialInhibit::LinkDelay { measured_ms, allowed_ms },
    ];
    let falls = [
        FallCause::BodyContact,
        FallCause::Roll { measured_rad, allowed_rad: settings.fall.roll_rad },
        FallCause::Pitch { measured_rad, allowed_rad: settings.fall.pitch_rad },
        FallCause::Roll { measured_rad, allowed_rad: flight_rad },
    ];
    let faults = faults.into_iter().map(TrialEnd::Fault);
    let others = inhibits.into_iter().map(TrialEnd::NotReady).chain(falls.into_iter().map(TrialEnd::Fell));
    faults.chain(others).chain([TrialEnd::NotQuiet]).collect()
}

/// The key exists in the shipped file with the value that the message names, and its change changes the limit in force.
#[test]
fn the_key_of_a_limit_is_a_key_of_its_file_and_changes_the_limit() {
    let shipped = Config::load(None).unwrap();
    let mut keys = std::collections::BTreeSet::new();
    for backend in [Backend::Simulator, Backend::Hardware] {
        let before = settings(&shipped, backend);
        for end in ends(&before) {
            let found = limit_key(&end, &before).unwrap_or_else(|| panic!("{end:?} has a limit"));
            let text = match found.file {
                "safety.toml" => include_str!("../../config/safety.toml"),
                "control.toml" => include_str!("../../config/control.toml"),
                file => panic!("{end:?}: {file}"),
            };
            let table: toml::Table = text.parse().unwrap();
            let (section, name) = found.key.split_once('.').unwrap();
            let value = table[section].get(name).unwrap_or_else(|| panic!("{end:?}: there is no {}", found.key));
            let number = value.as_float().or(value.as_integer().map(|number| number as f64)).unwrap();
            assert_eq!(number, found.value, "{end:?}: {}", found.key);
            assert_eq!(found.to_string(), format!("{} = {number} in {}", found.key, found.file));
            keys.insert(found.key);

            // Another value, within its range: smaller, or larger where a rule between two keys forbids that.
            let changed = [0.95, 1.05].into_iter().find_map(|factor| {
                let other = if value.is_integer() { (number * factor).round() } else { number * factor };
                let other = if value.is_integer() { format!("{other:.0}") } else { format!("{other:?}") };
                let folder = tempfile::tempdir().unwrap();
                std::fs::write(folder.path().join(found.file), format!("[{section}]\n{name} = {other}\n")).unwrap();
                let config = Config::load(Some(folder.path())).ok()?;
                let robot = RobotDescription::embedded("go1").unwrap();
                let after = config.settings(&robot, Task::Forward, backend).ok()?;
                (after != before).then_some((other.parse::<f64>().unwrap(), after))
            });
            // Zero stays zero: late ticks of the simulator are only counted.
            let Some((other, after)) = changed else {
                assert!(number == 0.0 || number < 11.0 && value.is_integer(), "{} changes nothing", found.key);
                continue;
            };
            let end =
                ends(&after).into_iter().find(|end| limit_key(end, &after).is_some_and(|key| key.key == found.key));
            assert_eq!(limit_key(&end.unwrap(), &after).unwrap().value, other, "{}", found.key);
        }
    }
    assert!(keys.len() > 35, "{} keys: {keys:?}", keys.len());
}

#[test]
fn an_end_without_a_limit_has_no_key() {
    let settings = settings(&Config::load(None).unwrap(), Backend::Simulator);
    let faults =
        [Fault::Reboot, Fault::RemoteStop, Fault::EventsLost, Fault::OperatorLeft, Fault::MotorMode { joint: 0 }];
    let ends =
        faults.map(TrialEnd::Fault).into_iter().chain([TrialEnd::Settled, TrialEnd::Stopped, TrialEnd::Cancelled]);
    for end in ends {
        assert_eq!(limit_key(&end, &settings), None, "{end:?}");
    }
}

/// A simulated robot with warm motors.
struct WarmRobot(Simulator);

impl Robot for WarmRobot {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        Ok(RobotState { motor_temperature_c: [75.0; 12], ..self.0.read()? })
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.0.write(command)
    }
    fn place(&mut self, placement: &Placement) -> bool {
        self.0.place(placement)
    }
}

#[test]
fn ten_void_trials_in_a_row_end_with_the_cause_the_limit_and_its_key() {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let simulator = Simulator::new(&robot, &config.simulator).unwrap();
    let mut rollout = Rollout::new(WarmRobot(simulator), &settings(&config, Backend::Simulator));
    let options = Options { trials: Some(30), ..Options::new(config, robot, Backend::Simulator, Task::Forward) };
    let mut experiment = open_experiment(&options, Durability::Buffered, "").unwrap();
    let mut trials = 0;
    let message = automatic::run(&mut experiment, &mut rollout, |_, _| trials += 1).unwrap_err().to_string();
    assert_eq!(trials, 10);
    for part in ["10 trials in a row were void", "FR_hip at 75 degrees", "watchdog.motor_warm_c = 70 in safety.toml"] {
        assert!(message.contains(part), "{part} is not in: {message}");
    }
}

#[test]
fn ten_falls_in_a_row_by_the_same_limit_warn_with_its_key_and_the_study_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("safety.toml"), "[fall]\npitch_rad = 0.05\n").unwrap();
    let config = Config::load(Some(folder.path())).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let simulator = Simulator::new(&robot, &config.simulator).unwrap();
    let mut rollout = Rollout::new(simulator, &settings(&config, Backend::Simulator));
    let options = Options { trials: Some(21), ..Options::new(config, robot, Backend::Simulator, Task::Forward) };
    let mut experiment = open_experiment(&options, Durability::Buffered, "").unwrap();
    let mut warnings = Vec::new();
    let each = |trial: JudgedTrial| {
        assert_eq!(trial.row.verdict, Some(Verdict::Fall), "{}", trial.row.cause);
        warnings.extend(trial.warning.map(|warning| (trial.row.trial, warning.to_owned())));
    };
    automatic::run_watched(&mut experiment, &mut rollout, each, || false).unwrap();
    assert_eq!(experiment.counted(), 21);
    assert_eq!(warnings.iter().map(|(trial, _)| *trial).collect::<Vec<_>>(), [9, 19]);
    for part in ["10 trials in a row", "pitch", "fall.pitch_rad = 0.05 in safety.toml"] {
        assert!(warnings[0].1.contains(part), "{part} is not in: {}", warnings[0].1);
    }
}

/// The friction that a trial's seed draws is an attribute of the trial, as its seed is.
#[test]
fn the_study_keeps_the_friction_of_each_trial() {
    let kept = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("simulator.toml"), text).unwrap();
        let config = Config::load(Some(folder.path())).unwrap();
        let terrain = config.simulator.terrain;
        let robot = RobotDescription::embedded("go1").unwrap();
        let options = Options {
            trials: Some(3),
            folder: Some(folder.path().to_owned()),
            ..Options::new(config.clone(), robot.clone(), Backend::Simulator, Task::Forward)
        };
        let simulator = Simulator::new(&robot, &config.simulator).unwrap();
        let mut rollout = Rollout::new(simulator, &settings(&config, Backend::Simulator));
        let mut experiment = open_experiment(&options, Durability::Buffered, "").unwrap();
        automatic::run(&mut experiment, &mut rollout, |_, _| {}).unwrap();
        let storage = Storage::File(folder.path().join(STUDY_FILE));
        let opened = open_stored(&storage, None, &config).unwrap();
        let trials = opened.study.trials().iter().map(|trial| {
            let seed: u64 = trial.user_attributes["seed"].as_str().unwrap().parse().unwrap();
            (terrain.friction_of(seed), trial.user_attributes.get("friction").and_then(serde_json::Value::as_f64))
        });
        trials.collect::<Vec<_>>()
    };
    let drawn = kept("[terrain]\nfriction_range = [0.4, 0.9]\n");
    assert_eq!(drawn.len(), 3);
    assert!(drawn.iter().all(|(of_seed, attribute)| Some(*of_seed) == *attribute), "{drawn:?}");
    assert!(kept("").iter().all(|(_, attribute)| attribute.is_none()));
}
