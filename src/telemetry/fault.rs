//! Faults, falls, warnings and trial inhibits: quantity, measured value and limit. A joint is an index, 0..12.

use nix::errno::Errno;
use strum::{IntoStaticStr, VariantArray};

use crate::robot::joint_name;

/// Cause of a fall.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant, the name of a field holds its unit")]
pub enum FallCause {
    /// Known in simulation only.
    #[error("a part other than the feet touched the ground")]
    BodyContact,
    #[error("roll {}", exceeds(*.measured_rad, *.allowed_rad, "rad", 3))]
    Roll { measured_rad: f64, allowed_rad: f64 },
    #[error("pitch {}", exceeds(*.measured_rad, *.allowed_rad, "rad", 3))]
    Pitch { measured_rad: f64, allowed_rad: f64 },
}

/// Cause of a failsafe or of a fault of the last gate: quantity, joint, measured value, limit.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant, the name of a field holds its unit")]
pub enum Fault {
    #[error("{what} is not a finite number")]
    NotFinite { what: &'static str },
    /// Values that no motion has; the measured one is the last of them.
    #[error(
        "the accelerometer reports impossible values, {measured_m_s2:.1e} m/s^2, limit {allowed_m_s2} m/s^2, in {states} states within 1 s; check the inertial unit"
    )]
    Acceleration { measured_m_s2: f64, allowed_m_s2: f64, states: u32 },
    #[error("{} at {}", joint_name(*.joint as usize), exceeds(*.measured_rad, *.allowed_rad, "rad", 3))]
    JointPosition { joint: u8, measured_rad: f64, allowed_rad: f64 },
    #[error("{} at {}", joint_name(*.joint as usize), exceeds(*.measured_rad_s, *.allowed_rad_s, "rad/s", 1))]
    JointVelocity { joint: u8, measured_rad_s: f64, allowed_rad_s: f64 },
    /// The torque is that which the controller wants.
    #[error("{} wanted a torque of {measured_n_m:.1e} N m, limit {allowed_n_m:.0} N m; check its sensors", joint_name(*.joint as usize))]
    WantedTorque { joint: u8, measured_n_m: f64, allowed_n_m: f64 },
    /// The torque is that which the motor estimates.
    #[error("{} at {}", joint_name(*.joint as usize), exceeds(*.measured_n_m, *.allowed_n_m, "N m", 1))]
    JointTorque { joint: u8, measured_n_m: f64, allowed_n_m: f64 },
    #[error("no state from the robot for {age_ms} ms, limit {allowed_ms} ms")]
    StateAge { age_ms: u32, allowed_ms: u32 },
    #[error("link to the robot lost: no state for {age_ms} ms, limit {allowed_ms} ms")]
    LinkLost { age_ms: u32, allowed_ms: u32 },
    #[error("{count} states with a wrong checksum within 5 s, limit {allowed}")]
    Corrupt { count: u32, allowed: u32 },
    #[error("the robot restarted: its clock went backwards")]
    Reboot,
    #[error("motor {} left servo mode", joint_name(*.joint as usize))]
    MotorMode { joint: u8 },
    #[error("motor {} at {measured_c:.0} degrees Celsius, limit {allowed_c:.0}", joint_name(*.joint as usize))]
    MotorTemperature { joint: u8, measured_c: f64, allowed_c: f64 },
    /// Roll or pitch exceeds the limit of the mode.
    #[error("tilt {}", exceeds(*.measured_rad, *.allowed_rad, "rad", 3))]
    Tilt { measured_rad: f64, allowed_rad: f64 },
    #[error("control thread late: {}", exceeds(*.measured_ms, *.allowed_ms, "ms", 1))]
    Late { measured_ms: f64, allowed_ms: f64 },
    /// The measured period is the last one.
    #[error("{ticks} control periods in a row too long: {}", exceeds(*.measured_ms, *.allowed_ms, "ms", 1))]
    Slow { ticks: u32, measured_ms: f64, allowed_ms: f64 },
    /// Standing up or sitting down; the error is the largest of a joint.
    #[error("pose not reached in time: joint error {error_rad:.3} rad")]
    PoseTimeout { error_rad: f64 },
    #[error("operator lost: no heartbeat of the operator's console for {silent_ms} ms")]
    OperatorLost { silent_ms: u32 },
    #[error("the session ended: the program was quit or its terminal was lost")]
    OperatorLeft,
    #[error("{}", not_sent(*.errno))]
    Send { errno: i32 },
    /// The ring of events is full or abandoned.
    #[error("the session does not take events")]
    EventsLost,
    #[error("sensor check \"{}\" failed: {}; check {}", .check.name(), exceeds(*.measured, *.allowed, .check.unit(), .check.digits()), .check.suspect())]
    Sensors { check: SensorCheck, measured: f64, allowed: f64 },
    #[error(
        "the robot's clock is off by {measured_ms:.0} ms against this computer's, limit {allowed_ms:.0} ms: one of them stepped or stood still"
    )]
    RobotClock { measured_ms: f64, allowed_ms: f64 },
    /// Or the cable is bad; the sign is the same.
    #[error("another program commands the robot: {}; end it, then check the cable", .sign.words(*.measured, *.allowed))]
    OtherCommander { sign: CommanderSign, measured: f64, allowed: f64 },
    #[error("stop buttons of the remote control pressed")]
    RemoteStop,
    #[error(
        "the remote control does not answer for {silent_ms} ms, limit {allowed_ms} ms: nobody beside the robot can stop it"
    )]
    RemoteSilent { silent_ms: u32, allowed_ms: u32 },
    /// Time is that by which CLOCK_BOOTTIME ran ahead of CLOCK_MONOTONIC.
    #[error("the computer was suspended for {suspended_ms} ms, limit {allowed_ms} ms")]
    Suspended { suspended_ms: u32, allowed_ms: u32 },
    /// The time is `u32::MAX` when the guard process has ended.
    #[error("{}", guard_silent(*.silent_ms, *.allowed_ms))]
    GuardSilent { silent_ms: u32, allowed_ms: u32 },
    /// Growth of local time minus robot time above its least value.
    #[error("the link's delay grew: {}", exceeds(*.measured_ms, *.allowed_ms, "ms", 1))]
    LinkDelay { measured_ms: f64, allowed_ms: f64 },
    /// Standing up or sitting down.
    #[error("{} blocked: distance from its target {}", joint_name(*.joint as usize), exceeds(*.measured_rad, *.allowed_rad, "rad", 3))]
    FollowingError { joint: u8, measured_rad: f64, allowed_rad: f64 },
    /// Standing up or sitting down: torque that the ramp demands.
    #[error("{} blocked: demanded torque {}", joint_name(*.joint as usize), exceeds(*.measured_n_m, *.allowed_n_m, "N m", 1))]
    RampTorque { joint: u8, measured_n_m: f64, allowed_n_m: f64 },
}

