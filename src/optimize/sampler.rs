//! Dispatch to the sampler of the configuration.

use super::ask::{Ask, Candidate, SamplerKind, Streams};
use super::{gp, model_free, tpe};

/// Proposes the next point. A function of its arguments alone; advances `streams`.
pub fn propose(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    match ask.config.kind {
        SamplerKind::Tpe => tpe::propose(ask, streams),
        SamplerKind::Gp => gp::propose(ask, streams),
        SamplerKind::Random => model_free::random(ask, streams),
        SamplerKind::Sobol => model_free::sobol(ask, streams),
    }
}
