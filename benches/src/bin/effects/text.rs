//! Bytes of machine code that a function leads to, from a disassembly of the running program.

use std::collections::{HashMap, HashSet};
use std::error::Error;
use std::process::Command;

/// A function of the program.
struct Function {
    name: String,
    start: u64,
    bytes: u64,
    /// Names of the functions that it refers to: calls, jumps, addresses.
    refers_to: Vec<String>,
}

/// The functions of this program.
pub(crate) struct Text {
    functions: Vec<Function>,
    by_name: HashMap<String, usize>,
    /// Where the program lies in memory, less where its file says.
    shift: u64,
}

impl Text {
    /// Disassembles this program, with `objdump` of the system's binutils, which linking needs anyway.
    pub(crate) fn of_this_program() -> Result<Self, Box<dyn Error>> {
        let exe = std::env::current_exe()?;
        let output = Command::new("objdump").args(["-d", "--no-show-raw-insn"]).arg(&exe).output();
        let output = output.map_err(|e| format!("cannot run objdump: {e}"))?;
        let mut functions: Vec<Function> = Vec::new();
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            let heading = line.strip_suffix(">:").and_then(|l| l.split_once(" <"));
            if let Some((start, name)) = heading {
                let start = u64::from_str_radix(start, 16)?;
                if let Some(last) = functions.last_mut() {
                    last.bytes = start - last.start;
                }
                functions.push(Function { name: name.into(), start, bytes: 0, refers_to: Vec::new() });
            } else if let Some((_, name)) = line.strip_suffix('>').and_then(|l| l.rsplit_once('<'))
                && let Some(last) = functions.last_mut()
            {
                last.refers_to.push(name.split("+0x").next().unwrap_or(name).into());
            }
        }
        let by_name = functions.iter().enumerate().map(|(i, f)| (f.name.clone(), i)).collect();
        let maps = std::fs::read_to_string("/proc/self/maps")?;
        let loaded = maps.lines().find(|l| l.ends_with(&*exe.to_string_lossy())).ok_or("the program is not mapped")?;
        let shift = u64::from_str_radix(loaded.split('-').next().unwrap_or(""), 16)?;
        Ok(Self { functions, by_name, shift })
    }

    /// Bytes of the function at an address and of all functions of these crates that it leads to.
    pub(crate) fn bytes(&self, address: usize) -> Result<u64, Box<dyn Error>> {
        let start = address as u64 - self.shift;
        let first = self.functions.iter().position(|f| f.start == start).ok_or("no function at this address")?;
        let (mut seen, mut waiting, mut sum) = (HashSet::from([first]), vec![first], 0);
        while let Some(i) = waiting.pop() {
            let f = &self.functions[i];
            sum += f.bytes;
            for to in f.refers_to.iter().filter_map(|name| self.by_name.get(name)) {
                // what messages of panics need belongs to no effect
                if self.functions[*to].name.contains("croupier") && seen.insert(*to) {
                    waiting.push(*to);
                }
            }
        }
        Ok(sum)
    }
}
