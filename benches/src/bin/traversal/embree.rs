//! Embree 4 in a process of its own: `benches/embree/rays.c`, which the system's C compiler makes a program of. It
//! loads the shared library; nothing here needs unsafe code or is linked with it.

use crate::rays::{Set, Tri};
use croupier::unstable::scene::blob::NONE;
use std::error::Error;
use std::fmt;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// A way to trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Mode {
    /// Index into [`devices`].
    pub device: usize,
    pub robust: bool,
    /// 1, 8 or 16 rays a call.
    pub width: u32,
    /// Are rays said to be coherent?
    pub coherent: bool,
}

impl Mode {
    /// All of them. Single rays are traced one way, whatever is said of them.
    pub(crate) fn all() -> Vec<Self> {
        let ways = [(1, false), (8, false), (8, true), (16, false), (16, true)];
        let mut modes = Vec::new();
        for robust in [false, true] {
            for device in 0..devices().len() {
                modes.extend(ways.map(|(width, coherent)| Self { device, robust, width, coherent }));
            }
        }
        modes
    }

    /// The scene's flags.
    pub(crate) fn flags(self) -> &'static str {
        if self.robust { "ROBUST" } else { "default" }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let coherent = if self.coherent { " coherent" } else { "" };
        let device = devices().get(self.device).map_or("", |d| d.0);
        write!(f, "{} {}{coherent}, {device}", self.flags(), self.width)
    }
}

/// Names and configurations of the devices: the instruction sets of this processor that Embree has kernels for.
pub(crate) fn devices() -> Vec<(&'static str, &'static str)> {
    let mut devices = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::is_x86_feature_detected as has;
        if has!("avx2") && has!("fma") && has!("bmi2") && has!("lzcnt") {
            devices.push(("AVX2", "isa=avx2,threads=1"));
        }
        if has!("avx512f") && has!("avx512dq") && has!("avx512cd") && has!("avx512bw") && has!("avx512vl") {
            devices.push(("AVX-512", "isa=avx512,threads=1"));
        }
    }
    if devices.is_empty() {
        devices.push(("any", "threads=1"));
    }
    devices
}

/// Compiles the program, beside this one.
pub(crate) fn compile() -> Result<PathBuf, Box<dyn Error>> {
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/embree/rays.c");
    let program = std::env::current_exe()?.with_file_name("traversal-embree");
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let mut command = Command::new(&compiler);
    command.args(["-std=c11", "-O3"]);
    if cfg!(target_arch = "x86_64") {
        // what is written to a packet is read at once, as wide as Embree's registers are
        command.args(["-march=native", "-mprefer-vector-width=512"]);
    }
    command.arg(source).arg("-o").arg(&program).arg("-ldl");
    let compiler = compiler.to_string_lossy();
    let status = command.status().map_err(|e| format!("--embree needs a C compiler: {compiler}: {e}"))?;
    if status.success() { Ok(program) } else { Err(format!("{compiler} cannot compile {source}").into()) }
}

/// A hit: t, triangle.
pub(crate) type Hit = Option<(f32, u32)>;

/// The process, with the scenes built.
pub(crate) struct Embree {
    child: Child,
    /// `None` ends it.
    questions: Option<BufWriter<ChildStdin>>,
    answers: BufReader<ChildStdout>,
    /// Rays by set.
    rays: Vec<usize>,
    /// Of the library.
    pub version: String,
    /// Seconds to build without flags and ROBUST, by device.
    pub build: Vec<[f32; 2]>,
}

impl Embree {
    /// Starts the program with triangles and sets of rays.
    pub(crate) fn start(
        program: &Path,
        library: &Path,
        triangles: &[Tri],
        sets: &[Set],
    ) -> Result<Self, Box<dyn Error>> {
        // a name without a folder would be looked for where the system has libraries
        let library = std::path::absolute(library)?;
        let devices = devices();
        let mut command = Command::new(program);
        command.arg(library).args(devices.iter().map(|d| d.1)).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(|e| format!("{}: {e}", program.display()))?;
        let (questions, answers) = child.stdin.take().zip(child.stdout.take()).ok_or("a process without pipes")?;
        let mut started = Self {
            child,
            questions: Some(BufWriter::new(questions)),
            answers: BufReader::new(answers),
            rays: sets.iter().map(|s| s.single.len()).collect(),
            version: String::new(),
            build: Vec::new(),
        };
        // if the program ends early, it has said why
        started.give(triangles, sets).and_then(|()| started.greeting(devices.len())).map_err(|_| started.end())?;
        Ok(started)
    }

    fn give(&mut self, triangles: &[Tri], sets: &[Set]) -> std::io::Result<()> {
        let mut words = vec![triangles.len() as u32];
        words.extend(triangles.iter().flatten().flatten().map(|x| x.to_bits()));
        words.push(sets.len() as u32);
        for set in sets {
            words.extend([u32::from(set.any), set.single.len() as u32]);
            for r in &set.single {
                let ray = [r.origin.to_array(), r.direction.to_array()];
                words.extend(ray.as_flattened().iter().chain([&r.tmax]).map(|x| x.to_bits()));
            }
        }
        self.write(&words)
    }

    fn greeting(&mut self, devices: usize) -> std::io::Result<()> {
        let [major, minor, patch] = self.read::<[u32; 3]>()?;
        self.version = format!("{major}.{minor}.{patch}");
        for _ in 0..devices {
            let seconds = self.read()?;
            self.build.push(seconds);
        }
        Ok(())
    }

    /// Words to the program.
    fn write(&mut self, words: &[u32]) -> std::io::Result<()> {
        let Some(questions) = &mut self.questions else { return Ok(()) };
        questions.write_all(bytemuck::cast_slice(words))?;
        questions.flush()
    }

    /// Numbers from the program.
    fn read<T: bytemuck::Pod>(&mut self) -> std::io::Result<T> {
        let mut numbers = T::zeroed();
        self.answers.read_exact(bytemuck::bytes_of_mut(&mut numbers))?;
        Ok(numbers)
    }

    fn question(&mut self, mode: Mode, set: usize, passes: u32) -> std::io::Result<()> {
        let scene = 2 * mode.device as u32 + u32::from(mode.robust);
        self.write(&[scene, set as u32, mode.width, u32::from(mode.coherent), passes])
    }

    /// CPU seconds for a set, the mean of so many passes (at least one).
    pub(crate) fn seconds(&mut self, mode: Mode, set: usize, passes: u32) -> Result<f64, Box<dyn Error>> {
        self.question(mode, set, passes.max(1))?;
        let [nanoseconds, _hits] = self.read::<[u64; 2]>()?;
        Ok(1e-9 * nanoseconds as f64 / f64::from(passes.max(1)))
    }

    /// Every ray's hit.
    pub(crate) fn hits(&mut self, mode: Mode, set: usize) -> Result<Vec<Hit>, Box<dyn Error>> {
        self.question(mode, set, 0)?;
        let mut words = vec![[0u32; 2]; self.rays[set]];
        self.answers.read_exact(bytemuck::cast_slice_mut(&mut words))?;
        let hit = |[t, triangle]: [u32; 2]| (triangle != NONE).then(|| (f32::from_bits(t), triangle));
        Ok(words.into_iter().map(hit).collect())
    }

    /// The process's number.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits for the end of a program that has failed.
    fn end(&mut self) -> Box<dyn Error> {
        self.questions = None;
        match self.child.wait() {
            Ok(status) => format!("the program that loads Embree ended with {status}").into(),
            Err(e) => e.into(),
        }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        self.questions = None;
        // it ends at the end of its input
        let _ = self.child.wait();
    }
}
