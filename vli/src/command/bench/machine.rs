//! The limits of the machine, measured: nothing that the engine does can be faster.

use std::hint::black_box;
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};
use vg500_engine::Level;
use vg500_engine::optimised::simd::{HALF, LANES, Simd, Work};

/// Rounds of each measurement, of which the fastest counts.
const ROUNDS: usize = 40;
/// How long a round takes.
const ROUND: Duration = Duration::from_millis(2);
/// What a thread does between two looks at the time, in bytes or steps.
const PORTION: usize = 1 << 20;

/// Working sets that every machine is measured with.
const WORKING_SETS: [WorkingSet; 4] = [
    WorkingSet::Each(24 << 10),
    WorkingSet::Each(512 << 10),
    WorkingSet::All(8 << 20),
    WorkingSet::All(64 << 20),
];

/// Bytes that are read again and again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkingSet {
    /// By each thread its own.
    Each(usize),
    /// By all threads together, each a part.
    All(usize),
}

/// What some threads of a machine can do together.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Cores that these threads can use.
    pub cores: usize,
    /// Cycles per second of a core.
    pub clock: f64,
    /// Look-ups per second of 8-byte entries in a table of 32 KiB.
    pub look_ups: f64,
    /// Bytes per second that can be read, by working set.
    pub bandwidth: Vec<(WorkingSet, f64)>,
}

/// A limit of how many samples per second can be processed.
#[derive(Clone, Copy, Debug)]
pub struct Limit {
    /// What it is a limit of.
    pub name: &'static str,
    /// Samples per second.
    pub rate: f64,
}

impl Machine {
    /// Measures `threads` threads that read with the instructions of a level; also volumes of so many bytes.
    pub fn measure(level: Level, threads: usize, volumes: &[usize]) -> Self {
        let cores = threads.min(thread::available_parallelism().map_or(1, usize::from));
        let mut sets = WORKING_SETS.to_vec();
        for set in volumes.iter().map(|&bytes| WorkingSet::All(bytes)) {
            if !sets.contains(&set) {
                sets.push(set);
            }
        }
        sets.sort_by_key(|set| set.bytes(cores));
        Self {
            cores,
            clock: apart(&rates(cores, additions)) / cores as f64,
            look_ups: apart(&rates(cores, look_ups)),
            bandwidth: sets.into_iter().map(|set| (set, bandwidth(level, cores, set))).collect(),
        }
    }

    /// Bytes per second that can be read of a volume that was measured.
    fn bandwidth_of(&self, volume: usize) -> f64 {
        let found = self.bandwidth.iter().find(|(set, _)| *set == WorkingSet::All(volume));
        found.map_or(f64::INFINITY, |(_, rate)| *rate)
    }

    /// The lowest limit of frames with `samples` samples in a volume of so many bytes. Every voxel is read once; if
    /// every sample is classified, each takes a look-up.
    pub fn limit(&self, samples: u64, volume: usize, classified: bool) -> Limit {
        let reading = self.bandwidth_of(volume) * samples as f64 / volume as f64;
        if classified && self.look_ups < reading {
            return Limit { name: "table look-ups", rate: self.look_ups };
        }
        Limit { name: "read bandwidth", rate: reading }
    }

    /// Cycles per sample of all cores together.
    pub fn cycles_per_sample(&self, seconds: f64, samples: u64) -> f64 {
        seconds * self.clock * self.cores as f64 / samples as f64
    }
}

impl WorkingSet {
    /// Bytes of all of `threads` threads.
    pub const fn bytes(self, threads: usize) -> usize {
        match self {
            Self::Each(bytes) => bytes * threads,
            Self::All(bytes) => bytes,
        }
    }
}

/// How much each of some threads does per second, in each round, when they work at the same time. What `prepare` makes
/// for a thread does a portion of the work, and says how much that was.
fn rates<W: FnMut() -> usize>(threads: usize, prepare: impl Fn() -> W + Sync) -> Vec<[f64; ROUNDS]> {
    let barrier = Barrier::new(threads);
    let measure = || {
        let mut work = prepare();
        [(); ROUNDS].map(|()| {
            barrier.wait();
            let (mut done, started) = (0, Instant::now());
            while started.elapsed() < ROUND {
                done += work();
            }
            done as f64 / started.elapsed().as_secs_f64()
        })
    };
    thread::scope(|scope| {
        let others: Vec<_> = (1..threads).map(|_| scope.spawn(measure)).collect();
        let own = measure();
        others.into_iter().filter_map(|thread| thread.join().ok()).chain([own]).collect()
    })
}

/// What threads do per second that share nothing: each in its best round.
fn apart(rates: &[[f64; ROUNDS]]) -> f64 {
    rates.iter().map(|rounds| rounds.iter().copied().fold(0.0, f64::max)).sum()
}

/// What threads do per second that share caches and memory: all of them in the best round.
fn together(rates: &[[f64; ROUNDS]]) -> f64 {
    (0..ROUNDS).map(|round| rates.iter().map(|rounds| rounds[round]).sum()).fold(0.0, f64::max)
}

