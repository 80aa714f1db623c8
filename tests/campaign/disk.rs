//! Disks that take no more: the program ends with the file and the cause, and the study goes on once there is room.

use std::fs;
use std::process::{Command, Stdio};

use crate::kill::{WithOptimize, assert_equal, finish, unbroken};
use crate::program::{Program, with_small_files};
use crate::{Passed, Try};

/// A study that meets its end at a random length of its files.
pub fn file_limit(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let seed = (this.seed % 50).to_string();
    let whole = unbroken(&program, this, &seed);
    let record = ["none", "best", "all"][this.random.below(3)];
    let blocks = 8 + this.random.below(if record == "none" { 50 } else { 2000 }) as u32;
    let arguments = this.arguments(&["--seed", &seed, "--output", "broken", "--record", record]).with_optimize();
    let (status, message) = with_small_files(&program, blocks, &arguments);
    let ended = judged(status, &message);
    finish(&program, this, &seed, "broken");
    assert_equal(&program.study("broken"), &whole, &[]);
    Passed::Tried(ended)
}

/// Checks that the program ended by itself, with a cause where it did not succeed.
fn judged(status: Option<i32>, message: &str) -> String {
    match status {
        Some(0) => "fitted".to_owned(),
        Some(1) => {
            let causes = ["File too large", "No space left on device"];
            assert!(causes.iter().any(|cause| message.contains(cause)), "no cause: {message}");
            "ended with the cause".to_owned()
        }
        other => panic!("ended with {other:?}: {message}"),
    }
}

/// A file system in memory, unmounted when dropped.
struct SmallDisk(std::path::PathBuf);

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

/// A study on a file system of its own that is full at a random moment.
pub fn full(this: &mut Try<'_>) -> Passed {
    let program = Program::new();
    let disk = program.path("broken");
    fs::create_dir(&disk).unwrap();
    let mount =
        Command::new("mount").args(["-t", "tmpfs", "-o", "size=8m", "tmpfs"]).arg(&disk).stderr(Stdio::null()).status();
    if !mount.is_ok_and(|status| status.success()) {
        return Passed::Skipped("mounting is not allowed".into());
    }
    let disk = SmallDisk(disk);
    let seed = (this.seed % 50).to_string();
    let whole = unbroken(&program, this, &seed);
    let record = ["none", "best", "all"][this.random.below(3)];
    let left = 8192 + this.random.below(if record == "none" { 40_000 } else { 1_000_000 });
    let filler = disk.0.join("filler");
    fs::write(&filler, vec![1_u8; (8 << 20) - left]).unwrap();
    let arguments = this.arguments(&["--seed", &seed, "--output", "broken", "--record", record]).with_optimize();
    let output = program.run(&arguments);
    let ended = judged(output.status.code(), &String::from_utf8_lossy(&output.stderr));
    fs::remove_file(&filler).unwrap();
    finish(&program, this, &seed, "broken");
    assert_equal(&program.study("broken"), &whole, &[]);
    Passed::Tried(ended)
}
