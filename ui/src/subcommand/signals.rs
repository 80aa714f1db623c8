//! Signals that would end the program, for a command that has something to do before.

use anyhow::anyhow;
use nix::sys::signal::Signal;
use tokio::signal::unix::{SignalKind, signal};

use super::failure::Failure;

/// Exit status of a program that a signal ended, less the signal's number.
const BY_SIGNAL: i32 = 128;

/// Calls `act` in a thread of its own for each Ctrl-C, SIGTERM and loss of the terminal; none of them ends the program from now on.
///
/// # Errors
/// When the system refuses the registration or the thread.
pub fn on_signal(mut act: impl FnMut(Signal) + Send + 'static) -> Result<(), Failure> {
    let failed = |error: std::io::Error| Failure::Other(anyhow!("signals cannot be received: {error}"));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let register = |kind| {
        let _context = runtime.enter();
        signal(kind).map_err(failed)
    };
    let (mut interrupt, mut terminate, mut hang_up) =
        (register(SignalKind::interrupt())?, register(SignalKind::terminate())?, register(SignalKind::hangup())?);
    let wait = move || {
        loop {
            act(runtime.block_on(async {
                tokio::select! {
                    _ = interrupt.recv() => Signal::SIGINT,
                    _ = terminate.recv() => Signal::SIGTERM,
                    _ = hang_up.recv() => Signal::SIGHUP,
                }
            }));
        }
    };
    std::thread::Builder::new().name("interrupt".to_owned()).spawn(wait).map_err(failed)?;
    Ok(())
}

/// Ends the process as the signal would have.
pub fn exit_by(signal: Signal) -> ! {
    std::process::exit(BY_SIGNAL + signal as i32)
}
