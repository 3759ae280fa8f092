//! The crates in a program, as CycloneDX JSON: what cargo builds for one target with that target's features.
//!
//! Own code replaces cargo-cyclonedx 0.5, which joins the features of all targets and tests, and writes a new number each time.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};

use crate::{run, sources};

/// Information on each crate, by `NAME@VERSION`.
type Crates = BTreeMap<String, String>;

/// The crates of a program.
pub struct Sbom {
    /// Licences of the crates in the program, including its own package.
    inside: Crates,
    /// Licences of these crates and of those that run during the build: macros, build scripts and their dependencies.
    all: Crates,
    /// Check sums of the third-party packages in `Cargo.lock`.
    sums: Crates,
}

impl Sbom {
    /// The crates of a package's program for a target.
    pub fn new(package: &str, target: &str) -> Result<Self> {
        let tree = |edges| {
            let what = format!("tree --locked -p {package} --target {target} -e {edges}");
            let form = " --prefix none --no-dedupe --format {p}|{l}";
            crates(&run::said(&mut run::cargo(&(what + form)))?)
        };
        let (all, inside) = (tree("no-dev")?, tree("no-dev,no-build,no-proc-macro")?);
        Ok(Self { inside, all, sums: sums(&sources::read("Cargo.lock")?)? })
    }

    /// The third-party crates in the program.
    pub fn of_others(&self) -> impl Iterator<Item = &String> {
        self.sums.keys().filter(|one| self.inside.contains_key(*one))
    }

    /// Fails if the debug information of an image names sources of a crate that is not listed, or none at all.
    pub fn check(&self, image: &[u8]) -> Result<()> {
        let named = self.sums.keys().filter(|one| {
            let path = format!("\0{}/src/", one.replace('@', "-"));
            image.windows(path.len()).any(|part| part == path.as_bytes())
        });
        let (listed, not): (Vec<_>, Vec<_>) = named.partition(|one| self.inside.contains_key(*one));
        ensure!(not.is_empty(), "in the image, and not in its list of crates: {not:?}");
        ensure!(!listed.is_empty(), "the image has no debug information of crates");
        Ok(())
    }

    /// The document for a package's program of this kind, built by this compiler. The same crates give the same text.
    pub fn document(&self, package: &str, kind: &str, compiler: &str) -> Result<String> {
        let version = env!("CARGO_PKG_VERSION");
        // The standard library is not in `Cargo.lock`.
        let library = json!({ "type": "library", "name": "rust-std", "version": compiler });
        let mut components = vec![library];
        for (one, licence) in &self.all {
            let (name, version) = one.split_once('@').unwrap_or_default();
            let (purl, inside) = (format!("pkg:cargo/{one}"), self.inside.contains_key(one));
            let sum = self.sums.get(one).map(|sum| json!({ "alg": "SHA-256", "content": sum }));
            components.push(json!({
                "type": "library", "bom-ref": purl, "purl": purl, "name": name, "version": version,
                "scope": if inside { "required" } else { "excluded" },
                "licenses": [{ "expression": licence }], "hashes": sum.as_slice(),
            }));
        }
        let document = json!({
            "bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "components": components,
            "metadata": { "component": { "type": kind, "name": package, "version": version } },
        });
        Ok(serde_json::to_string_pretty(&document)? + "\n")
    }
}

/// The licences in the lines of `cargo tree`: `NAME vVERSION (path or kind)|LICENCE`.
fn crates(tree: &str) -> Result<Crates> {
    let lines = tree.lines().map(|line| {
        let (of, licence) = line.split_once('|')?;
        let (name, version) = of.split_once(" v")?;
        // A slash is the older way to write a choice of licences.
        Some((format!("{name}@{}", version.split(' ').next()?), licence.replace('/', " OR ")))
    });
    lines.collect::<Option<_>>().with_context(|| format!("cargo tree: {tree}"))
}

