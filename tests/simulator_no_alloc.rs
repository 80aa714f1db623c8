//! No step allocates: a jump-like run on every terrain with all sensor and motor errors, under an allocator that aborts.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

#[path = "support/no_alloc.rs"]
mod no_alloc;

use no_alloc::without_allocation;
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::{JointCommand, Placement, Robot};
use quadfrog::sim::{ActuatorKind, SimConfig, Simulator, TerrainKind};

#[test]
fn a_step_does_not_allocate() {
    let robot = RobotDescription::embedded("go1").unwrap();
    for kind in [TerrainKind::Flat, TerrainKind::Slope, TerrainKind::Steps, TerrainKind::Blocks] {
        for actuator in [ActuatorKind::Ideal, ActuatorKind::HardwareLike] {
            let mut config = SimConfig::default();
            config.terrain.kind = kind;
            config.terrain.blocks.loose = true;
            config.terrain.blocks.count = 500;
            config.actuator.kind = actuator;
            config.sensors.enabled = true;
            config.sensors.delay_ms = 3;
            let mut simulator = Simulator::new(&robot, &config).unwrap();
            let joint_position = robot.lying_position;
            simulator.place(&Placement { joint_position, lying: true, seed: 5 });
            // Random motion, jumps and falls: every kind of step, with many contacts.
            println!("{kind:?}, {actuator:?}");
            without_allocation(|| {
                for tick in 0..3000 {
                    let t = f64::from(tick) * 0.001;
                    let command = JointCommand::torques(&std::array::from_fn(|i| 25.0 * (7.0 * t + i as f64).sin()));
                    simulator.write(&command).unwrap();
                    let state = simulator.read().unwrap();
                    assert!(state.joint_position_rad[0].is_finite());
                }
            });
        }
    }
}
