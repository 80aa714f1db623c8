//! The program in a pseudo-terminal whose screen `vt100` emulates.

#![allow(dead_code, reason = "each test program uses a part")]

use std::io::{Read, Write};
use std::num::NonZeroU16;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use portable_pty::{Child, CommandBuilder, ExitStatus, MasterPty, PtySize, native_pty_system};

/// Time limit of every wait.
const PATIENCE: Duration = Duration::from_secs(30);

/// The user's own configuration of every program: one that waits for a busy processor is not a lost operator.
const PATIENT: (&str, &str) =
    ("XDG_CONFIG_HOME", concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/console/support/user-configuration"));
/// No configuration of the user's own. On hardware the other is refused.
pub const STRICT: (&str, &str) = ("XDG_CONFIG_HOME", "/nonexistent");

/// Output of the program so far.
struct Output {
    parser: vt100::Parser,
    bytes: Vec<u8>,
    /// Time and number of bytes so far of each read.
    reads: Vec<(Instant, usize)>,
}

/// A program in a terminal.
pub struct Session {
    master: Option<Box<dyn MasterPty + Send>>,
    writer: Option<Box<dyn Write + Send>>,
    child: Box<dyn Child + Send + Sync>,
    output: Arc<Mutex<Output>>,
    reader: Option<JoinHandle<()>>,
    reading: Arc<AtomicBool>,
    closed: Arc<AtomicBool>,
    cell: (u16, u16),
}

/// Terminal and environment of a program.
pub struct Setup<'a> {
    /// Columns and rows.
    pub size: (u16, u16),
    /// Width and height of a cell as the terminal reports them, pixels; zeros where it does not.
    pub cell: (u16, u16),
    /// Variables of the environment.
    pub variables: &'a [(&'a str, &'a str)],
}

fn nonzero(value: u16) -> NonZeroU16 {
    NonZeroU16::new(value).expect("a size")
}

fn pty_size((columns, rows): (u16, u16), cell: (u16, u16)) -> PtySize {
    PtySize { rows, cols: columns, pixel_width: columns * cell.0, pixel_height: rows * cell.1 }
}

impl Session {
    /// Starts `quadfrog --output folder`, with further arguments.
    pub fn start(folder: &Path, (columns, rows): (u16, u16), arguments: &[&str]) -> Session {
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.arg("--output");
        command.arg(folder);
        command.args(arguments);
        Session::run(folder, (columns, rows), command)
    }

    /// Starts the console in a new folder and waits until the robot can be armed.
    pub fn opened(size: (u16, u16), arguments: &[&str]) -> (tempfile::TempDir, Session) {
        let folder = tempfile::tempdir().expect("a folder");
        let session = Session::start(folder.path(), size, arguments);
        session.wait_for(&["Press A to arm"]);
        (folder, session)
    }

    /// Starts any command.
    pub fn run(folder: &Path, size: (u16, u16), command: CommandBuilder) -> Session {
        Session::run_in(folder, &Setup { size, cell: (0, 0), variables: &[] }, command)
    }

