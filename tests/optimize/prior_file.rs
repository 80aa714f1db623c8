//! The file of a prior: kept, reused, refused, made again. A session makes its prior behind the console.

use crate::attached_console;
use std::fs;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use attached_console::AttachedConsole;
use quadfrog::config::{Config, ConfigLayer};
use quadfrog::control::settings::ObjectiveSource;
use quadfrog::engine::{EngineError, Options, PRIOR_FILE, PriorFileError, PriorMaker, ReadyPrior, open_experiment};
use quadfrog::optimize::ask::SamplerKind;
use quadfrog::optimize::journal::Durability;
use quadfrog::recording::record::{LogLevel, Record};
use quadfrog::robot::description::{RobotDescription, RobotFiles};
use quadfrog::robot::hardware::Network;
use quadfrog::session::operator_request::OperatorRequest;
use quadfrog::telemetry::Mode;
use quadfrog::trial::{Backend, Task};

const SMALL: (&str, &str) = ("prior.toml", "worlds = 2\npoints = 16");

fn config(texts: &[(&str, &str)]) -> Config {
    let layers: Vec<_> = texts.iter().map(|(file, text)| ConfigLayer { file, origin: "the test", text }).collect();
    let mut config = Config::layered(&layers).unwrap();
    config.choose_sampler(SamplerKind::Sim);
    config
}

fn maker(texts: &[(&str, &str)]) -> PriorMaker {
    let robot = RobotDescription::embedded("go1").unwrap();
    PriorMaker::new(&config(&[&[SMALL], texts].concat()), &robot, Task::Forward, Backend::Simulator).unwrap()
}

fn find_or_make(maker: &PriorMaker, files: &[PathBuf]) -> (ReadyPrior, Vec<String>) {
    let mut notices = Vec::new();
    let found = maker.find_or_make(files, 2, &|_| (), &AtomicBool::new(false), &mut |text| notices.push(text));
    (found.unwrap(), notices)
}

#[test]
fn a_prior_is_kept_and_reused_until_something_changes_that_it_depends_on() {
    let folder = tempfile::tempdir().unwrap();
    let files = [folder.path().join("study").join(PRIOR_FILE), folder.path().join("priors/shared.json")];
    let (made, notices) = find_or_make(&maker(&[]), &files);
    assert!(made.from.is_none() && notices.is_empty());
    made.keep(&files).unwrap();
    assert_eq!(fs::read(&files[0]).unwrap(), fs::read(&files[1]).unwrap());
    assert_eq!(fs::read_dir(folder.path().join("study")).unwrap().count(), 1, "no unfinished file is left");

    let (reused, notices) = find_or_make(&maker(&[]), &files);
    assert_eq!((reused.from.as_ref(), notices.len()), (Some(&files[0]), 0));
    assert_eq!(reused.model.prior(), made.model.prior());
    fs::remove_file(&files[0]).unwrap();
    let (reused, _) = find_or_make(&maker(&[]), &files);
    assert_eq!(reused.from.as_ref(), Some(&files[1]));
    reused.keep(&files).unwrap();
    assert_eq!(fs::read(&files[0]).unwrap(), fs::read(&files[1]).unwrap());

    // Seed of the sampler, budget, colours: the same prior.
    let elsewhere = [("optimize.toml", "trials = 7\n[sampler]\nseed = 9"), ("console.toml", "[screen]\n")];
    assert_eq!(maker(&elsewhere[..1]).key(), maker(&[]).key());
    for other in [
        ("simulator.toml", "[terrain]\nfriction = 0.9"),
        ("control.toml", "[tasks.forward]\nkp = 410.0"),
        ("safety.toml", "[fall]\nroll_rad = 0.9"),
        ("optimize.toml", "[bounds]\nFx = [0.0, 140.0]"),
        ("prior.toml", "seed = 1\nworlds = 2\npoints = 16"),
    ] {
        let error = maker(&[other]).read(&files[0]).expect_err(other.1);
        assert!(matches!(error, PriorFileError::Other { .. }), "{other:?}: {error}");
    }
    let robot = RobotDescription::embedded("a1").unwrap();
    let a1 = PriorMaker::new(&config(&[SMALL]), &robot, Task::Forward, Backend::Simulator).unwrap();
    assert_ne!(a1.key(), maker(&[]).key());
}