/// The check sums of a `Cargo.lock`.
fn sums(lock: &str) -> Result<Crates> {
    let lock: Value = toml::from_str(lock)?;
    let packages = lock["package"].as_array().into_iter().flatten();
    let sums = packages.filter_map(|one| {
        let [name, version, sum] = ["name", "version", "checksum"].map(|key| one[key].as_str());
        Some((format!("{}@{}", name?, version?), sum?.to_owned()))
    });
    Ok(sums.collect())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn fixture() -> Sbom {
        let inside = crates("drive v0.2.0 (/a/folder)|MIT\naz v1.3.0|MIT/Apache-2.0").unwrap();
        let build = crates("syn v3.0.1 (proc-macro)|MIT\naz v1.3.0|MIT/Apache-2.0").unwrap();
        let all = inside.clone().into_iter().chain(build).collect();
        let lock = r#"
            package = [{ name = "az", version = "1.3.0", checksum = "ab" }, { name = "az", version = "2.0.0", checksum = "cd" },
            { name = "drive", version = "0.2.0" }, { name = "syn", version = "3.0.1", checksum = "ef" }]
        "#;
        Sbom { inside, all, sums: sums(lock).unwrap() }
    }

    #[test]
    fn the_document_lists_each_crate_with_licence_and_check_sum() {
        let text = fixture().document("drive", "firmware", "rustc 1").unwrap();
        let document: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(document["metadata"]["component"]["version"], env!("CARGO_PKG_VERSION"));
        let [library, az, drive, syn] = document["components"].as_array().unwrap().as_slice()
        else {
            panic!("{text}");
        };
        assert_eq!(library["version"], "rustc 1");
        assert_eq!(az["purl"], "pkg:cargo/az@1.3.0");
        assert_eq!(az["licenses"][0]["expression"], "MIT OR Apache-2.0");
        assert_eq!((&az["hashes"][0]["content"], &az["scope"]), (&json!("ab"), &json!("required")));
        assert_eq!((&drive["hashes"], &drive["scope"]), (&json!([]), &json!("required")));
        assert_eq!(syn["scope"], "excluded");
    }

    #[test]
    fn a_crate_of_the_image_that_is_not_listed_fails() {
        let check = |image: &[u8]| fixture().check(image).map_err(|error| error.to_string());
        assert_eq!(check(b"\0az-1.3.0/src/lib.rs\0"), Ok(()));
        let unlisted = "in the image, and not in its list of crates: [\"az@2.0.0\"]".to_owned();
        assert_eq!(check(b"\0az-1.3.0/src/lib.rs\0az-2.0.0/src/lib.rs\0"), Err(unlisted));
        assert!(check(b"\0xaz-2.0.0/src/lib.rs\0").is_err());
        assert_eq!(fixture().of_others().collect::<Vec<_>>(), ["az@1.3.0"]);
    }

    /// Compares the list with the crates that another command of cargo resolves for the image.
    #[test]
    fn the_crates_of_the_image_are_those_that_cargo_resolves() {
        let sbom = Sbom::new("induction-drive", run::TARGET).unwrap();
        let words =
            format!("metadata --locked --format-version 1 --filter-platform {}", run::TARGET);
        let metadata: Value =
            serde_json::from_str(&run::said(&mut run::cargo(&words)).unwrap()).unwrap();
        let list = |value: &Value| value.as_array().unwrap().clone();
        let nodes: BTreeMap<_, _> = list(&metadata["resolve"]["nodes"])
            .into_iter()
            .map(|node| (node["id"].as_str().unwrap().to_owned(), node))
            .collect();
        let packages = list(&metadata["packages"]);
        let of = |id: &str| packages.iter().find(|one| one["id"] == id).unwrap();
        let is_macro = |id: &str| {
            list(&of(id)["targets"]).iter().any(|target| target["kind"][0] == "proc-macro")
        };
        let mut found = BTreeSet::new();
        let mut open: Vec<String> =
            nodes.keys().filter(|id| of(id)["name"] == "induction-drive").cloned().collect();
        while let Some(id) = open.pop() {
            if is_macro(&id) || !found.insert(id.clone()) {
                continue;
            }
            for dependency in list(&nodes[&id]["deps"]) {
                if list(&dependency["dep_kinds"]).iter().any(|kind| kind["kind"].is_null()) {
                    open.push(dependency["pkg"].as_str().unwrap().to_owned());
                }
            }
        }
        let name = |id: &String| {
            let text = |key: &str| of(id)[key].as_str().unwrap().to_owned();
            text("name") + "@" + &text("version")
        };
        let found: BTreeSet<_> = found.iter().map(name).collect();
        let ours: BTreeSet<_> = sbom.inside.keys().cloned().collect();
        assert_eq!(ours.difference(&found).next(), None);
        // That command joins the features of all targets and tests: the operating system's random numbers in rand_core belong to the
        // host, the settings are tested with serde, and only the small image reads coefficients in the format of postcard.
        let hosts = ["getrandom@", "cfg-if@", "serde@", "serde_core@", "postcard@", "cobs@"];
        let more = found.difference(&ours);
        let more: Vec<_> = more.filter(|one| !hosts.iter().any(|of| one.starts_with(of))).collect();
        assert_eq!(more, Vec::<&String>::new());
    }
}
