//! Checks of hard numerical cases (`docs/NUMERICS.md`) for any seed and any number of cases: tests run them small with
//! fixed seeds, the program `hard` of the benchmarks large with fresh ones.
//!
//! | file | checks |
//! |---|---|
//! | `aimed` | rays at edges and vertices of closed meshes |
//! | `spawned` | rays and shadow rays that start on surfaces |
//! | `boxes` | boxes that rays meet |
//! | `comb` | sample counts over all random numbers |
//! | `sampling` | samples of surfaces, media and lights against their densities |
//! | `even` | the mean of very many equal samples |
//! | `torture` | hard scenes with every strategy |

pub mod aimed;
pub mod boxes;
pub mod comb;
pub mod even;
pub mod sampling;
pub mod spawned;
pub mod torture;

/// What a check, or a part of one, has found.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Cases that were tried.
    pub cases: u64,
    /// Cases that failed.
    pub failures: u64,
    /// The largest of the figures that the check measures, in its unit.
    pub worst: f64,
    /// The first failure, so that it can be looked at.
    pub example: Option<String>,
}

impl Found {
    /// Adds a case, which is a failure if `ok` is false; `example` describes it.
    pub fn case(&mut self, ok: bool, example: impl FnOnce() -> String) {
        self.cases += 1;
        if !ok {
            self.fail(1, example);
        }
    }

    /// Adds failures without cases.
    pub fn fail(&mut self, failures: u64, example: impl FnOnce() -> String) {
        if failures > 0 && self.example.is_none() {
            self.example = Some(example());
        }
        self.failures += failures;
    }

    /// Adds a figure; NaN is worse than any number.
    pub fn figure(&mut self, x: f64) {
        if x > self.worst || x.is_nan() {
            self.worst = x;
        }
    }

    /// Two parts as one.
    pub fn merge(&mut self, other: Self) {
        self.cases += other.cases;
        self.failures += other.failures;
        self.figure(other.worst);
        self.example = self.example.take().or(other.example);
    }

    /// Asserts that nothing has failed, for tests.
    ///
    /// # Panics
    /// If something has.
    #[track_caller]
    pub fn assert_none(&self, what: &str) {
        println!("{what}: {} cases, worst figure {:e}", self.cases, self.worst);
        let example = self.example.as_deref().unwrap_or("");
        assert_eq!(self.failures, 0, "{what}: of {} cases; {example}", self.cases);
    }
}
