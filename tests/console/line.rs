//! The operator's SSH line, from the system's own table of connections.

use std::net::{SocketAddr, TcpListener, TcpStream};

use quadfrog_console::line::{Connection, Line};

fn words(there: SocketAddr, here: SocketAddr) -> String {
    format!("{} {} {} {}", there.ip(), there.port(), here.ip(), here.port())
}

/// Both versions, and version 4 through a socket of version 6, as sshd has it: found in this machine's tables, nothing repeated.
#[test]
fn a_living_connection_is_found_and_nothing_is_repeated() {
    for (listens, calls) in [("127.0.0.1:0", "127.0.0.1"), ("[::1]:0", "::1"), ("[::]:0", "127.0.0.1")] {
        let listener = TcpListener::bind(listens).unwrap();
        let port = listener.local_addr().unwrap().port();
        let client = TcpStream::connect((calls, port)).unwrap();
        let (_server, _) = listener.accept().unwrap();
        let words = words(client.local_addr().unwrap(), client.peer_addr().unwrap());
        let connection = Connection::of_ssh(&words).unwrap();
        let tables = ["/proc/net/tcp", "/proc/net/tcp6"].map(|path| std::fs::read_to_string(path).unwrap_or_default());
        let found: Vec<u32> = tables.iter().filter_map(|table| connection.repetitions(table)).collect();
        assert_eq!(found, [0], "{listens}: {words}");
    }
}

/// Lines that a kernel wrote (Linux 6.18) while the other side of 10.7.0.2:22 was cut off.
#[test]
fn repetitions_are_read_from_the_right_column_of_the_right_line() {
    let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0200070A:0016 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 71190 1 0000000000000000 100 0 0 10 0
   1: 0200070A:0016 0100070A:B0D4 01 00000BAC:00000000 01:0000008E 0000000A     0        0 71316 4 0000000000000000 320 4 31 1 7
   2: 0200070A:0016 0100070A:B0D6 01 00000000:00000000 02:000AF4C8 00000000     0        0 71317 2 0000000000000000 20 4 29 10 -1
";
    let repetitions = |words: &str| Connection::of_ssh(words).unwrap().repetitions(table);
    assert_eq!(repetitions("10.7.0.1 45268 10.7.0.2 22"), Some(10));
    assert_eq!(repetitions("10.7.0.1 45270 10.7.0.2 22"), Some(0));
    assert_eq!(repetitions("10.7.0.1 45272 10.7.0.2 22"), None);
    assert_eq!(repetitions("10.7.0.2 22 10.7.0.1 45268"), None, "the other way round is another connection");
}

#[test]
fn what_is_no_connection_is_none() {
    for words in ["", "10.7.0.1", "10.7.0.1 45268 10.7.0.2", "10.7.0.1 x 10.7.0.2 22", "host 1 10.7.0.2 22"] {
        assert_eq!(Connection::of_ssh(words), None, "{words:?}");
    }
    let scoped = Connection::of_ssh("fe80::1%eth0 45268 fe80::2%eth0 22");
    assert_eq!(scoped, Connection::of_ssh("fe80::1 45268 fe80::2 22"));
    assert!(scoped.is_some());
    let ssh = "10.7.0.1 45268 10.7.0.2 22";
    for set in [&[][..], &[("SSH_CONNECTION", "nonsense")], &[("SSH_CONNECTION", ssh), ("TMUX", "x")]] {
        let line = Line::watch(|name| set.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned()));
        assert!(line.unwrap().alive());
    }
}
