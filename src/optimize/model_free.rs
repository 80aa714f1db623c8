//! Points that do not depend on results: uniform draws and the Sobol sequence.

use super::ask::{Ask, Candidate, Streams};
use super::mt19937::Mt19937;
use super::sobol::Sobol;
use super::space::Range;

/// Draws every parameter that is not given uniformly.
pub fn random(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let parameters = ask.space.parameters().iter();
    let values = parameters.map(|p| ask.given(p).unwrap_or_else(|| uniform(&p.range, &mut streams.startup)));
    values.collect::<Vec<f64>>().into()
}

/// Returns the next point of the seed's Sobol sequence; takes one double per parameter, none if all are given.
pub fn sobol(ask: &Ask<'_>, streams: &mut Streams) -> Candidate {
    let parameters = ask.space.parameters();
    let mut values: Vec<Option<f64>> = parameters.iter().map(|p| ask.given(p)).collect();
    if values.iter().any(Option::is_none) {
        // The shift is a function of the seed; only the position advances.
        let sequence = Sobol::new(parameters.len(), &mut Mt19937::new(ask.config.seed));
        let index = streams.startup.drawn() / parameters.len() as u64;
        streams.startup.advance_to((index + 1) * parameters.len() as u64);
        for ((value, p), u) in values.iter_mut().zip(parameters).zip(sequence.point(index as u32)) {
            value.get_or_insert_with(|| p.range.unscale(u));
        }
    }
    values.into_iter().flatten().collect::<Vec<f64>>().into()
}

/// One uniform draw over the search coordinate; never the upper bound itself.
pub fn uniform(range: &Range, stream: &mut Mt19937) -> f64 {
    let (a, b) = range.inner_bounds();
    // x = a + (b - a) u
    let x = a + (b - a) * stream.double();
    let x = if range.log { range.outer(x).max(range.low) } else { x };
    x.min(range.high.next_down())
}
