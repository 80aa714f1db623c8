//! The event loop: input, feed, update, draw, in this order, so that neither a slow link nor a busy engine delays the
//! response to a key. The loop waits for neither terminal nor engine; it waits for the disk when a table is exported.

use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use crossterm::clipboard::CopyToClipboard;
use nix::sys::signal::{Signal, raise};
use quadfrog::engine::EngineHandle;
use quadfrog::printable::shell_word;
use quadfrog::recording::record::LogLevel;
use quadfrog::telemetry::Mode;
use quadfrog::trial::counted;
use ratatui::Frame;
use ratatui::widgets::Clear;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::time::{MissedTickBehavior, interval};

use crate::action::Action;
use crate::connection::{ConnectionMonitor, TerminalLocation};

use crate::feed::{Feed, read_best_jump};
use crate::foreground::{NO_SHELL, has_shell, in_foreground};
use crate::graphics::GraphicsSupport;
use crate::input::{KeyReader, NumberedEvent, ReadEvent, SpaceBarIsText, TerminalEvent, read_in_thread};
use crate::leaving::Leaving;
use crate::message::{Effect, ExportedRows, Msg};
use crate::model::{Model, RobotFacts};
use crate::picture::PictureSchedule;
use crate::settings::{ChartMode, ConsoleSettings};
use crate::terminal::{self, TerminalProtocol, TerminalScreen};
use crate::theme::{ColourChoice, GlyphChoice, Theme, ThemeChoice};
use crate::update::{reply, say, update};
use crate::{export, text, view};

/// Maximum period of the loop and of the operator heartbeat.
const PULSE: Duration = Duration::from_millis(50);
/// Maximum frames per second over a slow link.
const LOW_BANDWIDTH_FRAMES: u32 = 2;

/// Longest wait of the first frame for the terminal's report of its background. A later report changes the colours.
const BACKGROUND_WAIT: Duration = Duration::from_millis(200);
/// Longest time that a replay plays at once: what passes while the process is stopped is not played.
const LONGEST_STEP: Duration = Duration::from_millis(500);

/// Options of the console.
#[derive(Debug, Clone)]
pub struct ConsoleOptions {
    /// `console.toml`.
    pub settings: ConsoleSettings,
    /// The robot, its limits and its ground.
    pub robot: RobotFacts,
    /// Recordings of earlier sessions of the study.
    pub earlier: Vec<PathBuf>,
}

impl ConsoleOptions {
    /// Overrides the settings by those of the command line.
    pub fn new(
        mut settings: ConsoleSettings,
        colours: Option<ColourChoice>,
        theme: ThemeChoice,
        ascii: bool,
        low_bandwidth: bool,
    ) -> ConsoleOptions {
        settings.low_bandwidth = low_bandwidth;
        if low_bandwidth {
            if settings.colours != ColourChoice::None {
                settings.colours = ColourChoice::Named;
            }
            settings.frames_per_second = settings.frames_per_second.min(LOW_BANDWIDTH_FRAMES);
            settings.chart_mode = ChartMode::Sweep;
        }
        if let Some(colours) = colours {
            settings.colours = colours;
        }
        if theme != ThemeChoice::Auto {
            settings.theme = theme;
        }
        if ascii {
            settings.glyphs = GlyphChoice::Ascii;
        }
        ConsoleOptions { settings, robot: RobotFacts::default(), earlier: Vec::new() }
    }

    /// Adds the robot.
    #[must_use]
    pub fn with_robot(self, robot: RobotFacts) -> ConsoleOptions {
        ConsoleOptions { robot, ..self }
    }

    /// Adds the recordings of earlier sessions of the study: the charts show the jump of their best trial.
    #[must_use]
    pub fn with_earlier(self, earlier: Vec<PathBuf>) -> ConsoleOptions {
        ConsoleOptions { earlier, ..self }
    }
}

/// The reason for which the console ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say the rest")]
pub enum ConsoleExit {
    Quit,
    Terminated,
    /// The terminal hung up; nothing can be printed.
    HungUp,
}

