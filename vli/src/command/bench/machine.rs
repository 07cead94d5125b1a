//! The machine's own limits, measured beside what is to come near them.

use std::hint::black_box;
use std::sync::Barrier;
use std::time::Instant;

/// Bytes that are read again and again.
const WORKING_SETS: [usize; 4] = [24 << 10, 512 << 10, 8 << 20, 64 << 20];
/// Bytes that a measurement reads.
const BYTES: usize = 256 << 20;
/// Entries of the table that is looked up: those of the card's lookup table, of 8 bytes each.
const ENTRIES: usize = 4096;
/// Repetitions, of which the best counts.
const TIMES: usize = 5;

/// What a machine can do with so many threads.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Threads that were busy at a time.
    pub threads: usize,
    /// Clocks per second of a busy core.
    pub clock: f64,
    /// Bytes of a working set, and bytes per second that are read from it.
    pub bandwidth: Vec<(usize, f64)>,
    /// Look-ups of 8 bytes per second, in a table of 32 KiB.
    pub look_ups: f64,
}

impl Machine {
    /// Measures with `threads` threads; each has its own part of a working set.
    pub fn measure(threads: usize) -> Self {
        Self {
            threads,
            clock: clock(),
            bandwidth: WORKING_SETS.map(|bytes| (bytes, bandwidth(threads, bytes))).to_vec(),
            look_ups: look_ups(threads),
        }
    }

    /// Bytes per second that are read of a working set of `bytes`: that of the nearest size measured, not smaller if
    /// there is one.
    pub fn bandwidth_of(&self, bytes: usize) -> f64 {
        let not_smaller = self.bandwidth.iter().find(|(size, _)| *size >= bytes);
        not_smaller.or(self.bandwidth.last()).map_or(0.0, |(_, rate)| *rate)
    }
}

/// Clocks per second, from multiplications that wait for each other: three clocks each on every x86-64 processor since
/// 2008 (Nehalem, Zen).
fn clock() -> f64 {
    const STEPS: u32 = 10_000_000;
    let seconds = best(|| {
        let mut value = black_box(3_u64);
        for _ in 0..STEPS {
            value = value.wrapping_mul(black_box(0x9e37_79b9_7f4a_7c15));
        }
        black_box(value);
    });
    3.0 * f64::from(STEPS) / seconds
}

fn bandwidth(threads: usize, bytes: usize) -> f64 {
    let words = bytes / 8 / threads;
    let passes = (BYTES / threads).div_ceil(8 * words);
    let seconds = together(threads, || {
        let memory: Vec<u64> = (0..words as u64).collect();
        move || {
            for _ in 0..passes {
                black_box(black_box(&memory[..]).iter().fold(0, |all, word| all ^ word));
            }
        }
    });
    (8 * words * passes * threads) as f64 / seconds
}

fn look_ups(threads: usize) -> f64 {
    const PASSES: usize = 2000;
    let seconds = together(threads, || {
        let table: Vec<u64> = (0..ENTRIES as u64).collect();
        let indices: Vec<u16> =
            (0..ENTRIES as u32).map(|at| (at.wrapping_mul(2_654_435_761) >> 20) as u16).collect();
        move || {
            for _ in 0..PASSES {
                let entries = black_box(&indices[..]).iter().map(|&at| table[usize::from(at) % ENTRIES]);
                black_box(entries.fold(0, |all, entry| all ^ entry));
            }
        }
    });
    (PASSES * ENTRIES * threads) as f64 / seconds
}

/// The best time of some.
fn best(mut work: impl FnMut()) -> f64 {
    let mut time = || {
        let begin = Instant::now();
        work();
        begin.elapsed().as_secs_f64()
    };
    (0..TIMES).map(|_| time()).fold(f64::MAX, f64::min)
}

/// The best time in which all of some threads do their work, which each prepares first.
fn together<W: FnMut()>(threads: usize, prepare: impl Fn() -> W + Sync) -> f64 {
    let barrier = Barrier::new(threads);
    let one = || {
        let mut work = prepare();
        best(|| {
            barrier.wait();
            work();
            barrier.wait();
        })
    };
    std::thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(one)).collect();
        let own = one();
        others.into_iter().filter_map(|other| other.join().ok()).fold(own, f64::max)
    })
}
