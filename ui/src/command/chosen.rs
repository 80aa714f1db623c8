//! Which study: a new one, one that is continued, or one that is joined.

use std::path::{Path, PathBuf};

use quadfrog::engine::{STUDY_FILE, StoredStudy, stored_studies, stored_study};
use quadfrog::optimize::study::Storage;
use quadfrog::realtime::command::Task;
use quadfrog::robot::description::RobotDescription;

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

/// The study of `storage` that is to be joined; one that does not exist yet is made as `task` and `seed` say, or the
/// defaults where they are left out. `folder` is this worker's own.
pub fn joined(
    storage: &Storage,
    task: Option<Task>,
    seed: Option<u32>,
    robot: &RobotDescription,
    (usual_task, usual_seed): (Task, u32),
    folder: PathBuf,
) -> Result<Chosen, Failure> {
    let all = stored_studies(storage)?;
    let fits =
        |study: &&StoredStudy| task.is_none_or(|task| task == study.task) && seed.is_none_or(|seed| seed == study.seed);
    let fitting: Vec<&StoredStudy> = all.iter().filter(fits).collect();
    match fitting.as_slice() {
        [] if !all.is_empty() && task.is_none() | seed.is_none() => {
            let there: Vec<String> = all.iter().map(|s| format!("{} seed {}", s.task.name(), s.seed)).collect();
            let message = format!(
                "--join {storage}: there is no such study in it, only {}; to make another give --task and --seed",
                there.join(", ")
            );
            Err(Failure::Input(message))
        }
        [] => Ok(Chosen { task: task.unwrap_or(usual_task), seed: seed.unwrap_or(usual_seed), folder, budget: None }),
        [study] if study.robot != robot.name => Err(Failure::Input(format!(
            "--model {}: {storage} holds a study of the {}; give --model {}",
            robot.name, study.robot, study.robot
        ))),
        [study] => Ok(Chosen { task: study.task, seed: study.seed, folder, budget: study.budget }),
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
