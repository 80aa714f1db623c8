//! The folder of a study: its lock, the configuration that ran, the recordings.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};

use super::options::{EngineError, Options};
use crate::config::{Config, ConfigError, write_new_files};
use crate::recording::session_files::next_recording;
use crate::robot::description::{RobotDescription, read_text};

/// Name of the study's journal in its folder.
pub const STUDY_FILE: &str = "study.log";
/// Name of the lock in a study's folder. A session that runs holds it and has written itself into it.
const LOCK_FILE: &str = "session.lock";
/// Most bytes of the lock that are read, for its owner.
const OWNER_BYTES: u64 = 200;
/// Name of the folder of the robot's files in a kept configuration.
const ROBOT_FOLDER: &str = "robot";

/// Creates and locks the folder of `options`, keeps the configuration in it, and names the next recording there:
/// `session.mcap`, `session-2.mcap`, ...; none without a folder.
///
/// # Errors
/// When the folder cannot be created or written, or another session has it.
pub fn prepare_folder(options: &Options) -> Result<LockedFolder, EngineError> {
    let Some(folder) = &options.folder else { return Ok(LockedFolder { recording: None, _lock: None }) };
    let system = |what: String| move |source| EngineError::System { what, source };
    std::fs::create_dir_all(folder).map_err(system(format!("{}: cannot be made", folder.display())))?;
    let lock = lock_folder(folder)?;
    keep_config(options, folder)?;
    Ok(LockedFolder { recording: next_recording(folder, None), _lock: Some(lock) })
}

/// Locks a study's folder and writes this process into the lock. The operating system releases the lock however the session
/// ends.
fn lock_folder(folder: &Path) -> Result<File, EngineError> {
    let path = folder.join(LOCK_FILE);
    let system = |what: &str| {
        let what = format!("{}: cannot be {what}", path.display());
        move |source| EngineError::System { what, source }
    };
    // Not truncated: it names its owner until it is locked.
    let mut lock =
        open_lock(OpenOptions::new().write(true).create(true).truncate(false), &path).map_err(system("made"))?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            return Err(EngineError::InUse { folder: folder.to_owned(), owner: lock_owner(&path) });
        }
        Err(TryLockError::Error(source)) => return Err(system("locked")(source)),
    }
    let host = nix::unistd::gethostname().map(|host| format!(" on {}", host.to_string_lossy())).unwrap_or_default();
    let owner = format!("process {}{host}, since {:.0}\n", std::process::id(), jiff::Timestamp::now());
    lock.set_len(0).and_then(|()| lock.write_all(owner.as_bytes())).map_err(system("written"))?;
    Ok(lock)
}

/// Opens a lock; a link would name another file, and a pipe would wait for its other end.
fn open_lock(options: &mut OpenOptions, path: &Path) -> io::Result<File> {
    let lock = options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(path)?;
    if lock.metadata()?.is_file() { Ok(lock) } else { Err(io::Error::other("it is not a regular file")) }
}

/// Returns the owner that a lock names; a lock of an older version names none.
fn lock_owner(path: &Path) -> String {
    let mut text = Vec::new();
    // What cannot be read names no owner.
    let _ =
        open_lock(OpenOptions::new().read(true), path).and_then(|lock| lock.take(OWNER_BYTES).read_to_end(&mut text));
    let text = String::from_utf8_lossy(&text);
    let line = text.lines().next().unwrap_or_default();
    if line.is_empty() { "a process that is not known".to_owned() } else { line.to_owned() }
}

