//! Selection of the study to run: a new one, a continued one or a joined one.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use crate::notice;
use quadfrog::engine::{EngineError, STUDY_FILE, StoredStudy, has_journal, stored_studies, stored_study};
use quadfrog::optimize::study::Storage;
use quadfrog::robot::description::RobotDescription;
use quadfrog::trial::Task;

use super::failure::{Failure, is_of_place};

/// A study to run.
#[derive(Clone)]
pub struct SelectedStudy {
    /// Its name in its journal; none for a new study.
    pub name: Option<String>,
    pub task: Task,
    pub seed: u32,
    /// Its folder, which exists if the study is continued.
    pub folder: PathBuf,
    /// Whether the folder is to be made; a number is appended to its name if it exists by then.
    pub new: bool,
    /// Number of trials that count, as stored in the study; none for a new study.
    pub budget: Option<u32>,
}

impl SelectedStudy {
    /// Makes the folder of a new study. Of two programs that start in the same second each gets its own, because only one can
    /// make a folder.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn with_folder(&self) -> Result<SelectedStudy, Failure> {
        if !self.new {
            return Ok(self.clone());
        }
        let failed = |folder: &Path, source: io::Error| {
            let what = format!("{}: cannot be made", folder.display());
            match source.kind() {
                ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
                    Failure::input(format!("{what}: a part of its path is a file; give another folder with --output"))
                }
                kind if is_of_place(kind) => {
                    Failure::input(format!("{what}: {source}; give another folder with --output"))
                }
                _ => Failure::from(EngineError::System { what, source }),
            }
        };
        let name = self.folder.display();
        let numbered = (2..).map(|number| PathBuf::from(format!("{name}-{number}")));
        if let Some(parent) = self.folder.parent() {
            std::fs::create_dir_all(parent).map_err(|error| failed(&self.folder, error))?;
        }
        for folder in std::iter::once(self.folder.clone()).chain(numbered) {
            match std::fs::create_dir(&folder) {
                Ok(()) => return Ok(SelectedStudy { folder, new: false, ..self.clone() }),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(failed(&folder, error)),
            }
        }
        unreachable!("the numbers have no end")
    }
}

/// Parses the place of a study: its folder, its journal file or a Redis address.
pub fn parse_storage(place: &str) -> Storage {
    if place.starts_with("redis://") || place.starts_with("rediss://") {
        return Storage::Redis(place.to_owned());
    }
    // A file either way; that it is no journal, and the remedy, is in the error.
    let path = Path::new(place.strip_prefix("sqlite:///").unwrap_or(place));
    Storage::File(if path.is_dir() { path.join(STUDY_FILE) } else { path.to_owned() })
}

fn labels<'a>(studies: impl IntoIterator<Item = &'a StoredStudy>) -> String {
    let label = |study: &StoredStudy| format!("{} seed {}", study.task.name(), study.seed);
    studies.into_iter().map(label).collect::<Vec<_>>().join(", ")
}

/// Returns the study of `storage` with this task and seed, where given. If there is none, a new study needs both;
/// otherwise the place may be mistyped and is refused.
pub fn study_to_join(
    storage: &Storage,
    task: Option<Task>,
    seed: Option<u32>,
    robot: &RobotDescription,
) -> Result<StoredStudy, Failure> {
    let exists = has_journal(storage)?;
    let all = if exists { stored_studies(storage)? } else { Vec::new() };
    let matches =
        |study: &&StoredStudy| task.is_none_or(|task| task == study.task) && seed.is_none_or(|seed| seed == study.seed);
    let matching: Vec<&StoredStudy> = all.iter().filter(matches).collect();
    match matching.as_slice() {
        [] => {
            if let (Some(task), Some(seed)) = (task, seed) {
                notice!("a new study of {} seed {seed} is made in {storage}", task.name());
                return Ok(StoredStudy { name: None, task, seed, robot: robot.name.clone(), budget: None, unit: None });
            }
            let found = match (exists, all.as_slice()) {
                (false, _) => "there is no such journal".to_owned(),
                (true, []) => "there is no study of this program in it".to_owned(),
                (true, all) => format!("there is no such study in it, only {}", labels(all)),
            };
            Err(Failure::Input(format!("--join {storage}: {found}; for a new study give --task and --seed")))
        }
        [study] if study.robot != robot.name => Err(Failure::Input(format!(
            "--model {}: {storage} holds a study of the {}; give --model {}",
            robot.name, study.robot, study.robot
        ))),
        [study] => Ok((*study).clone()),
        several => {
            let labels = labels(several.iter().copied());
            Err(Failure::Input(format!("--join {storage}: several studies; select with --task and --seed: {labels}")))
        }
    }
}

/// Returns the study in `folder`; task, seed and robot must agree with it, where given.
pub fn study_to_continue(
    folder: &Path,
    task: Option<Task>,
    seed: Option<u32>,
    robot: &RobotDescription,
) -> Result<SelectedStudy, Failure> {
    let file = folder.join(STUDY_FILE);
    if folder.is_file() {
        let name = folder.display();
        return Err(Failure::Input(format!("{name}: this is a file; give the folder of the study that it lies in")));
    }
    if !has_journal(&Storage::File(file.clone()))? {
        let found = match folder.is_dir() {
            true => format!("there is no {STUDY_FILE} in this folder"),
            false => "there is no such folder".to_owned(),
        };
        let name = folder.display();
        return Err(Failure::Input(format!(
            "{name}: {found}; give the folder of a study, as `quadfrog study list` names it"
        )));
    }
    let stored = stored_study(&file)?;
    let refuse = |option: String, holds: String, remedy: String| {
        Err(Failure::Input(format!("{option}: {} holds a study of {holds}; {remedy}", file.display())))
    };
    if task.is_some_and(|task| task != stored.task) {
        return refuse("--task".into(), stored.task.name().into(), "omit --task to continue it".into());
    }
    if seed.is_some_and(|seed| seed != stored.seed) {
        return refuse("--seed".into(), format!("seed {}", stored.seed), "omit --seed to continue it".into());
    }
    if robot.name != stored.robot {
        let option = format!("--model {}", robot.name);
        return refuse(option, format!("the {}", stored.robot), format!("give --model {}", stored.robot));
    }
    Ok(SelectedStudy {
        name: stored.name,
        task: stored.task,
        seed: stored.seed,
        folder: folder.to_owned(),
        new: false,
        budget: stored.budget,
    })
}
