//! `prehend completions` and `prehend man`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::wrong_calls::snapshot;
use crate::{commands, prehend};

#[test]
fn every_shell_gets_a_script_that_knows_every_command() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = prehend(folder.path(), &format!("completions {shell}")).ends_with(0);
        let text = String::from_utf8(script.stdout).unwrap();
        for command in commands() {
            let word = command.rsplit(' ').next().unwrap();
            assert!(text.contains(word), "{shell}: {word}");
        }
        assert!(text.contains("force-norm") && script.stderr.is_empty(), "{shell}");
    }
}

/// What bash offers for the last of the words.
fn completed(script: &Path, words: &[&str]) -> Vec<String> {
    let program = r#"
        source "$1"; shift
        COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
        function=$(complete -p prehend | sed 's/.*-F \([^ ]*\).*/\1/')
        "$function" prehend "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
        printf '%s\n' "${COMPREPLY[@]}""#;
    let mut bash = Command::new("bash");
    bash.args(["--norc", "-c", program, "bash"]).arg(script).args(words);
    let output = bash.output().unwrap();
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn bash_takes_the_script_and_completes() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("prehend.bash");
    fs::write(&script, prehend(folder.path(), "completions bash").ends_with(0).stdout).unwrap();
    assert!(Command::new("bash").arg("-n").arg(&script).status().unwrap().success());
    for (words, offered) in [
        (&["prehend", "pl"][..], &["plan"][..]),
        (&["prehend", "ex"], &["execute", "experiment", "export"]),
        (&["prehend", "hand", "s"], &["show"]),
        (&["prehend", "plan", "--stra"], &["--strategy"]),
        (&["prehend", "plan", "--strategy", ""], &["paper", "best"]),
        (&["prehend", "hand", "monitor", "--ra"], &["--rate"]),
    ] {
        assert_eq!(completed(&script, words), offered, "{words:?}");
    }
}

/// The pages in a folder by their names.
fn pages(folder: &Path) -> BTreeMap<String, String> {
    snapshot(folder).into_iter().map(|(name, bytes)| (name, String::from_utf8(bytes).unwrap())).collect()
}

#[test]
fn every_command_has_a_page_with_its_options_and_examples() {
    let folder = tempfile::tempdir().unwrap();
    prehend(folder.path(), "man share/man1").ends_with(0);
    let pages = pages(&folder.path().join("share/man1"));
    for command in commands() {
        let name = format!("prehend-{}", command.replace(' ', "-"));
        let page = pages.get(&format!("{name}.1")).unwrap_or_else(|| panic!("{name}"));
        assert!(page.starts_with(".ie ") || page.starts_with(".TH "), "{name}");
        assert!(page.contains(&format!(".TH {name} 1 ")), "{name}: {page}");
        let headings: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix(".SH ")).collect();
        for heading in ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "EXAMPLES"] {
            assert_eq!(headings.iter().filter(|other| **other == heading).count(), 1, "{name}: {heading}");
        }
        // A line of text that begins like a request would be taken for one: only those that are meant are there.
        for request in page.lines().filter(|line| line.starts_with(['.', '\''])) {
            let word = request[1..].split(' ').next().unwrap();
            let known =
                ["ie", "el", "TH", "SH", "TP", "RS", "RE", "IP", "PP", "nf", "fi", "br", "sp", "\\\""];
            assert!(known.contains(&word), "{name}: {request}");
        }
        let filled = ["nf", "fi"].map(|word| page.lines().filter(|line| *line == format!(".{word}")).count());
        assert_eq!(filled, [1, 1], "{name}");
        // Each example on a line of its own, its dashes such that they can be copied.
        let examples = page.split(".SH EXAMPLES\n").nth(1).unwrap();
        let first = examples.lines().nth(1).unwrap();
        assert!(first.replace("\\-", "-").starts_with(&format!("prehend {command}")), "{first}");
        assert!(!first.replace("\\-", "").contains('-'), "{first}");
    }
    assert!(pages["prehend-plan.1"].contains("\\-\\-strategy"));
    assert!(pages["prehend.1"].contains("prehend\\-hand(1)"));
    // One for each, and for the two that have others below them.
    assert_eq!(pages.len(), commands().len() + 2);
}

#[test]
fn pages_of_ours_are_replaced_and_others_stay() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join("man").join(name);
    let man = |status: i32| prehend(folder.path(), "man man").ends_with(status);
    man(0);
    let fresh = pages(&folder.path().join("man"));
    let again = man(0);
    assert!(String::from_utf8_lossy(&again.stdout).starts_with("wrote 0 of "));
    // As another version would have written it: other text, sealed in the same way.
    fs::copy(path("prehend-scan.1"), path("prehend-plan.1")).unwrap();
    fs::remove_file(path("prehend-demo.1")).unwrap();
    let mended = man(0);
    assert!(String::from_utf8_lossy(&mended.stdout).starts_with("wrote 2 of "));
    assert_eq!(pages(&folder.path().join("man")), fresh);
    // Somebody's additions to a page of ours, and somebody's own: nothing at all is written.
    fs::remove_file(path("prehend-demo.1")).unwrap();
    for theirs in
        [fresh["prehend-plan.1"].replace(".SH NAME", ".SH NAMES"), "my page\n".into(), String::new()]
    {
        fs::write(path("prehend-plan.1"), &theirs).unwrap();
        let before = pages(&folder.path().join("man"));
        let refused = man(2);
        assert!(refused.stderr.contains("prehend-plan.1: is there already"), "{}", refused.stderr);
        assert_eq!((refused.stderr.lines().count(), pages(&folder.path().join("man"))), (1, before));
    }
}
