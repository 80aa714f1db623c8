//! The Kalman filter of position and velocity.
//!
//! Linear, because the orientation is given: Bledt et al., "MIT Cheetah 3: Design and Control of a Robust, Dynamic
//! Quadruped Robot", IROS 2018, section on state estimation, with its process model and its leg residuals e_p and e_v.
//! Five things are ours or from Bloesch et al., "State Estimation for Legged Robots: Consistent Fusion of Leg Kinematics
//! and IMU", RSS 2012:
//!
//! * the accelerometer's bias is a state (Bloesch), estimated while the robot stands and used while it flies;
//! * a foot has a position only while it stands: its state is added at touchdown and dropped at lift-off (Bloesch);
//! * a foot is a ball that rolls, so its centre moves while it stands (ours: about 2 cm at push-off);
//! * a gap in the states is bridged as a step of the acceleration at an unknown time, with the variance of that (ours). The
//!   covariance of position and velocity lets a landing correct both;
//! * when all standing feet contradict the velocity for long, the variances of velocity and position are raised (ours).
//!
//! There is no residual of the ground's height: a jump may land on a block, and only the height would improve.

use nalgebra::{Matrix3, SVector, Vector3};

use super::covariance;
use crate::control::settings::EstimatorSettings;
use crate::robot::{CONTROL_PERIOD_S, GRAVITY, LEGS, PerLeg};

/// Position, velocity, bias of the accelerometer, four feet.
const STATES: usize = 9 + 3 * LEGS;
const POSITION: usize = 0;
const VELOCITY: usize = 3;
const BIAS: usize = 6;

type FilterState = SVector<f64, STATES>;
type StateCovariance = covariance::Covariance<STATES>;
type StateColumns = covariance::Columns<STATES>;

const fn foot(leg: usize) -> usize {
    9 + 3 * leg
}

/// Motion of one foot from joint angles and orientation, relative to the inertial unit, world axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootOdometry {
    /// From the inertial unit to the foot's centre, m.
    pub offset_world: Vector3<f64>,
    /// Velocity of the foot's centre relative to the inertial unit, m/s.
    pub velocity_world: Vector3<f64>,
    /// Velocity over the ground of the centre of a foot that rolls without slipping, m/s.
    pub rolling_world: Vector3<f64>,
}

/// Position and velocity of the inertial unit: the point whose acceleration is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Filter {
    state: FilterState,
    covariance: StateCovariance,
    /// Feet with a position in the state.
    anchored: PerLeg<bool>,
    /// Time for which feet were down and all were rejected, s.
    rejected_s: f64,
    /// The last measurement; none at the start.
    last: Option<MotionSample>,
}

/// Measured motion of one state.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MotionSample {
    /// Of the inertial unit, m/s^2.
    acceleration_world: Vector3<f64>,
    /// Velocity of each rolling foot's centre over the ground, m/s.
    rolling_world: PerLeg<Vector3<f64>>,
}

