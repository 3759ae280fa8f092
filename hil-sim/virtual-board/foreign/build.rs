//! The memory layout of cortex-m-rt, with the memory.x of embassy-stm32.

fn main() {
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
}
