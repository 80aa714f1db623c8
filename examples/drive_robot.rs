//! Drives the simulated Go1 joint by joint, without the controller: from lying to standing in 1.5 s, then a nod in 2 s.
//! Prints height and pitch of the trunk every 0.25 s.
//!
//! `cargo run --release --example drive_robot`

use quadfrog::config::Config;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{CONTROL_PERIOD_S, Joints, Leg, Placement, Robot as _, ticks_in};
use quadfrog::sim::Simulator;
use quadfrog::{robot::JointCommand, trial::Backend, trial::Task};

/// Stiffness of every joint, N m/rad.
const KP_JOINT: f64 = 60.0;
/// Damping of every joint, N m s/rad.
const KD_JOINT: f64 = 2.0;
/// Time of standing up, s.
const STAND_UP_S: f64 = 1.5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let config = Config::load(None)?;
    let robot = RobotDescription::embedded("go1")?;
    // Leg geometry, lying pose and stance are those of the controller.
    let settings = config.settings(&robot, Task::Forward, Backend::Simulator)?;
    let lying = settings.lying_position;
    let stance = settings.geometry.stance(&config.task(Task::Forward).stance_leg(), &lying);

    let mut simulator = Simulator::new(&robot, &config.simulator)?;
    simulator.place(&Placement { joint_position: lying, lying: true, seed: 0 });
    for tick in 0..ticks_in(4.0) {
        let time_s = f64::from(tick) * CONTROL_PERIOD_S;
        let state = simulator.read()?;
        if tick % ticks_in(0.25) == 0 {
            let height_m = state.truth.map_or(0.0, |truth| truth.position_world.z);
            let (_, pitch_rad, _) = state.imu.world_from_body.euler_angles();
            println!("{time_s:.2} s: height {height_m:.3} m, pitch {pitch_rad:+.3} rad");
        }
        let target = nod(&between(&lying, &stance, time_s / STAND_UP_S), time_s - STAND_UP_S);
        // One command is one control period of 1 ms.
        simulator.write(&JointCommand::hold(&target, KP_JOINT, KD_JOINT))?;
    }
    Ok(())
}

/// Returns the joint angles at `share` (0..1) of the way, rad.
fn between(from: &Joints, to: &Joints, share: f64) -> Joints {
    std::array::from_fn(|joint| from[joint] + share.clamp(0.0, 1.0) * (to[joint] - from[joint]))
}

/// Bends the front legs and stretches the rear ones, then the reverse, in 2 s from `time_s` = 0 on.
fn nod(stance: &Joints, time_s: f64) -> Joints {
    let mut target = *stance;
    let bend_rad = 0.1 * (std::f64::consts::PI * time_s.max(0.0)).sin();
    for leg in Leg::ALL {
        let thigh = 3 * leg as usize + 1;
        target[thigh] += leg.front_sign() * bend_rad;
        // The knee bends twice as far, so that the foot stays under the hip.
        target[thigh + 1] -= 2.0 * leg.front_sign() * bend_rad;
    }
    target
}
