//! Mutated inputs for whatever reads bytes: nothing may panic, hang, or need more memory than its input explains.
//!
//! A target is a test that calls [`run`]. It takes a few hundred inputs, always the same ones; with `YAMABICO_FUZZ_SECONDS` it
//! takes new ones for that long, from the seed `YAMABICO_FUZZ_SEED`. An input that fails is kept in `target/fuzz`, to be put into
//! the seeds of its target when the fault is mended.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Number of inputs of an ordinary test.
const INPUTS: u64 = 400;
/// Longest computing time that one input may take.
const MAX_TIME: Duration = Duration::from_secs(10);
/// Maximum length of an input, bytes.
const MAX_BYTES: usize = 1 << 20;

/// Reads the files of a folder, in alphabetical order.
///
/// # Panics
/// If the folder cannot be read.
#[must_use]
pub fn seeds(folder: &Path) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths.iter().filter_map(|path| std::fs::read(path).ok()).collect()
}

/// Hands the seeds, mutations of them and noise to `target`.
///
/// # Panics
/// If the target panics, or computes for longer than ten seconds; the message names the file with the input.
pub fn run(name: &str, seeds: &[Vec<u8>], target: impl Fn(&[u8])) {
    let number = |variable: &str| std::env::var(variable).ok().and_then(|text| text.parse::<u64>().ok());
    let duration = number("YAMABICO_FUZZ_SECONDS").map(Duration::from_secs);
    let mut random = Random(number("YAMABICO_FUZZ_SEED").unwrap_or(1));
    let begin = Instant::now();
    let mut inputs = 0;
    let is_over = |inputs: u64| match duration {
        Some(duration) => begin.elapsed() >= duration && inputs >= seeds.len() as u64,
        None => inputs >= INPUTS.max(seeds.len() as u64),
    };
    while !is_over(inputs) {
        let input = match seeds.get(inputs as usize) {
            Some(seed) => seed.clone(),
            None => mutated(seeds, &mut random),
        };
        inputs += 1;
        check(name, &input, &target);
    }
    let seconds = begin.elapsed().as_secs_f64();
    println!("{name}: {inputs} inputs from {} seeds in {seconds:.1} s, none failed", seeds.len());
}

fn check(name: &str, input: &[u8], target: &impl Fn(&[u8])) {
    let begin = computing_time();
    let result = catch_unwind(AssertUnwindSafe(|| target(input)));
    let elapsed = computing_time().saturating_sub(begin);
    if result.is_ok() && elapsed < MAX_TIME {
        return;
    }
    let folder = crate::workspace().join("target/fuzz");
    let hash = input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let path = folder.join(format!("{name}-{hash:016x}"));
    let kept = std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, input));
    let cause = if result.is_err() { "panicked" } else { "took too long" };
    panic!("{name}: {cause} after {:.1} s on {} ({kept:?})", elapsed.as_secs_f64(), path.display());
}

/// Time for which this thread has computed, whatever else the machine does.
fn computing_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|number| number.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or(0))
}

/// Random numbers (Steele, Lea & Flood 2014: SplitMix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }
}

fn mutated(seeds: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    if seeds.is_empty() || random.below(32) == 0 {
        let length = random.below(512);
        return (0..length).map(|_| random.next() as u8).collect();
    }
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..=random.below(6) {
        mutate(&mut bytes, seeds, random);
    }
    bytes.truncate(MAX_BYTES);
    bytes
}

fn mutate(bytes: &mut Vec<u8>, seeds: &[Vec<u8>], random: &mut Random) {
    let at = random.below(bytes.len() + 1);
    let length = 1 << random.below(9);
    let end = (at + random.below(length) + 1).min(bytes.len());
    match random.below(9) {
        0 => bytes.truncate(at),
        1 => drop(bytes.drain(at.min(end)..end)),
        2 => {
            let part = bytes[at.min(end)..end].to_vec();
            bytes.splice(at..at, part);
        }
        3 => {
            let noise: Vec<u8> = (0..=random.below(16)).map(|_| random.next() as u8).collect();
            bytes.splice(at..at, noise);
        }
        4 => {
            let other = &seeds[random.below(seeds.len())];
            let from = random.below(other.len() + 1);
            let to = (from + random.below(256)).min(other.len());
            bytes.splice(at.min(end)..end, other[from..to].iter().copied());
        }
        5 | 6 => {
            // Lengths and numbers that lie.
            let large =
                [0, 1, 0x7f, 0xff, 0x7fff_ffff, 0xffff_ffff, u64::MAX, u64::MAX / 2, bytes.len() as u64];
            let number = large[random.below(large.len())];
            let width = [1, 2, 4, 8][random.below(4)];
            let raw = if random.below(2) == 0 {
                number.to_le_bytes()
            } else {
                number.rotate_left(64 - 8 * width as u32 % 64).to_be_bytes()
            };
            bytes.iter_mut().skip(at).zip(&raw[..width]).for_each(|(byte, new)| *byte = *new);
        }
        _ => {
            if let Some(byte) = bytes.get_mut(at) {
                *byte ^= 1 << random.below(8);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn a_fault_is_found_and_its_input_is_kept() {
        let seeds = [b"a small text with a number 1234".to_vec()];
        run("harmless", &seeds, |bytes| drop(bytes.to_vec()));
        let seen = Cell::new(0_u64);
        let faulty = |bytes: &[u8]| {
            seen.set(seen.get() + 1);
            assert!(!bytes.ends_with(b"number"), "the fault");
        };
        let result =
            catch_unwind(AssertUnwindSafe(|| run("faulty", &[seeds[0].clone(), b"number".to_vec()], faulty)));
        let message = result.unwrap_err().downcast::<String>().unwrap();
        assert!(message.contains("faulty-") && seen.get() == 2, "{message}");
        let path = message.split(" on ").nth(1).unwrap().split(" (").next().unwrap();
        assert_eq!(std::fs::read(path).unwrap(), b"number");
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn the_same_seed_gives_the_same_inputs() {
        let seeds = [vec![7; 100], b"other".to_vec()];
        let inputs =
            || (0..50).scan(Random(3), |random, _| Some(mutated(&seeds, random))).collect::<Vec<_>>();
        assert_eq!(inputs(), inputs());
        assert!(inputs().windows(2).any(|pair| pair[0] != pair[1]));
    }
}
