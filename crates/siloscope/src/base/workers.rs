//! Threads of our own, only where the caller asks for more than one.

use crate::{Error, Result};
use rayon::ThreadPool;
use rayon::prelude::*;

/// Most threads that a caller may ask for.
pub const MAX_THREADS: usize = 1024;

/// Refuses 0 threads and a number that no machine has.
pub fn check_threads(threads: usize) -> Result<()> {
    match (1..=MAX_THREADS).contains(&threads) {
        true => Ok(()),
        false => Err(Error::Setting { name: "threads", bounds: "between 1 and 1024", value: threads as f64 }),
    }
}

/// Runs loops over independent items; the answer never depends on the number of threads.
pub struct Workers {
    pool: Option<ThreadPool>,
}

/// Items handled together: large enough that handing them out costs nothing beside the work.
const CHUNK: usize = 64;

/// Most threads that are started: a wrong number must not ask the system for millions.
const MOST: usize = 256;

impl Workers {
    /// Workers on `threads` threads, at most 256; 1 (or 0) starts none. Where the system refuses threads the caller's
    /// own is used.
    pub fn new(threads: usize) -> Self {
        let threads = threads.min(MOST);
        let build = || rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok();
        Self { pool: if threads > 1 { build() } else { None } }
    }

    /// Number of threads at work.
    pub fn threads(&self) -> usize {
        self.pool.as_ref().map_or(1, ThreadPool::current_num_threads)
    }

    /// `f(i)` for every i below `n`, in order.
    pub fn map<T: Send>(&self, n: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
        match &self.pool {
            None => (0..n).map(f).collect(),
            Some(pool) => pool.install(|| (0..n).into_par_iter().with_min_len(CHUNK).map(&f).collect()),
        }
    }

    /// `f(i, part)` for every `size` consecutive items of `out`, i counting the parts.
    pub fn for_parts<T: Send>(&self, out: &mut [T], size: usize, f: impl Fn(usize, &mut [T]) + Sync) {
        let size = size.max(1);
        match &self.pool {
            None => out.chunks_mut(size).enumerate().for_each(|(i, part)| f(i, part)),
            Some(pool) => pool.install(|| out.par_chunks_mut(size).enumerate().for_each(|(i, part)| f(i, part))),
        }
    }

    /// Both closures, side by side where there are threads for it.
    pub fn join<A: Send, B: Send>(&self, a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
        match &self.pool {
            None => (a(), b()),
            Some(pool) => pool.install(|| rayon::join(a, b)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_threads_changes_nothing() {
        for threads in [0, 1, 2, 5, usize::MAX] {
            let workers = Workers::new(threads);
            assert_eq!(workers.map(1000, |i| i * i), (0..1000).map(|i| i * i).collect::<Vec<_>>());
            let mut out = vec![0; 1001];
            workers.for_parts(&mut out, 7, |i, part| part.iter_mut().enumerate().for_each(|(j, x)| *x = 7 * i + j));
            assert_eq!(out, (0..1001).collect::<Vec<_>>());
        }
    }
}
