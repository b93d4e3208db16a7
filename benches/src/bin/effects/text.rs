//! Bytes of machine code that a function leads to, from a disassembly of the running program.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::error::Error;
use std::path::Path;
use std::process::Command;

/// A function of the program.
struct Function {
    /// Whether it belongs to these crates.
    ours: bool,
    bytes: u64,
    /// Addresses that it refers to: of functions that it calls, or of the slots that hold those.
    refers_to: Vec<u64>,
}

/// The functions of this program.
pub(crate) struct Text {
    functions: BTreeMap<u64, Function>,
    /// Addresses in slots that the loader fills in: calls between crates go through them.
    slots: HashMap<u64, u64>,
    /// Where the program lies in memory, less where its file says.
    shift: u64,
}

impl Text {
    /// Disassembles this program, with `objdump` of the system's binutils, which linking needs anyway.
    pub(crate) fn of_this_program() -> Result<Self, Box<dyn Error>> {
        let exe = std::env::current_exe()?;
        let mut functions: BTreeMap<u64, Function> = BTreeMap::new();
        for line in objdump(&["-d", "--no-show-raw-insn"], &exe)?.lines() {
            if let Some((start, name)) = line.strip_suffix(">:").and_then(|l| l.split_once(" <")) {
                let start = hexadecimal(start)?;
                if let Some(mut last) = functions.last_entry() {
                    last.get_mut().bytes = start - last.key();
                }
                let ours = name.contains("croupier");
                functions.insert(start, Function { ours, bytes: 0, refers_to: Vec::new() });
            } else if let Some((before, _)) = line.strip_suffix('>').and_then(|l| l.rsplit_once(" <"))
                && let Some(address) = before.split_whitespace().last()
                && let Some(mut last) = functions.last_entry()
            {
                last.get_mut().refers_to.extend(hexadecimal(address));
            }
        }
        let mut slots = HashMap::new();
        for line in objdump(&["-R"], &exe)?.lines() {
            if let Some((before, target)) = line.split_once("*ABS*+0x")
                && let Some(slot) = before.split_whitespace().next()
            {
                slots.insert(hexadecimal(slot)?, hexadecimal(target)?);
            }
        }
        let maps = std::fs::read_to_string("/proc/self/maps")?;
        let loaded = maps.lines().find(|l| l.ends_with(&*exe.to_string_lossy())).ok_or("the program is not mapped")?;
        let shift = hexadecimal(loaded.split('-').next().unwrap_or(""))?;
        Ok(Self { functions, slots, shift })
    }

    /// Bytes of the function at an address and of all functions of these crates that it leads to. What messages of
    /// panics need belongs to no effect.
    pub(crate) fn bytes(&self, address: usize) -> Result<u64, Box<dyn Error>> {
        let first = address as u64 - self.shift;
        let (mut seen, mut waiting, mut sum) = (HashSet::from([first]), vec![first], 0);
        while let Some(start) = waiting.pop() {
            let f = self.functions.get(&start).ok_or("no function at this address")?;
            sum += f.bytes;
            for to in f.refers_to.iter().map(|to| self.slots.get(to).unwrap_or(to)) {
                if self.functions.get(to).is_some_and(|f| f.ours) && seen.insert(*to) {
                    waiting.push(*to);
                }
            }
        }
        Ok(sum)
    }
}

fn hexadecimal(text: &str) -> Result<u64, std::num::ParseIntError> {
    u64::from_str_radix(text, 16)
}

fn objdump(args: &[&str], exe: &Path) -> Result<String, Box<dyn Error>> {
    let output = Command::new("objdump").args(args).arg(exe).output();
    let output = output.map_err(|e| format!("cannot run objdump: {e}"))?;
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
