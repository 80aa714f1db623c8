//! A second person on the same machine: `quadfrog sessions` lists what runs, `quadfrog attach` watches it and passes STOP on.

use std::io::{BufRead, BufReader, Error, ErrorKind, Read, Write};
use std::os::unix::fs::{DirBuilderExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use crate::pty::Session;
use nix::sys::signal::Signal;
use portable_pty::CommandBuilder;
use quadfrog::engine::{Observer, find_sessions};

const SIZE: (u16, u16) = (120, 40);

/// A lab's machine: a folder for studies, and one for what runs.
struct Lab {
    folder: tempfile::TempDir,
}

impl Lab {
    fn new() -> Lab {
        Lab { folder: tempfile::tempdir().unwrap() }
    }

    /// The folder of the sockets: the sessions of the machine that runs the tests are not seen.
    fn sessions(&self) -> PathBuf {
        self.folder.path().join("sessions")
    }

    fn open(&self, arguments: &[&str]) -> Session {
        let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.args(arguments);
        command.env("QUADFROG_SESSIONS", self.sessions());
        Session::run(self.folder.path(), SIZE, command)
    }

    /// A session that can be armed.
    fn session(&self, output: &str, arguments: &[&str]) -> Session {
        let session = self.open(&[&["--output", output, "--operator", "Ada"], arguments].concat());
        session.wait_for(&["Press A to arm"]);
        session
    }

    fn command(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.args(arguments).current_dir(self.folder.path()).env("QUADFROG_SESSIONS", self.sessions());
        command.output().unwrap()
    }

    /// The lines of `quadfrog sessions` below their heading.
    fn listed(&self) -> Vec<String> {
        let output = self.command(&["sessions"]);
        assert!(output.status.success());
        let text = String::from_utf8(output.stdout).unwrap();
        let mut lines = text.lines().map(str::to_owned);
        assert!(lines.next().is_none_or(|heading| heading.starts_with("process  robot")), "{text}");
        lines.collect()
    }

    fn sockets(&self) -> Vec<PathBuf> {
        std::fs::read_dir(self.sessions()).unwrap().map(|entry| entry.unwrap().path()).collect()
    }
}

fn refusal(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn a_colleague_watches_a_session_and_stops_its_robot() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    let listed = lab.listed();
    assert_eq!(listed.len(), 1, "{listed:?}");
    for part in [" sim go1 ", " forward ", " Ada  ", "-forward-seed"] {
        assert!(listed[0].contains(part), "{listed:?}");
    }
    session.send("A");
    session.wait_for(&["READY"]);
    let mut watcher = lab.open(&["attach", "--operator", "Grace"]);
    watcher.wait_for(&["WATCHING", "FOLLOWING", "READY"]);
    session.send("6");
    session.wait_for(&["Grace watches this session"]);
    session.send("5");
    session.wait_for(&["1 with quadfrog attach"]);
    // Nothing but STOP reaches the session.
    watcher.send("k");
    watcher.wait_for(&["this console only watches"]);
    session.send("1");
    session.approve();
    session.wait_for(&["JUMP"]);
    watcher.send(" ");
    session.wait_for(&["DAMPED"]);
    // The operator's line says who stopped; one press is one line of the log.
    session.wait_for(&["k acknowledges: STOP by Grace"]);
    session.send("6");
    session.wait_for(&["W session   STOP by Grace, who watches this session"]);
    std::thread::sleep(Duration::from_millis(300));
    let lines = session.screen().matches("W session   STOP by Grace").count();
    assert_eq!(lines, 1, "{}", session.screen());
    // Regression: the trial's cause did not name the observer.
    session.send("2");
    session.wait_for(&["STOP was pressed by Grace, who watches this session"]);
    watcher.wait_for(&["DAMPED"]);
    assert!(!watcher.screen().contains("NOT CONFIRMED"), "{}", watcher.screen());
    watcher.send("q");
    assert!(watcher.wait().success());
    session.send("6");
    session.wait_for(&["Grace does not watch any longer"]);
    assert!(session.quit().success());
    assert!(lab.sockets().is_empty() && lab.listed().is_empty());
}

/// Regression: the operator's own STOP was attributed to an observer called "STOP by Eve" who had just come.
#[test]
fn an_observer_called_as_a_stop_has_not_stopped_the_trial() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    session.send("A");
    session.wait_for(&["READY"]);
    session.approve();
    session.wait_for(&["JUMP"]);
    let mut named = UnixStream::connect(lab.sockets().remove(0)).unwrap();
    named.write_all(b"{\"watch\":\"STOP by Eve\"}\n").unwrap();
    std::thread::sleep(Duration::from_millis(50));
    session.send(" ");
    session.wait_for(&["DAMPED"]);
    session.send("2");
    session.wait_for(&["STOP was pressed"]);
    assert!(!session.screen().contains("pressed by"), "{}", session.screen());
    session.send("6");
    session.wait_for(&["STOP by Eve watches this session"]);
    assert!(session.quit().success());
}

