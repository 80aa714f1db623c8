//! Joint stops and dry joint friction as rows of the constraint solver.

use super::contact::ContactSolver;
use super::motion::StepContext;
use crate::robot::description::JointLimits;
use crate::robot::{JOINTS, Joints};

/// A stop gets a constraint row if the joint would be nearer than this at the end of the step, rad.
const MARGIN_RAD: f64 = 2e-3;
/// Largest velocity with which a joint returns that was set beyond its stop. Landings at 4 m/s are 0.003 rad beyond: 1.2 rad/s.
const FASTEST_RECOVERY_RAD_S: f64 = 5.0;

/// Adds the stops at the joint angles of `limits` and dry friction (bounds, N m) to `solver`.
pub(super) fn add_joint_constraints(
    solver: &mut ContactSolver,
    step: &StepContext,
    limits: &JointLimits,
    dry_friction: &Joints,
) {
    let h = step.h;
    let position = &step.state.joint_position;
    for joint in 0..JOINTS {
        let free = step.free_velocity.legs[joint / 3][joint % 3];
        let gaps =
            [(1.0, position[joint] - limits.min_position[joint]), (-1.0, limits.max_position[joint] - position[joint])];
        for (sign, gap) in gaps {
            // gap + h v >= 0
            if gap + h * sign * free < MARGIN_RAD {
                let rhs = sign * free + solver.gap_velocity(gap, FASTEST_RECOVERY_RAD_S, h);
                solver.add_joint_stop(step, joint, sign, rhs);
            }
        }
        if dry_friction[joint] > 0.0 {
            solver.add_joint_friction(step, joint, free, dry_friction[joint] * h);
        }
    }
}
