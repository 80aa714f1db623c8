//! Wires the threads; computes nothing. `Engine::start` takes a checked configuration and gives a screen its [`Handle`].

mod control_thread;
mod guard;
mod stored;

pub use guard::{GUARD, GuardError, Watch, stand as stand_guard};
pub use stored::{Opened, StoredStudy, newest_config, open_stored, stored_studies, stored_study, study_files};

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::json;

use self::guard::Guard;
use crate::config::{Backend, Config, ConfigError};
use crate::optimize::journal::Durability;
use crate::optimize::sampler::Direction;
use crate::optimize::space::{Range, Space, SpaceError};
use crate::optimize::study::{Storage, Study, StudyError, StudyOptions};
use crate::realtime::channel::{Heartbeat, ScreenEnd, StopLatch, channels};
use crate::realtime::clock::{Clock, MonotonicClock};
use crate::recording::RecordingError;
use crate::recording::record::{Record, SessionInfo, Stamped};
use crate::recording::recorder::{Recorder, RecorderStatus};
use crate::recording::writer::Writer;
use crate::robot::description::RobotDescription;
use crate::robot::go1::Go1;
use crate::robot::go1::link::LinkError;
use crate::robot::{Placement, Robot};
use crate::session::arming_checklist::ArmingChecklist;
use crate::session::experiment::{BUDGET, Experiment, ExperimentPlan};
use crate::session::operator_request::{OperatorRequest, StampedRequest};
use crate::session::supervisor::{RecordSinks, Supervisor, SupervisorParts};
use crate::sim::{SimError, Simulator};
use crate::telemetry::{Mode, Snapshot, Tick};
use crate::trial::{Approval, Task};

/// What an engine is started with.
pub struct Options {
    /// The configuration.
    pub config: Config,
    /// The machine.
    pub robot: RobotDescription,
    /// What stands behind the controller.
    pub backend: Backend,
    /// The task.
    pub task: Task,
    /// Seed of the study.
    pub seed: u32,
    /// Trials that are to count; none takes the configuration's.
    pub trials: Option<u32>,
    /// The folder of the study, made if it does not exist: study.log, session.mcap, config/. None keeps nothing.
    pub folder: Option<PathBuf>,
    /// Whether the session only looks.
    pub observe: bool,
    /// Who approves and judges.
    pub approve: Approval,
    /// A journal in which to take part as one more worker, instead of the study of the folder.
    pub join: Option<Storage>,
    /// The program that stands guard over a real robot when it is run with [`GUARD`]: it damps the robot when this process falls
    /// silent. None does without.
    pub guard: Option<PathBuf>,
}

impl Options {
    /// A study of `task` with seed 0 that keeps nothing and in which a person approves and judges.
    pub fn new(config: Config, robot: RobotDescription, backend: Backend, task: Task) -> Options {
        Options {
            config,
            robot,
            backend,
            task,
            seed: 0,
            trials: None,
            folder: None,
            observe: false,
            approve: Approval::Each,
            join: None,
            guard: None,
        }
    }

    fn budget(&self) -> u32 {
        self.trials.unwrap_or(self.config.optimize.trials)
    }
}

