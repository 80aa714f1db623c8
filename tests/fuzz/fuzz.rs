//! Mutated inputs in great numbers: no panic, no memory and no time without bound.
//!
//! The normal suite runs a few of each target. `cargo test --release --test fuzz -- --ignored --nocapture --test-threads 1`
//! runs more: `QUADFROG_FUZZ_TARGET` (all), `_COUNT` (inputs of each target, 100000), `_SEED` (1), `_FIRST` (number of the first
//! input, 0: a failure names it). `docs/reliability.md` holds the last run.
#![allow(
    unsafe_code,
    reason = "an allocator can only be written with unsafe; this one hands everything to the system's"
)]

mod corpus;
#[path = "../support/count_alloc.rs"]
mod count_alloc;
mod hostile;
mod mutate;
mod targets;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use nix::time::{ClockId, clock_gettime};

/// A function of bytes with its valid inputs and limits.
struct Target {
    name: &'static str,
    run: fn(&[u8]),
    corpus: fn() -> Vec<Vec<u8>>,
    /// Most memory of one input, bytes.
    memory: usize,
    /// Inputs in the normal suite.
    few: u64,
}

const MB: usize = 1 << 20;

/// Longest processor time of one input: a thousand times the usual one; in wall-clock time a busy machine would decide.
const LONGEST: Duration = Duration::from_secs(5);

/// The player may hold one chunk of the largest size that it accepts, packed and unpacked.
const TARGETS: [Target; 6] = [
    Target { name: "packets", run: targets::packets, corpus: corpus::packets, memory: MB, few: 20_000 },
    Target { name: "journal", run: targets::journal, corpus: corpus::journal, memory: 16 * MB, few: 10_000 },
    Target { name: "player", run: targets::player, corpus: corpus::player, memory: 600 * MB, few: 700 },
    Target { name: "urdf", run: targets::urdf, corpus: corpus::urdf, memory: 64 * MB, few: 500 },
    Target { name: "config", run: targets::config, corpus: corpus::config, memory: 64 * MB, few: 700 },
    Target { name: "keys", run: targets::keys, corpus: corpus::keys, memory: 16 * MB, few: 20_000 },
];

/// Most memory and processor time over all inputs of a run, and the whole time.
#[derive(Default)]
struct Most {
    memory: usize,
    time: Duration,
    sum: Duration,
}

fn processor_time() -> Duration {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap().into()
}

/// Runs `count` inputs from number `first` on.
///
/// # Errors
/// The first input that panics or exceeds a limit: its number, a file with its bytes, and the fault.
fn run(target: &Target, seed: u64, first: u64, count: u64) -> Result<Most, String> {
    let corpus = (target.corpus)();
    corpus.iter().for_each(|valid| (target.run)(valid));
    let mut most = Most::default();
    for number in first..first + count {
        let input = mutate::input(&corpus, corpus::WORDS, seed, number);
        let begun = processor_time();
        let (result, memory) = count_alloc::most_memory(|| catch_unwind(AssertUnwindSafe(|| (target.run)(&input))));
        let time = processor_time() - begun;
        most = Most { memory: most.memory.max(memory), time: most.time.max(time), sum: most.sum + time };
        let fault = match result {
            Err(_) => "panicked".to_owned(),
            Ok(()) if memory > target.memory => format!("used {memory} bytes, more than {}", target.memory),
            Ok(()) if time > LONGEST => format!("took {time:?} of the processor, more than {LONGEST:?}"),
            Ok(()) => continue,
        };
        let file = std::env::temp_dir().join(format!("quadfrog-fuzz-{}-{seed}-{number}", target.name));
        fs::write(&file, &input).unwrap();
        targets::clean();
        return Err(format!("{} with seed {seed}, input {number} ({}): {fault}", target.name, file.display()));
    }
    targets::clean();
    Ok(most)
}

fn few(name: &str) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    run(target, 1, 0, target.few).unwrap_or_else(|fault| panic!("{fault}"));
}

#[test]
fn mutated_datagrams_are_read_or_rejected() {
    few("packets");
}

#[test]
fn mutated_journals_are_read_or_refused_and_written_lines_are_read_alike() {
    few("journal");
}

#[test]
fn mutated_recordings_are_played_and_recovered_or_refused() {
    few("player");
}

#[test]
fn mutated_descriptions_are_read_or_refused() {
    few("urdf");
}

#[test]
fn mutated_configurations_are_read_or_refused() {
    few("config");
}

#[test]
fn mutated_key_streams_lose_no_stop_and_do_not_depend_on_their_splits() {
    few("keys");
}

/// Regression: a length in the metadata, which have no checksum, was allocated by `recover` before it was checked, up to 4 GB.
#[test]
fn a_damaged_length_in_the_metadata_of_a_recording_is_not_allocated() {
    for whole in corpus::player() {
        let at = whole.windows(9).position(|bytes| bytes == b"\x05\0\0\0robot").expect("the name of a value");
        let mut damaged = whole.clone();
        // The value of `r` now has the length "obot", 1.95 GB.
        damaged[at] = 1;
        let ((), memory) = count_alloc::most_memory(|| targets::player(&damaged));
        assert!(memory < 16 * MB, "{memory} bytes");
    }
    targets::clean();
}