/// Regression: an observer that left within 10 ms of its STOP had not sent it.
#[test]
fn an_observer_that_leaves_at_once_has_sent_its_stop() {
    let (_folder, mut session) = Session::opened(SIZE, &[]);
    session.send("A");
    session.wait_for(&["READY"]);
    let process = session.pid();
    let found = find_sessions().running;
    let running = found.into_iter().find(|running| running.facts.process.to_string() == process.to_string());
    let observer = Observer::join(running.expect("the session"), "Grace").unwrap();
    observer.stop_latch().set();
    drop(observer);
    session.wait_for(&["DAMPED", "k acknowledges: STOP by Grace"]);
    assert!(session.quit().success());
}

/// The STOP that comes in one read with the key that quits.
#[test]
fn a_stop_and_a_quit_at_once_stop_the_robot_of_a_watched_session() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    session.send("A");
    session.wait_for(&["READY"]);
    // Ctrl-C twice; F12 and q.
    for keys in ["\x03\x03", "\x1b[24~q"] {
        let mut watcher = lab.open(&["attach", "--operator", "Grace"]);
        watcher.wait_for(&["WATCHING", "READY"]);
        watcher.send(keys);
        assert!(watcher.wait().success());
        session.wait_for(&["DAMPED", "k acknowledges: STOP by Grace"]);
        session.send("k");
        session.wait_for(&["DISARMED"]);
        session.send("A");
        session.wait_for(&["READY"]);
    }
    assert!(session.quit().success());
}

/// A session that hangs confirms nothing: the observer waits for it and leaves all the same.
#[test]
fn an_observer_of_a_hung_session_can_quit_after_its_stop() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    let mut watcher = lab.open(&["attach"]);
    watcher.wait_for(&["WATCHING"]);
    session.signal(Signal::SIGSTOP);
    watcher.send("\x03\x03");
    assert!(watcher.wait().success());
    watcher.wait_for(&["the session did not confirm STOP"]);
    session.signal(Signal::SIGCONT);
    session.quit();
}

/// Regression: where neither USER nor LOGNAME names the user, as in a container, the operator was unknown.
#[test]
fn an_operator_without_variables_has_the_login_name() {
    let lab = Lab::new();
    let mut command = CommandBuilder::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.env("QUADFROG_SESSIONS", lab.sessions());
    command.env("USER", "");
    command.env("LOGNAME", "");
    let mut session = Session::run(lab.folder.path(), SIZE, command);
    session.wait_for(&["Press A to arm"]);
    let login = Command::new("id").arg("-un").output().unwrap();
    let login = String::from_utf8(login.stdout).unwrap();
    let listed = lab.listed();
    assert!(listed.len() == 1 && listed[0].contains(&format!(" {} ", login.trim())), "{listed:?}");
    assert!(session.quit().success());
}

#[test]
fn an_observer_sees_that_its_session_was_killed() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    let mut watcher = lab.open(&["attach"]);
    watcher.wait_for(&["WATCHING"]);
    session.signal(Signal::SIGKILL);
    session.wait();
    watcher.wait_for(&["ENDED", "STOP does not reach its robot any longer", "no robot to stop"]);
    watcher.send(" ");
    watcher.wait_for(&["its robot cannot be stopped from here"]);
    watcher.send("q");
    watcher.wait();
    assert_eq!(lab.sockets().len(), 1, "a killed process removes nothing");
    assert!(lab.listed().is_empty() && lab.sockets().is_empty(), "its socket is removed");
}