/// Steps of a cycle each: every one needs the result of the one before, and cannot be merged with it.
fn additions() -> impl FnMut() -> usize {
    let (addend, flipped) = black_box((0x9e37_79b9_7f4a_7c15_u64, 0x85eb_ca6b_c2b2_ae35));
    let mut value = 0_u64;
    move || {
        for _ in 0..PORTION / 16 {
            value = value.wrapping_add(addend) ^ flipped;
        }
        value = black_box(value);
        PORTION / 8
    }
}

/// Entries of the card's lookup table; of 8 bytes each they take 32 KiB.
const ENTRIES: u16 = 4096;
/// Indices of look-ups, in the cache beside the table.
const INDICES: usize = 2048;

/// Look-ups of scattered entries.
fn look_ups() -> impl FnMut() -> usize {
    // There is an entry for every index of 16 bits, so that none is checked; only the first ones are used.
    let table: Vec<u64> = (0..=u64::from(u16::MAX)).collect();
    let mut state = 1_u32;
    let indices = [(); INDICES].map(|()| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 16) as u16 % ENTRIES
    });
    move || {
        let Some(table) = table.first_chunk::<{ 1 << 16 }>() else { return 0 };
        let mut sums = [0; 4];
        for four in black_box(&indices).as_chunks::<4>().0 {
            for (sum, &index) in sums.iter_mut().zip(four) {
                *sum ^= table[usize::from(index)];
            }
        }
        black_box(sums);
        INDICES
    }
}

/// As many words as in a vector.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Block([u16; LANES]);

/// Bytes per second that threads read of a working set.
fn bandwidth(level: Level, threads: usize, set: WorkingSet) -> f64 {
    let bytes = set.bytes(threads) / threads;
    together(&rates(threads, move || {
        let blocks = vec![Block([1; LANES]); bytes.div_ceil(size_of::<Block>()).max(1)];
        let bytes = size_of_val(&*blocks);
        let passes = PORTION.div_ceil(bytes);
        move || {
            for _ in 0..passes {
                black_box(level.run(Read(black_box(&blocks))));
            }
            passes * bytes
        }
    }))
}

/// Reads all of some blocks.
struct Read<'a>(&'a [Block]);

impl Work for Read<'_> {
    type Output = [[u16; HALF]; 2];

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> [[u16; HALF]; 2] {
        let mut sums = simd.splat(0);
        for block in self.0 {
            let words = block.0.as_ptr();
            // SAFETY: as many words as in a vector.
            sums = simd.add(sums, unsafe { simd.load([words, words.add(HALF)]) });
        }
        let mut halves = [[0; HALF]; 2];
        let [first, second] = &mut halves;
        // SAFETY: as many words as in a vector.
        unsafe { simd.store([first.as_mut_ptr(), second.as_mut_ptr()], sums) };
        halves
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn machine() -> Machine {
        let bandwidth = vec![(WorkingSet::All(2000), 8e9)];
        Machine { cores: 2, clock: 3e9, look_ups: 5e9, bandwidth }
    }

    #[test]
    fn the_lowest_limit_counts() {
        let limit = |samples, classified| {
            let limit = machine().limit(samples, 2000, classified);
            (limit.name, limit.rate)
        };
        // 2 bytes of the volume for each sample.
        assert_eq!(limit(1000, false), ("read bandwidth", 4e9));
        assert_eq!(limit(1000, true), ("read bandwidth", 4e9));
        // 1 byte for each: look-ups are slower then.
        assert_eq!(limit(2000, true), ("table look-ups", 5e9));
        assert_eq!(limit(2000, false), ("read bandwidth", 8e9));
    }

    #[test]
    fn cycles_are_those_of_all_cores() {
        assert_eq!(machine().cycles_per_sample(1e-3, 1_000_000), 6.0);
    }

    #[test]
    fn each_volume_is_measured_once_beside_what_every_machine_is_measured_with() {
        let machine = Machine::measure(Level::detect(), 1, &[16, 8 << 20, 16]);
        let sets: Vec<_> = machine.bandwidth.iter().map(|(set, _)| set.bytes(1)).collect();
        assert_eq!(sets, [16, 24 << 10, 512 << 10, 8 << 20, 64 << 20]);
        assert!(machine.clock > 0.0 && machine.look_ups > 0.0);
        assert!(machine.bandwidth.iter().all(|(_, rate)| *rate > 0.0));
    }

    #[test]
    fn rounds_count_for_each_thread_or_for_all() {
        let mut rates = [[1.0; ROUNDS]; 2];
        (rates[0][3], rates[1][4]) = (5.0, 7.0);
        assert_eq!((apart(&rates), together(&rates)), (12.0, 8.0));
    }

    #[test]
    fn threads_share_what_they_read_together() {
        assert_eq!((WorkingSet::Each(10).bytes(3), WorkingSet::All(10).bytes(3)), (30, 10));
    }
}