/// A check of sensors against each other while the robot is commanded. The order is the order of the checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, VariantArray, IntoStaticStr)]
#[expect(missing_docs, reason = "`control::consistency` describes each check")]
pub enum SensorCheck {
    #[strum(serialize = "inertial unit live")]
    InertialUnitLive,
    #[strum(serialize = "magnitude of gravity")]
    GravityMagnitude,
    #[strum(serialize = "orientation against gyroscope and gravity")]
    Orientation,
    #[strum(serialize = "turn against gyroscope")]
    TurnRate,
    #[strum(serialize = "feet carry the weight")]
    FeetLoaded,
    #[strum(serialize = "no foot down in free fall")]
    FeetInFreeFall,
    #[strum(serialize = "feet down after landing")]
    FeetAfterLanding,
    #[strum(serialize = "joint velocity")]
    JointVelocity,
    #[strum(serialize = "motors live")]
    MotorsLive,
}

impl SensorCheck {
    /// All values in order.
    pub const ALL: &'static [SensorCheck] = Self::VARIANTS;

    /// Name on screens and in files.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Unit of the measured value.
    pub const fn unit(self) -> &'static str {
        match self {
            SensorCheck::InertialUnitLive | SensorCheck::MotorsLive => "repeated states",
            SensorCheck::GravityMagnitude => "m/s^2",
            SensorCheck::Orientation | SensorCheck::TurnRate | SensorCheck::JointVelocity => "rad",
            SensorCheck::FeetLoaded | SensorCheck::FeetInFreeFall | SensorCheck::FeetAfterLanding => "s",
        }
    }

    /// Decimals of the measured value.
    const fn digits(self) -> usize {
        if matches!(self, SensorCheck::InertialUnitLive | SensorCheck::MotorsLive) { 0 } else { 3 }
    }

    /// The sensors to check.
    const fn suspect(self) -> &'static str {
        match self {
            SensorCheck::InertialUnitLive
            | SensorCheck::GravityMagnitude
            | SensorCheck::Orientation
            | SensorCheck::TurnRate => "the inertial unit and its axes",
            SensorCheck::FeetLoaded | SensorCheck::FeetInFreeFall | SensorCheck::FeetAfterLanding => {
                "the foot sensors and foot_force_n"
            }
            SensorCheck::JointVelocity => "the joint's encoder",
            SensorCheck::MotorsLive => "the legs' cables and motor boards",
        }
    }
}