/// A file in the way is named and replaced: a prior can be made again at any time.
#[test]
fn a_damaged_or_foreign_file_is_made_again_with_a_notice() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join(PRIOR_FILE);
    let maker = maker(&[]);
    maker.make(2, &|_| (), &AtomicBool::new(false)).unwrap().write(&file).unwrap();
    let whole = fs::read_to_string(&file).unwrap();
    let first = whole.find("\"values\":[").unwrap() + "\"values\":[".len();
    // Some digit of a value, another one.
    let digit = first + whole[first..].find(|c: char| ('1'..='8').contains(&c)).unwrap();
    let mut changed = whole.clone().into_bytes();
    changed[digit] += 1;
    for (text, expected) in [
        (&whole.as_bytes()[..whole.len() / 2], "is no prior of this program"),
        (&changed, "the prior is damaged: its checksum is"),
        (b"", "is no prior of this program"),
        (b"{\"name\":\"x\"}", "is no prior of this program"),
        (b"\xff\xfe\x00", "cannot be read"),
        (whole.replace("quadfrog prior", "other").as_bytes(), "its format is \"other\""),
        (whole.replace("\"version\":1", "\"version\":2").as_bytes(), "format version 2, of a newer program"),
        (whole.replace("\"worlds\":[", "\"worlds\":[7,").as_bytes(), "the prior is damaged"),
    ] {
        fs::write(&file, text).unwrap();
        let error = maker.read(&file).expect_err(expected).to_string();
        assert!(error.contains(expected) && error.contains("prior.json"), "{error}");
        assert_eq!(fs::read(&file).unwrap(), text, "reading changes nothing");
    }
    let (made, notices) = find_or_make(&maker, std::slice::from_ref(&file));
    assert!(
        matches!(&notices[..], [notice] if notice.contains("is damaged") && notice.ends_with("; it is made again"))
    );
    made.keep(std::slice::from_ref(&file)).unwrap();
    assert_eq!(fs::read_to_string(&file).unwrap(), whole, "the same bytes");
}

#[test]
fn the_sampler_sim_is_never_without_a_prior() {
    let robot = RobotDescription::embedded("go1").unwrap();
    let options = Options::new(config(&[SMALL]), robot.clone(), Backend::Simulator, Task::Forward);
    let refused = open_experiment(&options, Durability::Buffered, "").map(drop);
    assert!(matches!(refused, Err(EngineError::NoPrior)), "{refused:?}");
    // No jump without a vertical force stands: the sampler could only guess.
    let useless = [SMALL, ("optimize.toml", "[bounds]\nf0 = [0.75, 0.75]\nFz = [350.0, 350.0]\nFx = [150.0, 150.0]")];
    let maker = PriorMaker::new(&config(&useless), &robot, Task::Forward, Backend::Simulator).unwrap();
    let made = maker.make(2, &|_| (), &AtomicBool::new(false));
    assert!(matches!(&made, Err(EngineError::UnusablePrior(_))), "{made:?}");
}

fn session(folder: &Path, prior: &str) -> Options {
    let robot = RobotDescription::embedded("go1").unwrap();
    let folder = Some(folder.join("study"));
    Options { folder, ..Options::new(config(&[("prior.toml", prior)]), robot, Backend::Simulator, Task::Forward) }
}

const MOST: Duration = Duration::from_secs(120);

fn logged(console: &AttachedConsole, text: &str) -> bool {
    console.records.iter().any(|r| matches!(r, Record::Log(log) if log.message.contains(text)))
}