/// Returns the session that runs in the folder of a study: the owner of its lock, as text; none if the lock is free or
/// missing, or on a file system without locks, where no session runs.
///
/// # Errors
/// When the lock cannot be opened or asked.
pub fn running_session(folder: &Path) -> io::Result<Option<String>> {
    let path = folder.join(LOCK_FILE);
    let lock = match open_lock(OpenOptions::new().read(true), &path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        lock => lock?,
    };
    match lock.try_lock_shared() {
        Ok(()) => Ok(None),
        Err(TryLockError::WouldBlock) => Ok(Some(lock_owner(&path))),
        Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// A study's folder, locked for this session until this is dropped.
pub struct LockedFolder {
    /// Path of the recording.
    pub recording: Option<PathBuf>,
    _lock: Option<File>,
}

/// Keeps the running configuration in `config/`, or in `config-2/`, ... if the session before ran with another one: the
/// highest number is the configuration that ran last. The robot's files are in the folder `robot` in it, a folder for
/// `--model`. A session before that kept none, as of older versions, counts as another one. The folder's lock is held: an
/// unfinished configuration is that of a killed session.
fn keep_config(options: &Options, folder: &Path) -> Result<(), EngineError> {
    remove_unfinished_configs(folder);
    let files = kept_files(options);
    let config = match newest_config(folder) {
        None => folder.join("config"),
        Some((number, newest)) => {
            let same = |(name, text): &(PathBuf, &str)| read_text(&newest.join(name)).is_ok_and(|kept| kept == *text);
            if files.iter().all(same) {
                return Ok(());
            }
            let next = number.checked_add(1).ok_or(ConfigError::Exists { path: newest })?;
            folder.join(format!("config-{next}"))
        }
    };
    Ok(write_new_files(&config, &files).map(drop)?)
}

/// Removes the folders of [`write_new_files`] that a killed session has left. Nothing reads them: one that cannot be removed stays.
fn remove_unfinished_configs(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with(".config") && name.ends_with(".part") {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

/// Returns the files of the configuration and of the robot by their path in the kept folder.
fn kept_files(options: &Options) -> Vec<(PathBuf, &str)> {
    let config = options.config.as_run.iter().map(|(name, text)| (PathBuf::from(name), text.as_str()));
    let robot = options.robot.files.iter();
    config.chain(robot.map(|(name, text)| (Path::new(ROBOT_FOLDER).join(name), text.as_str()))).collect()
}

/// Returns the configuration that ran last in a study's folder, with its number: 1 for `config/`, N for `config-N/`; none
/// where none was kept.
pub fn newest_config(folder: &Path) -> Option<(u32, PathBuf)> {
    let numbered = |path: PathBuf| {
        let number = match path.file_name()?.to_str()? {
            "config" => 1,
            name => name.strip_prefix("config-")?.parse().ok()?,
        };
        path.is_dir().then_some((number, path))
    };
    let entries = std::fs::read_dir(folder).ok()?;
    entries.filter_map(|entry| numbered(entry.ok()?.path())).max_by_key(|(number, _)| *number)
}

/// Returns the folder of the robot's files in a kept configuration; none in one of an earlier version.
pub fn kept_robot(config: &Path) -> Option<PathBuf> {
    Some(config.join(ROBOT_FOLDER)).filter(|robot| robot.is_dir())
}

/// Refuses a kept configuration with an empty file: it was whole when its study ran.
///
/// # Errors
/// [`ConfigError::Empty`].
pub fn check_kept_config(config: &Path) -> Result<(), ConfigError> {
    let files = std::fs::read_dir(config).into_iter().flatten().filter_map(|entry| Some(entry.ok()?.path()));
    let is_empty = |path: &PathBuf| path.metadata().is_ok_and(|about| about.is_file() && about.len() == 0);
    files
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .find(is_empty)
        .map_or(Ok(()), |path| Err(ConfigError::Empty { path }))
}

/// Returns whether there is a file of this name. A place that cannot be looked at is an error, not a missing file.
pub(super) fn is_file(path: &Path) -> io::Result<bool> {
    match path.metadata() {
        Ok(about) => Ok(about.is_file()),
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Returns the study files of `folder` and of the folders in it, in the order of their names; also those of which it cannot be known
/// whether they are there.
pub fn study_files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let own = folder.join(STUDY_FILE);
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path().join(STUDY_FILE)))
        .chain([own])
        .filter(|file| is_file(file).unwrap_or(true))
        .collect();
    files.sort();
    Ok(files)
}

/// Returns the attachments of a recording: the running configuration and the robot's files.
pub fn attachments(options: &Options) -> Vec<(&str, &str, &[u8])> {
    let media = |name: &str| if name.ends_with(".toml") { "application/toml" } else { "application/xml" };
    let files = options.config.as_run.iter().chain(&options.robot.files);
    files.map(|(name, text)| (name.as_str(), media(name), text.as_bytes())).collect()
}

/// Returns a short name of the configuration and of the robot's files, for an operator to compare: FNV-1a of all files, 64
/// bits (Fowler, Noll and Vo, draft-eastlake-fnv).
pub fn fingerprint(config: &Config, robot: &RobotDescription) -> String {
    fnv1a(config.as_run.iter().chain(&robot.files).flat_map(|(name, text)| [name.as_bytes(), text.as_bytes()]))
}

/// Returns a short name of the robot's files, to compare the robots of workers on several hosts.
pub(super) fn robot_fingerprint(robot: &RobotDescription) -> String {
    fnv1a(robot.files.iter().flat_map(|(name, text)| [name.as_bytes(), text.as_bytes()]))
}

/// Returns the FNV-1a hash of texts one after the other, 64 bits, as hexadecimal digits.
pub(super) fn fnv1a<'a>(texts: impl Iterator<Item = &'a [u8]>) -> String {
    let hash = texts
        .flatten()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("{hash:016x}")
}

/// Returns the present time, UTC, ns since 1970.
pub fn utc_ns() -> u64 {
    u64::try_from(jiff::Timestamp::now().as_nanosecond()).unwrap_or(0)
}
