//! The Kalman filter of position and velocity.
//!
//! Linear, because the orientation is given: Bledt et al., "MIT Cheetah 3: Design and Control of a Robust, Dynamic
//! Quadruped Robot", IROS 2018, section on state estimation, with its process model and its leg residuals e_p and e_v.
//! Three things are ours or from Bloesch et al., "State Estimation for Legged Robots: Consistent Fusion of Leg Kinematics
//! and IMU", RSS 2012:
//!
//! * the accelerometer's bias is a state (Bloesch), learnt while the robot stands and used while it flies;
//! * a foot has a place only while it stands: its state is made at touchdown and dropped at lift-off (Bloesch);
//! * a foot is a ball that rolls, so its centre moves while it stands (ours: at push-off by some 2 cm).
//!
//! There is no residual of the ground's height: a jump may land on a block, and only the height would gain by it.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::control::estimator::GRAVITY;
use crate::control::settings::{EstimatorSettings, PERIOD_S};
use crate::robot::{LEGS, PerLeg};

/// Position, velocity, bias of the accelerometer, four feet.
const STATES: usize = 9 + 3 * LEGS;
const POSITION: usize = 0;
const VELOCITY: usize = 3;
const BIAS: usize = 6;

type State = SVector<f64, STATES>;
type Covariance = SMatrix<f64, STATES, STATES>;
/// Three columns of it: covariance of the whole state with three measured numbers.
type Columns = SMatrix<f64, STATES, 3>;

const fn foot(leg: usize) -> usize {
    9 + 3 * leg
}

/// What the legs and the orientation say of one foot in one tick; all relative to the inertial unit, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootMotion {
    /// From the inertial unit to the foot's centre, m.
    pub offset_world: Vector3<f64>,
    /// How fast the foot's centre moves relative to the inertial unit, m/s.
    pub velocity_world: Vector3<f64>,
    /// How fast the centre of a foot that rolls without slipping moves over the ground, m/s.
    pub rolling_world: Vector3<f64>,
}

/// Position and velocity of the inertial unit: the point whose acceleration is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    state: State,
    covariance: Covariance,
    /// Which feet have a place.
    anchored: PerLeg<bool>,
    /// For how long feet were down and none was believed, s.
    disbelieved_s: f64,
}

impl Filter {
    /// At rest at `position_world` (m), no foot down.
    pub fn new(position_world: &Vector3<f64>, settings: &EstimatorSettings) -> Filter {
        let mut filter = Filter {
            state: State::zeros(),
            covariance: Covariance::zeros(),
            anchored: [false; LEGS],
            disbelieved_s: 0.0,
        };
        filter.state.fixed_rows_mut::<3>(POSITION).copy_from(position_world);
        filter.forget_velocity(settings);
        filter.set_variance(BIAS, settings.accel_bias_m_s2.powi(2));
        filter
    }

    /// Position, world, m.
    pub fn position_world(&self) -> Vector3<f64> {
        self.vector(POSITION)
    }

    /// Velocity, world, m/s.
    pub fn velocity_world(&self) -> Vector3<f64> {
        self.vector(VELOCITY)
    }

    /// The accelerometer's bias as learnt so far, body axes, m/s^2.
    pub fn accel_bias_body(&self) -> Vector3<f64> {
        self.vector(BIAS)
    }

