//! The journal on a Redis server, in the layout of Optuna's `JournalRedisBackend` (`docs/journal.md`): `P:log_number` is
//! the index of the last line, `P:log:<i>` the text of line i, P a prefix that is empty by default. Snapshots of Python are
//! not read.
//!
//! No lock is needed: lines are appended by a script that the server runs atomically, and only if no other writer has
//! appended since the last read.

use super::error::JournalError;
use redis::{Client, Connection, IntoConnectionInfo, RedisError, RedisResult};

/// Lines per request.
const BATCH: i64 = 1000;

/// Appends ARGV[3..] after line ARGV[2] if that is the last line; P is ARGV[1]. Returns 1 on success, else 0.
const APPEND: &str = "\
local number = ARGV[1] .. ':log_number'
local last = tonumber(redis.call('get', number) or '-1')
if last ~= tonumber(ARGV[2]) then return 0 end
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
    address: String,
    prefix: String,
    /// Lines read; the index of the next line.
    lines: i64,
}

impl JournalRedis {
    /// The journal of the server at `url` (`redis://host:port/db`) under the key prefix `prefix`; does not connect.
    pub fn new(url: &str, prefix: &str) -> Result<Self, JournalError> {
        let refuse = |source| JournalError::Redis { action: "parse the address of", address: url.to_owned(), source };
        let info = url.into_connection_info().map_err(refuse)?;
        let address = info.addr().to_string();
        let client = Client::open(info).map_err(refuse)?;
        Ok(JournalRedis { client, connection: None, address, prefix: prefix.to_owned(), lines: 0 })
    }

    /// Passes every line appended since the last call to `accept`, which returns the fault of an invalid line. A line that
    /// is counted but not yet present, as on clusters, is left for the next call.
    pub(super) fn read(&mut self, mut accept: impl FnMut(&str) -> Result<(), String>) -> Result<(), JournalError> {
        let number = format!("{}:log_number", self.prefix);
        let last: Option<i64> = self.ask("read", |c| redis::cmd("GET").arg(&number).query(c))?;
        let last = last.unwrap_or(-1);
        while self.lines <= last {
            let until = last.min(self.lines + BATCH - 1);
            let keys: Vec<String> = (self.lines..=until).map(|i| format!("{}:log:{i}", self.prefix)).collect();
            let batch: Vec<Option<String>> = self.ask("read", |c| redis::cmd("MGET").arg(&keys).query(c))?;
            for line in batch {
                let Some(line) = line else { return Ok(()) };
                accept(line.trim_end()).map_err(|fault| {
                    let path = format!("{}, key {}:log:{}", self.address, self.prefix, self.lines).into();
                    JournalError::Line { path, line: self.lines as usize + 1, fault }
                })?;
                self.lines += 1;
            }
        }
        Ok(())
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

    /// Runs a command, connecting first if necessary. A failed connection is dropped; the next call reconnects.
    fn ask<T>(
        &mut self,
        action: &'static str,
        command: impl FnOnce(&mut Connection) -> RedisResult<T>,
    ) -> Result<T, JournalError> {
        let name = |source: RedisError| JournalError::Redis { action, address: self.address.clone(), source };
        let mut connection = match self.connection.take() {
            Some(connection) => connection,
            None => self.client.get_connection().map_err(name)?,
        };
        let answer = command(&mut connection).map_err(name)?;
        self.connection = Some(connection);
        Ok(answer)
    }
}

impl std::fmt::Debug for JournalRedis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("JournalRedis")
            .field("address", &self.address)
            .field("lines", &self.lines)
            .finish_non_exhaustive()
    }
}
