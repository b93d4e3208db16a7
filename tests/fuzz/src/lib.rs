//! Inputs of the fuzz targets. `.ci/fuzz` runs them.

pub mod inputs;
pub mod memory;

pub use libfuzzer_sys::fuzz_target;

/// Most bytes that an input may take.
pub const LIMIT: usize = 1 << 30;

#[global_allocator]
static ALLOCATOR: memory::Counting = memory::Counting::unlimited();

/// Runs an input of the format of this name.
pub fn run(name: &str, bench: &mut inputs::Workbench, data: &[u8]) -> bool {
    ALLOCATOR.limit(LIMIT);
    inputs::FORMATS.iter().find(|f| f.name == name).is_some_and(|f| (f.run)(bench, data))
}

/// The fuzz target of a format.
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        thread_local! {
            static BENCH: std::cell::RefCell<$crate::inputs::Workbench> = Default::default();
        }
        $crate::fuzz_target!(|data: &[u8]| {
            BENCH.with_borrow_mut(|bench| $crate::run($name, bench, data));
        });
    };
}
