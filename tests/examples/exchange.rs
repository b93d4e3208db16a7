//! Prints the table of docs/CLUSTER.md: `cargo run -p croupier-tests --example exchange`.

use croupier_tests::exchange::{COLUMNS, measured, rows};

fn main() {
    println!("| {COLUMNS} |");
    rows().iter().for_each(|row| println!("{row}"));
    println!("picture B sends in each iteration: {:?}", measured());
}