/// A sign that another program commands the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CommanderSign {
    /// No motor is in servo mode, which every command requests.
    ForeignMode,
    /// States are lost, percent: the robot sends them to another program.
    LostStates,
    /// A motor reports another torque than that of the command, N m.
    ForeignTorque,
    /// Commands of another program on the robot's topic.
    ForeignCommands,
}

impl CommanderSign {
    fn words(self, measured: f64, allowed: f64) -> String {
        match self {
            CommanderSign::ForeignMode => "no motor is in servo mode".to_owned(),
            CommanderSign::LostStates => format!("{measured:.1} % of the states lost in 1 s, limit {allowed:.1} %"),
            CommanderSign::ForeignCommands => format!("{measured:.0} commands of another program, limit {allowed:.0}"),
            CommanderSign::ForeignTorque => {
                format!("a torque differs from the command by {measured:.1} N m, limit {allowed:.1} N m")
            }
        }
    }
}

impl Fault {
    /// Whether the fault voids the operator's confirmations: the robot may have restarted, which ends low-level mode, or a person
    /// may have been at it. Such a fault is reported also when another one is latched.
    pub fn voids_confirmations(&self) -> bool {
        matches!(
            self,
            Fault::Reboot
                | Fault::LinkLost { .. }
                | Fault::MotorMode { .. }
                | Fault::RobotClock { .. }
                | Fault::OtherCommander { .. }
                | Fault::Suspended { .. }
        )
    }
}

fn not_sent(errno: i32) -> String {
    let cause = Errno::from_raw(errno).desc();
    format!("the command could not be sent: {cause} (error {errno}); check the cable and this computer's network")
}

fn guard_silent(silent_ms: u32, allowed_ms: u32) -> String {
    match silent_ms {
        u32::MAX => "the guard process has ended: nothing damps the robot if quadfrog is killed".to_owned(),
        _ => format!("the guard process does not answer for {silent_ms} ms, limit {allowed_ms} ms"),
    }
}

/// "1.004 rad exceeds 1.000 rad": at least `digits` decimals, more where both numbers would print alike.
fn exceeds(measured: f64, limit: f64, unit: &str, digits: usize) -> String {
    let digits = digits_apart(measured, limit, digits);
    format!("{measured:.digits$} {unit} exceeds {limit:.digits$} {unit}")
}

/// Least number of decimals, from `digits` on, at which both numbers print differently.
pub(crate) fn digits_apart(measured: f64, limit: f64, digits: usize) -> usize {
    let alike = |digits: &usize| format!("{:.digits$}", measured.abs()) == format!("{:.digits$}", limit.abs());
    (digits..9).find(|digits| !alike(digits)).unwrap_or(digits)
}