/// Opens the console on the feed and runs it until the operator or the system ends it; then ends the session of a live feed.
///
/// # Errors
/// When the terminal cannot be used. When a thread panicked; STOP is set then.
pub fn run(feed: Feed, options: ConsoleOptions) -> anyhow::Result<ConsoleExit> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().context("event loop")?;
    runtime.block_on(Console::open(feed, options)?.run())
}

struct Console {
    feed: Feed,
    /// The jump of an earlier session, once it is read.
    earlier: Option<Receiver<Msg>>,
    connection: ConnectionMonitor,
    /// State of the connection at the last heartbeat.
    connected: bool,
    model: Model,
    /// Report to the thread that reads the terminal, and the number of keys that were processed.
    space_bar_is_text: SpaceBarIsText,
    keys: u64,
    screen: TerminalScreen,
    pictures: PictureSchedule,
    started: Instant,
    frame_period: Duration,
    last_frame: Option<Instant>,
    last_feed: Instant,
    redraw: bool,
    /// A shell has, or had, the terminal since the console configured it.
    terminal_lost: bool,
    /// End of the wait for the terminal's report of its background.
    background_due: Option<Instant>,
    ended: Option<ConsoleExit>,
}

impl Console {
    fn open(feed: Feed, options: ConsoleOptions) -> anyhow::Result<Console> {
        let settings = options.settings;
        let theme = Theme::detect(settings.colours, settings.glyphs, |name| std::env::var(name).ok());
        let frame_period = Duration::from_secs(1) / settings.frames_per_second.max(1);
        let low_bandwidth = settings.low_bandwidth;
        let variable = |name: &str| std::env::var(name).ok();
        let support = GraphicsSupport::detect(settings.graphics, &theme, low_bandwidth, variable);
        let mut pictures = PictureSchedule::new(support);
        pictures.resize(crossterm::terminal::window_size().ok());
        let mut model = Model::new(settings, theme, options.robot);
        model.first_frame = true;
        let (columns, rows) = crossterm::terminal::size().context("the terminal's size")?;
        update(&mut model, Msg::Resize(columns, rows));
        // The kernel's console has no such report.
        let asks = model.follow_background
            && (theme.follows_background() || pictures.possible())
            && std::env::var("TERM").is_ok_and(|term| term != "linux");
        let protocol = TerminalProtocol {
            pastes: matches!(feed, Feed::Replay(_)),
            asks_background: asks,
            asks_attributes: pictures.asks(),
            synchronized: !low_bandwidth,
        };
        let mut screen = TerminalScreen::enter(protocol).context("the terminal cannot be used")?;
        screen.mouse(model.mouse).context("the terminal cannot be used")?;
        terminal::stop_on_panic(feed.handle().map(EngineHandle::stop_latch));
        let connection = match &feed {
            Feed::Live(_) => {
                let location = TerminalLocation::of(|name| std::env::var(name).ok());
                ConnectionMonitor::watch(location).context("connection monitor")?
            }
            Feed::Replay(_) => ConnectionMonitor::unmonitored(),
        };
        let now = Instant::now();
        let earlier = Some(options.earlier).filter(|files| !files.is_empty()).map(read_best_jump);
        Ok(Console {
            feed,
            earlier,
            connection,
            connected: true,
            model,
            space_bar_is_text: SpaceBarIsText::default(),
            keys: 0,
            screen,
            pictures,
            started: now,
            frame_period,
            last_frame: None,
            last_feed: now,
            redraw: true,
            terminal_lost: false,
            background_due: asks.then(|| now + BACKGROUND_WAIT),
            ended: None,
        })
    }

