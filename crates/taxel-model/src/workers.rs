//! Who does the taxels of a fit: one after the other, or several at once.
//!
//! Taxels are fitted by themselves, so what comes out is the same. The engine starts no threads: the daemon leaves a robot's
//! other cores alone. A program that fits files has all of them, and brings them here.

use std::sync::OnceLock;

/// Does jobs that do not depend on each other.
pub trait Workers: Sync {
    /// Does `job` for each number below `jobs`, each once and in any order, and returns when all are done.
    fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync));

    /// Is told how much of all the work is done, 0 to 1.
    fn progress(&self, _share: f64) {}
}

/// One after the other.
#[derive(Clone, Copy, Debug)]
pub struct OneByOne;

impl Workers for OneByOne {
    fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
        (0..jobs).for_each(job);
    }
}

/// What `job` gives for each number below `jobs`, in order.
#[must_use]
pub fn map<T: Send + Sync>(workers: &dyn Workers, jobs: usize, job: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let cells: Vec<OnceLock<T>> = (0..jobs).map(|_| OnceLock::new()).collect();
    workers.each(jobs, &|number| _ = cells[number].set(job(number)));
    // Workers that leave one out have it done here.
    cells.into_iter().enumerate().map(|(number, cell)| cell.into_inner().unwrap_or_else(|| job(number))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Does the odd ones alone, from behind and twice.
    struct Sloppy;

    impl Workers for Sloppy {
        fn each(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
            (0..jobs).rev().filter(|number| number % 2 == 1).for_each(|number| {
                job(number);
                job(number);
            });
        }
    }

    #[test]
    fn whoever_works_the_results_are_in_order() {
        let square = |number: usize| number * number;
        for jobs in [0, 1, 7] {
            let expected: Vec<usize> = (0..jobs).map(square).collect();
            assert_eq!(map(&OneByOne, jobs, square), expected);
            assert_eq!(map(&Sloppy, jobs, square), expected);
        }
    }
}
