//! The field's terms: `xtask/words.txt` lists phrases that comments, messages and pages must not contain.

/// Reports each breach with file, line, phrase and the word to use; commits only where git knows the repository.
#[cfg(test)]
#[test]
fn comments_messages_and_commits_use_the_terms() {
    let list = crate::sources::read("xtask/words.txt").unwrap();
    let rules = list.lines().filter(|line| !line.starts_with("# "));
    let rules: Vec<_> = rules.map(|line| line.split_once(" -> ").expect("an arrow")).collect();
    let openings = ["What", "That which", "Of the", "By so"].map(|one| (one, "a noun or a verb"));
    let mut found = String::new();
    let pages = ["README.md", "CONTRIBUTING.md", "hil-sim/lab/texts.toml"].map(Into::into);
    // The glossary has the old words beside the new ones.
    let book = crate::sources::files("md").unwrap().into_iter();
    let book = book.filter(|page| page.starts_with("docs") && !page.ends_with("glossary.md"));
    for path in crate::sources::files("rs").unwrap().into_iter().chain(pages).chain(book) {
        let text = crate::sources::read(&path).unwrap();
        let lines: Vec<_> = text.lines().map(str::trim).collect();
        let bare = |n| lines.get(n).map_or("", |s: &&str| s.trim_start_matches(['/', '!', ' ']));
        for (n, line) in lines.iter().enumerate() {
            let both = format!("{line} {}", bare(n + 1)).to_ascii_lowercase();
            let allowed = |rest: &str| rest.split(" | ").skip(1).any(|one| both.contains(one));
            let is_here = |phrase| both.find(phrase).is_some_and(|at| at < line.len());
            let wrong = rules.iter().filter(|(phrase, rest)| is_here(*phrase) && !allowed(rest));
            let opens = |one: &str| line.starts_with("//") && bare(n).starts_with(one);
            for (phrase, rest) in wrong.chain(openings.iter().filter(|(one, _)| opens(one))) {
                let word = rest.split(" | ").next().unwrap_or_default();
                found += &format!("{}:{}: `{phrase}`: use {word}\n", path.display(), n + 1);
            }
        }
    }
    // With a time of day: to a bare date git adds the present one.
    let log = ["log", "--since=2026-11-29T00:00:00Z", "--format=%s"];
    for line in crate::run::output("git", &log).unwrap_or_default().lines() {
        let area = line.split_once(": ").filter(|(area, _)| *area == area.to_lowercase());
        if line.chars().count() > 72 || area.is_none() {
            found += &format!("commit: `{line}`: use `area: ...`, at most 72 characters\n");
        }
    }
    assert!(found.is_empty(), "{} breaches:\n{found}", found.lines().count());
}
