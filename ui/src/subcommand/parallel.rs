//! Work on several threads with results in the order of the items, whatever the number of threads.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::failure::Failure;

/// Runs `run` on every item, on at most `threads` threads with a state of `state` each. The order of the results is that of
/// `items`; items are begun in that order.
///
/// # Errors
/// The failure of a state or an item; the other threads finish the items that they have begun and begin no others.
pub fn in_parallel<I: Sync, S, R: Send>(
    threads: usize,
    items: &[I],
    state: impl Fn() -> Result<S, Failure> + Sync,
    run: impl Fn(&mut S, &I) -> Result<R, Failure> + Sync,
) -> Result<Vec<R>, Failure> {
    let next = AtomicUsize::new(0);
    let work = || -> Result<Vec<(usize, R)>, Failure> {
        let mut state = state()?;
        let mut results = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { return Ok(results) };
            let result = run(&mut state, item).inspect_err(|_| next.store(items.len(), Ordering::Relaxed))?;
            results.push((index, result));
        }
    };
    let parts: Result<Vec<_>, Failure> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.clamp(1, items.len().max(1))).map(|_| scope.spawn(work)).collect();
        workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    let mut results: Vec<(usize, R)> = parts?.into_iter().flatten().collect();
    results.sort_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}