    async fn run(mut self) -> anyhow::Result<ConsoleExit> {
        let (input, mut inputs) = unbounded_channel();
        let stop = self.feed.stop_latch();
        read_in_thread(input.clone(), KeyReader::new(stop.is_none(), stop, self.space_bar_is_text.clone()))?;
        terminal::watch_for_hang_up(move || drop(input.send(None))).context("hang-up watcher")?;
        let mut interrupted = signal(SignalKind::interrupt())?;
        let mut terminated = signal(SignalKind::terminate())?;
        let mut hung_up = signal(SignalKind::hangup())?;
        let mut resized = signal(SignalKind::window_change())?;
        let mut suspended = signal(SignalKind::from_raw(Signal::SIGTSTP as i32))?;
        let mut continued = signal(SignalKind::from_raw(Signal::SIGCONT as i32))?;
        let mut pulse = interval(PULSE.min(self.frame_period));
        pulse.set_missed_tick_behavior(MissedTickBehavior::Skip);
        while self.ended.is_none() {
            self.hold_terminal();
            self.beat();
            tokio::select! {
                biased;
                Some(input) = inputs.recv() => self.process_input(input, &mut inputs),
                _ = hung_up.recv() => self.hang_up(),
                _ = terminated.recv() => self.exit_with(ConsoleExit::Terminated),
                _ = interrupted.recv() => {
                    let key = self.model.keymap.keys(Action::Interrupt).next();
                    self.update_with(key.map(Msg::Key));
                }
                _ = resized.recv() => self.resize(),
                _ = suspended.recv() => self.update_with([Msg::Suspend]),
                _ = continued.recv() => self.terminal_lost = true,
                _ = pulse.tick() => {}
            }
            if let Some(thread) = terminal::panicked() {
                self.perform_effect(Effect::Stop);
                self.feed.shutdown();
                return Err(panic_error(&thread));
            }
            self.poll_feed();
            self.draw_if_due()?;
        }
        self.end_session(&mut inputs)
    }

    /// Configures the terminal again after a shell or another program had it. In the background nothing is drawn.
    fn hold_terminal(&mut self) {
        if !in_foreground() {
            self.terminal_lost = true;
        } else if self.terminal_lost || self.screen.mode_was_changed() {
            self.terminal_lost = false;
            if self.screen.configure().and_then(|()| self.screen.mouse(self.model.mouse)).is_err() {
                self.hang_up();
            }
            update(&mut self.model, Msg::Resumed);
            self.redraw = true;
        }
    }

    /// Sends the operator heartbeat while the console is in the foreground and the connection is alive, and reports its loss and its
    /// return.
    fn beat(&mut self) {
        let connected = self.connection.alive();
        if connected
            && !self.terminal_lost
            && let Some(handle) = self.feed.handle()
        {
            handle.send_heartbeat();
        }
        if connected != self.connected {
            self.connected = connected;
            let text = if connected { "responds again" } else { "does not respond" };
            say(&mut self.model, LogLevel::Warning, format!("the SSH connection {text}"));
        }
    }

    /// Processes an input and all that are queued behind it.
    fn process_input(&mut self, input: ReadEvent, inputs: &mut UnboundedReceiver<ReadEvent>) {
        let mut next = Some(input);
        while let Some(input) = next {
            match input {
                Some(NumberedEvent { event, keys }) => {
                    self.keys = keys;
                    if matches!(event, TerminalEvent::Background(_)) {
                        self.background_due = None;
                    }
                    let message = match event {
                        TerminalEvent::Key(key) => Some(Msg::Key(key)),
                        TerminalEvent::Paste(text) => Some(Msg::Paste(text)),
                        TerminalEvent::Mouse(event) => Some(Msg::Mouse(event)),
                        TerminalEvent::Background(background) => Some(Msg::Background(background)),
                        TerminalEvent::Sixel(sixel) => {
                            self.pictures.answer(sixel);
                            None
                        }
                    };
                    self.update_with(message);
                }
                None => self.hang_up(),
            }
            self.redraw = true;
            next = inputs.try_recv().ok();
        }
    }

