//! The series of the live view's charts: names and units.

use quadfrog::robot::{JOINTS, Leg};
use strum::{EnumString, IntoStaticStr, VariantArray};

/// One signal over time, in the order of the charts. The names are those of the charts and of `console.toml`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, VariantArray, EnumString, IntoStaticStr)]
#[strum(serialize_all = "lowercase")]
#[expect(missing_docs, reason = "the names say what each is")]
pub enum Series {
    Roll,
    Pitch,
    #[strum(to_string = "FR foot z", serialize = "FR foot")]
    FrFoot,
    #[strum(to_string = "FL foot z", serialize = "FL foot")]
    FlFoot,
    #[strum(to_string = "RR foot z", serialize = "RR foot")]
    RrFoot,
    #[strum(to_string = "RL foot z", serialize = "RL foot")]
    RlFoot,
    Height,
    Oscillator,
    #[strum(serialize = "FR force")]
    FrForce,
    #[strum(serialize = "FL force")]
    FlForce,
    #[strum(serialize = "RR force")]
    RrForce,
    #[strum(serialize = "RL force")]
    RlForce,
    Yaw,
    X,
    Y,
    #[strum(serialize = "x velocity")]
    VelocityX,
    #[strum(serialize = "y velocity")]
    VelocityY,
    #[strum(serialize = "z velocity")]
    VelocityZ,
    #[strum(serialize = "gyro x")]
    GyroX,
    #[strum(serialize = "gyro y")]
    GyroY,
    #[strum(serialize = "gyro z")]
    GyroZ,
    #[strum(serialize = "accelerometer x")]
    AccelerationX,
    #[strum(serialize = "accelerometer y")]
    AccelerationY,
    #[strum(serialize = "accelerometer z")]
    AccelerationZ,
    #[strum(serialize = "FR_hip angle")]
    FrHipAngle,
    #[strum(serialize = "FR_thigh angle")]
    FrThighAngle,
    #[strum(serialize = "FR_calf angle")]
    FrCalfAngle,
    #[strum(serialize = "FL_hip angle")]
    FlHipAngle,
    #[strum(serialize = "FL_thigh angle")]
    FlThighAngle,
    #[strum(serialize = "FL_calf angle")]
    FlCalfAngle,
    #[strum(serialize = "RR_hip angle")]
    RrHipAngle,
    #[strum(serialize = "RR_thigh angle")]
    RrThighAngle,
    #[strum(serialize = "RR_calf angle")]
    RrCalfAngle,
    #[strum(serialize = "RL_hip angle")]
    RlHipAngle,
    #[strum(serialize = "RL_thigh angle")]
    RlThighAngle,
    #[strum(serialize = "RL_calf angle")]
    RlCalfAngle,
    #[strum(serialize = "FR_hip torque")]
    FrHipTorque,
    #[strum(serialize = "FR_thigh torque")]
    FrThighTorque,
    #[strum(serialize = "FR_calf torque")]
    FrCalfTorque,
    #[strum(serialize = "FL_hip torque")]
    FlHipTorque,
    #[strum(serialize = "FL_thigh torque")]
    FlThighTorque,
    #[strum(serialize = "FL_calf torque")]
    FlCalfTorque,
    #[strum(serialize = "RR_hip torque")]
    RrHipTorque,
    #[strum(serialize = "RR_thigh torque")]
    RrThighTorque,
    #[strum(serialize = "RR_calf torque")]
    RrCalfTorque,
    #[strum(serialize = "RL_hip torque")]
    RlHipTorque,
    #[strum(serialize = "RL_thigh torque")]
    RlThighTorque,
    #[strum(serialize = "RL_calf torque")]
    RlCalfTorque,
    #[strum(serialize = "FR_hip speed")]
    FrHipSpeed,
    #[strum(serialize = "FR_thigh speed")]
    FrThighSpeed,
    #[strum(serialize = "FR_calf speed")]
    FrCalfSpeed,
    #[strum(serialize = "FL_hip speed")]
    FlHipSpeed,
    #[strum(serialize = "FL_thigh speed")]
    FlThighSpeed,
    #[strum(serialize = "FL_calf speed")]
    FlCalfSpeed,
    #[strum(serialize = "RR_hip speed")]
    RrHipSpeed,
    #[strum(serialize = "RR_thigh speed")]
    RrThighSpeed,
    #[strum(serialize = "RR_calf speed")]
    RrCalfSpeed,
    #[strum(serialize = "RL_hip speed")]
    RlHipSpeed,
    #[strum(serialize = "RL_thigh speed")]
    RlThighSpeed,
    #[strum(serialize = "RL_calf speed")]
    RlCalfSpeed,
    #[strum(serialize = "FR_hip temperature")]
    FrHipTemperature,
    #[strum(serialize = "FR_thigh temperature")]
    FrThighTemperature,
    #[strum(serialize = "FR_calf temperature")]
    FrCalfTemperature,
    #[strum(serialize = "FL_hip temperature")]
    FlHipTemperature,
    #[strum(serialize = "FL_thigh temperature")]
    FlThighTemperature,
    #[strum(serialize = "FL_calf temperature")]
    FlCalfTemperature,
    #[strum(serialize = "RR_hip temperature")]
    RrHipTemperature,
    #[strum(serialize = "RR_thigh temperature")]
    RrThighTemperature,
    #[strum(serialize = "RR_calf temperature")]
    RrCalfTemperature,
    #[strum(serialize = "RL_hip temperature")]
    RlHipTemperature,
    #[strum(serialize = "RL_thigh temperature")]
    RlThighTemperature,
    #[strum(serialize = "RL_calf temperature")]
    RlCalfTemperature,
}

