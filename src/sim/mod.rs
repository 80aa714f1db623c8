//! Rigid-body simulator behind the [`Robot`] trait.
//!
//! [`RobotModel`] is constant, [`SimState`] changes; `step.rs` is the sequence of one control period. Contact impulses
//! are solved together by a per-contact Gauss-Seidel method with the exact Coulomb cone. Deterministic: the same seed
//! and the same commands give the same bits. Nothing allocates after `new` and `place`.

mod actuator;
pub mod bench;
mod collision;
mod config;
mod contact;
mod dynamics;
pub mod emulator;
pub mod ensemble;
mod flight;
mod integrate;
mod joint_stop;
mod lanes;
mod leg;
mod model;
mod motion;
mod quantities;
pub(crate) mod ranges;
mod sensors;
mod six;
mod spatial;
mod state;
mod step;
mod streams;
pub mod terrain;

use nalgebra::Vector3;

pub use config::{
    ActuatorConfig, ActuatorKind, BlocksConfig, BodyKind, ContactConfig, ContactLaw, EmulatorConfig,
    HardwareLikeConfig, SensorConfig, SimConfig, SimError, SlopeConfig, SolverConfig, StepConfig, StepsConfig,
    TerrainConfig, TerrainKind,
};
pub use model::RobotModel;
pub use quantities::{DOF, Energy, FootKinematics, Momentum};
pub use state::{Acceleration, SimState};
pub use terrain::TerrainBox;

use crate::robot::description::{JointLimits, RobotDescription};
use crate::robot::{
    CONTROL_PERIOD_S, GRAVITY, Imu, JOINTS, JointCommand, Placement, Robot, RobotError, RobotState, Truth,
};
use actuator::Actuator;
use collision::Collider;
use contact::ContactSolver;
use dynamics::Dynamics;
use flight::FlightMemory;
use sensors::Sensors;
use state::PeriodContacts;
use terrain::Terrain;

/// Step by which a robot is lowered that the nearest ground is beside, m.
const LOWERING_STEP_M: f64 = 1e-3;
/// Distance from the ground at which a placed robot touches it, m.
const LOWERING_TOLERANCE_M: f64 = 1e-12;

/// A simulated robot.
#[derive(Debug, Clone)]
pub struct Simulator {
    config: SimConfig,
    model: RobotModel,
    limits: JointLimits,
    imu_origin: Vector3<f64>,
    collider: Collider,
    terrain: Terrain,
    actuator: Actuator,
    solver: ContactSolver,
    state: SimState,
    /// Equations of the step.
    dynamics: Dynamics,
    /// Present if the last step was one of free flight; the equations are those of the present state then.
    flight: Option<FlightMemory>,
    contacts: PeriodContacts,
    /// Mean acceleration of the inertial unit over the last period, less gravity; body axes, m/s^2.
    specific_force_body: Vector3<f64>,
    /// Control periods since `place`.
    ticks: u32,
    sensors: Sensors,
    /// State that `read` returns until the next control period.
    reported: RobotState,
}

impl Simulator {
    /// Creates the robot `description` in the world of `config`, at rest at the world's origin with joint angles zero.
    ///
    /// # Errors
    /// A value of `config` is out of range.
    pub fn new(description: &RobotDescription, config: &SimConfig) -> Result<Simulator, SimError> {
        config.check()?;
        let motor = &config.actuator;
        let mut model = RobotModel::new(description);
        if motor.kind == ActuatorKind::HardwareLike && motor.hardware_like.rotor_inertia {
            model = model.with_rotor_inertia(description.rotor_inertia);
        }
        let collider = Collider::new(description, config);
        let mut simulator = Simulator {
            solver: ContactSolver::new(config.solver, &config.contact, collider.warm_start_slots()),
            terrain: Terrain::new(&config.terrain),
            actuator: Actuator::new(motor, &description.limits),
            dynamics: Dynamics::of(&model),
            model,
            limits: description.limits,
            imu_origin: description.imu_origin,
            collider,
            state: SimState::default(),
            flight: None,
            contacts: PeriodContacts::default(),
            specific_force_body: Vector3::new(0.0, 0.0, GRAVITY),
            ticks: 0,
            sensors: Sensors::new(&config.sensors),
            reported: RobotState::default(),
            config: config.clone(),
        };
        simulator.set_state(&SimState::default());
        Ok(simulator)
    }

    /// Computes as [`RobotModel::with_baseline_instructions`].
    pub fn with_baseline_instructions(mut self) -> Simulator {
        self.model = self.model.with_baseline_instructions();
        self.dynamics = Dynamics::of(&self.model);
        self.flight = None;
        self
    }

    /// The constant model.
    pub fn model(&self) -> &RobotModel {
        &self.model
    }