/// Reason to refuse the next trial; a running one finishes.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant, the name of a field holds its unit")]
pub enum TrialInhibit {
    #[error("battery at {}; charge or change it", needs(*.measured_percent, *.allowed_percent, "%", 0))]
    BatteryLow { measured_percent: f64, allowed_percent: f64 },
    #[error("the battery does not report a charge from 0 to 100 %; sit down and check it")]
    BatteryUnreported,
    #[error("motor {} at {measured_c:.0} degrees Celsius, a jump needs less than {allowed_c:.0}; sit down and wait", joint_name(*.joint as usize))]
    MotorWarm { joint: u8, measured_c: f64, allowed_c: f64 },
    #[error("motor {} reports {measured_c:.0} degrees Celsius, no measurement below {allowed_c:.0}; sit down and restart the robot", joint_name(*.joint as usize))]
    MotorUnmeasured { joint: u8, measured_c: f64, allowed_c: f64 },
    #[error("the remote control does not answer, a jump needs it; switch it on and bring it in reach")]
    RemoteSilent,
    #[error("{down} of 4 feet on the ground, a jump needs all; check stance and foot sensors")]
    FeetUp { down: u8 },
    #[error(
        "foot forces add up to {measured_n:.0} N, a jump needs {least_n:.0} to {most_n:.0} N; check the foot sensors and their scale"
    )]
    FootForces { measured_n: f64, least_n: f64, most_n: f64 },
    /// The larger of roll and pitch.
    #[error("tilt {}; put the robot on level ground", at_most(*.measured_rad, *.allowed_rad, "rad", 3))]
    NotLevel { measured_rad: f64, allowed_rad: f64 },
    #[error("{} off its stance by {}; sit down and stand up again", joint_name(*.joint as usize), at_most(*.measured_rad, *.allowed_rad, "rad", 3))]
    NotAtStance { joint: u8, measured_rad: f64, allowed_rad: f64 },
    #[error("all feet down and the trunk at rest for {}; wait", needs(*.measured_s, *.needed_s, "s", 1))]
    NotQuiet { measured_s: f64, needed_s: f64 },
    #[error(
        "a state was {age_ms} ms old within the last second, a jump needs at most {allowed_ms} ms; check the cable"
    )]
    StatesOld { age_ms: u32, allowed_ms: u32 },
    #[error("states of the last second lost: {}; check the cable", at_most(100.0 * .measured_share, 100.0 * .allowed_share, "%", 1))]
    StatesLost { measured_share: f64, allowed_share: f64 },
    #[error("control ticks of the last second late: {}; end other programs", at_most(100.0 * .measured_share, 100.0 * .allowed_share, "%", 1))]
    TicksLate { measured_share: f64, allowed_share: f64 },
    #[error("the link's delay grew by {}; check the cable", at_most(*.measured_ms, *.allowed_ms, "ms", 1))]
    LinkDelay { measured_ms: f64, allowed_ms: f64 },
}

/// "0.120 rad, a jump needs at most 0.100 rad": more decimals where both numbers would print alike.
fn at_most(measured: f64, limit: f64, unit: &str, digits: usize) -> String {
    needed("at most ", measured, limit, unit, digits)
}

/// "0.28 s, a jump needs 0.30 s", as [`at_most`].
fn needs(measured: f64, limit: f64, unit: &str, digits: usize) -> String {
    needed("", measured, limit, unit, digits)
}

fn needed(bound: &str, measured: f64, limit: f64, unit: &str, digits: usize) -> String {
    let digits = digits_apart(measured, limit, digits);
    format!("{measured:.digits$} {unit}, a jump needs {bound}{limit:.digits$} {unit}")
}

/// Warning before a failsafe trips.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the message describes a variant, the name of a field holds its unit")]
pub enum FailsafeWarning {
    #[error("no state from the robot for {age_ms} ms, usually at most {allowed_ms} ms")]
    StateAge { age_ms: u32, allowed_ms: u32 },
    #[error("no heartbeat of the operator's console for {silent_ms} ms, usually at most {allowed_ms} ms")]
    OperatorQuiet { silent_ms: u32, allowed_ms: u32 },
    #[error("the link's delay grew by {measured_ms:.1} ms, usually at most {allowed_ms} ms")]
    LinkDelay { measured_ms: f64, allowed_ms: f64 },
    #[error("{:.1} % of the states of the last second lost, usually at most {} %", 100.0 * .measured_share, 100.0 * .allowed_share)]
    StatesLost { measured_share: f64, allowed_share: f64 },
    #[error("the robot lands before it is damped: {0}")]
    Landing(Fault),
}