/// Kind of a series: its unit and its axis. The number is an index of a leg, an axis or a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SeriesKind {
    /// Roll, pitch.
    Tilt(usize),
    /// Height of a foot in its leg frame.
    Foot(usize),
    /// Height of the trunk.
    Height,
    /// Phase of the oscillator.
    Oscillator,
    /// Normal force at a foot.
    Force(usize),
    /// Yaw of the trunk.
    Yaw,
    /// Position of the trunk along x or y.
    Position(usize),
    /// Velocity of the trunk along an axis of the world.
    Velocity(usize),
    /// Angular velocity about an axis of the body.
    Gyro(usize),
    /// Specific force along an axis of the body.
    Acceleration(usize),
    /// Angle of a joint.
    Angle(usize),
    /// Torque of a joint.
    Torque(usize),
    /// Speed of a joint.
    Speed(usize),
    /// Temperature of a motor.
    Temperature(usize),
}

/// A named set of series, which one key shows after the other.
pub const SETS: [&[Series]; 4] = [&Series::ATTITUDE, &Series::FORCES, &Series::MOTION, &Series::TORQUES];

impl Series {
    /// Roll, pitch and the four foot heights, as the paper's figure over rough terrain.
    pub const ATTITUDE: [Series; 6] =
        [Series::Roll, Series::Pitch, Series::FrFoot, Series::FlFoot, Series::RrFoot, Series::RlFoot];
    /// Height of the trunk, phase of the oscillator and the four foot forces.
    pub const FORCES: [Series; 6] =
        [Series::Height, Series::Oscillator, Series::FrForce, Series::FlForce, Series::RrForce, Series::RlForce];
    /// Position, yaw and velocity of the trunk.
    pub const MOTION: [Series; 6] =
        [Series::X, Series::VelocityX, Series::Y, Series::VelocityY, Series::Yaw, Series::VelocityZ];
    /// Torques of all joints, measured and commanded.
    pub const TORQUES: [Series; 12] = [
        Series::FrHipTorque,
        Series::FlHipTorque,
        Series::FrThighTorque,
        Series::FlThighTorque,
        Series::FrCalfTorque,
        Series::FlCalfTorque,
        Series::RrHipTorque,
        Series::RlHipTorque,
        Series::RrThighTorque,
        Series::RlThighTorque,
        Series::RrCalfTorque,
        Series::RlCalfTorque,
    ];

