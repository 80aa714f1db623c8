//! A process with too few file descriptors: a message, no session. In a file of its own, because the limit is the process's.

use nix::sys::resource::{Resource, getrlimit, setrlimit};
use quadfrog::config::Config;
use quadfrog::engine::{self, Options};
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::{Backend, Task};

/// Regression: a console with 14 descriptors ended at once with exit status 0, without a word.
#[test]
fn a_session_with_too_few_descriptors_is_refused_with_the_remedy() {
    let (config, robot) = (Config::load(None).unwrap(), RobotDescription::embedded("go1").unwrap());
    let start = || engine::start(Options::new(config.clone(), robot.clone(), Backend::Simulator, Task::Forward)).err();
    assert!(start().is_none());
    let (_, most) = getrlimit(Resource::RLIMIT_NOFILE).unwrap();
    let open = std::fs::read_dir("/proc/self/fd").unwrap().count() as u64;
    for free in [0, 5, 20] {
        setrlimit(Resource::RLIMIT_NOFILE, open + free, most).unwrap();
        let error = start().expect("should be refused").to_string();
        assert!(error.starts_with("too few file descriptors"), "{error}");
        assert!(free == 0 || error.contains("a session needs 32") && error.contains("ulimit -n 1024"), "{error}");
    }
}
