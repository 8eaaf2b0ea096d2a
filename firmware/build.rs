//! Link arguments of the board images; nothing for the library and for hosts.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // The linker finds the map by itself, but cargo does not know that.
    println!("cargo:rerun-if-changed=../memory.x");
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        println!("cargo:rustc-link-arg-bins=--nmagic");
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
        if env::var_os("CARGO_FEATURE_MPS2_AN386").is_some() {
            println!("cargo:rustc-link-arg-bins=--defsym=_board_mps2_an386=1");
        }
    }
}
