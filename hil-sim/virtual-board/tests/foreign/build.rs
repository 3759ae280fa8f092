//! Supplies the memory layout for cortex-m-rt: the memory.x of embassy-stm32.

fn main() {
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
}
