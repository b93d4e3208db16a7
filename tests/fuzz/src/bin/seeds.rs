//! Writes the seeds of every format into FOLDER/<format>/, and prints the formats.

use croupier_fuzz::inputs::FORMATS;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).expect("a folder");
    for format in FORMATS {
        let folder = Path::new(&folder).join(format.name);
        std::fs::create_dir_all(&folder)?;
        for (i, seed) in (format.seeds)().iter().enumerate() {
            std::fs::write(folder.join(format!("seed{i}")), seed)?;
        }
        println!("{}", format.name);
    }
    Ok(())
}