    fn poll_feed(&mut self) {
        let now = Instant::now();
        let elapsed = now.duration_since(self.last_feed);
        self.last_feed = now;
        // An observer stays with its session.
        let longest = if self.model.observer().is_none() { LONGEST_STEP } else { Duration::MAX };
        let elapsed = elapsed.min(longest);
        let news = self.feed.poll(u64::try_from(elapsed.as_nanos()).unwrap_or(0));
        self.update_with(news);
        if let Some(jump) = self.earlier.as_ref().and_then(|earlier| earlier.try_recv().ok()) {
            self.earlier = None;
            self.update_with([jump]);
        }
    }

    /// Updates the model and performs the effects.
    fn update_with(&mut self, messages: impl IntoIterator<Item = Msg>) {
        update(&mut self.model, Msg::Clock(self.started.elapsed()));
        for message in messages {
            for effect in update(&mut self.model, message) {
                self.perform_effect(effect);
            }
            self.space_bar_is_text.report(self.keys, self.model.space_bar_is_text());
        }
    }

    fn resize(&mut self) {
        if let Ok((columns, rows)) = crossterm::terminal::size() {
            self.pictures.resize(crossterm::terminal::window_size().ok());
            self.update_with([Msg::Resize(columns, rows)]);
            self.redraw = true;
        }
    }

    fn perform_effect(&mut self, effect: Effect) {
        match effect {
            Effect::Stop => self.feed.stop_latch().into_iter().for_each(|stop| stop.set()),
            Effect::Request(request) => {
                self.feed.handle().into_iter().for_each(|handle| handle.request(request.clone()))
            }
            Effect::Replay(command) => self.feed.control_replay(command),
            Effect::Rejudge(folder) => {
                self.feed.rejudge(Some(folder).filter(|folder| !folder.is_empty()).map(PathBuf::from));
            }
            Effect::EndRejudge => self.feed.end_rejudge(),
            Effect::Bell => self.send(b"\x07"),
            Effect::CopyTrial(trial) => self.copy_trial(trial),
            // A failure of these two is reported with the next frame.
            Effect::Mouse(on) => drop(self.screen.mouse(on)),
            Effect::Redraw => drop(self.screen.clear()),
            Effect::Export(rows) => {
                let written = export::table(&self.model, rows);
                let (shown, all) = (self.model.trial_rows().len(), self.model.every_trial().len());
                let count = match rows {
                    ExportedRows::All => format!("all {}", counted(all, "trial")),
                    ExportedRows::Shown => {
                        format!("{shown} of {}, {} left out", counted(all, "trial"), all - shown.min(all))
                    }
                };
                self.say_written(written, |path| {
                    format!("written: {count}, {} and the same as .md beside it", path.display())
                });
            }
            Effect::ExportBest => {
                let written = export::best(&self.model);
                self.say_written(written, |to| format!("exported; start with quadfrog --config {}", shell_word(to)));
            }
            Effect::Suspend if has_shell() => self.suspend(),
            Effect::Suspend => reply(&mut self.model, LogLevel::Warning, NO_SHELL),
            Effect::Quit => self.exit_with(ConsoleExit::Quit),
        }
    }

    /// Sends bytes, or drops them if the terminal is not ready: the loop never waits for a bell.
    fn send(&mut self, bytes: &[u8]) {
        if self.screen.ready() {
            let _ = self.screen.send(bytes);
        }
    }

    fn copy_trial(&mut self, trial: u32) {
        let Some(trial) = self.model.trial(trial) else { return };
        let mut bytes = Vec::new();
        // Writing to memory does not fail.
        let _ = crossterm::queue!(bytes, CopyToClipboard::to_clipboard_from(text::as_text(trial, &self.model)));
        self.send(&bytes);
    }

    fn say_written(&mut self, written: anyhow::Result<PathBuf>, text: impl FnOnce(&Path) -> String) {
        match written {
            Ok(path) => reply(&mut self.model, LogLevel::Info, text(&path)),
            Err(error) => say(&mut self.model, LogLevel::Error, format!("not written: {error}")),
        }
    }

