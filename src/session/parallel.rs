//! Work on several threads with results in the order of the items, whatever the number of threads.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::Builder;

/// Returns the number of cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Runs `run` on every item, on at most `threads` threads with a state of `state` each: on those that the system gives, on the calling
/// thread if it gives none. The order of the results is that of `items`; items are begun in that order.
///
/// # Errors
/// The error of a state or an item; the other threads finish the items that they have begun and begin no others.
pub fn in_parallel<I: Sync, S, R: Send, E: Send>(
    threads: usize,
    items: &[I],
    state: impl Fn() -> Result<S, E> + Sync,
    run: impl Fn(&mut S, &I) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let next = AtomicUsize::new(0);
    let work = || -> Result<Vec<(usize, R)>, E> {
        let mut state = state()?;
        let mut results = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { return Ok(results) };
            let result = run(&mut state, item).inspect_err(|_| next.store(items.len(), Ordering::Relaxed))?;
            results.push((index, result));
        }
    };
    let parts: Result<Vec<_>, E> = std::thread::scope(|scope| {
        let started =
            (0..threads.clamp(1, items.len().max(1))).map_while(|_| Builder::new().spawn_scoped(scope, work).ok());
        let workers: Vec<_> = started.collect();
        let alone = workers.is_empty().then(work);
        let joined = workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| resume_unwind(panic)));
        joined.chain(alone).collect()
    });
    let mut results: Vec<(usize, R)> = parts?.into_iter().flatten().collect();
    results.sort_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}
