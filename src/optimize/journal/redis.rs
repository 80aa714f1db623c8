//! The journal on a Redis server, in the layout of Optuna's `JournalRedisBackend` (`docs/journal.md`): `P:log_number` is
//! the index of the last line, `P:log:<i>` the text of line i, P a prefix that is empty by default. Snapshots of Python are
//! not read.
//!
//! No lock is needed: lines are appended by a script that the server runs atomically, and only if no other writer has
//! appended since the last read. After a lost connection the same request is sent again; the script recognizes lines that it
//! has appended already, so that a lost answer doubles nothing.

use std::time::Duration;

use super::error::JournalError;
use super::wait::{JournalWait, LongWait, WaitedFor};
use redis::{Client, Connection, ErrorKind, IntoConnectionInfo, RedisError, RedisResult, ServerErrorKind};

/// Lines per request.
const BATCH: i64 = 1000;

/// Longest time for a connection, and for the answer to one request: a server that loads its data, or one that a thousand
/// workers ask at once, answers within a second.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(5);

/// Longest time without a connection after the first one: a server that restarts and loads its data takes less.
const RECONNECT_TIMEOUT: Duration = Duration::from_secs(120);

/// Longest wait for a line that is counted and not there: another writer on a cluster sets it right after it has counted it.
const LINE_TIMEOUT: Duration = Duration::from_secs(3);

/// Code of the script's error: lines are there that `log_number` does not count.
const UNCOUNTED: &str = "UNCOUNTED";

/// Shortest and longest pause between two attempts to connect.
const PAUSES: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(2)];

/// A wait is ended within this time.
const STEP: Duration = Duration::from_millis(50);

/// Appends ARGV[3..] after line ARGV[2] if that is the last line; P is ARGV[1]. Returns 1 if these lines follow that line, now
/// or since an earlier request, else 0. Each line names its writer, so that no other writer's line is equal. Where the number of the
/// last line was lost and the lines are there, it writes nothing and returns the error [`UNCOUNTED`].
const APPEND: &str = "\
local number = ARGV[1] .. ':log_number'
local last = tonumber(redis.call('get', number) or '-1')
local next = string.format('%d', tonumber(ARGV[2]) + 1)
if last ~= tonumber(ARGV[2]) then
  if redis.call('get', ARGV[1] .. ':log:' .. next) == ARGV[3] then return 1 end
  return 0
end
if redis.call('exists', ARGV[1] .. ':log:' .. next) == 1 then return redis.error_reply('UNCOUNTED ' .. next) end
for i = 3, #ARGV do
  last = last + 1
  redis.call('set', ARGV[1] .. ':log:' .. string.format('%d', last), ARGV[i])
end
redis.call('set', number, string.format('%d', last))
return 1";

/// A journal on a Redis server with the read position.
pub struct JournalRedis {
    client: Client,
    connection: Option<Connection>,
    /// Whether the server has answered before: only then a lost connection is waited for.
    answered: bool,
    wait: JournalWait,
    address: String,
    prefix: String,
    /// Lines read; the index of the next line.
    lines: i64,
}

/// Returns the address of a Redis journal for messages, without user and password; nothing but the scheme where the
/// address cannot be parsed, because any part of it may be the password.
pub(in crate::optimize) fn public_address(url: &str) -> String {
    match url.into_connection_info() {
        Ok(info) => format!("redis://{}/{}", info.addr(), info.redis_settings().db()),
        Err(_) => {
            let scheme = url.split_once("://").map_or("", |(scheme, _)| scheme);
            format!("{scheme}://... (the rest is not shown: it may hold a password)")
        }
    }
}

