//! The emulated robot without its network: motors, body and reported state, with the injected defects.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::robot::description::RobotDescription;
use crate::robot::remote::{Remote, RemoteButtons};
use crate::robot::rotation::from_scaled_axis;
use crate::robot::{
    Battery, CONTROL_PERIOD_S, Imu, JOINTS, JointCommand, Joints, LEGS, MotorCommand, Placement, Robot, RobotState,
    Truth,
};
use crate::sim::{EmulatorConfig, SimConfig, SimError, Simulator};

/// Number of cells of the battery, and voltage of an empty and of a full one, V. Assumption: a six-cell pack, from the
/// Go1's nominal 21.6 V.
const CELLS: usize = 6;
const CELL_V: [f64; 2] = [3.3, 4.2];
/// Power of the robot's computers, W. Assumption.
const IDLE_W: f64 = 30.0;
/// Stiffness, N m/rad, and damping, N m s/rad, of a stuck joint, up to the motor's torque.
const STUCK_GAINS: [f64; 2] = [600.0, 10.0];

/// Noise of the inertial unit, rad/s, m/s^2 and rad. Assumption: far below that of a real unit, above the resolution of a state.
const IMU_NOISE: f64 = 1e-5;

/// Injected defects of the robot.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RobotDefects {
    pub frozen: bool,
    pub repeating: bool,
    pub hot: [Option<f64>; JOINTS],
    pub charge_percent: Option<f64>,
    pub servo_off: [bool; JOINTS],
    pub stuck_at: [Option<f64>; JOINTS],
    pub angle: [Option<f64>; JOINTS],
    pub speed: [Option<f64>; JOINTS],
    pub torque: [Option<f64>; JOINTS],
    pub tilt_rad: f64,
    pub imu_frozen: bool,
    pub motor_frozen: [bool; JOINTS],
    /// Wrong sign of roll and of pitch.
    pub flipped: [bool; 2],
    pub foot_force_n: Option<f64>,
    pub clock_drift_ms_per_s: f64,
    pub remote_buttons: RemoteButtons,
    pub remote_off: bool,
}

/// The emulated robot.
#[derive(Debug)]
pub(super) struct EmulatedRobot {
    simulator: Simulator,
    config: EmulatorConfig,
    lying_position: Joints,
    seed: u64,
    /// Number of times that the robot was laid down.
    placed: u64,
    /// Clock of the robot, ms since its boot.
    pub time_ms: u32,
    pub defects: RobotDefects,
    /// Command of each motor; none if it brakes.
    pub motors: [Option<MotorCommand>; JOINTS],
    last_state: Option<RobotState>,
    /// The last reported measurements of the inertial unit and of the motors: angle, velocity and torque.
    last_imu: Imu,
    last_motors: [Joints; 3],
    /// Fraction of a millisecond by which the robot's clock is ahead.
    clock_ahead_ms: f64,
}

impl EmulatedRobot {
    pub fn new(description: &RobotDescription, config: &SimConfig, seed: u64) -> Result<EmulatedRobot, SimError> {
        let mut robot = EmulatedRobot {
            simulator: Simulator::new(description, config)?,
            config: config.emulator,
            lying_position: description.lying_position,
            seed,
            placed: 0,
            time_ms: 0,
            defects: RobotDefects::default(),
            motors: [None; JOINTS],
            last_state: None,
            last_imu: Imu::default(),
            last_motors: Default::default(),
            clock_ahead_ms: 0.0,
        };
        robot.lay_down();
        Ok(robot)
    }

    pub fn place(&mut self, placement: &Placement) {
        self.simulator.place(placement);
    }

    /// Lays the robot down at the world's origin, as a person would.
    pub fn lay_down(&mut self) {
        let seed = self.seed.wrapping_add(self.placed);
        self.place(&Placement { joint_position: self.lying_position, lying: true, seed });
        self.placed += 1;
    }

    /// Blocks a joint at its current angle.
    pub fn block(&mut self, joint: usize) {
        self.defects.stuck_at[joint] = Some(self.simulator.state().joint_position[joint]);
    }

    /// True state of the simulator.
    pub fn truth(&mut self) -> Option<Truth> {
        self.simulator.read().ok().and_then(|state| state.truth)
    }

    /// Simulates one millisecond.
    pub fn step(&mut self) {
        let braking = MotorCommand { kd_joint: self.config.braking_kd, ..MotorCommand::default() };
        let mut drive = JointCommand::default();
        for (joint, motor) in drive.motor.iter_mut().enumerate() {
            *motor = match (self.defects.stuck_at[joint], self.motors[joint]) {
                (Some(position), _) => MotorCommand {
                    position_rad: position,
                    kp_joint: STUCK_GAINS[0],
                    kd_joint: STUCK_GAINS[1],
                    ..MotorCommand::default()
                },
                (None, Some(command)) if self.in_servo(joint) => command,
                _ => braking,
            };
        }
        // The simulator's write never fails.
        let _ = self.simulator.write(&drive);
    }

