//! Robots with injected faults, for tests of control and session.
#![allow(dead_code, reason = "each test uses its own part")]

use nalgebra::{UnitQuaternion, Vector3};
use quadfrog::robot::description::RobotDescription;
use quadfrog::robot::remote::Remote;
use quadfrog::robot::{Battery, JOINTS, JointCommand, LinkStatus, Placement, Robot, RobotError, RobotState};
use quadfrog::sim::{SimConfig, Simulator};

/// Noise of an inertial unit, so small that it changes no result: without it a robot at rest repeats its measurements.
pub fn noise(state: &mut RobotState) {
    let sign = if state.robot_time_ms.is_multiple_of(2) { 1.0 } else { -1.0 };
    state.imu.gyro_body.z += sign * 1e-7;
    state.imu.accel_body.z += sign * 1e-7;
    state.imu.world_from_body *= UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sign * 1e-9);
}

/// A simulator behind the border of a hardware robot: it has a link and a battery, reports may be changed, reads and writes
/// may fail, and the program cannot place it.
pub struct LinkedRobot {
    pub simulator: Simulator,
    /// False for a plain simulator, without link and battery, which can be placed.
    pub linked: bool,
    /// Whether states contain the true state.
    pub with_truth: bool,
    pub charge_percent: f64,
    pub link: LinkStatus,
    /// Changes every reported state.
    pub tamper: fn(&mut RobotState),
    /// Age of the newest state, ms, counted by `read`; zero while states are available.
    pub silent_ms: u32,
    /// Error of every write.
    pub send_errno: Option<i32>,
    pub writes: u32,
    /// Commands, if they are kept.
    pub sent: Vec<JointCommand>,
    pub keeps_commands: bool,
}

impl LinkedRobot {
    /// A robot without faults that lies folded on the floor and does not report the true state.
    pub fn lying(description: &RobotDescription, config: &SimConfig) -> LinkedRobot {
        let mut simulator = Simulator::new(description, config).unwrap();
        simulator.place(&Placement { joint_position: description.lying_position, lying: true, seed: 0 });
        LinkedRobot {
            simulator,
            linked: true,
            with_truth: false,
            charge_percent: 80.0,
            link: LinkStatus { recent_received: 5000, ..LinkStatus::default() },
            tamper: |_| {},
            silent_ms: 0,
            send_errno: None,
            writes: 0,
            sent: Vec::new(),
            keeps_commands: false,
        }
    }
}

impl Robot for LinkedRobot {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        if self.silent_ms > 0 {
            self.silent_ms += 1;
            return Err(RobotError::NoNewState { age_ms: self.silent_ms });
        }
        let mut state = self.simulator.read()?;
        if self.linked {
            state.truth = state.truth.filter(|_| self.with_truth);
            state.motor_temperature_c = [35.0; JOINTS];
            let charge_percent = self.charge_percent;
            state.battery = Some(Battery { charge_percent, voltage_v: 24.0, current_a: -2.0, cell_v: [0.0; 10] });
            state.remote = Some(Remote::default());
            noise(&mut state);
        }
        (self.tamper)(&mut state);
        Ok(state)
    }
    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        self.writes += 1;
        if self.keeps_commands {
            self.sent.push(*command);
        }
        self.simulator.write(command)?;
        self.send_errno.map_or(Ok(()), |errno| Err(RobotError::Send { errno }))
    }
    fn place(&mut self, placement: &Placement) -> bool {
        !self.linked && self.simulator.place(placement)
    }
    fn link(&self) -> Option<LinkStatus> {
        self.linked.then_some(self.link)
    }
}

/// A robot that reports a given state, with the next time, and ignores commands.
pub struct ScriptedRobot {
    pub state: Result<RobotState, RobotError>,
    pub link: LinkStatus,
    /// Whether the inertial unit has noise.
    pub noisy: bool,
}

impl Robot for ScriptedRobot {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        if let Ok(state) = &mut self.state {
            state.robot_time_ms += 1;
            if self.noisy {
                noise(state);
            }
        }
        self.state
    }
    fn write(&mut self, _: &JointCommand) -> Result<(), RobotError> {
        Ok(())
    }
    fn place(&mut self, _: &Placement) -> bool {
        false
    }
    fn link(&self) -> Option<LinkStatus> {
        Some(self.link)
    }
}
