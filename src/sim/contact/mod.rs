//! Rigid unilateral contacts with Coulomb friction, also on loose blocks, joint stops and dry joint friction, all solved together.
//!
//! The unknowns are the impulses p of one step, each in its friction cone K: |p_t| <= mu p_n. The cone is exact, not a
//! pyramid. Two laws select the impulse of the cone (`contact.law`):
//!
//! - **Coulomb**: gap after the step >= 0, p_n >= 0, one of them zero (Signorini); a sliding point slides against p_t
//!   with |p_t| = mu p_n and stays on the ground.
//! - **Convex**, as in MuJoCo: v' - k v in the dual cone K* and orthogonal to p, which makes all contacts one convex
//!   problem (Anitescu, "Optimization-based simulation of nonsmooth rigid multibody dynamics", Math. Program. 105,
//!   2006; Todorov, "Convex and analytically-invertible dynamics with contacts and constraints", ICRA 2014). k = exp(-h
//!   / slip_time) is the share of a slip velocity that a step keeps. The price is dilatancy: a sliding point also
//!   rises, so fast sliding feet hop. Normal contact is rigid here; in MuJoCo it is soft. Two kinds of points have no impulse,
//!   although the problem has one for them: those that the ground does not have to stop (v_n >= 0 without it), which sliding
//!   alone would push off, also before they touch; and those that a pull alone would make stick, while A + s D of [`law`] is
//!   positive definite. Feet that slide fast sink by up to 1 mm there (mu = 2; 0.3 mm with 0.6). With the impulse for the
//!   second kind `golden_jumps` agrees less with MuJoCo (yaw of twists with the added terms 5.9 % in place of 1.1 %, take-off
//!   2.5 ms in place of 1.5 ms), with that for both kinds much less (take-off 9.5 ms): rigid feet are then held at take-off.
//!
//! [`solver`] sweeps over the contacts (Gauss-Seidel) and solves each exactly with the others fixed: Hwangbo, Lee,
//! Hutter, "Per-contact iteration method for solving contact dynamics", IEEE RA-L 3(2), 2018. That paper bisects for
//! the impulse of most dissipation; [`law`] solves the contact law itself, reduced to one scalar equation as in
//! Bonnefon and Daviet, "Quartic formulation of Coulomb 3D frictional contact", INRIA RT-0400, 2011.
//! Before each sweep the rows of a leg that stick, contact and dry friction, are solved at once (block Gauss-Seidel).
//!
//! With the factors of [`super::dynamics`] the Delassus matrix is J M^-1 J^T = W W^T + (within a leg) U U^T with W =
//! (J_0 - J_l G_l) L^-T and U = J_l C_l^-T. The sweep keeps the sums y_0 = sum W^T p and y_l = sum U^T p, so the cost
//! of one visit does not depend on the number of contacts.

mod constraint;
mod law;
mod preparation;
mod solver;
mod sticking_leg;

pub(super) use preparation::{ContactCandidate, SPEED_MARGIN};
pub(super) use solver::ContactSolver;