/// Why an engine does not start.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// A value of the configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The simulator's configuration.
    #[error(transparent)]
    Simulator(#[from] SimError),
    /// The link to the robot.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The search space.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The study.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A robot that may hurt somebody is not left to itself.
    #[error(
        "--approve auto: only on the simulator; a jump of the robot is approved by a person: give each or falls-only"
    )]
    Unattended,
    /// A journal that is not there.
    #[error("{}: there is no such journal; give a study's folder, its study.log, a journal file or redis://HOST:PORT/DB", file.display())]
    NoJournal {
        /// The file.
        file: PathBuf,
    },
    /// A journal with several studies.
    #[error("{journal}: several studies are in it: say with --name which: {names}")]
    WhichStudy {
        /// The journal.
        journal: String,
        /// Their names.
        names: String,
    },
    /// A study that is not there.
    #[error("{journal}: there is no such study in it{}", if names.is_empty() { String::new() } else { format!("; there is {names}") })]
    NoSuchStudy {
        /// The journal.
        journal: String,
        /// The names that there are.
        names: String,
    },
    /// A study that this program cannot use.
    #[error(
        "{journal}: study {name} has no real-valued parameter yet, or several objectives; this program knows neither"
    )]
    Unusable {
        /// The journal.
        journal: String,
        /// Its name.
        name: String,
    },
    /// A journal without a study of ours.
    #[error("{}: holds no study of this program; give one that it made", file.display())]
    NoStudy {
        /// The file.
        file: PathBuf,
    },
    /// Another session has the study.
    #[error("{}: another session is running in this folder; end it first, or look at it with optuna-dashboard", folder.display())]
    InUse {
        /// The folder.
        folder: PathBuf,
    },
    /// The folder of the study, or a thread.
    #[error("{what}: {source}")]
    System {
        /// What was attempted.
        what: String,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Opens the study of `options` as a life of trials: what console and `optimize` have in common.
///
/// # Errors
/// When the study cannot be read, or is of another task.
pub fn open_life(options: &Options, durability: Durability, recording: &str) -> Result<Experiment, EngineError> {
    let parameters = options.config.parameters(options.task);
    let space = Space::new(parameters.iter().map(|p| (p.name.clone(), Range::linear(p.low, p.high))))?;
    let mut sampler = options.config.optimize.sampler.clone();
    sampler.seed = options.seed;
    let storage = match (&options.join, &options.folder) {
        (Some(storage), _) => storage.clone(),
        (None, Some(folder)) => Storage::File(folder.join(STUDY_FILE)),
        (None, None) => Storage::Memory,
    };
    let budget = options.budget();
    let mut study = Study::open(
        storage,
        StudyOptions {
            name: study_name(options.task, options.seed),
            direction: Direction::Maximize,
            metric: format!("J_{} ({})", options.task.name(), options.task.unit()),
            space,
            sampler,
            attributes: vec![
                ("task".to_owned(), json!(options.task.name())),
                ("robot".to_owned(), json!(options.robot.name)),
                ("seed".to_owned(), json!(options.seed)),
                ("sampler".to_owned(), json!(options.config.optimize.sampler)),
                ("version".to_owned(), json!(env!("CARGO_PKG_VERSION"))),
                (BUDGET.to_owned(), json!(budget)),
            ],
            durability,
        },
    )?;
    if options.join.is_none() && study.trials().is_empty() {
        enqueue_first(&mut study, &options.config.first(options.task))?;
    }
    let worker = if options.join.is_some() { study.join()? } else { 0 };
    if worker == 0 && study.attributes().get(BUDGET) != Some(&json!(budget)) {
        study.annotate_study(&[(BUDGET.to_owned(), json!(budget))])?;
    }
    let plan = ExperimentPlan {
        task: options.task,
        control: *options.config.task(options.task),
        parameters,
        seed: u64::from(options.seed),
        budget,
        recording: recording.to_owned(),
        widest: options.config.widest(options.task),
        gains: options.config.gains(),
        contenders: options.config.optimize.confirm.contenders,
        confidence: options.config.optimize.confirm.confidence,
        worker,
        abandoned: Duration::from_secs_f64(options.config.optimize.workers.abandoned_s),
    };
    Ok(Experiment::open(plan, study)?)
}

/// The point that the configuration asks to begin with.
fn enqueue_first(study: &mut Study, point: &[(String, f64)]) -> Result<(), StudyError> {
    if point.is_empty() {
        return Ok(());
    }
    study.enqueue_unless(point, &[("source".to_owned(), json!("queued"))], |trials| !trials.is_empty()).map(drop)
}

/// The name of a study in its journal.
pub fn study_name(task: Task, seed: u32) -> String {
    format!("{}-seed{seed}", task.name())
}

/// What a session of `options` is called in its recording.
pub fn session_info(options: &Options, recording: &str) -> SessionInfo {
    SessionInfo {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        backend: match options.backend {
            Backend::Simulator => "sim",
            Backend::Hardware => "go1",
        }
        .to_owned(),
        robot: options.robot.name.clone(),
        task: options.task.name().to_owned(),
        unit: options.task.unit().to_owned(),
        sampler: format!("{:?}", options.config.optimize.sampler.kind).to_lowercase(),
        seed: u64::from(options.seed),
        budget: options.budget(),
        parameters: options.config.parameters(options.task),
        study: match (&options.join, &options.folder) {
            (Some(storage), _) => storage.to_string(),
            (None, Some(folder)) => folder.join(STUDY_FILE).display().to_string(),
            (None, None) => String::new(),
        },
        recording: recording.to_owned(),
        started: jiff::Timestamp::now().to_string(),
        observe: options.observe,
        gains: options.config.gains(),
        approve: options.approve.name().to_owned(),
    }
}

/// The study's file in its folder.
pub const STUDY_FILE: &str = "study.log";

/// Makes the folder of `options`, keeps the configuration in it as it runs, and names the next recording there:
/// `session.mcap`, `session-2.mcap`, ...; none without a folder.
///
/// # Errors
/// When the folder cannot be made or written.
pub fn prepare_folder(options: &Options) -> Result<Prepared, EngineError> {
    let Some(folder) = &options.folder else { return Ok(Prepared { recording: None, _lock: None }) };
    let system = |what: String| move |source| EngineError::System { what, source };
    std::fs::create_dir_all(folder).map_err(system(format!("{}: cannot be made", folder.display())))?;
    // The operating system lets go of the lock however the session ends.
    let path = folder.join("session.lock");
    let lock = std::fs::File::create(&path).map_err(system(format!("{}: cannot be made", path.display())))?;
    match lock.try_lock() {
        Ok(()) => {}
        Err(std::fs::TryLockError::WouldBlock) => return Err(EngineError::InUse { folder: folder.clone() }),
        Err(std::fs::TryLockError::Error(source)) => {
            return Err(system(format!("{}: cannot be locked", path.display()))(source));
        }
    }
    keep_config(options, folder)?;
    let taken = |path: &PathBuf| path.exists() || path.with_extension("mcap.part").exists();
    let names = std::iter::once("session.mcap".to_owned()).chain((2..).map(|n| format!("session-{n}.mcap")));
    let recording = names.map(|name| folder.join(name)).find(|path| !taken(path));
    Ok(Prepared { recording, _lock: Some(lock) })
}

/// A study's folder that this session alone may use, as long as this lives.
pub struct Prepared {
    /// Where the recording goes.
    pub recording: Option<PathBuf>,
    _lock: Option<std::fs::File>,
}

/// Keeps the configuration as it runs in `config/`, or in `config-2/`, ... where the session before ran with another: the
/// one of highest number is always the one that ran last.
fn keep_config(options: &Options, folder: &Path) -> Result<(), EngineError> {
    let system = |what: String| move |source| EngineError::System { what, source };
    let config = match newest_config(folder) {
        None => folder.join("config"),
        Some((number, newest)) => {
            let same = |(name, text): &(String, String)| {
                std::fs::read_to_string(newest.join(name)).is_ok_and(|kept| kept == *text)
            };
            if options.config.as_run.iter().all(same) {
                return Ok(());
            }
            folder.join(format!("config-{}", number + 1))
        }
    };
    std::fs::create_dir(&config).map_err(system(format!("{}: cannot be made", config.display())))?;
    for (name, text) in &options.config.as_run {
        let path = config.join(name);
        std::fs::write(&path, text).map_err(system(format!("{}: cannot be written", path.display())))?;
    }
    Ok(())
}

/// The attachments of a recording: the configuration as it runs.
pub fn attachments(config: &Config) -> Vec<(&str, &str, &[u8])> {
    config.as_run.iter().map(|(name, text)| (name.as_str(), "application/toml", text.as_bytes())).collect()
}

/// A short name of the configuration as it runs, for an operator to compare: FNV-1a of all files, 64 bits (Fowler, Noll and
/// Vo, draft-eastlake-fnv).
pub fn fingerprint(config: &Config) -> String {
    let texts = config.as_run.iter().flat_map(|(name, text)| [name.as_bytes(), text.as_bytes()]);
    let hash = texts
        .flatten()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3));
    format!("{hash:016x}")
}