    /// Restores the terminal and stops this process, as Ctrl-Z does, until it is continued.
    fn suspend(&mut self) {
        self.screen.release();
        // If SIGSTOP fails, the screen returns at once.
        let _ = raise(Signal::SIGSTOP);
        self.terminal_lost = true;
    }

    fn hang_up(&mut self) {
        self.screen.hang_up();
        self.exit_with(ConsoleExit::HungUp);
    }

    fn exit_with(&mut self, ended: ConsoleExit) {
        self.ended.get_or_insert(ended);
    }

    fn draw_if_due(&mut self) -> anyhow::Result<()> {
        // A quarter of the loop period early, so that a frame is not delayed by one whole period.
        let due = self.redraw || self.last_frame.is_none_or(|last| last.elapsed() + PULSE / 4 >= self.frame_period);
        let waits = self.background_due.is_some_and(|due| Instant::now() < due);
        if !due || waits || self.terminal_lost || !self.screen.ready() || self.ended == Some(ConsoleExit::HungUp) {
            return Ok(());
        }
        if self.screen.broken() {
            self.hang_up();
            return Ok(());
        }
        self.redraw = false;
        self.last_frame = Some(Instant::now());
        let (model, pictures) = (&self.model, &mut self.pictures);
        let draw = |frame: &mut Frame| {
            view::render(frame, model);
            let size = frame.area().as_size();
            // The cells below stay blank: a character there would be in the picture, or erase a part of it.
            pictures.picture(model, size, Instant::now()).inspect(|picture| frame.render_widget(Clear, picture.area))
        };
        self.screen.draw(draw).context("drawing")?;
        // The rest of the screen follows at once.
        self.redraw = std::mem::take(&mut self.model.first_frame);
        Ok(())
    }

    /// Ends the session, or leaves a watched one. Sitting down takes seconds, a lock of the study half a minute, an unconfirmed STOP at
    /// most one second: the screen goes on until the session has ended, and STOP keeps working.
    fn end_session(mut self, inputs: &mut UnboundedReceiver<ReadEvent>) -> anyhow::Result<ConsoleExit> {
        let ended = self.ended.unwrap_or(ConsoleExit::Quit);
        // The operator is present after a quit key, but not after a hang-up or SIGTERM.
        let heartbeat = self.feed.handle().map(EngineHandle::heartbeat).filter(|_| ended == ConsoleExit::Quit);
        let mut leaving = Leaving { heartbeat, stop: self.feed.stop_latch(), inputs };
        let jumps = matches!(self.model.mode(), Mode::Jump | Mode::Settle);
        if self.model.robot_is_energised() && (jumps || self.model.session.info.is_hardware()) {
            let first = if jumps { "lands" } else { "sits down" };
            say(&mut self.model, LogLevel::Info, format!("quitting: the robot {first}, then the program ends"));
        }
        self.update_with([Msg::Leaving]);
        self.redraw = true;
        self.screen.wait_until_written();
        self.draw_if_due()?;
        self.feed.end_requests();
        while !self.feed.session_has_ended() {
            leaving.pause(&self.connection);
            if !self.screen.broken() {
                self.hold_terminal();
            }
            self.poll_feed();
            // A terminal that cannot be drawn on shortens no sitting down.
            let _ = self.draw_if_due();
        }
        let (feed, connection) = (self.feed, self.connection);
        let closing = std::thread::Builder::new().name("close".into()).spawn(move || feed.shutdown())?;
        while !closing.is_finished() {
            leaving.pause(&connection);
        }
        // A panic of the closing thread is among those of all threads.
        let _ = closing.join();
        terminal::panicked().map_or(Ok(ended), |thread| Err(panic_error(&thread)))
    }
}

/// Returns the error of a session that the panic of a thread ended, once the panic is reported.
fn panic_error(thread: &str) -> anyhow::Error {
    terminal::wait_for_report();
    anyhow!("the thread `{thread}` panicked; the robot was stopped and the session was ended")
}
