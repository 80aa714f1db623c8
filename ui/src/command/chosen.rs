//! Which study: a new one, one that is continued, or one that is joined.

use std::path::{Path, PathBuf};

use quadfrog::engine::{STUDY_FILE, StoredStudy, stored_studies, stored_study};
use quadfrog::optimize::study::Storage;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::Task;

use super::Failure;

/// A study to be run: its task, its seed and its folder.
pub struct Chosen {
    /// The task.
    pub task: Task,
    /// The seed.
    pub seed: u32,
    /// The folder; it exists already if the study is continued.
    pub folder: PathBuf,
    /// How many trials are to count, where the study knows it and the command line does not.
    pub budget: Option<u32>,
}

/// A journal to take part in, as on the command line: a study's folder, its file, or an address.
pub fn journal(place: &str) -> Storage {
    if place.starts_with("redis://") || place.starts_with("rediss://") {
        return Storage::Redis(place.to_owned());
    }
    let path = Path::new(place);
    Storage::File(if path.is_dir() { path.join(STUDY_FILE) } else { path.to_owned() })
}

/// The study of `storage` that is to be joined. One that does not exist yet is made where both `task` and `seed` are
/// given; without them the place is taken for mistyped.
pub fn joined(
    storage: &Storage,
    task: Option<Task>,
    seed: Option<u32>,
    robot: &RobotDescription,
) -> Result<StoredStudy, Failure> {
    let there = match storage {
        // To look into a journal file makes its folder.
        Storage::File(file) => file.is_file(),
        _ => true,
    };
    let all = if there { stored_studies(storage)? } else { Vec::new() };
    let fits =
        |study: &&StoredStudy| task.is_none_or(|task| task == study.task) && seed.is_none_or(|seed| seed == study.seed);
    let fitting: Vec<&StoredStudy> = all.iter().filter(fits).collect();
    match fitting.as_slice() {
        [] => {
            if let (Some(task), Some(seed)) = (task, seed) {
                eprintln!("quadfrog: a new study of {} seed {seed} is made in {storage}", task.name());
                return Ok(StoredStudy { task, seed, robot: robot.name.clone(), budget: None });
            }
            let known: Vec<String> = all.iter().map(|s| format!("{} seed {}", s.task.name(), s.seed)).collect();
            let found = match (there, known.as_slice()) {
                (false, _) => "there is no such journal".to_owned(),
                (true, []) => "there is no study of this program in it".to_owned(),
                (true, known) => format!("there is no such study in it, only {}", known.join(", ")),
            };
            let what = if all.is_empty() { "a new study" } else { "another" };
            Err(Failure::Input(format!("--join {storage}: {found}; to make {what} give --task and --seed")))
        }
        [study] if study.robot != robot.name => Err(Failure::Input(format!(
            "--model {}: {storage} holds a study of the {}; give --model {}",
            robot.name, study.robot, study.robot
        ))),
        [study] => Ok((*study).clone()),
        several => {
            let there: Vec<String> = several.iter().map(|s| format!("{} seed {}", s.task.name(), s.seed)).collect();
            let message = format!("--join {storage}: say with --task and --seed which: {}", there.join(", "));
            Err(Failure::Input(message))
        }
    }
}

/// The study that `folder` holds, whatever was asked for besides, as long as it does not contradict.
pub fn continued(
    folder: &Path,
    task: Option<Task>,
    seed: Option<u32>,
    robot: &RobotDescription,
) -> Result<Chosen, Failure> {
    let file = folder.join(STUDY_FILE);
    if !file.is_file() {
        let message = format!(
            "{}: there is no {STUDY_FILE} in this folder; give the folder of an earlier study, as it was printed when it ended",
            folder.display()
        );
        return Err(Failure::Input(message));
    }
    let stored = stored_study(&file)?;
    if task.is_some_and(|task| task != stored.task) {
        let message = format!(
            "--task: {} holds a study of {}; leave --task away to continue it",
            file.display(),
            stored.task.name()
        );
        return Err(Failure::Input(message));
    }
    if seed.is_some_and(|seed| seed != stored.seed) {
        let message = format!(
            "--seed: {} holds a study of seed {}; leave --seed away to continue it",
            file.display(),
            stored.seed
        );
        return Err(Failure::Input(message));
    }
    if robot.name != stored.robot {
        let message = format!(
            "--model {}: {} holds a study of the {}; give --model {}",
            robot.name,
            file.display(),
            stored.robot,
            stored.robot
        );
        return Err(Failure::Input(message));
    }
    Ok(Chosen { task: stored.task, seed: stored.seed, folder: folder.to_owned(), budget: stored.budget })
}
