//! The ranges of `safety.toml`, `[gains]`, on the simulator.

use quadfrog::config::Config;
use quadfrog::control::settings::TaskControl;
use quadfrog::robot::description::RobotDescription;
use quadfrog::session::objective;
use quadfrog::session::rollout::Rollout;
use quadfrog::sim::Simulator;
use quadfrog::telemetry::TrialSpec;
use quadfrog::trial::{Backend, Gains, JumpParameters, ObjectiveRule, Task};

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
