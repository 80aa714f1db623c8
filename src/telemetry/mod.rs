//! Everything that crosses the real-time boundary. All types are `Copy`: nothing is allocated or freed inside a tick.

mod arming;
mod command;
mod event;
mod fault;
mod landing_terms;
mod mode;
mod tick;

pub use arming::{ArmingCheck, ArmingCheckSet, ArmingCheckState, ArmingFinding, ArmingFindings};
pub use command::{Command, Permit, TrialSpec};
pub use event::{CommandRefusal, Event, Readiness, TrialEnd};
pub(crate) use fault::digits_apart;
pub use fault::{CommanderSign, FailsafeWarning, FallCause, Fault, SensorCheck, TrialInhibit};
pub use landing_terms::{Cutoff, LandingTerms};
pub use mode::{Mode, Phase, TransitionCause};
pub use tick::{Counters, Estimate, RecentLateness, Snapshot, Tick, TickDurations};