impl JournalRedis {
    /// The journal of the server at `url` (`redis://host:port/db`) under the key prefix `prefix`; does not connect.
    pub fn new(url: &str, prefix: &str) -> Result<Self, JournalError> {
        let refuse = |error: RedisError| JournalError::RedisAddress {
            address: public_address(url),
            // The detail may repeat the address.
            fault: error.category().to_owned(),
        };
        let info = url.into_connection_info().map_err(refuse)?;
        let address = public_address(url);
        let client = Client::open(info).map_err(refuse)?;
        Ok(JournalRedis {
            client,
            connection: None,
            answered: false,
            wait: JournalWait::default(),
            address,
            prefix: prefix.to_owned(),
            lines: 0,
        })
    }

    /// Returns the wait for the server.
    pub(super) fn wait(&self) -> &JournalWait {
        &self.wait
    }

    /// Passes every line appended since the last call to `accept`, which returns the fault of an invalid line. A line that
    /// is counted but not yet present, as on clusters, is waited for.
    ///
    /// # Errors
    /// If the server cannot be read, has fewer lines than were read before, lines and no number of the last one, or an invalid line; if
    /// a line is missing for [`LINE_TIMEOUT`], or the wait for it was ended.
    pub(super) fn read(&mut self, mut accept: impl FnMut(&str) -> Result<(), String>) -> Result<(), JournalError> {
        let last = self.last_line()?.unwrap_or(-1);
        if last + 1 < self.lines {
            let (address, had, has) = (self.address.clone(), self.lines, last + 1);
            return Err(JournalError::RedisShortened { address, had, has });
        }
        let mut waited: Option<LongWait> = None;
        while self.lines <= last {
            let until = last.min(self.lines + BATCH - 1);
            let keys: Vec<String> = (self.lines..=until).map(|i| format!("{}:log:{i}", self.prefix)).collect();
            let batch: Vec<Option<String>> = self.ask("read", |c| redis::cmd("MGET").arg(&keys).query(c))?;
            for line in batch {
                let Some(line) = line else { break };
                accept(line.trim_end()).map_err(|fault| self.fault_of_line(fault))?;
                self.lines += 1;
                waited = None;
            }
            if self.lines <= until {
                self.await_line(waited.get_or_insert_with(LongWait::begin))?;
            }
        }
        Ok(())
    }

    /// Returns the number of the last line; none of an empty journal.
    ///
    /// # Errors
    /// If the server cannot be read, or has a first line without the number of the last one: that was lost.
    fn last_line(&mut self) -> Result<Option<i64>, JournalError> {
        let [number, first] = ["log_number", "log:0"].map(|key| format!("{}:{key}", self.prefix));
        // In one step: another writer may begin the journal meanwhile.
        let keys = [&number, &first];
        let (last, first): (Option<i64>, Option<String>) =
            self.ask("read", |c| redis::cmd("MGET").arg(&keys).query(c))?;
        match (last, first) {
            (None, Some(_)) => Err(self.uncounted(0)),
            (last, _) => Ok(last),
        }
    }

    /// Returns the error of a line that `log_number` does not count.
    fn uncounted(&self, index: i64) -> JournalError {
        JournalError::RedisUncounted { address: self.address.clone(), prefix: self.prefix.clone(), index }
    }

    /// Waits a moment for the next line, which is counted and not there.
    fn await_line(&self, waited: &mut LongWait) -> Result<(), JournalError> {
        if self.wait.is_interrupted() {
            return Err(JournalError::ServerWaitEnded { address: self.address.clone() });
        }
        if waited.elapsed() >= LINE_TIMEOUT {
            return Err(self.fault_of_line("the line is missing on the server".to_owned()));
        }
        waited.announce(|| {
            format!(
                "waiting for line {} of the journal on the Redis server {}, for {} s at most; Ctrl-C ends the wait",
                self.lines + 1,
                self.address,
                LINE_TIMEOUT.as_secs()
            )
        });
        std::thread::sleep(STEP);
        Ok(())
    }

    /// Returns the error of the next line.
    fn fault_of_line(&self, fault: String) -> JournalError {
        let path = format!("{}, key {}:log:{}", self.address, self.prefix, self.lines).into();
        JournalError::Line { path, line: self.lines as usize + 1, fault }
    }