    /// Its name on charts and in `console.toml`.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Its kind, from its place in the list.
    pub const fn kind(self) -> SeriesKind {
        let index = self as usize;
        let joint = index.wrapping_sub(Series::FrHipAngle as usize);
        match self {
            Series::Roll | Series::Pitch => SeriesKind::Tilt(index),
            Series::FrFoot | Series::FlFoot | Series::RrFoot | Series::RlFoot => {
                SeriesKind::Foot(index - Series::FrFoot as usize)
            }
            Series::Height => SeriesKind::Height,
            Series::Oscillator => SeriesKind::Oscillator,
            Series::FrForce | Series::FlForce | Series::RrForce | Series::RlForce => {
                SeriesKind::Force(index - Series::FrForce as usize)
            }
            Series::Yaw => SeriesKind::Yaw,
            Series::X | Series::Y => SeriesKind::Position(index - Series::X as usize),
            Series::VelocityX | Series::VelocityY | Series::VelocityZ => {
                SeriesKind::Velocity(index - Series::VelocityX as usize)
            }
            Series::GyroX | Series::GyroY | Series::GyroZ => SeriesKind::Gyro(index - Series::GyroX as usize),
            Series::AccelerationX | Series::AccelerationY | Series::AccelerationZ => {
                SeriesKind::Acceleration(index - Series::AccelerationX as usize)
            }
            // Four quantities of the joints follow, each in the order of the joints.
            _ => match joint / JOINTS {
                0 => SeriesKind::Angle(joint % JOINTS),
                1 => SeriesKind::Torque(joint % JOINTS),
                2 => SeriesKind::Speed(joint % JOINTS),
                _ => SeriesKind::Temperature(joint % JOINTS),
            },
        }
    }

    /// The foot whose contact indicator stands beside the name.
    pub fn foot(self) -> Option<Leg> {
        match self.kind() {
            SeriesKind::Foot(leg) | SeriesKind::Force(leg) => Some(Leg::ALL[leg]),
            _ => None,
        }
    }

    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self.kind() {
            SeriesKind::Tilt(_) | SeriesKind::Oscillator | SeriesKind::Yaw | SeriesKind::Angle(_) => "rad",
            SeriesKind::Foot(_) | SeriesKind::Height | SeriesKind::Position(_) => "m",
            SeriesKind::Force(_) => "N",
            SeriesKind::Velocity(_) => "m/s",
            SeriesKind::Gyro(_) | SeriesKind::Speed(_) => "rad/s",
            SeriesKind::Acceleration(_) => "m/s2",
            SeriesKind::Torque(_) => "N m",
            SeriesKind::Temperature(_) => "C",
        }
    }

    /// Its content, for the dialog.
    pub const fn help(self) -> &'static str {
        match self.kind() {
            SeriesKind::Foot(_) => "m, in the leg's hip frame",
            SeriesKind::Height => "m, of the trunk over the world's zero",
            SeriesKind::Oscillator => "rad, phase",
            SeriesKind::Force(_) => "N, normal to the foot's sensor",
            SeriesKind::Yaw => "rad, unwrapped",
            SeriesKind::Position(_) => "m, of the trunk, world",
            SeriesKind::Velocity(_) => "m/s, of the trunk, world",
            SeriesKind::Gyro(_) => "rad/s, about the body's axis",
            SeriesKind::Acceleration(_) => "m/s2, along the body's axis, with gravity",
            SeriesKind::Angle(_) => "rad; dotted: as commanded",
            SeriesKind::Torque(_) => "N m, as the motor estimates; dotted: as commanded",
            SeriesKind::Tilt(_) | SeriesKind::Speed(_) | SeriesKind::Temperature(_) => self.unit(),
        }
    }
}
