//! A landing with a fault, after which the robot is damped.

use super::ramp::PoseRamp;
use crate::telemetry::Fault;

/// A landing with a fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultLanding {
    /// The fault that is latched after the landing.
    pub fault: Fault,
    /// Targets of the motors; none while the controller lands the robot.
    pub hold: Option<PoseRamp>,
    /// Ticks since the fault, or since the motors hold the stance.
    pub ticks: u32,
}