#[test]
fn a_session_makes_its_prior_before_the_first_proposal_and_the_next_session_reuses_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut console = AttachedConsole::start(session(folder.path(), SMALL.1));
    let proposed = |c: &AttachedConsole| c.records.iter().any(|r| matches!(r, Record::Proposal(_)));
    console.until_within(MOST, "a proposal", proposed);
    console.until_within(MOST, "the message", |c| logged(c, "the prior of the sampler sim is made"));
    console.handle.shutdown();
    let kept = folder.path().join("study").join(PRIOR_FILE);
    let shared: Vec<_> = fs::read_dir(folder.path().join("priors")).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(fs::read(&kept).unwrap(), fs::read(&shared[0]).unwrap());

    let mut console = AttachedConsole::start(session(folder.path(), SMALL.1));
    console.until_within(MOST, "a proposal", proposed);
    console.until_within(MOST, "the message", |c| logged(c, &format!("is that of {}", kept.display())));
    console.handle.shutdown();
}

/// Hardware has the estimate alone, by which jumps fall that stand by the simulator's truth: the prior of a session on a robot was that
/// of the truth. The robot is silent; its prior is made all the same.
#[test]
fn the_prior_of_a_session_on_hardware_is_simulated_with_the_estimate() {
    let folder = tempfile::tempdir().unwrap();
    let silent = UdpSocket::bind("127.0.0.1:0").unwrap();
    let Some(Network::Go1(mut network)) = Network::read(&RobotFiles::embedded("go1").unwrap()).unwrap() else {
        unreachable!()
    };
    (network.address, network.local_port) = (silent.local_addr().unwrap(), 0);
    let simulated = session(folder.path(), SMALL.1);
    let mut options = Options::new(simulated.config, simulated.robot, Backend::Hardware, Task::Forward);
    (options.folder, options.network) = (simulated.folder, Some(Network::Go1(network)));
    let made_for = |backend| PriorMaker::new(&options.config, &options.robot, Task::Forward, backend).unwrap();
    let [on_simulator, on_hardware] = [Backend::Simulator, Backend::Hardware].map(made_for);
    assert_eq!(on_hardware.plan().settings.objective, ObjectiveSource::Estimate);

    let mut console = AttachedConsole::start(options);
    console.until_within(MOST, "the message", |c| logged(c, "the prior of the sampler sim is made"));
    console.handle.shutdown();
    let kept = folder.path().join("study").join(PRIOR_FILE);
    let read = on_hardware.read(&kept).unwrap();
    assert!(matches!(on_simulator.read(&kept), Err(PriorFileError::Other { .. })));
    let of_truth = on_simulator.make(2, &|_| (), &AtomicBool::new(false)).unwrap();
    assert_ne!(read.model.prior().worlds, of_truth.model.prior().worlds);
}

/// A prior of hours: keys that move the robot, STOP and the end of the session do not wait for it, and nothing of it is kept.
#[test]
fn keys_stop_and_the_end_of_a_session_do_not_wait_for_a_prior() {
    let folder = tempfile::tempdir().unwrap();
    let mut console = AttachedConsole::start(session(folder.path(), "worlds = 64\npoints = 4096"));
    let simulates = |c: &AttachedConsole| {
        c.handle
            .storage_wait()
            .and_then(|wait| wait.prior)
            .is_some_and(|prior| prior.done > 0 && prior.total == 262_144)
    };
    console.until_within(MOST, "progress", simulates);
    console.until_within(MOST, "disarmed", |c| c.mode() == Some(Mode::Disarmed));
    console.handle.request(OperatorRequest::Arm);
    console.until_within(MOST, "standing", |c| c.mode() == Some(Mode::StandUp) || c.mode() == Some(Mode::Ready));
    console.handle.stop();
    console.until_within(MOST, "damping", |c| c.mode() == Some(Mode::Damped));
    console.handle.request(OperatorRequest::Acknowledge);
    console.until_within(MOST, "the acknowledgement", |c| c.mode() == Some(Mode::Disarmed));
    assert!(!console.records.iter().any(|r| matches!(r, Record::Proposal(_))));
    assert!(simulates(&console), "the prior is still made");
    let end = console.handle.shutdown();
    let errors = end.iter().filter(|s| matches!(&s.record, Record::Log(log) if log.level == LogLevel::Error));
    assert_eq!(errors.count(), 0, "{end:?}");
    assert!(!folder.path().join("study").join(PRIOR_FILE).exists() && !folder.path().join("priors").exists());
}
