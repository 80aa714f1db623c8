//! Real-time settings of the control thread: priority, locked memory, a core of its own, no deep sleep of the processor. Each is
//! requested by itself; a denied one is a value with the remedy. A thread without them runs, with later ticks.

use std::fs::File;
use std::io::Write;

use nix::sched::{CpuSet, sched_setaffinity};
use nix::sys::mman::{MlockAllFlags, mlockall};
use nix::unistd::Pid;

use super::system;

/// Requested settings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Scheduling {
    /// Priority under SCHED_FIFO, 1 to 99; with 0 the thread stays ordinary and requests no setting at all.
    pub priority: u8,
    /// Core to run on; none means the first isolated core, or the system's choice without one.
    pub core: Option<usize>,
    /// Whether the program's memory is locked, so that no page fault reads a disk.
    pub lock_memory: bool,
}

/// One real-time setting.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RealtimeSetting {
    /// SCHED_FIFO at this priority.
    Priority(u8),
    /// The program's memory is locked.
    LockedMemory,
    /// The thread stays on this core.
    Core(usize),
    /// The processor does not sleep deeply while the thread runs.
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

/// A denied setting.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{setting} not granted: {reason}; {remedy}")]
pub struct DeniedSetting {
    /// The setting.
    pub setting: RealtimeSetting,
    /// The system's reason.
    pub reason: String,
    /// Instruction to the operator.
    pub remedy: &'static str,
}

/// Remedy for a denied priority.
pub const ALLOW_PRIORITY: &str = "allow it: `sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v quadfrog)`, or `@realtime - rtprio 99` in /etc/security/limits.conf and a new login";
/// Remedy for denied memory locking.
pub const ALLOW_LOCKING: &str = "allow it: `sudo setcap cap_sys_nice,cap_ipc_lock+ep $(command -v quadfrog)`, or `@realtime - memlock unlimited` in /etc/security/limits.conf and a new login";
const ALLOW_CORE: &str = "set realtime.core in control.toml to a core that this program may use, or to -1";
const ALLOW_AWAKE: &str = "run as root, or give this user the right to write /dev/cpu_dma_latency (a udev rule)";

/// Granted and denied settings. Keeps the processor awake until dropped.
#[derive(Debug)]
pub struct GrantedSettings {
    /// Granted settings.
    pub granted: Vec<RealtimeSetting>,
    /// Denied settings.
    pub denied: Vec<DeniedSetting>,
    _awake: Option<File>,
}

impl Scheduling {
    /// Requests the settings for the calling thread. Allocates and blocks: to be called before the loop.
    pub fn apply(&self) -> GrantedSettings {
        let mut settings = GrantedSettings { granted: Vec::new(), denied: Vec::new(), _awake: None };
        if self.priority == 0 {
            return settings;
        }
        let mut note = |setting: RealtimeSetting, result: Result<(), String>, remedy: &'static str| match result {
            Ok(()) => settings.granted.push(setting),
            Err(reason) => settings.denied.push(DeniedSetting { setting, reason, remedy }),
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
        // Last, so that the calls above run at ordinary priority.
        note(RealtimeSetting::Priority(self.priority), set_priority(self.priority), ALLOW_PRIORITY);
        settings._awake = awake.ok();
        settings
    }
}

/// Locks all pages, present and future. Refused under a limit, because the first allocation beyond it would fail, in any thread.
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

/// Requests a wake-up latency of 0 us (Linux, Documentation/power/pm_qos_interface.rst) for as long as the file is open.
fn stay_awake() -> std::io::Result<File> {
    let mut file = File::options().write(true).open("/dev/cpu_dma_latency")?;
    file.write_all(&0_i32.to_ne_bytes())?;
    Ok(file)
}

/// Touches 256 KiB of the stack, so that its pages are mapped before the first tick.
#[inline(never)]
fn prefault_stack() {
    let mut stack = [0_u8; 256 * 1024];
    for byte in stack.iter_mut().step_by(4096) {
        *byte = 1;
    }
    std::hint::black_box(&stack);
}

/// Requests SCHED_FIFO at `priority` for the calling thread and the threads that it will start.
///
/// # Errors
/// The system's reason for a denial.
#[allow(unsafe_code, reason = "nix has no call for the scheduling policy")]
pub fn set_priority(priority: u8) -> Result<(), String> {
    // SAFETY: an all-zero `sched_param` is a valid value of this plain C struct.
    let mut parameters: libc::sched_param = unsafe { std::mem::zeroed() };
    parameters.sched_priority = priority.into();
    // SAFETY: 0 is the calling thread; the pointer is to a value that lives through the call.
    let result = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &parameters) };
    if result == 0 { Ok(()) } else { Err(std::io::Error::last_os_error().to_string()) }
}