    /// Standard deviations of the velocity that the filter believes of itself, m/s.
    pub fn velocity_deviation(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.covariance[(VELOCITY + i, VELOCITY + i)].max(0.0).sqrt())
    }

    /// Moves on by `dt_s` with the specific force `accel_body` (m/s^2) that was measured at its end.
    pub fn predict(
        &mut self,
        accel_body: &Vector3<f64>,
        world_from_body: &Matrix3<f64>,
        feet: &PerLeg<FootMotion>,
        dt_s: f64,
        settings: &EstimatorSettings,
    ) {
        // a = R (f - b) + g;  p += v dt + a dt^2 / 2;  v += a dt;  p_i += (rolling) dt.
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY);
        let acceleration = world_from_body * (accel_body - self.vector(BIAS)) + gravity;
        let moved = self.vector(VELOCITY) * dt_s + acceleration * (0.5 * dt_s * dt_s);
        self.add(POSITION, &moved);
        self.add(VELOCITY, &(acceleration * dt_s));
        for (leg, motion) in feet.iter().enumerate() {
            if self.anchored[leg] {
                self.add(foot(leg), &(motion.rolling_world * dt_s));
            }
        }

        // P <- F P F^T + Q, where F is the identity but for dp/dv = dt and dv/db = -R dt: rows first, then columns. The
        // second-order terms in dt, 1e-6 of the first, are left out.
        let p = &mut self.covariance;
        let turned = world_from_body * -dt_s;
        let velocity_rows = p.fixed_rows::<3>(VELOCITY).into_owned();
        let bias_rows = p.fixed_rows::<3>(BIAS).into_owned();
        let mut rows = p.fixed_rows_mut::<3>(POSITION);
        rows += velocity_rows * dt_s;
        let mut rows = p.fixed_rows_mut::<3>(VELOCITY);
        rows += turned * bias_rows;
        let velocity_columns = p.fixed_columns::<3>(VELOCITY).into_owned();
        let bias_columns = p.fixed_columns::<3>(BIAS).into_owned();
        let mut columns = p.fixed_columns_mut::<3>(POSITION);
        columns += velocity_columns * dt_s;
        let mut columns = p.fixed_columns_mut::<3>(VELOCITY);
        columns += bias_columns * turned.transpose();

        // White noise of one sample a period, and what a sample misses of a jerk.
        let sample = settings.accel_noise_m_s2 + settings.accel_error_share * acceleration.norm();
        self.add_variance(VELOCITY, sample * sample * PERIOD_S * dt_s);
        self.add_variance(BIAS, settings.accel_bias_walk.powi(2) * dt_s);
        for leg in 0..LEGS {
            if self.anchored[leg] {
                self.add_variance(foot(leg), settings.foot_creep.powi(2) * dt_s);
            }
        }
    }

    /// Learns from the feet that are down. A foot that moves otherwise than a standing foot would slips: it says nothing, and
    /// finds a new place when it stops.
    pub fn correct(&mut self, feet: &PerLeg<FootMotion>, down: &PerLeg<bool>, dt_s: f64, settings: &EstimatorSettings) {
        let (mut any_down, mut any_believed) = (false, false);
        for (leg, motion) in feet.iter().enumerate() {
            if !down[leg] {
                self.release(leg);
                continue;
            }
            any_down = true;
            let stands = self.correct_velocity(motion, settings);
            let stayed = stands && self.anchored[leg] && self.correct_position(leg, motion, settings);
            any_believed |= stands;
            if !stayed {
                self.anchor(leg, motion, settings);
            }
        }
        self.disbelieved_s = if any_down && !any_believed { self.disbelieved_s + dt_s } else { 0.0 };
        if self.disbelieved_s > settings.longest_slip_s {
            // All feet slip for longer than feet can: it is the velocity that is wrong.
            self.forget_velocity(settings);
            self.disbelieved_s = 0.0;
        }
    }

    /// The robot hangs or is carried: what an accelerometer gathers in seconds means nothing.
    pub fn rest(&mut self, settings: &EstimatorSettings) {
        self.state.fixed_rows_mut::<3>(VELOCITY).fill(0.0);
        self.forget_velocity(settings);
    }

    /// e_v: a standing foot's centre moves as rolling says, so v = rolling - (velocity relative to the unit). False where
    /// that cannot be.
    fn correct_velocity(&mut self, motion: &FootMotion, settings: &EstimatorSettings) -> bool {
        // Joint velocities err in proportion to the lever, and more the faster the leg is.
        let noise = settings.foot_velocity_m_s + settings.foot_velocity_share * motion.velocity_world.norm();
        let residual = motion.rolling_world - motion.velocity_world - self.vector(VELOCITY);
        let with_state = self.covariance.fixed_columns::<3>(VELOCITY).into_owned();
        let variance = with_state.fixed_rows::<3>(VELOCITY).into_owned();
        self.learn(&with_state, variance, noise, &residual, settings.gate_sigma)
    }

    /// e_p: the foot is where it was put down. False where that cannot be.
    fn correct_position(&mut self, leg: usize, motion: &FootMotion, settings: &EstimatorSettings) -> bool {
        let residual = motion.offset_world - (self.vector(foot(leg)) - self.vector(POSITION));
        let with_state: Columns =
            self.covariance.fixed_columns::<3>(foot(leg)) - self.covariance.fixed_columns::<3>(POSITION);
        let variance = with_state.fixed_rows::<3>(foot(leg)) - with_state.fixed_rows::<3>(POSITION);
        self.learn(&with_state, variance, settings.foot_position_m, &residual, settings.gate_sigma)
    }

    /// Three measured numbers with independent errors of `noise`: `with_state` is P H^T, `variance` H P H^T. Nothing is
    /// learnt, and false returned, where the residual is more than `gate` standard deviations long.
    fn learn(
        &mut self,
        with_state: &Columns,
        variance: Matrix3<f64>,
        noise: f64,
        residual: &Vector3<f64>,
        gate: f64,
    ) -> bool {
        let Some(root) = (variance + Matrix3::from_diagonal_element(noise * noise)).cholesky() else { return false };
        let lower = root.l_dirty();
        let Some(whitened) = lower.solve_lower_triangular(residual) else { return false };
        // Also false for a residual that is no number.
        let believable = whitened.norm() <= gate;
        if !believable {
            return false;
        }
        // With S = L L^T and U = P H^T L^-T: x += U L^-1 e, P -= U U^T. This form keeps P symmetric to the bit.
        let Some(inverse) = lower.solve_lower_triangular(&Matrix3::identity()) else { return false };
        let scaled = with_state * inverse.transpose();
        self.state += scaled * whitened;
        for column in scaled.column_iter() {
            self.covariance.ger(-1.0, &column, &column, 1.0);
        }
        true
    }

    /// The foot is where it is now: p_i = p + offset, with the kinematics' error.
    fn anchor(&mut self, leg: usize, motion: &FootMotion, settings: &EstimatorSettings) {
        let place = self.vector(POSITION) + motion.offset_world;
        self.state.fixed_rows_mut::<3>(foot(leg)).copy_from(&place);
        let rows = self.covariance.fixed_rows::<3>(POSITION).into_owned();
        self.covariance.fixed_rows_mut::<3>(foot(leg)).copy_from(&rows);
        let columns = self.covariance.fixed_columns::<3>(POSITION).into_owned();
        self.covariance.fixed_columns_mut::<3>(foot(leg)).copy_from(&columns);
        self.add_variance(foot(leg), settings.foot_position_m.powi(2));
        self.anchored[leg] = true;
    }

    /// The foot is in the air: it has no place.
    fn release(&mut self, leg: usize) {
        if self.anchored[leg] {
            self.set_variance(foot(leg), 0.0);
            self.anchored[leg] = false;
        }
    }

    fn forget_velocity(&mut self, settings: &EstimatorSettings) {
        self.set_variance(VELOCITY, settings.start_velocity_m_s.powi(2));
    }

    fn vector(&self, at: usize) -> Vector3<f64> {
        self.state.fixed_rows::<3>(at).into_owned()
    }

    fn add(&mut self, at: usize, change: &Vector3<f64>) {
        let mut rows = self.state.fixed_rows_mut::<3>(at);
        rows += change;
    }

    fn add_variance(&mut self, at: usize, variance: f64) {
        for i in at..at + 3 {
            self.covariance[(i, i)] += variance;
        }
    }

    /// Three states that are known this well, and independently of everything else.
    fn set_variance(&mut self, at: usize, variance: f64) {
        self.covariance.fixed_rows_mut::<3>(at).fill(0.0);
        self.covariance.fixed_columns_mut::<3>(at).fill(0.0);
        self.add_variance(at, variance);
    }
}
