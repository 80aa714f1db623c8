//! The operator's SSH line, from the system's own table of connections.

use std::net::{SocketAddr, TcpListener, TcpStream};

use quadfrog_console::line::{Connection, Line, Place};

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

/// The middle line is one that a kernel wrote (Linux 6.18) two seconds after the other side of 10.7.0.2:2222 was cut off.
#[test]
fn repetitions_are_read_from_the_right_column_of_the_right_line() {
    let table = "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   1: 0200070A:08AE 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 685353 1 0000000001cd59ae 100 0 0 10 0
   2: 0200070A:08AE 0100070A:9064 01 00007840:00000000 01:00000066 00000003     0        0 685421 3 00000000cd48d142 163 4 31 1 -1
   3: 0200070A:08AE 0100070A:9066 01 00000000:00000000 02:000AF8FB 00000000     0        0 685422 3 00000000cd48d142 20 4 30 113 -1
";
    let repetitions = |words: &str| Connection::of_ssh(words).unwrap().repetitions(table);
    assert_eq!(repetitions("10.7.0.1 36964 10.7.0.2 2222"), Some(3));
    assert_eq!(repetitions("10.7.0.1 36966 10.7.0.2 2222"), Some(0));
    assert_eq!(repetitions("10.7.0.1 36968 10.7.0.2 2222"), None);
    assert_eq!(repetitions("10.7.0.2 2222 10.7.0.1 36964"), None, "the other way round is another connection");
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
    for (set, place) in [
        (&[][..], Place::Here),
        (&[("SSH_CONNECTION", "nonsense")], Place::Ssh(None)),
        (&[("SSH_CONNECTION", ssh)], Place::Ssh(Connection::of_ssh(ssh))),
        (&[("SSH_CONNECTION", ssh), ("TMUX", "x")], Place::Multiplexer),
        (&[("STY", "x")], Place::Multiplexer),
    ] {
        let found = Place::of(|name| set.iter().find(|(n, _)| *n == name).map(|(_, value)| (*value).to_owned()));
        assert_eq!(found, place, "{set:?}");
        assert!(Line::watch(found).unwrap().alive());
    }
}