/// Regression: the head of a chunk, which has no checksum, names its compression; a length of 1.7 GB was allocated by every reader.
#[test]
fn a_damaged_length_in_the_head_of_a_chunk_is_not_allocated() {
    for whole in corpus::player() {
        let at = whole.windows(8).position(|bytes| bytes == b"\x04\0\0\0zstd").expect("the compression of a chunk");
        let mut damaged = whole.clone();
        damaged[at..at + 4].copy_from_slice(b"\0\x04te");
        let ((), memory) = count_alloc::most_memory(|| targets::player(&damaged));
        assert!(memory < 16 * MB, "{memory} bytes");
    }
    targets::clean();
}

/// Regression: the record in the place of the footer was parsed whatever its opcode, so that another one's text with a length of
/// 1 GB was allocated by every reader.
#[test]
fn another_record_in_the_place_of_the_footer_is_not_allocated() {
    for mut damaged in corpus::player() {
        let magic_at = damaged.len() - 8;
        let footer_at = magic_at - 29;
        // An index of metadata: offset, length, and a name of 1 GB.
        damaged[footer_at] = 13;
        damaged[magic_at - 4..magic_at].copy_from_slice(&(1_u32 << 30).to_le_bytes());
        let ((), memory) = count_alloc::most_memory(|| targets::player(&damaged));
        assert!(memory < 16 * MB, "{memory} bytes");
    }
    targets::clean();
}

/// Tests the runner: a panic, endless memory and endless work are each found, with an input that repeats.
#[test]
fn a_fault_of_a_target_is_found_and_repeats_by_its_number() {
    let corpus = || vec![b"valid".to_vec()];
    let target = |run: fn(&[u8])| Target { name: "faulty", run, corpus, memory: MB, few: 0 };
    let has = |bytes: &[u8]| bytes.len() > 6 && bytes != b"valid";
    type Act = fn(&[u8]);
    let faults: [(Act, &str); 2] = [
        (|bytes| assert!(bytes.len() <= 6 || bytes == b"valid"), "panicked"),
        (
            |bytes| {
                if bytes.len() > 6 {
                    std::hint::black_box(vec![0_u8; 2 * MB]);
                }
            },
            "more than 1048576",
        ),
    ];
    for (act, words) in faults {
        let fault = run(&target(act), 7, 0, 1000).err().expect("a fault");
        assert!(fault.contains(words), "{fault}");
        let number: u64 = fault.split("input ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        let again = run(&target(act), 7, number, 1).err().expect("the same fault");
        assert_eq!(again, fault);
        let file = fault.split(['(', ')']).nth(1).unwrap();
        assert!(has(&fs::read(file).unwrap()));
        fs::remove_file(file).unwrap();
    }
    assert!(run(&target(|_| {}), 7, 0, 1000).is_ok());
}

/// Every target has an entry for cargo-fuzz, which calls the same function.
#[test]
fn every_target_has_an_entry_for_cargo_fuzz() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz");
    let manifest = fs::read_to_string(format!("{folder}/Cargo.toml")).unwrap();
    let entries = fs::read_dir(format!("{folder}/fuzz_targets")).unwrap().count();
    assert_eq!(entries, TARGETS.len());
    for Target { name, .. } in TARGETS {
        let entry = fs::read_to_string(format!("{folder}/fuzz_targets/{name}.rs")).unwrap();
        assert!(entry.contains(&format!("targets::{name}(bytes)")), "{entry}");
        assert!(manifest.contains(&format!("name = \"{name}\"\npath = \"fuzz_targets/{name}.rs\"")), "{name}");
    }
}

#[test]
#[ignore = "a long run: see the head of this file"]
fn many_inputs_of_each_target() {
    let number = |name: &str, default: u64| {
        let text = std::env::var(format!("QUADFROG_FUZZ_{name}"));
        text.map_or(default, |text| {
            text.parse().unwrap_or_else(|_| panic!("QUADFROG_FUZZ_{name}: {text} is no number"))
        })
    };
    let (count, seed, first) = (number("COUNT", 100_000), number("SEED", 1), number("FIRST", 0));
    let chosen = std::env::var("QUADFROG_FUZZ_TARGET").ok();
    let chosen: Vec<_> = TARGETS.iter().filter(|t| chosen.as_ref().is_none_or(|name| name == t.name)).collect();
    assert!(!chosen.is_empty(), "QUADFROG_FUZZ_TARGET is none of the targets");
    println!("| target | inputs | seed | most memory (MB) | longest input (ms) | processor time (s) |");
    for target in chosen {
        let most = run(target, seed, first, count).unwrap_or_else(|fault| panic!("{fault}"));
        println!(
            "| {} | {count} | {seed} | {:.1} | {:.0} | {:.0} |",
            target.name,
            most.memory as f64 / MB as f64,
            most.time.as_secs_f64() * 1e3,
            most.sum.as_secs_f64()
        );
    }
}