/// The present time, UTC, ns since 1970.
pub fn utc_ns() -> u64 {
    u64::try_from(jiff::Timestamp::now().as_nanosecond()).unwrap_or(0)
}

/// A running engine: control, recorder and session threads.
pub struct Engine;

impl Engine {
    /// Starts the threads.
    ///
    /// # Errors
    /// When the configuration, the study, the recording or the system does not allow it; nothing runs then.
    pub fn start(options: Options) -> Result<Handle, EngineError> {
        if options.approve == Approval::Auto && options.backend == Backend::Hardware {
            return Err(EngineError::Unattended);
        }
        let settings = options.config.settings(&options.robot, options.task, options.backend)?;
        let system = |what: &'static str| {
            move |source| EngineError::System { what: format!("the {what} could not be started"), source }
        };
        let (mut robot, guard): (Box<dyn Robot>, _) = match options.backend {
            Backend::Simulator => (Box::new(Simulator::new(&options.robot, &options.config.simulator)?), None),
            Backend::Hardware => {
                let go1 = Go1::open(&options.robot, options.observe)?;
                let post = |program: &PathBuf| Guard::post(program, &go1, &settings);
                let guard = options.guard.as_ref().map(post).transpose().map_err(system("guard"))?;
                (Box::new(go1), guard)
            }
        };
        // A simulated robot begins as a real one does: lying folded on its belly.
        robot.place(&Placement { joint_position: settings.lying_position, lying: true, seed: u64::from(options.seed) });
        let prepared = prepare_folder(&options)?;
        let recording = prepared.recording.clone();
        let recording_name =
            recording.as_ref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned());
        let life = open_life(&options, Durability::Synced, recording_name.as_deref().unwrap_or_default())?;
        let info = session_info(&options, &recording.as_ref().map(|p| p.display().to_string()).unwrap_or_default());
        let (guard, lifeline) = guard.unzip();
        let clock = MonotonicClock::start();
        let writer = match &recording {
            Some(path) => Some(Writer::create(path, &info, utc_ns(), &attachments(&options.config))?),
            None => None,
        };

        let (control_end, session_end, screen_end, tick_end) = channels();
        let (to_recorder, recorder_records) = channel();
        let (to_screen, screen_records) = channel();
        let (handed_in, handed) = channel();
        let recorder = Recorder::spawn(tick_end, recorder_records, writer, handed_in);
        let outlets = RecordSinks { recorder: to_recorder, screen: to_screen };
        let status = recorder.watch();
        let closing = Arc::new(AtomicBool::new(false));

        let thread = std::thread::Builder::new().name("control".into());
        let flag = closing.clone();
        let scheduling = options.config.scheduling(options.backend);
        let (told, granted) = channel();
        let real = options.backend == Backend::Hardware;
        let control = thread
            .spawn(move || {
                let start = control_thread::Start {
                    settings: &settings,
                    scheduling,
                    told,
                    clock: &clock,
                    closing: &flag,
                    real,
                    lifeline,
                };
                control_thread::run(start, control_end, &mut *robot);
            })
            .map_err(system("control thread"))?;

        let (intents_in, intents) = channel();
        let folder = recording.as_ref().and(options.folder.clone());
        let pre_arm = ArmingChecklist::new(&settings, fingerprint(&options.config), folder);
        let parts = SupervisorParts { life, control: session_end, handed, outlets, recorder: status, pre_arm, info };
        let simulated = options.backend == Backend::Simulator;
        let mut supervisor = Supervisor::new(parts, clock.now_ns()).approving(options.approve, simulated);
        if let Ok((favours, shortfalls)) = granted.recv() {
            supervisor.tell_scheduling(&favours, &shortfalls, clock.now_ns());
        }
        let sits_down = options.backend == Backend::Hardware;
        let session = std::thread::Builder::new()
            .name("session".into())
            .spawn(move || run_session(supervisor, guard, &intents, &clock, sits_down))
            .map_err(system("session thread"))?;

        Ok(Handle {
            screen: screen_end,
            recording,
            _prepared: prepared,
            intents: Some(intents_in),
            clock,
            records: screen_records,
            closing,
            control: Some(control),
            session: Some(session),
            recorder: Some(recorder),
        })
    }
}

