//! What a control thread asks of the operating system: a real-time priority, locked memory, a core of its own, no deep
//! sleep of the processor. Each is tried by itself, and what is not granted is a value that says how to get it: a thread
//! without them still runs, only later now and then.

use std::fs::File;
use std::io::Write;

use nix::sched::{CpuSet, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::unistd::Pid;

use super::system;

/// What is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Scheduling {
    /// Priority under SCHED_FIFO, 1 to 99; 0 stays an ordinary thread, and asks for nothing else either.
    pub priority: u8,
    /// The core to stay on; none leaves the choice to the system, unless a core is isolated for such a thread.
    pub core: Option<usize>,
    /// Whether the program's memory is locked: no page of it is ever fetched from a disk.
    pub lock_memory: bool,
}

/// One of the things asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RealtimeSetting {
    /// SCHED_FIFO at this priority.
    Priority(u8),
    /// The program's memory is locked.
    LockedMemory,
    /// The thread stays on this core.
    Core(usize),
    /// The processor does not sleep deeply while the thread lives.
    Awake,
}

impl std::fmt::Display for RealtimeSetting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RealtimeSetting::Priority(priority) => write!(f, "SCHED_FIFO priority {priority}"),
            RealtimeSetting::LockedMemory => write!(f, "locked memory"),
            RealtimeSetting::Core(core) => write!(f, "core {core}"),
            RealtimeSetting::Awake => write!(f, "processor kept awake"),
        }
    }
}

/// What was not granted, why, and the way to get it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{favour} not granted: {reason}; {remedy}")]
pub struct DeniedSetting {
    /// What was asked.
    pub favour: RealtimeSetting,
    /// What the system says.
    pub reason: String,
    /// What to do.
    pub remedy: &'static str,
}

/// How to be allowed what a control thread needs.
pub const ALLOW_PRIORITY: &str = "allow it: `sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v quadfrog)`, or `@realtime - rtprio 99` in /etc/security/limits.conf and a new login";
/// How to be allowed to lock memory.
pub const ALLOW_LOCKING: &str = "allow it: `sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v quadfrog)`, or `@realtime - memlock unlimited` in /etc/security/limits.conf and a new login";
const ALLOW_CORE: &str = "set realtime.core in control.toml to a core that this program may use, or to -1";
const ALLOW_AWAKE: &str = "run as root, or give this user the right to write /dev/cpu_dma_latency (a udev rule)";

/// What was granted; the processor is kept awake for as long as this lives.
#[derive(Debug)]
pub struct GrantedSettings {
    /// What was granted.
    pub favours: Vec<RealtimeSetting>,
    /// What was not.
    pub shortfalls: Vec<DeniedSetting>,
    _awake: Option<File>,
}

impl Scheduling {
    /// Asks for the calling thread. To be called before the loop: it allocates and waits.
    pub fn apply(&self) -> GrantedSettings {
        let mut granted = GrantedSettings { favours: Vec::new(), shortfalls: Vec::new(), _awake: None };
        if self.priority == 0 {
            return granted;
        }
        let mut note = |favour: RealtimeSetting, asked: Result<(), String>, remedy: &'static str| match asked {
            Ok(()) => granted.favours.push(favour),
            Err(reason) => granted.shortfalls.push(DeniedSetting { favour, reason, remedy }),
        };
        if self.lock_memory {
            note(RealtimeSetting::LockedMemory, lock_memory(), ALLOW_LOCKING);
        }
        prefault_stack();
        if let Some(core) = self.core.or_else(|| system::isolated_cores().first().copied()) {
            note(RealtimeSetting::Core(core), pin(core), ALLOW_CORE);
        }
        let awake = stay_awake();
        note(RealtimeSetting::Awake, awake.as_ref().map(|_| ()).map_err(ToString::to_string), ALLOW_AWAKE);
        // Last: what came before may take its time.
        note(RealtimeSetting::Priority(self.priority), set_priority(self.priority), ALLOW_PRIORITY);
        granted._awake = awake.ok();
        granted
    }
}

/// All pages, present and future. Only where there is no limit: with one, the first allocation beyond it would fail, in
/// whatever thread.
fn lock_memory() -> Result<(), String> {
    if let Some(bytes) = system::memlock_limit() {
        return Err(format!("this user may lock {} MB only", bytes / 1_000_000));
    }
    mlockall(MlockAllFlags::MCL_CURRENT | MlockAllFlags::MCL_FUTURE).map_err(|error| error.to_string())
}

fn pin(core: usize) -> Result<(), String> {
    let mut set = CpuSet::new();
    set.set(core).and_then(|()| sched_setaffinity(Pid::from_raw(0), &set)).map_err(|error| error.to_string())
}

/// Asks the power management for a wake-up latency of 0 us (Linux, Documentation/power/pm_qos_interface.rst); holds while
/// the file is open.
fn stay_awake() -> std::io::Result<File> {
    let mut file = File::options().write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0_i32.to_ne_bytes())?;
    Ok(file)
}

/// Touches the part of the stack that a tick may use, so that its pages are there before the first one.
#[inline(never)]
fn prefault_stack() {
    let mut stack = [0_u8; 256 * 1024];
    for byte in stack.iter_mut().step_by(4096) {
        *byte = 1;
    }
    std::hint::black_box(&stack);
}

#[allow(unsafe_code, reason = "nix has no call for the scheduling policy")]
fn set_priority(priority: u8) -> Result<(), String> {
    // SAFETY: an all-zero `sched_param` is a valid value of this plain C struct.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = priority.into();
    // SAFETY: 0 is the calling thread; the pointer is to a value that lives through the call.
    let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) };
    if result == 0 { Ok(()) } else { Err(std::io::Error::last_os_error().to_string()) }
}
