//! Cases of one test on all cores.

use std::convert::Infallible;

use quadfrog::session::parallel::{cores, in_parallel};

/// Runs every case; returns the results in the order of the cases. The first panic is that of the test.
pub fn on_all_cores<C: Sync, R: Send>(cases: &[C], run: impl Fn(&C) -> R + Sync) -> Vec<R> {
    let Ok(results) = in_parallel(cores(), cases, || Ok::<_, Infallible>(()), |(), case| Ok(run(case)));
    results
}
