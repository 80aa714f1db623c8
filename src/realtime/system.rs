//! Real-time properties of the machine, for `quadfrog doctor` and `scheduling`.

use std::fs::read_to_string;

use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};

/// Whether the kernel is built for real time (PREEMPT_RT).
pub fn kernel_is_realtime() -> bool {
    read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1") || kernel_build().contains("PREEMPT_RT")
}

/// The kernel's release, for example `6.12.0-rt`.
pub fn kernel_release() -> String {
    read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default().trim().to_owned()
}

/// The kernel's build, for example `#1 SMP PREEMPT_DYNAMIC`.
pub fn kernel_build() -> String {
    read_to_string("/proc/sys/kernel/version").unwrap_or_default().trim().to_owned()
}

/// The highest real-time priority that this process may take; 99 with the capability CAP_SYS_NICE.
pub fn priority_limit() -> u64 {
    if has_capability(23) {
        return 99;
    }
    getrlimit(Resource::RLIMIT_RTPRIO).map_or(0, |(soft, _)| soft.min(99))
}

/// Limit of locked memory of this process, bytes; none without a limit, as with the capability CAP_IPC_LOCK.
pub fn memlock_limit() -> Option<u64> {
    if has_capability(14) {
        return None;
    }
    let soft = getrlimit(Resource::RLIMIT_MEMLOCK).map_or(0, |(soft, _)| soft);
    (soft != RLIM_INFINITY).then_some(soft)
}

/// File descriptors of this process: free and allowed ones.
///
/// # Errors
/// When the system does not report them; without a free descriptor it cannot.
pub fn descriptors() -> std::io::Result<(u64, u64)> {
    let (allowed, _) = getrlimit(Resource::RLIMIT_NOFILE)?;
    // One of them reads the folder.
    let open = std::fs::read_dir("/proc/self/fd")?.count().saturating_sub(1);
    Ok((allowed.saturating_sub(open as u64), allowed))
}

/// Cores without ordinary threads (boot parameter `isolcpus`).
pub fn isolated_cores() -> Vec<usize> {
    cores(&read_to_string("/sys/devices/system/cpu/isolated").unwrap_or_default())
}

/// The frequency governors in use, each once; empty where the system reports none (a virtual machine).
pub fn governors() -> Vec<String> {
    let mut found = Vec::new();
    let count = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    for core in 0..count {
        let path = format!("/sys/devices/system/cpu/cpu{core}/cpufreq/scaling_governor");
        if let Ok(governor) = read_to_string(path) {
            let governor = governor.trim().to_owned();
            if !found.contains(&governor) {
                found.push(governor);
            }
        }
    }
    found
}

/// Resolution of the monotonic clock, ns.
///
/// # Errors
/// When the system does not report it.
pub fn timer_resolution_ns() -> Result<u64, nix::Error> {
    let resolution = nix::time::clock_getres(nix::time::ClockId::CLOCK_MONOTONIC)?;
    Ok(resolution.tv_sec() as u64 * 1_000_000_000 + resolution.tv_nsec() as u64)
}

/// Whether this process has capability number `bit` in effect (Linux, include/uapi/linux/capability.h).
fn has_capability(bit: u32) -> bool {
    let status = read_to_string("/proc/self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    effective.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()).is_some_and(|set| set & (1 << bit) != 0)
}

/// Parses the kernel's list of cores, for example `0,2-4`; empty for an empty list.
pub fn cores(list: &str) -> Vec<usize> {
    let mut found = Vec::new();
    for part in list.trim().split(',').filter(|part| !part.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        if let (Ok(first), Ok(last)) = (first.parse::<usize>(), last.parse::<usize>()) {
            found.extend(first..=last);
        }
    }
    found
}
