//! Link arguments of the board images; nothing for the library and for hosts.

use std::env;

/// Boards whose memory map or link scripts differ from the default: their feature as cargo spells it, and their symbol
/// in `memory.x`.
const BOARDS: [(&str, &str); 3] = [
    ("CARGO_FEATURE_MPS2_AN386", "_board_mps2_an386"),
    ("CARGO_FEATURE_STM32G474", "_board_stm32g474"),
    ("CARGO_FEATURE_STM32H563", "_board_stm32h563"),
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // The linker finds the map by itself, but cargo does not know that.
    println!("cargo:rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        println!("cargo:rustc-link-arg-bins=--nmagic");
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
        for (feature, symbol) in BOARDS {
            if env::var_os(feature).is_some() {
                println!("cargo:rustc-link-arg-bins=--defsym={symbol}=1");
            }
        }
        if env::var_os("CARGO_FEATURE__STM32").is_some() {
            println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
            // Without a word nothing but errors is compiled in.
            println!("cargo:rerun-if-env-changed=DEFMT_LOG");
            if env::var_os("DEFMT_LOG").is_none() {
                println!("cargo:rustc-env=DEFMT_LOG=info");
            }
        }
    }
}