    /// Appends the lines unless another writer has appended since the last read. Returns whether it has appended.
    pub(super) fn append(&mut self, lines: &[String]) -> Result<bool, JournalError> {
        let last = self.lines - 1;
        let prefix = self.prefix.clone();
        self.ask("append to", |c| {
            let mut script = redis::cmd("EVAL");
            script.arg(APPEND).arg(0).arg(&prefix).arg(last);
            script.arg(lines.iter().map(|line| line.trim_end()).collect::<Vec<_>>());
            script.query(c)
        })
    }

    /// Runs a command, connecting first if necessary. After a lost connection it is run again, with growing pauses.
    ///
    /// # Errors
    /// If the server was never reached, refuses the command, stays away for [`RECONNECT_TIMEOUT`], or the wait was ended.
    fn ask<T>(
        &mut self,
        action: &'static str,
        command: impl Fn(&mut Connection) -> RedisResult<T>,
    ) -> Result<T, JournalError> {
        let mut waited = LongWait::begin();
        let mut pause = PAUSES[0];
        let answer = loop {
            let source = match self.attempt(&command) {
                Ok(answer) => break Ok(answer),
                Err(error) => error,
            };
            let address = self.address.clone();
            if source.code() == Some(UNCOUNTED) {
                break Err(self.uncounted(self.lines));
            }
            self.connection = None;
            if !self.answered || !is_passing(&source) || waited.elapsed() >= RECONNECT_TIMEOUT {
                break Err(JournalError::Redis { action, address, reason: in_words(&source) });
            }
            self.wait.set(Some(WaitedFor::Server));
            let until = waited.elapsed() + pause;
            while waited.elapsed() < until && !self.wait.is_interrupted() {
                std::thread::sleep(STEP.min(pause));
            }
            if self.wait.is_interrupted() {
                break Err(JournalError::ServerWaitEnded { address });
            }
            pause = (pause * 2).min(PAUSES[1]);
            waited.announce(|| {
                format!(
                    "waiting for the Redis server {address}, for {} s at most ({source}); Ctrl-C ends the wait",
                    RECONNECT_TIMEOUT.as_secs()
                )
            });
        };
        self.wait.set(None);
        answer
    }

    fn attempt<T>(&mut self, command: impl Fn(&mut Connection) -> RedisResult<T>) -> RedisResult<T> {
        let connection = match &mut self.connection {
            Some(connection) => connection,
            none => {
                let connection = self.client.get_connection_with_timeout(ANSWER_TIMEOUT)?;
                connection.set_read_timeout(Some(ANSWER_TIMEOUT))?;
                connection.set_write_timeout(Some(ANSWER_TIMEOUT))?;
                none.insert(connection)
            }
        };
        let answer = command(connection)?;
        self.answered = true;
        Ok(answer)
    }
}

/// Returns an error with the remedy against a server that cannot be reached.
fn in_words(error: &RedisError) -> String {
    const REMEDY: &str = "start it or correct the address";
    if error.is_timeout() {
        return format!("it does not answer within {} s; {REMEDY}", ANSWER_TIMEOUT.as_secs());
    }
    if error.is_connection_refusal() { format!("{error}; {REMEDY}") } else { error.to_string() }
}

/// Whether an error may pass with time: no connection, a lost one, no answer in time, or a server that starts or hands over.
fn is_passing(error: &RedisError) -> bool {
    let starting = matches!(
        error.kind(),
        ErrorKind::Server(ServerErrorKind::BusyLoading | ServerErrorKind::MasterDown | ServerErrorKind::TryAgain)
    );
    starting || error.is_io_error() || error.is_connection_dropped() || error.is_timeout()
}

impl std::fmt::Debug for JournalRedis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JournalRedis")
            .field("address", &self.address)
            .field("lines", &self.lines)
            .finish_non_exhaustive()
    }
}