    /// Advances the robot's clock, and returns the state that it reports.
    pub fn next_state(&mut self) -> RobotState {
        self.time_ms = self.time_ms.wrapping_add(1);
        self.clock_ahead_ms += self.defects.clock_drift_ms_per_s * CONTROL_PERIOD_S;
        self.step_clock(self.clock_ahead_ms.trunc());
        self.clock_ahead_ms = self.clock_ahead_ms.fract();
        match self.last_state.filter(|_| self.defects.repeating) {
            Some(repeated) => repeated,
            None => {
                let state = self.state();
                *self.last_state.insert(state)
            }
        }
    }

    /// Steps the robot's clock by whole milliseconds.
    pub fn step_clock(&mut self, ms: f64) {
        self.time_ms = self.time_ms.wrapping_add_signed(ms as i32);
    }

    /// Whether a motor is in servo mode.
    fn in_servo(&self, joint: usize) -> bool {
        self.motors[joint].is_some() && !self.defects.servo_off[joint]
    }

    /// Returns the state with its defects.
    fn state(&mut self) -> RobotState {
        let mut state = self.simulator.read().unwrap_or_default();
        state.robot_time_ms = self.time_ms;
        state.motor_enabled = std::array::from_fn(|joint| self.in_servo(joint));
        state.motor_temperature_c = self.defects.hot.map(|celsius| celsius.unwrap_or(self.config.motor_temperature_c));
        state.battery = Some(self.battery(&state));
        let replace = |reported: &mut Joints, defects: &[Option<f64>; JOINTS]| {
            for (value, defect) in reported.iter_mut().zip(defects) {
                *value = defect.unwrap_or(*value);
            }
        };
        replace(&mut state.joint_position_rad, &self.defects.angle);
        replace(&mut state.joint_velocity_rad_s, &self.defects.speed);
        replace(&mut state.joint_torque_n_m, &self.defects.torque);
        let measured = [&mut state.joint_position_rad, &mut state.joint_velocity_rad_s, &mut state.joint_torque_n_m];
        for (values, last) in measured.into_iter().zip(&mut self.last_motors) {
            for joint in (0..JOINTS).filter(|&joint| self.defects.motor_frozen[joint]) {
                values[joint] = last[joint];
            }
            *last = *values;
        }
        state.imu.world_from_body *= from_scaled_axis(Vector3::x() * self.defects.tilt_rad);
        let [flips_roll, flips_pitch] = self.defects.flipped.map(|flipped| if flipped { -1.0 } else { 1.0 });
        let [x, y, z, w]: [f64; 4] = state.imu.world_from_body.coords.into();
        let reported = Quaternion::new(w, flips_roll * x, flips_pitch * y, z);
        state.imu.world_from_body = UnitQuaternion::new_unchecked(reported);
        if self.defects.imu_frozen {
            state.imu = self.last_imu;
        } else {
            self.add_imu_noise(&mut state.imu);
        }
        self.last_imu = state.imu;
        state.foot_force_n = self.defects.foot_force_n.map_or(state.foot_force_n, |newtons| [newtons; LEGS]);
        let buttons = self.defects.remote_buttons;
        state.remote = (!self.defects.remote_off).then_some(Remote { buttons, ..Remote::default() });
        state
    }

    /// Adds the least noise of an inertial unit: a unit that measures never repeats a measurement.
    fn add_imu_noise(&self, imu: &mut Imu) {
        let sign = if self.time_ms.is_multiple_of(2) { 1.0 } else { -1.0 };
        imu.gyro_body.z += sign * IMU_NOISE;
        imu.accel_body.z += sign * IMU_NOISE;
        imu.world_from_body *= from_scaled_axis(Vector3::z() * (sign * IMU_NOISE));
    }

    fn battery(&self, state: &RobotState) -> Battery {
        let charge_percent = self.defects.charge_percent.unwrap_or(self.config.battery_percent);
        let cell = CELL_V[0] + (CELL_V[1] - CELL_V[0]) * charge_percent.min(100.0) / 100.0;
        let voltage_v = cell * CELLS as f64;
        let mechanical: f64 =
            state.joint_torque_n_m.iter().zip(&state.joint_velocity_rad_s).map(|(torque, dq)| torque * dq).sum();
        Battery {
            charge_percent,
            voltage_v,
            current_a: -(IDLE_W + mechanical.max(0.0)) / voltage_v,
            cell_v: std::array::from_fn(|i| if i < CELLS { cell } else { 0.0 }),
        }
    }
}