#[test]
fn a_stopped_session_looks_old_and_its_stop_unconfirmed() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    let mut watcher = lab.open(&["attach"]);
    watcher.wait_for(&["WATCHING"]);
    session.signal(Signal::SIGSTOP);
    watcher.wait_for(&["OLD: nothing new for"]);
    watcher.send(" ");
    // Regression: the last line said that STOP reaches the robot at once.
    watcher.wait_for(&["STOP NOT CONFIRMED", "STOP is not confirmed: the session does not answer."]);
    // Regression: they said below the line about this session that no session runs.
    let number = session.pid().to_string();
    let stopped = lab.command(&["sessions"]);
    let printed = String::from_utf8_lossy(&stopped.stderr).into_owned();
    assert!(printed.contains(&format!("kill -CONT {number}")) && !printed.contains("no session runs"), "{printed}");
    let refused = refusal(&lab.command(&["attach", &number]));
    assert!(refused.contains(&format!("{number}: no session answers")), "{refused}");
    session.signal(Signal::SIGCONT);
    watcher.wait_until("it is confirmed", || !watcher.screen().contains("NOT CONFIRMED"));
    watcher.send("q");
    watcher.wait();
    session.quit();
}

/// Regression: after a pause the observer stayed behind by its length and read FOLLOWING and "about 1 s behind".
#[test]
fn a_pause_of_an_observer_looks_old_and_ends_at_the_present() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    let mut watcher = lab.open(&["attach"]);
    watcher.wait_for(&["FOLLOWING", "about 1 s behind"]);
    watcher.send("p");
    watcher.wait_for(&["OLD: ", "s behind", ") shows the present"]);
    assert!(!watcher.screen().contains("FOLLOWING"), "{}", watcher.screen());
    watcher.send("p");
    watcher.wait_for(&["FOLLOWING", "about 1 s behind"]);
    // Regression: the key that the line names showed the present once, paused, and it became old again.
    watcher.send("p");
    watcher.wait_for(&["OLD: ", ") shows the present"]);
    watcher.send(")");
    watcher.wait_for(&["FOLLOWING", "about 1 s behind"]);
    assert!(!watcher.screen().contains("paused"), "{}", watcher.screen());
    session.send("A");
    watcher.wait_for(&["READY"]);
    watcher.send("q");
    watcher.wait();
    session.quit();
}

#[test]
fn of_several_sessions_one_is_named() {
    let lab = Lab::new();
    let none = refusal(&lab.command(&["attach"]));
    assert!(none.contains("no session runs on this machine"), "{none}");
    let mut first = lab.session("one", &["--task", "lateral-left"]);
    let mut second = lab.session("two", &[]);
    let several = refusal(&lab.command(&["attach"]));
    assert!(several.contains("several sessions run") && several.lines().count() == 3, "{several}");
    let unknown = refusal(&lab.command(&["attach", "one"]));
    assert!(unknown.contains("one: no session of that number or folder runs"), "{unknown}");
    let study = std::fs::read_dir(lab.folder.path().join("one")).unwrap().next().unwrap().unwrap().path();
    let mut by_folder = lab.open(&["attach", study.to_str().unwrap()]);
    by_folder.wait_for(&["WATCHING", "lateral-left"]);
    let number =
        lab.listed().iter().find(|line| line.contains(" forward ")).unwrap().split(' ').next().unwrap().to_owned();
    let mut by_number = lab.open(&["attach", &number]);
    by_number.wait_for(&["WATCHING", "forward"]);
    for session in [&mut by_folder, &mut by_number] {
        session.send("q");
        session.wait();
    }
    first.quit();
    second.quit();
}

