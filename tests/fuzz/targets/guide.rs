#![no_main]

croupier_fuzz::target!("guide");
