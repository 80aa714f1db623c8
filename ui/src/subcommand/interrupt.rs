//! Ctrl-C, SIGTERM and the loss of the terminal in a command without a screen: the process ends at once, and neither the lock of a
//! journal, nor an unfinished file, nor a program that it has started stays. A command may do more at the first signal.

use std::future::poll_fn;
use std::io::{self, Read};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::channel;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::Duration;

use nix::sys::signal::Signal;
use quadfrog::optimize::journal::stop_locking;
use quadfrog::unfinished::remove_unfinished;
use tokio::runtime::{Builder, Runtime};
use tokio::signal::unix::{Signal as SignalStream, SignalKind, signal};

/// Signals that end a command.
const ENDING: [Signal; 3] = [Signal::SIGINT, Signal::SIGTERM, Signal::SIGHUP];

/// Longest wait for a write to a journal: one on a slow disk takes a tenth of it.
const LONGEST_WRITE: Duration = Duration::from_secs(1);

/// Course of a command after its first signal.
pub enum AfterSignal {
    /// The process ends now.
    End,
    /// The command ends by itself, soon; the next signal ends the process now.
    Finish,
}

type FirstSignal = Box<dyn FnOnce(Signal) -> AfterSignal + Send>;

static FIRST_SIGNAL: Mutex<Option<FirstSignal>> = Mutex::new(None);

/// Runs `act` at the first signal, on the thread of the signals.
pub fn at_first_signal(act: impl FnOnce(Signal) -> AfterSignal + Send + 'static) {
    *locked(&FIRST_SIGNAL) = Some(Box::new(act));
}

/// Lets a signal end the process in order. Where the system grants no thread, it ends the process as SIGKILL does.
pub fn handle_signals() {
    let act = |received| {
        let first = locked(&FIRST_SIGNAL).take();
        if !matches!(first.map(|act| act(received)), Some(AfterSignal::Finish)) {
            end(received);
        }
    };
    let _ = on_signal(act);
}

/// Calls `act`, on a thread of its own, for each signal that would end the process; none of them does from now on. A signal that is
/// ignored, as SIGHUP under `nohup` and SIGINT in the background of a script, stays ignored.
///
/// # Errors
/// When the system refuses the thread or the registration; signals then act as before.
pub fn on_signal(mut act: impl FnMut(Signal) + Send + 'static) -> io::Result<()> {
    let (registering, registered) = channel();
    let wait = move || {
        let (runtime, mut streams) = match register() {
            Ok(both) => both,
            Err(error) => return registering.send(Err(error)).unwrap_or(()),
        };
        drop(registering);
        loop {
            act(runtime.block_on(next(&mut streams)));
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(wait)?;
    // Without a message when the sender is dropped: the signals are registered.
    registered.recv().unwrap_or(Ok(()))
}

type Streams = Vec<(Signal, SignalStream)>;

fn register() -> io::Result<(Runtime, Streams)> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    let ignored = ignored_signals();
    let streams = {
        let _context = runtime.enter();
        let handled = ENDING.into_iter().filter(|ending| ignored & mask(*ending) == 0);
        let register = |ending| signal(SignalKind::from_raw(ending as i32)).map(|stream| (ending, stream));
        handled.map(register).collect::<io::Result<Streams>>()?
    };
    Ok((runtime, streams))
}

fn mask(signal: Signal) -> u64 {
    1 << (signal as i32 - 1)
}

/// Returns the signals that this process ignores (proc_pid_status(5), `SigIgn`).
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

async fn next(streams: &mut Streams) -> Signal {
    poll_fn(|context| {
        let mut streams = streams.iter_mut();
        let received = streams.find_map(|(signal, stream)| stream.poll_recv(context).is_ready().then_some(*signal));
        received.map_or(Poll::Pending, Poll::Ready)
    })
    .await
}

/// Ends the process in order.
fn end(signal: Signal) -> ! {
    // All three are held until the end: meanwhile no result of the program is taken, no lock acquired and no file begun.
    let mut child = locked(&CHILD);
    if let Some(child) = &mut *child {
        // One that has ended by itself needs no signal.
        let _ = child.kill();
        let _ = child.wait();
    }
    let _locking = stop_locking(LONGEST_WRITE);
    let _files = remove_unfinished();
    std::process::exit(exit_status(signal).into())
}

/// Returns the exit status of a program that a signal has ended.
pub fn exit_status(signal: Signal) -> u8 {
    128 + signal as u8
}

/// The program that runs for this command.
static CHILD: Mutex<Option<Child>> = Mutex::new(None);

/// Runs a program and returns its output, as [`Command::output`]; one at a time. A signal that ends this process ends it, too.
pub fn output_of(command: &mut Command) -> io::Result<Output> {
    let (stdout, stderr) = {
        let mut running = locked(&CHILD);
        let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        let child = running.insert(child);
        (child.stdout.take(), child.stderr.take())
    };
    // Both at the same time: a program waits while one of them is full.
    let errors = std::thread::Builder::new().spawn(move || read_all(stderr))?;
    let stdout = read_all(stdout);
    let stderr = errors.join().unwrap_or_else(|_| Err(io::Error::other("its messages could not be read")));
    let child = locked(&CHILD).take();
    let status = child.ok_or_else(|| io::Error::other("it was ended")).and_then(|mut child| child.wait())?;
    Ok(Output { status, stdout: stdout?, stderr: stderr? })
}

fn read_all(stream: Option<impl Read>) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    stream.map_or(Ok(0), |mut stream| stream.read_to_end(&mut bytes))?;
    Ok(bytes)
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
