//! The drawing of each series: its value in a sample, its ranges, its limits, its colour.

use quadfrog::robot::{JOINTS, LEGS, Leg};
use quadfrog::trial::Backend;

use crate::model::Model;
use crate::model::history::ChartSample;
use crate::series::{Series, SeriesKind};
use crate::theme::Role;

/// Drawing of a series.
#[derive(Clone, Copy)]
pub struct SeriesStyle {
    pub series: Series,
    /// Quantity that it shows; read for every sample.
    pub kind: SeriesKind,
    /// Ranges, narrowest first; the first one that holds the window's values is drawn.
    pub ranges: &'static [(f32, f32)],
    pub role: Role,
    /// The foot whose contact indicator stands beside the name.
    pub foot: Option<Leg>,
    /// Whether the robot is simulated: it is placed for its trial.
    pub simulated: bool,
    /// Lower and upper limit; no number where there is none.
    pub limits: [f32; 2],
}

impl SeriesStyle {
    /// Its value in a sample; no number while the robot sends no states.
    pub fn value(&self, sample: &ChartSample) -> f32 {
        if !sample.heard {
            return f32::NAN;
        }
        let joints = &sample.joints;
        match self.kind {
            SeriesKind::Tilt(axis) => [sample.roll, sample.pitch][axis],
            SeriesKind::Foot(leg) => sample.foot_z[leg],
            SeriesKind::Height => sample.height,
            SeriesKind::Oscillator => sample.theta,
            SeriesKind::Force(leg) => sample.foot_force[leg],
            SeriesKind::Yaw => sample.yaw,
            SeriesKind::Position(axis) => sample.position_world[axis],
            SeriesKind::Velocity(axis) => sample.velocity_world[axis],
            SeriesKind::Gyro(axis) => sample.gyro_body[axis],
            SeriesKind::Acceleration(axis) => sample.accel_body[axis],
            SeriesKind::Angle(joint) => joints.angle[joint],
            SeriesKind::Torque(joint) => joints.torque[joint],
            SeriesKind::Speed(joint) => joints.speed[joint],
            SeriesKind::Temperature(joint) => joints.temperature[joint],
        }
    }

    /// The largest difference of two samples that a line joins: half a turn of an angle that jumps by a whole turn.
    pub fn largest_step(&self) -> f32 {
        match self.kind {
            SeriesKind::Tilt(_) => std::f32::consts::PI,
            _ => f32::INFINITY,
        }
    }

    /// The contact of its foot in a sample; none for a series without a foot, of a silent robot, and while a simulated one is placed.
    pub fn contact(&self, sample: &ChartSample) -> Option<bool> {
        let known = sample.heard && !(self.simulated && sample.is_before_footing());
        self.foot.filter(|_| known).map(|leg| sample.contact[leg as usize])
    }

    /// The command for its value in a sample, no number while the robot sends no states; none for a series that is not commanded.
    pub fn commanded(&self, sample: &ChartSample) -> Option<f32> {
        let commanded = match self.kind {
            SeriesKind::Angle(joint) => sample.joints.commanded_angle[joint],
            SeriesKind::Torque(joint) => sample.joints.commanded_torque[joint],
            _ => return None,
        };
        Some(if sample.heard { commanded } else { f32::NAN })
    }
}

const TILT: &[(f32, f32)] = &[(-0.25, 0.25), (-0.5, 0.5), (-1.0, 1.0), (-1.5, 1.5), (-2.0, 2.0), (-3.2, 3.2)];
const FOOT: &[(f32, f32)] = &[(-0.35, -0.05), (-0.45, 0.05)];
const FORCE: &[(f32, f32)] = &[(0.0, 100.0), (0.0, 400.0), (0.0, 1000.0)];
const HEIGHT: &[(f32, f32)] = &[(0.0, 0.5), (0.0, 1.0), (0.0, 2.0)];
const TURN: &[(f32, f32)] = &[(0.0, 6.3)];
const YAW: &[(f32, f32)] =
    &[(-0.25, 0.25), (-1.0, 1.0), (-0.5, 4.0), (-4.0, 0.5), (-4.0, 4.0), (-1.0, 7.0), (-7.0, 1.0), (-13.0, 13.0)];
