//! The workflows: a job that builds also runs build scripts of others, so it gets no token with write permission.

use std::path::Path;

#[test]
fn no_job_that_builds_has_a_token_that_may_write() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../.github/workflows");
    let mut writes = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let (text, name) = (std::fs::read_to_string(&path).unwrap(), path.display());
        let lines = text.lines().filter(|line| !line.trim_start().starts_with('#'));
        let text: String = lines.map(|line| format!("{line}\n")).collect();
        let (head, jobs) = text.split_once("\njobs:\n").expect("jobs");
        assert!(
            head.contains("\npermissions:\n  contents: read\n"),
            "{name}: reads unless a job says more"
        );
        assert!(!head.contains("write") && !head.contains("token"), "{name}: of all jobs");
        // The line of a job is two spaces and its name.
        let mut all: Vec<String> = Vec::new();
        for line in jobs.lines() {
            let begins =
                line.starts_with("  ") && !line[2..].starts_with(' ') && line.ends_with(':');
            match all.last_mut().filter(|_| !begins) {
                Some(job) => *job += &format!("{line}\n"),
                None => all.push(format!("{line}\n")),
            }
        }
        for job in all {
            let may_write = job.contains("write") || job.contains("token");
            writes += u32::from(may_write);
            for of_builds in ["actions/checkout", "cargo ", "rustup "] {
                assert!(!may_write || !job.contains(of_builds), "{name}: {of_builds} in {job}");
            }
            let count = |what: &str| job.matches(what).count();
            assert_eq!(
                count("actions/checkout@"),
                count("persist-credentials: false"),
                "{name}: {job}"
            );
            for used in job.split("uses: ").skip(1) {
                let commit = used.split(['@', ' ']).nth(1).unwrap_or_default();
                assert!(
                    commit.len() == 40,
                    "{name}: a tag can be moved: {}",
                    used.lines().next().unwrap()
                );
            }
        }
    }
    assert_eq!(writes, 3, "the draft of the release, the wheels for PyPI, the pages");
}
