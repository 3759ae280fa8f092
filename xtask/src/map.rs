//! The linker's map of the image, as lld writes it.

/// A line of the map.
pub struct Entry<'a> {
    /// Address at run time.
    pub run: u64,
    /// Address of the contents from which they are copied at start.
    pub load: u64,
    /// Bytes.
    pub size: u64,
    /// Name, such as `.ccm`; `FILE.o:(.text.ADC1_2)`; `ADC1_2`.
    pub name: &'a str,
}

/// The level of a line, which its indentation shows.
#[derive(Clone, Copy)]
pub enum Level {
    /// A section of the image.
    Output = 0,
    /// A section of an object file.
    Input = 8,
    /// A symbol.
    Symbol = 16,
}

/// The lines of a level in a map: `10000000  803a000     5100     8 .ccm`.
pub fn entries(map: &str, level: Level) -> Vec<Entry<'_>> {
    let entry = |line| {
        let (run, line) = hex(line)?;
        let (load, line) = hex(line)?;
        let (size, line) = hex(line)?;
        let (_alignment, line) = hex(line)?;
        let name = line.trim_start();
        (line.len() - name.len() == level as usize).then_some(Entry { run, load, size, name })
    };
    map.lines().filter_map(entry).collect()
}

fn hex(line: &str) -> Option<(u64, &str)> {
    let (number, rest) = line.trim_start().split_once(' ')?;
    Some((u64::from_str_radix(number, 16).ok()?, rest))
}