    /// Current position and velocity of every part.
    pub fn state(&self) -> &SimState {
        &self.state
    }

    /// Sets the state; resets contact impulses and motor lag.
    pub fn set_state(&mut self, state: &SimState) {
        self.state = *state;
        self.flight = None;
        self.contacts = PeriodContacts::default();
        self.specific_force_body = state.world_from_body.inverse_transform_vector(&Vector3::new(0.0, 0.0, GRAVITY));
        self.solver.reset();
        self.actuator.reset();
        self.report();
    }

    /// Smallest distance between the robot and the ground, m; negative if a part is inside.
    pub fn smallest_gap(&self) -> f64 {
        let dynamics = Dynamics::new(&self.model, &self.state, &[0.0; JOINTS]);
        self.collider.smallest_gap(&dynamics, &self.state, &self.terrain)
    }

    /// Number of contact points of the last step.
    pub fn contact_count(&self) -> usize {
        self.solver.contacts().len()
    }

    /// The steps or blocks on the ground at their current positions.
    pub fn terrain_boxes(&self) -> impl Iterator<Item = TerrainBox> + '_ {
        self.terrain.boxes()
    }

    /// Velocity of the inertial unit, world, m/s.
    fn imu_velocity_world(&self) -> Vector3<f64> {
        let v = self.state.velocity_body + self.state.angular_velocity_body.cross(&self.imu_origin);
        self.state.world_from_body * v
    }

    /// Measures the current state with the sensors.
    fn report(&mut self) {
        let state = &self.state;
        let exact = RobotState {
            robot_time_ms: self.ticks,
            joint_position_rad: state.joint_position,
            joint_velocity_rad_s: state.joint_velocity,
            joint_torque_n_m: *self.actuator.torque(),
            imu: Imu {
                world_from_body: state.world_from_body,
                gyro_body: state.angular_velocity_body,
                accel_body: self.specific_force_body,
            },
            foot_force_n: self.contacts.foot_normal_impulse.map(|impulse| impulse / CONTROL_PERIOD_S),
            motor_enabled: [true; JOINTS],
            truth: Some(self.truth()),
            ..RobotState::default()
        };
        self.reported = self.sensors.measure(&exact);
    }

    fn truth(&self) -> Truth {
        let state = &self.state;
        Truth {
            position_world: state.position_world,
            velocity_world: state.world_from_body * state.velocity_body,
            world_from_body: state.world_from_body,
            angular_velocity_body: state.angular_velocity_body,
            foot_contact: self.contacts.foot,
            foot_force_world: self.contacts.foot_impulse_world.map(|impulse| impulse / CONTROL_PERIOD_S),
            body_contact: self.contacts.body,
        }
    }
}

impl Robot for Simulator {
    fn read(&mut self) -> Result<RobotState, RobotError> {
        Ok(self.reported)
    }

    fn write(&mut self, command: &JointCommand) -> Result<(), RobotError> {
        let before = self.imu_velocity_world();
        self.control_period(command);
        let acceleration = (self.imu_velocity_world() - before) / CONTROL_PERIOD_S;
        let specific_force = acceleration + Vector3::new(0.0, 0.0, GRAVITY);
        self.specific_force_body = self.state.world_from_body.inverse_transform_vector(&specific_force);
        self.report();
        Ok(())
    }

    /// Places the robot level above the world's origin, where it first touches the ground on its way down, and restarts all random
    /// numbers from the seed.
    fn place(&mut self, placement: &Placement) -> bool {
        self.terrain.reset(placement.seed);
        self.ticks = 0;
        let mut state = SimState { joint_position: placement.joint_position, ..SimState::default() };
        // Above everything that the robot could touch.
        state.position_world.z = 2.0;
        while self.terrain.clearance(&state.position_world) < self.collider.extent() {
            state.position_world.z *= 2.0;
        }
        // Lowered by the gap, which on level ground is the way to go, at a slope less. Beside a wall it is the way to the wall and can
        // be as small as one likes: there by a step, and half of it for each time that the robot is in the ground after it.
        let (mut free_z, mut step) = (state.position_world.z, LOWERING_STEP_M);
        while step > LOWERING_TOLERANCE_M {
            self.set_state(&state);
            let gap = self.smallest_gap();
            if gap < -LOWERING_TOLERANCE_M {
                step *= 0.5;
            } else {
                free_z = state.position_world.z;
                if gap < LOWERING_TOLERANCE_M {
                    break;
                }
            }
            state.position_world.z = free_z - gap.max(step);
        }
        state.position_world.z = free_z;
        self.set_state(&state);
        self.sensors.reset(placement.seed);
        self.report();
        true
    }
}
