//! A global allocator that aborts the process on an allocation or a free inside a guarded section. To be included by a test
//! program.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static FORBIDDEN: Cell<bool> = const { Cell::new(false) };
}

struct Forbidding;

/// Ends the process: a panic would allocate its message.
fn not_now() {
    if FORBIDDEN.with(Cell::get) {
        // The message must not allocate either.
        let _ = nix::unistd::write(std::io::stderr(), b"the tick allocated or freed memory\n");
        std::process::abort();
    }
}

// SAFETY: every call goes unchanged to the system's allocator; the check touches only a thread-local flag.
unsafe impl GlobalAlloc for Forbidding {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        not_now();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        not_now();
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static FORBIDDING: Forbidding = Forbidding;

/// Runs a closure that must not allocate or free.
pub fn without_allocation<T>(act: impl FnOnce() -> T) -> T {
    FORBIDDEN.with(|forbidden| forbidden.set(true));
    let result = act();
    FORBIDDEN.with(|forbidden| forbidden.set(false));
    result
}

/// Tests the allocator: an allocation in a guarded section ends the process.
#[test]
fn an_allocation_would_be_noticed() {
    const CHILD: &str = "QUADFROG_ALLOCATES";
    if std::env::var_os(CHILD).is_some() {
        without_allocation(|| std::hint::black_box(vec![1.0; 100]));
        return;
    }
    let program = std::env::current_exe().unwrap();
    let arguments = ["no_alloc::an_allocation_would_be_noticed", "--exact", "--test-threads=1"];
    let output = std::process::Command::new(program).args(arguments).env(CHILD, "1").output().unwrap();
    assert!(!output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("the tick allocated"), "{output:?}");
}
