//! The ranges of `safety.toml`, `[gains]`, on the simulator, and gains as parameters of a study.

use crate::support;
use quadfrog::config::Config;
use quadfrog::control::settings::TaskControl;
use quadfrog::optimize::space::{Range, Space};
use quadfrog::optimize::study::{Storage, Study, StudyOptions};
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::experiment::Experiment;
use quadfrog::session::objective;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{Backend, Gains, JumpParameters, ObjectiveRule, ParameterInfo, Task};

/// Whatever an operator may set, the robot stands until the impulse begins: no trial of allowed gains is lost before it
/// has jumped.
#[test]
fn the_robot_stands_in_every_corner_of_the_gains() {
    let config = Config::load(None).unwrap();
    let robot = RobotDescription::embedded("go1").unwrap();
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator).unwrap();
    let mut rollout = Rollout::new(Simulator::new(&robot, &config.simulator).unwrap(), &settings);
    let task: &TaskControl = config.task(Task::Forward);
    let ranges = config.gains();
    assert_eq!(ranges.iter().map(|gain| gain.name.as_str()).collect::<Vec<_>>(), ["kp", "kd", "kd_joint", "k_att"]);
    for corner in 0..1 << ranges.len() {
        let pick = |i: usize| if corner >> i & 1 == 0 { ranges[i].low } else { ranges[i].high };
        let gains = Gains { kp: pick(0), kd: pick(1), kd_joint: pick(2), k_att: pick(3) };
        let jump = JumpParameters { f0_hz: 1.3, f1_hz: 0.0, fx_n: 60.0, fy_n: 0.0, fz_n: 230.0 };
        let spec = TrialSpec { trial: corner, gains, ..task.trial(Task::Forward, jump) };
        let (end, ticks) = rollout.run(&spec);
        let start = ticks.iter().find(|tick| tick.trial_time_s >= 0.0);
        let height = start.unwrap_or_else(|| panic!("{gains:?}: {end:?} before the jump")).estimate.position_world.z;
        println!(
            "{gains:?}: height {height:.3} m, {end:?}, {:.3?} m",
            objective::measure(&ObjectiveRule::single(Task::Forward), ticks).map(|m| m.dx_m)
        );
        assert!(height > 0.14, "{gains:?}: it sags to {height:.3} m");
    }
}

/// A gain that is a parameter is set, queued and repeated as one; the trial runs with the value of its point.
#[test]
fn a_gain_that_is_a_parameter_has_the_value_of_the_point() {
    let mut plan = support::plan(9);
    plan.parameters.push(ParameterInfo { name: "kp".into(), unit: "N/m".into(), low: 300.0, high: 800.0 });
    plan.widest.push(ParameterInfo { name: "kp".into(), unit: "N/m".into(), low: 300.0, high: 800.0 });
    let base = support::study(Storage::Memory);
    let ranges = plan.parameters.iter().map(|p| (p.name.clone(), Range::linear(p.low, p.high)));
    let options = StudyOptions { space: Space::new(ranges).unwrap(), ..base.options().clone() };
    let mut experiment = Experiment::open(plan, Study::open(Storage::Memory, options).unwrap()).unwrap();

    let drawn = |experiment: &Experiment| experiment.proposal().unwrap().parameters[3].value;
    let value = drawn(&experiment);
    let gain = experiment.proposal().unwrap().gains[0].clone();
    assert_eq!((gain.name.as_str(), gain.value, gain.proposed), ("kp", value, value));
    let refusal = experiment.set_gain("kp", 500.0).unwrap_err().to_string();
    assert!(refusal.contains("kp is a parameter of this study"), "{refusal}");
    let refusal = experiment.set_parameter("kp", 801.0).unwrap_err().to_string();
    assert!(refusal.contains("kp = 801 N/m is outside its bounds 300 to 800"), "{refusal}");
    let spec = support::accept(&mut experiment);
    assert_eq!((spec.gains.kp, spec.gains.kd), (value, 8.0));

    experiment.set_parameter("kp", 512.0).unwrap();
    experiment.set_gain("kd", 9.0).unwrap();
    let spec = support::accept(&mut experiment);
    assert_eq!((spec.gains.kp, spec.gains.kd), (512.0, 9.0));
    let row = experiment.row(spec.trial).unwrap();
    assert_eq!((row.gains.get("kp"), row.parameters.get("kp")), (Some(512.0), Some(512.0)));
    assert_eq!(row.note, "other gains: kd 9 (configured 8)");

    experiment.enqueue(&[("kp".into(), 444.0), ("kd".into(), 7.0)]).unwrap();
    assert_eq!(drawn(&experiment), 444.0);
    let spec = support::accept(&mut experiment);
    assert_eq!((spec.gains.kp, spec.gains.kd), (444.0, 7.0));
    experiment.repeat(1).unwrap();
    // Changed once more, the point decides, not the gains of the repeated trial.
    experiment.set_parameter("kp", 600.0).unwrap();
    let spec = support::accept(&mut experiment);
    assert_eq!((spec.gains.kp, spec.gains.kd), (600.0, 9.0));
}