const POSITION: &[(f32, f32)] = &[(-0.5, 0.5), (-1.0, 1.0), (-2.0, 2.0), (-5.0, 5.0), (-20.0, 20.0)];
const VELOCITY: &[(f32, f32)] = &[(-1.0, 1.0), (-2.0, 2.0), (-5.0, 5.0)];
const GYRO: &[(f32, f32)] = &[(-1.0, 1.0), (-5.0, 5.0), (-20.0, 20.0)];
const ACCELERATION: &[(f32, f32)] = &[(-12.0, 12.0), (-50.0, 50.0), (-200.0, 200.0)];
const ANGLE: &[(f32, f32)] = &[(-1.0, 1.0), (0.0, 2.0), (-3.0, 0.0), (-3.2, 3.2), (-5.0, 5.0)];
const TORQUE: &[(f32, f32)] = &[(-10.0, 10.0), (-30.0, 30.0), (-60.0, 60.0)];
const SPEED: &[(f32, f32)] = &[(-5.0, 5.0), (-20.0, 20.0), (-60.0, 60.0)];
const TEMPERATURE: &[(f32, f32)] = &[(20.0, 80.0), (0.0, 120.0)];

pub fn style(series: Series, model: &Model) -> SeriesStyle {
    let kind = series.kind();
    let (ranges, role) = match kind {
        SeriesKind::Tilt(axis) => (TILT, [Role::SeriesA, Role::SeriesB][axis]),
        SeriesKind::Foot(leg) => (FOOT, role_of(leg)),
        SeriesKind::Height => (HEIGHT, Role::SeriesA),
        SeriesKind::Oscillator => (TURN, Role::SeriesB),
        SeriesKind::Force(leg) => (FORCE, role_of(leg)),
        SeriesKind::Yaw => (YAW, Role::SeriesB),
        SeriesKind::Position(_) => (POSITION, Role::SeriesA),
        SeriesKind::Velocity(_) => (VELOCITY, Role::SeriesB),
        SeriesKind::Gyro(_) => (GYRO, Role::SeriesA),
        SeriesKind::Acceleration(_) => (ACCELERATION, Role::SeriesB),
        SeriesKind::Angle(joint) => (ANGLE, role_of_joint(joint)),
        SeriesKind::Torque(joint) => (TORQUE, role_of_joint(joint)),
        SeriesKind::Speed(joint) => (SPEED, role_of_joint(joint)),
        SeriesKind::Temperature(joint) => (TEMPERATURE, role_of_joint(joint)),
    };
    let simulated = model.session.info.backend == Some(Backend::Simulator);
    let limits = limits(kind, model).unwrap_or([f32::NAN; 2]);
    SeriesStyle { series, kind, ranges, role, foot: series.foot(), simulated, limits }
}

/// The limits of a series, as far as they are known: of the fall detector, of the joints, and the motors' temperature that is
/// no longer good.
fn limits(kind: SeriesKind, model: &Model) -> Option<[f32; 2]> {
    let joints = || Some(&model.robot.as_ref()?.limits);
    let both = |limit: f64| [-limit as f32, limit as f32];
    match kind {
        SeriesKind::Tilt(axis) => Some(both(model.fall_tilt_rad?[axis])),
        SeriesKind::Angle(joint) => {
            let limits = joints()?;
            Some([limits.min_position[joint] as f32, limits.max_position[joint] as f32])
        }
        SeriesKind::Torque(joint) => Some(both(joints()?.max_torque[joint])),
        SeriesKind::Speed(joint) => Some(both(joints()?.max_velocity[joint])),
        SeriesKind::Temperature(_) => Some([f32::NAN, model.session.info.limits.motor_c as f32]),
        _ => None,
    }
}

const fn role_of(leg: usize) -> Role {
    if leg < LEGS / 2 { Role::SeriesA } else { Role::SeriesB }
}

const fn role_of_joint(joint: usize) -> Role {
    role_of(joint / (JOINTS / LEGS))
}
