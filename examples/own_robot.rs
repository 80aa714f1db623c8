//! An implementation of [`Robot`] of one's own: a Go1 whose rear left knee gives a part of its torque. The controller, the
//! estimator, the failsafes and the measurement of a jump work with it unchanged. Prints the same jump with the whole torque
//! and with less.
//!
//! `cargo run --release --example own_robot`
//!
//! A robot with a protocol of its own implements the same methods over its link; see `docs/extend/robot.md`.

use quadfrog::config::Config;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Leg, LinkStatus, MotorCommand, Placement, Robot, RobotError, RobotState};
use quadfrog::session::{evaluation, rollout::Rollout};
use quadfrog::sim::Simulator;
use quadfrog::trial::{Backend, JumpParameters, Task};

/// The knee that is weak.
const KNEE: usize = 3 * Leg::RL as usize + 2;

/// A Go1 with a weak motor.
struct WeakKnee {
    simulator: Simulator,
    /// Share of the commanded torque that the motor gives, 0..1.
    share: f64,
}

impl Robot for WeakKnee {
    /// The state that arrived since the last call. A simulator always has one.
    fn read(&mut self) -> Result<RobotState, RobotError> {
        self.simulator.read()
    }

    /// Sends one command. The gains scale with the torque: tau = torque + kp (q_d - q) + kd (dq_d - dq).
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        let mut weak = *command;
        let MotorCommand { torque_n_m, kp_joint, kd_joint, .. } = &mut weak.motor[KNEE];
        for part in [torque_n_m, kp_joint, kd_joint] {
            *part *= self.share;
        }
        self.simulator.write(&weak)
    }

    /// Places the robot for a trial. A real robot returns false: a person places it.
    fn place(&mut self, placement: &Placement) -> bool {
        self.simulator.place(placement)
    }

    /// Statistics of the link, which failsafes watch. No link here.
    fn link(&self) -> Option<LinkStatus> {
        None
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = Config::load(None)?;
    let robot = RobotDescription::embedded("go1")?;
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator)?;
    let control = config.task(Task::Forward);
    let jump = JumpParameters { f0_hz: 1.25, f1_hz: control.f1_hz, fx_n: 75.0, fy_n: 0.0, fz_n: 250.0 };
    let trial = control.trial(Task::Forward, jump);

    for share in [1.0, 0.9, 0.7, 0.5, 0.3] {
        let simulator = Simulator::new(&robot, &config.simulator)?;
        let mut rollout = Rollout::new(WeakKnee { simulator, share }, &settings);
        let run = evaluation::evaluate(&mut rollout, &trial);
        let turn_rad = run.measured.as_ref().map_or(0.0, |measured| measured.dyaw_rad);
        println!(
            "{:3.0} % of the torque: {:.3} m, turned by {turn_rad:+.3} rad, {}",
            100.0 * share,
            run.value,
            run.cause
        );
    }
    Ok(())
}