    /// Starts any command in a terminal and an environment.
    pub fn run_in(folder: &Path, setup: &Setup, mut command: CommandBuilder) -> Session {
        let (columns, rows) = setup.size;
        let pair = native_pty_system().openpty(pty_size(setup.size, setup.cell)).expect("a pseudo-terminal");
        command.cwd(folder);
        // Not the terminal of the user who runs the tests.
        for name in ["NO_COLOR", "COLORFGBG", "TMUX", "STY", "ZELLIJ", "TERM_PROGRAM", "LC_TERMINAL"] {
            command.env_remove(name);
        }
        let usual = [PATIENT, ("TERM", "xterm-256color"), ("LANG", "C.UTF-8"), ("LC_ALL", "C.UTF-8")];
        for (name, value) in usual.iter().chain(setup.variables) {
            command.env(name, value);
        }
        let child = pair.slave.spawn_command(command).expect("started");
        drop(pair.slave);
        let parser = vt100::Parser::new(nonzero(rows), nonzero(columns), 0);
        let output = Arc::new(Mutex::new(Output { parser, bytes: Vec::new(), reads: Vec::new() }));
        let reading = Arc::new(AtomicBool::new(true));
        let mut terminal = pair.master.try_clone_reader().expect("a reader");
        let closed = Arc::new(AtomicBool::new(false));
        let (kept, go_on, over) = (output.clone(), reading.clone(), closed.clone());
        let reader = std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            loop {
                while !go_on.load(Ordering::Acquire) {
                    std::thread::sleep(Duration::from_millis(5));
                }
                match terminal.read(&mut buffer) {
                    // The reader keeps the terminal open; a hang-up needs its end.
                    Ok(0) | Err(_) => return,
                    Ok(_) if over.load(Ordering::Acquire) => return,
                    Ok(count) => {
                        let mut kept = kept.lock().expect("output");
                        kept.parser.process(&buffer[..count]);
                        kept.bytes.extend_from_slice(&buffer[..count]);
                        let sent = kept.bytes.len();
                        kept.reads.push((Instant::now(), sent));
                    }
                }
            }
        });
        let writer = Some(pair.master.take_writer().expect("a writer"));
        let (master, reader) = (Some(pair.master), Some(reader));
        Session { master, writer, child, output, reader, reading, closed, cell: setup.cell }
    }

    /// Starts a shell with job control and waits for its prompt, `shell>`.
    pub fn shell(folder: &Path, setup: &Setup) -> Session {
        let mut shell = CommandBuilder::new("bash");
        shell.args(["--norc", "--noprofile", "-i"]);
        shell.env("PS1", "shell> ");
        let session = Session::run_in(folder, setup, shell);
        session.wait_for(&["shell>"]);
        session
    }

    fn output(&self) -> MutexGuard<'_, Output> {
        self.output.lock().expect("output")
    }

    /// The screen as text.
    pub fn screen(&self) -> String {
        self.output().parser.screen().contents()
    }

    /// Number of bytes sent to the terminal.
    pub fn bytes(&self) -> usize {
        self.output().bytes.len()
    }

    /// The bytes sent to the terminal.
    pub fn sent_bytes(&self) -> Vec<u8> {
        self.output().bytes.clone()
    }

    /// Number of bytes sent before each pause of 20 ms or more.
    pub fn bytes_before_pauses(&self) -> Vec<usize> {
        let output = self.output();
        let pause = |pair: &&[(Instant, usize)]| pair[1].0 - pair[0].0 >= Duration::from_millis(20);
        output.reads.windows(2).filter(pause).map(|pair| pair[0].1).collect()
    }

    /// Whether the output contains these bytes.
    pub fn sent(&self, bytes: &[u8]) -> bool {
        self.output().bytes.windows(bytes.len()).any(|window| window == bytes)
    }

    /// Whether the output after its first `from` bytes contains these.
    pub fn sent_after(&self, from: usize, bytes: &[u8]) -> bool {
        self.output().bytes[from..].windows(bytes.len()).any(|window| window == bytes)
    }

    /// Whether the terminal is restored: normal screen, visible cursor, no bracketed paste, no mouse capture.
    pub fn restored(&self) -> bool {
        let output = self.output();
        let screen = output.parser.screen();
        let own_mouse = screen.mouse_protocol_mode() == vt100::MouseProtocolMode::None;
        !screen.alternate_screen() && !screen.hide_cursor() && !screen.bracketed_paste() && own_mouse
    }

    /// Whether the line discipline is in cooked mode with signals.
    pub fn cooked(&self) -> bool {
        use nix::libc::{ECHO, ICANON, ISIG};
        let attributes = self.master.as_ref().and_then(|master| master.get_termios());
        let wanted = ICANON | ECHO | ISIG;
        attributes.is_some_and(|attributes| attributes.local_flags.bits() & wanted == wanted)
    }

    /// Waits until the screen shows all of the texts.
    pub fn wait_for(&self, texts: &[&str]) {
        self.wait_until(&format!("the screen shows {texts:?}"), || {
            let screen = self.screen();
            texts.iter().all(|text| screen.contains(text))
        });
    }

    /// Waits until `condition` holds.
    pub fn wait_until(&self, what: &str, condition: impl Fn() -> bool) {
        let begun = Instant::now();
        while !condition() {
            assert!(begun.elapsed() < PATIENCE, "never: {what}\n{}", self.screen());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until `condition` holds, through several jumps in real time.
    pub fn wait_for_long(&self, what: &str, condition: impl Fn() -> bool) {
        let begun = Instant::now();
        while !condition() {
            assert!(begun.elapsed() < 10 * PATIENCE, "never: {what}\n{}", self.screen());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Sends bytes as typed.
    pub fn send(&mut self, bytes: &str) {
        let writer = self.writer.as_mut().expect("the terminal is there");
        writer.write_all(bytes.as_bytes()).expect("typed");
        writer.flush().expect("typed");
    }

    /// Ends a console, which asks while the robot is armed.
    pub fn quit(&mut self) -> ExitStatus {
        self.send("q");
        self.wait_until("quitting asks or ends", || self.screen().contains("Quit?") || self.restored());
        if !self.restored() {
            self.send("y");
        }
        self.wait()
    }

    /// Approves the jump: two presses, a second apart.
    pub fn approve(&mut self) {
        self.send("g");
        self.wait_for(&["Jump?"]);
        std::thread::sleep(Duration::from_millis(1000));
        self.send("g");
    }

    pub fn resize(&self, columns: u16, rows: u16) {
        let size = pty_size((columns, rows), self.cell);
        self.output().parser.set_size(nonzero(rows), nonzero(columns));
        self.master.as_ref().expect("the terminal is there").resize(size).expect("resized");
    }

    /// Pauses or resumes reading the program's output.
    pub fn read(&self, on: bool) {
        self.reading.store(on, Ordering::Release);
    }

    pub fn pid(&self) -> Pid {
        Pid::from_raw(self.child.process_id().expect("running") as i32)
    }

    pub fn signal(&self, signal: Signal) {
        kill(self.pid(), signal).expect("signalled");
    }

    /// Closes the other end of the terminal, as a lost connection does.
    pub fn hang_up(&mut self) {
        self.closed.store(true, Ordering::Release);
        self.writer = None;
        self.master = None;
    }

    pub fn finished(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().expect("asked")
    }

    /// Waits until the program has ended; what it started may still run.
    pub fn ended(&mut self) -> ExitStatus {
        let begun = Instant::now();
        loop {
            if let Some(status) = self.finished() {
                return status;
            }
            assert!(begun.elapsed() < PATIENCE, "the program did not end:\n{}", self.screen());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until the program has ended and all of its output is read.
    pub fn wait(&mut self) -> ExitStatus {
        let status = self.ended();
        self.read(true);
        // The reader ends when the last process in the terminal has.
        if let Some(reader) = self.reader.take() {
            self.wait_until("the terminal is closed", || reader.is_finished());
        }
        status
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Ends the program of a failed test.
        let _ = self.child.kill();
    }
}
