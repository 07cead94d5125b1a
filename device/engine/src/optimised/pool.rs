//! Threads that live as long as the renderer, and work on one frame together.

use super::tile::Scratch;
use crossbeam::channel::{Receiver, Sender, bounded};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

/// What all threads do at the same time, each with memory of its own.
type Job<'a> = &'a (dyn Fn(&mut Scratch) + Sync);

/// The threads.
#[derive(Debug)]
pub struct Pool {
    workers: Vec<Worker>,
    /// Memory of the thread that asks; held while a frame is rendered.
    own: Mutex<Scratch>,
}

#[derive(Debug)]
struct Worker {
    jobs: Option<Sender<Job<'static>>>,
    done: Receiver<std::thread::Result<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    fn new(number: usize) -> std::io::Result<Self> {
        let (jobs, received) = bounded::<Job<'static>>(1);
        let (finished, done) = bounded(1);
        let work = move || {
            let mut scratch = Scratch::default();
            for job in received {
                let result = catch_unwind(AssertUnwindSafe(|| job(&mut scratch)));
                if finished.send(result).is_err() {
                    break;
                }
            }
        };
        let thread = Builder::new().name(format!("render {number}")).spawn(work)?;
        Ok(Self { jobs: Some(jobs), done, thread: Some(thread) })
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ended = thread.join();
        }
    }
}

impl Pool {
    /// A pool of `threads` threads, of which the one that asks for work is one. Fewer if the system has no more.
    #[must_use]
    pub fn new(threads: usize) -> Self {
        let workers = (1..threads).map_while(|number| Worker::new(number).ok()).collect();
        Self { workers, own: Mutex::default() }
    }

    /// Threads that work.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.workers.len() + 1
    }

    /// Does `job` on all threads and returns when it is done on all of them.
    pub fn run(&self, job: Job<'_>) {
        let mut scratch = self.own.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: only the lifetime changes. No worker uses the job after it has said that it is done with it, or
        // has ended, and this function waits for that before it returns, or unwinds.
        let lent = unsafe { core::mem::transmute::<Job<'_>, Job<'static>>(job) };
        let busy = self
            .workers
            .iter()
            .filter(|worker| worker.jobs.as_ref().is_some_and(|jobs| jobs.send(lent).is_ok()));
        let busy: Vec<_> = busy.collect();
        let own = catch_unwind(AssertUnwindSafe(|| job(&mut scratch)));
        let results: Vec<_> = busy.iter().filter_map(|worker| worker.done.recv().ok()).collect();
        for result in results.into_iter().chain([own]) {
            if let Err(panic) = result {
                resume_unwind(panic);
            }
        }
    }
}