/// How often the session looks for events.
const SESSION_PERIOD: Duration = Duration::from_millis(5);
/// How long landing and sitting down at the end may take.
const LONGEST_GOODBYE: Duration = Duration::from_secs(10);
/// For how long damping is sent to a real robot before nothing is: it sinks softly in that time.
const DAMPING_AT_THE_END: Duration = Duration::from_millis(500);
/// How long it is waited for the answer to the last STOP: a living control thread gives it in a millisecond.
const LONGEST_STOP: Duration = Duration::from_secs(2);

/// The session thread: intents as they come, events every few milliseconds, until the screen lets go of its handle.
/// Gives back the session's ends of the channels: a control thread whose session is gone takes that for a breakdown. The
/// guard, too: the control thread commands the robot until its own end.
fn run_session(
    mut supervisor: Supervisor,
    mut guard: Option<Guard>,
    intents: &Receiver<StampedRequest>,
    clock: &MonotonicClock,
    sits_down: bool,
) -> (Supervisor, Option<Guard>) {
    loop {
        supervisor.attend(clock.now_ns());
        if guard.as_mut().is_some_and(Guard::lost) {
            supervisor.tell_guard_lost(clock.now_ns());
        }
        if supervisor.mode() == Mode::Observe {
            supervisor.take_control();
        }
        match intents.recv_timeout(SESSION_PERIOD) {
            Ok(wish) => supervisor.carry_out(&wish, clock.now_ns()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    let begun = clock.now_ns();
    let within = |begun: u64, limit: Duration| clock.now_ns() - begun < limit.as_nanos() as u64;
    while supervisor.say_goodbye(sits_down) && within(begun, LONGEST_GOODBYE) {
        std::thread::sleep(SESSION_PERIOD);
        supervisor.attend(clock.now_ns());
    }
    if sits_down {
        supervisor.stop();
        let begun = clock.now_ns();
        // Until it is heard that nothing is energised. A control thread that does not say so any more damps by itself.
        while within(begun, DAMPING_AT_THE_END) || supervisor.mode().energised() && within(begun, LONGEST_STOP) {
            std::thread::sleep(SESSION_PERIOD);
            supervisor.attend(clock.now_ns());
        }
    }
    supervisor.close(clock.now_ns());
    (supervisor, guard)
}

/// What a screen holds of a running engine: it draws from it and asks through it, and decides nothing. Dropping it ends
/// the engine as `shutdown` does.
pub struct Handle {
    screen: ScreenEnd,
    recording: Option<PathBuf>,
    _prepared: Prepared,
    intents: Option<Sender<StampedRequest>>,
    clock: MonotonicClock,
    records: Receiver<Stamped>,
    closing: Arc<AtomicBool>,
    control: Option<JoinHandle<()>>,
    session: Option<JoinHandle<(Supervisor, Option<Guard>)>>,
    recorder: Option<crate::recording::recorder::RecorderHandle>,
}

impl Handle {
    /// Stops the robot: damping in the next tick, whatever the mode. Never waits, never fails.
    pub fn stop(&self) {
        self.screen.stop.set();
    }

    /// The stop latch itself, for a thread that must be able to stop without the screen.
    pub fn stop_latch(&self) -> StopLatch {
        self.screen.stop.clone()
    }

    /// The recording of this session; none where nothing is kept.
    pub fn recording(&self) -> Option<&Path> {
        self.recording.as_deref()
    }

    /// How the recorder is doing; none where nothing is kept.
    pub fn recorder(&self) -> Option<RecorderStatus> {
        self.recording.as_ref().and(self.recorder.as_ref()).map(|recorder| recorder.status())
    }

    /// The screen is alive; to be called at least ten times a second.
    pub fn beat(&self) {
        self.screen.heartbeat.beat();
    }

    /// The sign of life itself, for a screen that beats elsewhere.
    pub fn heartbeat(&self) -> Heartbeat {
        self.screen.heartbeat.clone()
    }

    /// Wishes something. The answer comes as a `CommandRecord`.
    pub fn wish(&self, intent: OperatorRequest) {
        if let Some(intents) = &self.intents {
            // A session that has ended answers nothing; the screen sees that its records end.
            let wish = StampedRequest { intent, stops: self.screen.stop.count(), time_ns: self.clock.now_ns() };
            let _ = intents.send(wish);
        }
    }

    /// The newest tick and counters.
    pub fn snapshot(&mut self) -> Snapshot {
        *self.screen.snapshot.read()
    }

    /// The next of the ticks for charts, 200 a second.
    pub fn next_tick(&mut self) -> Option<Tick> {
        self.screen.shown.pop().ok()
    }

    /// The next record that the screen has not seen.
    pub fn next_record(&mut self) -> Option<Stamped> {
        self.records.try_recv().ok()
    }

    /// Sits the robot down if it stands, closes the recording and ends the threads. Returns the records of the end.
    pub fn shutdown(mut self) -> Vec<Stamped> {
        self.end();
        self.records.try_iter().filter(|stamped| !matches!(stamped.record, Record::Counters(_))).collect()
    }

    fn end(&mut self) {
        self.intents = None;
        // Each thread ends with what feeds it: the session, then control, then the recorder. A thread that panicked has
        // said so already.
        let session = self.session.take().map(JoinHandle::join);
        self.closing.store(true, Ordering::Release);
        if let Some(control) = self.control.take() {
            let _ = control.join();
        }
        if let Some(Ok((supervisor, guard))) = session {
            // The last that feeds the recorder.
            drop(supervisor);
            if let Some(guard) = guard {
                guard.dismiss();
            }
        }
        if let Some(recorder) = self.recorder.take() {
            let _ = recorder.join();
        }
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.end();
    }
}
