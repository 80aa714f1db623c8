//! Rigid-body simulator behind the `Robot` trait: answers as the machine would.
//!
//! Constant [`Model`], changing [`State`]; one control period is `step.rs` read from the top. [`contact`](self) impulses are found
//! together by a per-contact Gauss-Seidel method with the exact Coulomb cone. Deterministic: the same seed and the same
//! commands give the same bits. Nothing allocates after `new` and `place`.

mod actuator;
pub mod bench;
mod collision;
mod config;
mod contact;
mod dynamics;
pub mod emulator;
mod integrate;
mod model;
mod quantities;
mod sensors;
mod spatial;
mod state;
mod step;
mod terrain;

use nalgebra::Vector3;

pub use config::{
    ActuatorConfig, ActuatorKind, BlocksConfig, BodyKind, ContactConfig, ContactLaw, EmulatorConfig,
    HardwareLikeConfig, SensorConfig, SimConfig, SimError, SlopeConfig, SolverConfig, StepConfig, StepsConfig,
    TerrainConfig, TerrainKind,
};
pub use model::{GRAVITY, Model};
pub use quantities::{DOF, Energy, FootMotion, Momentum};
pub use state::{Acceleration, State};
pub use step::CONTROL_PERIOD_S;
pub use terrain::TerrainBox;

use crate::robot::description::{JointLimits, RobotDescription};
use crate::robot::{Imu, JOINTS, JointCommand, Placement, Robot, RobotError, RobotState, Truth};
use actuator::Actuator;
use collision::Collider;
use contact::ContactSolver;
use dynamics::Dynamics;
use sensors::Sensors;
use step::Touched;
use terrain::Terrain;

/// The simulated machine.
#[derive(Debug, Clone)]
pub struct Simulator {
    config: SimConfig,
    model: Model,
    limits: JointLimits,
    imu_origin: Vector3<f64>,
    collider: Collider,
    terrain: Terrain,
    actuator: Actuator,
    solver: ContactSolver,
    state: State,
    touched: Touched,
    /// Mean acceleration of the inertial unit's place over the last period, less gravity; body axes, m/s^2.
    specific_force_body: Vector3<f64>,
    /// Control periods since it was placed.
    ticks: u32,
    sensors: Sensors,
    /// What is read until the next control period.
    reported: RobotState,
}

impl Simulator {
    /// The machine `description` in the world of `config`, at rest with joint angles zero at the world's origin until it is
    /// placed.
    ///
    /// # Errors
    /// When a value of `config` is out of range.
    pub fn new(description: &RobotDescription, config: &SimConfig) -> Result<Simulator, SimError> {
        config.check()?;
        let motor = &config.actuator;
        let mut model = Model::new(description);
        if motor.kind == ActuatorKind::HardwareLike && motor.hardware_like.rotor_inertia {
            model = model.with_rotor_inertia(description.rotor_inertia);
        }
        let collider = Collider::new(description, config);
        let mut simulator = Simulator {
            solver: ContactSolver::new(config.solver, &config.contact, collider.memories()),
            terrain: Terrain::new(&config.terrain),
            actuator: Actuator::new(motor, &description.limits),
            model,
            limits: description.limits,
            imu_origin: description.imu_origin,
            collider,
            state: State::default(),
            touched: Touched::default(),
            specific_force_body: Vector3::new(0.0, 0.0, GRAVITY),
            ticks: 0,
            sensors: Sensors::new(&config.sensors),
            reported: RobotState::default(),
            config: config.clone(),
        };
        simulator.set_state(&State::default());
        Ok(simulator)
    }

    /// What is constant about the machine.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Where it is and how it moves.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Puts it into any state, for tests and studies of its own; forgets contact forces and motor lag.
    pub fn set_state(&mut self, state: &State) {
        self.state = *state;
        self.touched = Touched::default();
        self.specific_force_body = state.orientation_world.inverse_transform_vector(&Vector3::new(0.0, 0.0, GRAVITY));
        self.solver.reset();
        self.actuator.reset();
        self.report();
    }

    /// Smallest distance between the machine and the ground, m; negative where it is inside.
    pub fn smallest_gap(&self) -> f64 {
        let dynamics = Dynamics::new(&self.model, &self.state, &[0.0; JOINTS]);
        self.collider.smallest_gap(&dynamics.legs(), &self.state, &self.terrain)
    }

    /// Number of points that touched, or could have, in the last step.
    pub fn contact_count(&self) -> usize {
        self.solver.contacts().len()
    }

    /// The steps or blocks on the ground, where they are now.
    pub fn terrain_boxes(&self) -> impl Iterator<Item = TerrainBox> + '_ {
        self.terrain.boxes()
    }

    /// Velocity of the inertial unit's place, world, m/s.
    fn imu_velocity_world(&self) -> Vector3<f64> {
        let v = self.state.velocity_body + self.state.angular_velocity_body.cross(&self.imu_origin);
        self.state.orientation_world * v
    }

    /// Has the sensors look.
    fn report(&mut self) {
        let state = &self.state;
        let exact = RobotState {
            robot_time_ms: self.ticks,
            joint_position: state.joint_position,
            joint_velocity: state.joint_velocity,
            joint_torque: *self.actuator.torque(),
            imu: Imu {
                orientation_world: state.orientation_world,
                gyro_body: state.angular_velocity_body,
                accel_body: self.specific_force_body,
            },
            foot_force: self.touched.foot_normal_impulse.map(|impulse| impulse / CONTROL_PERIOD_S),
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
            velocity_world: state.orientation_world * state.velocity_body,
            orientation_world: state.orientation_world,
            angular_velocity_body: state.angular_velocity_body,
            foot_contact: self.touched.foot,
            foot_force_world: self.touched.foot_impulse_world.map(|impulse| impulse / CONTROL_PERIOD_S),
            body_contact: self.touched.body,
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
        self.specific_force_body = self.state.orientation_world.inverse_transform_vector(&specific_force);
        self.report();
        Ok(())
    }

    /// Standing or lying level at the world's origin, as low as the ground allows; everything random starts anew from the seed.
    fn place(&mut self, placement: &Placement) -> bool {
        self.terrain.reset(placement.seed);
        self.ticks = 0;
        let mut state = State { joint_position: placement.joint_position, ..State::default() };
        // Lowered from above until the first part touches: on level ground in one step, on blocks in a few.
        state.position_world.z = 2.0;
        for _ in 0..200 {
            self.set_state(&state);
            let gap = self.smallest_gap();
            if gap < 1e-12 {
                break;
            }
            state.position_world.z -= gap;
        }
        self.sensors.reset(placement.seed);
        self.report();
        true
    }
}
