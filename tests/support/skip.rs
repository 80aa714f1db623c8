//! Tests that need a program or a package which may be absent.

/// Reports that a test is skipped, and the reason.
///
/// # Panics
/// Where `QUADFROG_NO_SKIPS` is set, as in `.ci/run`, which installs all that the tests need.
pub fn skip(reason: &str) {
    assert!(std::env::var_os("QUADFROG_NO_SKIPS").is_none(), "QUADFROG_NO_SKIPS is set, but {reason}");
    println!("skipped: {reason}");
}
