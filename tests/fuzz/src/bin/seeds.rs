//! Writes the seeds of every format into FOLDER/<format>/ and its words into FOLDER/<format>.dict, and prints the formats.

use croupier_fuzz::inputs::FORMATS;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).expect("a folder");
    let root = Path::new(&folder);
    for format in FORMATS {
        let folder = root.join(format.name);
        std::fs::create_dir_all(&folder)?;
        for (i, seed) in (format.seeds)().iter().enumerate() {
            std::fs::write(folder.join(format!("seed{i}")), seed)?;
        }
        let entry = |word: &&str| word.bytes().map(|b| format!("\\x{b:02x}")).collect::<String>();
        let words: String = format.words.iter().map(|word| format!("\"{}\"\n", entry(word))).collect();
        // libFuzzer refuses an empty file
        std::fs::write(root.join(format!("{}.dict", format.name)), format!("# words\n{words}"))?;
        println!("{}", format.name);
    }
    Ok(())
}