#[test]
fn a_hostile_observer_harms_no_session() {
    let lab = Lab::new();
    let mut session = lab.session("studies", &[]);
    let socket = lab.sockets().remove(0);
    let closed = |mut stream: UnixStream| {
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        // A reset is an end, too.
        let end = stream.read_to_end(&mut Vec::new());
        assert!(end.as_ref().map_err(Error::kind) != Err(ErrorKind::WouldBlock), "still open: {end:?}");
    };
    for hostile in [&b"{\"stop\":1}\n"[..], b"\xff\xfe\n", b"{}\n", b"[[[[[[[[\n", &[b'a'; 40_000]] {
        let mut stream = UnixStream::connect(&socket).unwrap();
        let _ = stream.write_all(hostile);
        closed(stream);
    }
    // Those that say nothing take no place of the ninth for ever, and hold up nothing.
    let silent: Vec<UnixStream> = (0..8).map(|_| UnixStream::connect(&socket).unwrap()).collect();
    for stream in &silent {
        BufReader::new(stream).read_line(&mut String::new()).unwrap();
    }
    closed(UnixStream::connect(&socket).unwrap());
    drop(silent);
    session.wait_until("there is room again", || lab.listed().len() == 1);
    // A name cannot write to the operator's terminal.
    let mut named = UnixStream::connect(&socket).unwrap();
    named.write_all(b"{\"watch\":\"\\u001b[2Jeve\"}\n").unwrap();
    session.send("6");
    session.wait_for(&["[2Jeve watches this session"]);
    session.send("A");
    session.wait_for(&["READY"]);
    session.quit();
}

#[test]
fn a_folder_of_others_is_not_used_for_the_socket() {
    let lab = Lab::new();
    std::fs::create_dir_all(lab.sessions()).unwrap();
    std::fs::set_permissions(lab.sessions(), PermissionsExt::from_mode(0o777)).unwrap();
    let mut session = lab.session("studies", &[]);
    session.send("6");
    session.wait_for(&["not a folder of this user alone"]);
    assert!(lab.sockets().is_empty());
    session.quit();
}

/// Regression: any user can make the folder in /tmp beforehand. A fake socket in it was listed as a session and confirmed a STOP that
/// reached no robot; a folder that cannot be read ended the search.
#[test]
fn a_folder_of_others_is_named_and_not_searched() {
    let lab = Lab::new();
    let own = |name: &str| {
        let folder = lab.folder.path().join(name);
        std::fs::DirBuilder::new().mode(0o700).create(&folder).unwrap();
        folder
    };
    let open = own("open");
    let target = own("target");
    let facts = r#"{"session":{"process":1,"folder":"/x","robot":"go1","backend":"hardware","task":"forward","operator":"Eve","since":""}}"#;
    for folder in [&open, &target] {
        let listener = UnixListener::bind(folder.join("1.sock")).unwrap();
        std::thread::spawn(move || {
            while let Ok((mut stream, _)) = listener.accept() {
                let _ = stream.write_all(format!("{facts}\n").as_bytes());
            }
        });
    }
    std::fs::set_permissions(&open, PermissionsExt::from_mode(0o755)).unwrap();
    let link = lab.folder.path().join("link");
    std::os::unix::fs::symlink(&target, &link).unwrap();
    let listed = |folder: &Path| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
        command.arg("sessions").env("QUADFROG_SESSIONS", folder).output().unwrap()
    };
    assert!(String::from_utf8(listed(&target).stdout).unwrap().contains("Eve"), "the socket answers as a session does");
    for folder in [&open, &link] {
        let output = listed(folder);
        assert!(output.status.success() && output.stdout.is_empty(), "{output:?}");
        let message = String::from_utf8(output.stderr).unwrap();
        let skipped = format!("{}: not a folder of this user alone", folder.display());
        assert!(message.contains(&skipped) && message.contains("no session runs"), "{message}");
    }
    // The folders after it are searched.
    let runtime = own("runtime");
    std::os::unix::fs::symlink(&target, runtime.join("quadfrog")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_quadfrog"));
    command.args(["attach", "1"]).env_remove("QUADFROG_SESSIONS").env("XDG_RUNTIME_DIR", &runtime);
    let message = refusal(&command.output().unwrap());
    assert_eq!(message.matches("runtime/quadfrog: not a folder of this user alone").count(), 1, "{message}");
    assert!(!message.contains("Eve"), "{message}");
}

#[test]
fn a_socket_of_another_program_is_named_and_left_alone() {
    let lab = Lab::new();
    let folder = lab.sessions();
    std::fs::DirBuilder::new().mode(0o700).create(&folder).unwrap();
    let listener = UnixListener::bind(folder.join("1.sock")).unwrap();
    let answer = std::thread::spawn(move || listener.accept().unwrap().0.write_all(b"220 mail\n").unwrap());
    let output = lab.command(&["sessions"]);
    answer.join().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains("1.sock: ") && message.contains("no session runs"), "{message}");
    assert!(Path::exists(&folder.join("1.sock")));
}