impl Filter {
    /// At rest at `position_world` (m), no foot down.
    pub fn new(position_world: &Vector3<f64>, settings: &EstimatorSettings) -> Filter {
        let mut filter = Filter {
            state: FilterState::zeros(),
            covariance: StateCovariance::zeros(),
            anchored: [false; LEGS],
            rejected_s: 0.0,
            last: None,
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

    /// Estimate of the accelerometer's bias, body axes, m/s^2.
    pub fn accel_bias_body(&self) -> Vector3<f64> {
        self.vector(BIAS)
    }

    /// Predicts over `dt_s` with the specific force `accel_body` (m/s^2) at its end, which is the mean of the last period; if it is not
    /// `measured`, it is an earlier one, and the last period is a part of the gap.
    ///
    /// Over a gap in the states the acceleration steps from the last known one to this one: the mean assumes the middle of the gap,
    /// the variance any time in it.
    pub fn predict(
        &mut self,
        accel_body: &Vector3<f64>,
        measured: bool,
        world_from_body: &Matrix3<f64>,
        feet: &PerLeg<FootOdometry>,
        dt_s: f64,
        settings: &EstimatorSettings,
    ) {
        // a = R (f - b) + g.
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY);
        let acceleration_world = world_from_body * (accel_body - self.vector(BIAS)) + gravity;
        let now = MotionSample { acceleration_world, rolling_world: feet.map(|motion| motion.rolling_world) };
        let before = self.last.replace(now).unwrap_or(now);
        // a' = a - (a - a_0) / 2 * (unseen / dt): over a gap the mean of both ends, but for the period that was measured.
        let unseen_s = if measured { (dt_s - CONTROL_PERIOD_S).max(0.0) } else { dt_s };
        let unseen_share = if unseen_s > 0.0 { unseen_s / dt_s } else { 0.0 };
        let change = now.acceleration_world - before.acceleration_world;
        let acceleration = acceleration_world - change * (0.5 * unseen_share);
        // p += v dt + a' dt^2 / 2;  v += a' dt;  p_i += (rolling) dt.
        let moved = self.vector(VELOCITY) * dt_s + acceleration * (0.5 * dt_s * dt_s);
        self.add(POSITION, &moved);
        self.add(VELOCITY, &(acceleration * dt_s));
        for leg in 0..LEGS {
            if self.anchored[leg] {
                let (rolling, rolled) = (now.rolling_world[leg], before.rolling_world[leg]);
                self.add(foot(leg), &((rolling - (rolling - rolled) * (0.5 * unseen_share)) * dt_s));
            }
        }

        // P <- F P F^T + Q, where F is the identity but for dp/dv = dt and dv/db = -R dt. The second-order terms in dt, 1e-6 of the
        // first, are left out.
        self.covariance.carry([POSITION, VELOCITY, BIAS], dt_s, &(world_from_body * -dt_s));

        // White noise of one sample a period, and the sample's error under jerk.
        let sample = settings.accel_noise_m_s2 + settings.accel_error_share * acceleration.norm();
        self.covariance.add_variance(VELOCITY, sample * sample * CONTROL_PERIOD_S * dt_s);
        if unseen_s > 0.0 {
            self.add_unseen(&change, unseen_s, settings);
        }
        self.covariance.add_variance(BIAS, settings.accel_bias_walk.powi(2) * dt_s);
        for leg in 0..LEGS {
            if self.anchored[leg] {
                self.covariance.add_variance(foot(leg), settings.foot_creep.powi(2) * dt_s);
            }
        }
    }

    /// Adds the variance of a gap of `unseen_s` seconds over which the acceleration changed by `change` (m/s^2).
    fn add_unseen(&mut self, change: &Vector3<f64>, unseen_s: f64, settings: &EstimatorSettings) {
        // A step at a uniformly distributed time: its mean has the variance change^2 / 12. Plus accelerations within the gap.
        let variance = change.map(|change| change * change / 12.0 + settings.unseen_accel_m_s2.powi(2));
        // A wrong mean acceleration e leaves e t in the velocity and e t^2 / 2 in the position.
        self.add_common(variance, 0.5 * unseen_s * unseen_s, unseen_s);
    }

    /// Adds an unknown vector of this variance per axis, `to_position` times to the position and `to_velocity` times to the velocity.
    fn add_common(&mut self, variance: Vector3<f64>, to_position: f64, to_velocity: f64) {
        for i in 0..3 {
            let (p, v) = (POSITION + i, VELOCITY + i);
            self.covariance.add(p, p, variance[i] * to_position * to_position);
            self.covariance.add(v, v, variance[i] * to_velocity * to_velocity);
            self.covariance.add(v, p, variance[i] * to_position * to_velocity);
        }
    }

    /// Corrects the state with the feet that are down. A foot that does not move as a standing foot slips: it is rejected, and gets a
    /// new position when it stops.
    pub fn correct(
        &mut self,
        feet: &PerLeg<FootOdometry>,
        down: &PerLeg<bool>,
        dt_s: f64,
        settings: &EstimatorSettings,
    ) {
        let stands = self.correct_velocity(feet, down, settings);
        let (mut disagreed, mut disagreement) = (0, Vector3::zeros());
        for (leg, motion) in feet.iter().enumerate() {
            if !down[leg] {
                self.release(leg);
                continue;
            }
            if !stands[leg] {
                disagreed += 1;
                disagreement += self.velocity_residual(motion);
            }
            let stayed = stands[leg] && self.anchored[leg] && self.correct_position(leg, motion, settings);
            if !stayed {
                self.anchor(leg, motion, settings);
            }
        }
        if disagreed == 0 || stands.contains(&true) {
            self.rejected_s = 0.0;
            return;
        }
        self.rejected_s += dt_s;
        if self.rejected_s > settings.longest_slip_s {
            // All feet slip for too long: the velocity is wrong.
            self.raise_velocity_variance((disagreement / f64::from(disagreed)).norm(), settings);
        }
    }

    /// Sets the velocity to zero and unknown: the robot hangs or is carried, and the integrated acceleration has drifted.
    pub fn rest(&mut self, settings: &EstimatorSettings) {
        self.state.fixed_rows_mut::<3>(VELOCITY).fill(0.0);
        self.forget_velocity(settings);
        self.last = None;
    }

    /// Velocity residual of a standing foot: e_v = (rolling) - (velocity relative to the unit) - v, m/s.
    fn velocity_residual(&self, motion: &FootOdometry) -> Vector3<f64> {
        motion.rolling_world - motion.velocity_world - self.vector(VELOCITY)
    }

    /// Corrects with e_v of the feet that are down. Returns the accepted feet; each is compared with the state before the correction.
    ///
    /// The feet measure the same velocity with independent errors, so together they are one measurement: their mean weighted by
    /// 1 / noise^2.
    fn correct_velocity(
        &mut self,
        feet: &PerLeg<FootOdometry>,
        down: &PerLeg<bool>,
        settings: &EstimatorSettings,
    ) -> PerLeg<bool> {
        let with_state = self.covariance.columns(VELOCITY);
        let variance = with_state.fixed_rows::<3>(VELOCITY).into_owned();
        let (mut weight, mut weighted) = (0.0, Vector3::zeros());
        let stands = std::array::from_fn(|leg| {
            let (motion, residual) = (&feet[leg], self.velocity_residual(&feet[leg]));
            // The error of joint velocities grows with the leg's velocity.
            let noise = settings.foot_velocity_m_s + settings.foot_velocity_share * motion.velocity_world.norm();
            let accepted = down[leg]
                && Innovation::new(variance, noise, &residual).is_some_and(|new| new.within(settings.gate_sigma));
            if accepted {
                weight += 1.0 / (noise * noise);
                weighted += residual / (noise * noise);
            }
            accepted
        });
        if weight > 0.0
            && let Some(new) = Innovation::new(variance, weight.sqrt().recip(), &(weighted / weight))
        {
            self.apply(&with_state, &new);
        }
        stands
    }

    /// Corrects with e_p: the foot is at its touchdown position. Returns false for a rejected residual.
    fn correct_position(&mut self, leg: usize, motion: &FootOdometry, settings: &EstimatorSettings) -> bool {
        let residual = motion.offset_world - (self.vector(foot(leg)) - self.vector(POSITION));
        let with_state = self.covariance.columns(foot(leg)) - self.covariance.columns(POSITION);
        let variance = with_state.fixed_rows::<3>(foot(leg)) - with_state.fixed_rows::<3>(POSITION);
        let new = Innovation::new(variance, settings.foot_position_m, &residual);
        let accepted = new.filter(|new| new.within(settings.gate_sigma));
        if let Some(new) = &accepted {
            self.apply(&with_state, new);
        }
        accepted.is_some()
    }

    /// Applies a measurement; `with_state` is P H^T.
    fn apply(&mut self, with_state: &StateColumns, new: &Innovation) {
        // With U = P H^T L^-T: x += U L^-1 e, P -= U U^T.
        let Some(inverse) = new.root.solve_lower_triangular(&Matrix3::identity()) else { return };
        let scaled = with_state * inverse.transpose();
        self.state += scaled * new.whitened;
        self.covariance.subtract_square(&scaled);
    }

    /// Sets the foot's position: p_i = p + offset, with the error of the kinematics.
    fn anchor(&mut self, leg: usize, motion: &FootOdometry, settings: &EstimatorSettings) {
        let place = self.vector(POSITION) + motion.offset_world;
        self.state.fixed_rows_mut::<3>(foot(leg)).copy_from(&place);
        let mut with_state = self.covariance.columns(POSITION);
        let of_position = with_state.fixed_rows::<3>(POSITION).into_owned();
        with_state.fixed_rows_mut::<3>(foot(leg)).copy_from(&of_position);
        self.covariance.set_columns(foot(leg), &with_state);
        self.covariance.add_variance(foot(leg), settings.foot_position_m.powi(2));
        self.anchored[leg] = true;
    }

    /// Drops the position of a foot in the air.
    fn release(&mut self, leg: usize) {
        if self.anchored[leg] {
            self.set_variance(foot(leg), 0.0);
            self.anchored[leg] = false;
        }
    }

    /// Raises the variances after an error of velocity of about `error` (m/s) for as long as all feet were rejected.
    fn raise_velocity_variance(&mut self, error: f64, settings: &EstimatorSettings) {
        // An error e for t seconds is e in the velocity and e t in the position; the feet get new positions after the correction.
        let deviation = error.max(settings.start_velocity_m_s);
        self.add_common(Vector3::repeat(deviation * deviation), self.rejected_s, 1.0);
        (0..LEGS).for_each(|leg| self.release(leg));
        self.rejected_s = 0.0;
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

    /// Sets the variance of three states and makes them independent of all others.
    fn set_variance(&mut self, at: usize, variance: f64) {
        self.covariance.set_columns(at, &StateColumns::zeros());
        self.covariance.add_variance(at, variance);
    }
}

/// Innovation of a measurement of three numbers.
struct Innovation {
    /// L, where L L^T = S = H P H^T + R; the elements above the diagonal are arbitrary.
    root: Matrix3<f64>,
    /// L^-1 e: the residual in standard deviations.
    whitened: Vector3<f64>,
}

impl Innovation {
    /// Innovation of the residual e with independent errors `noise`, where `variance` is H P H^T. None if S is not positive definite.
    fn new(variance: Matrix3<f64>, noise: f64, residual: &Vector3<f64>) -> Option<Innovation> {
        let cholesky = (variance + Matrix3::from_diagonal_element(noise * noise)).cholesky()?;
        let root = *cholesky.l_dirty();
        Some(Innovation { whitened: root.solve_lower_triangular(residual)?, root })
    }

    /// Whether the residual is within `gate_sigma` standard deviations; false for a NaN.
    fn within(&self, gate_sigma: f64) -> bool {
        self.whitened.norm() <= gate_sigma
    }
}
