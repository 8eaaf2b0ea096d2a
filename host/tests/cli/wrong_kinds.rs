//! Every command with every kind of wrong argument: one line, status 2, nothing touched.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::OsStrExt;

use crate::fixture::fill;
use crate::wrong_calls::{changed, faults, snapshot};
use crate::{command, commands, ran};

/// A call that is in order, or would be if somebody were at the other end, and what can be wrong in it.
struct Shape {
    command: &'static str,
    /// The words behind the command.
    words: &'static str,
    /// Which of them name files to read, and which to write.
    inputs: &'static [&'static str],
    outputs: &'static [&'static str],
    /// Options that take a number of 0 or more.
    amounts: &'static [&'static str],
    /// Options that take a whole number of 0 or more.
    counts: &'static [&'static str],
    /// Options that take one of a few words.
    choices: &'static [&'static str],
}

/// What most commands have nothing of.
const NONE: Shape =
    Shape { command: "", words: "", inputs: &[], outputs: &[], amounts: &[], counts: &[], choices: &[] };

const LINK: &str = "--link tcp:127.0.0.1:1";

const SHAPES: &[Shape] = &[
    Shape {
        command: "demo",
        words: "--object box.off --out new",
        inputs: &["box.off"],
        amounts: &["--friction", "--mass"],
        counts: &["--seed"],
        choices: &["--link", "--strategy", "--sweeps", "--unit"],
        ..NONE
    },
    Shape {
        command: "calibrate",
        words: "--markers markers.csv -o new.toml",
        inputs: &["markers.csv"],
        counts: &["--seed"],
        choices: &["--camera"],
        ..NONE
    },
    Shape {
        command: "calibrate-mount",
        words: "--virtual -o new.toml",
        outputs: &["new.toml"],
        amounts: &["--noise-mm", "--arm-error-mm"],
        counts: &["--sweeps", "--seed"],
        ..NONE
    },
    Shape {
        command: "scan",
        words: "--virtual box.off -o new.ply",
        inputs: &["box.off"],
        outputs: &["new.ply"],
        counts: &["--seed"],
        choices: &["--sweeps", "--unit"],
        ..NONE
    },
    Shape {
        command: "reconstruct",
        words: "cloud.ply -o new.stl",
        inputs: &["cloud.ply"],
        outputs: &["new.stl"],
        amounts: &["--cell", "--tolerance"],
        counts: &["--triangles", "--seed"],
        choices: &["--table", "--pick", "--unit", "--crop"],
    },
    Shape {
        command: "plan",
        words: "box.off --strategy paper --attempts 1 -o new.json",
        inputs: &["box.off"],
        outputs: &["new.json"],
        amounts: &["--friction", "--mass", "--threshold"],
        counts: &["--top", "--seed"],
        choices: &[
            "--hand", "--arm", "--table", "--place", "--up", "--pick", "--unit", "--start", "--server",
        ],
    },
    Shape {
        command: "serve",
        amounts: &["--time-limit", "--grace"],
        counts: &["--jobs", "--queue", "--keep", "--max-body", "--connections"],
        choices: &["--listen"],
        ..NONE
    },
    Shape {
        command: "quality",
        words: "pinch.json",
        inputs: &["pinch.json"],
        amounts: &["--tolerance"],
        counts: &["--edges"],
        choices: &["--convention", "--norm", "--force-norm", "--resist", "--ellipsoid"],
        ..NONE
    },
    Shape {
        command: "view",
        words: "good.json --mesh box.off --cloud cloud.ply --run run.json -o new.html",
        inputs: &["good.json", "box.off", "cloud.ply", "run.json"],
        outputs: &["new.html"],
        counts: &["--top"],
        choices: &["--hand", "--arm", "--unit"],
        ..NONE
    },
    Shape {
        command: "execute",
        words: "good.json -o new.json",
        inputs: &["good.json"],
        outputs: &["new.json"],
        amounts: &["--friction", "--mass"],
        counts: &["--grasp", "--seed"],
        choices: &["--link", "--fail", "--unit", "--offset"],
    },
    Shape {
        command: "experiment",
        words: "--strategy paper --object box.off",
        inputs: &["box.off"],
        amounts: &["--thumb-stiffness", "--shake"],
        counts: &["--trials", "--seed", "--threads", "--redo", "--plant-steps"],
        choices: &["--link", "--sweeps", "--unit"],
        ..NONE
    },
    Shape {
        command: "export",
        words: "good.json --format urdf -o new.urdf",
        inputs: &["good.json"],
        outputs: &["new.urdf"],
        counts: &["--grasp"],
        choices: &["--unit"],
        ..NONE
    },
    Shape { command: "hand show", words: "none.urdf", inputs: &["none.urdf"], ..NONE },
    Shape { command: "hand info", words: LINK, ..NONE },
    Shape { command: "hand params", words: LINK, ..NONE },
    Shape { command: "hand zero", words: LINK, ..NONE },
    Shape { command: "hand log", words: LINK, ..NONE },
    Shape { command: "hand monitor", words: LINK, amounts: &["--rate"], counts: &["--count"], ..NONE },
    Shape { command: "doctor", choices: &["--for"], ..NONE },
    Shape { command: "completions", words: "bash", ..NONE },
    Shape { command: "man", words: "new", ..NONE },
];

/// A name that is no UTF-8: Latin-1's e with an accent.
fn foreign(extension: &str) -> OsString {
    OsStr::from_bytes(&[b"caf\xe9.", extension.as_bytes()].concat()).to_owned()
}

/// The words of a call, and what its error must name.
type Case = (Vec<OsString>, String);

impl Shape {
    fn call(&self) -> Vec<OsString> {
        self.command.split(' ').chain(self.words.split_whitespace()).map(OsString::from).collect()
    }

    fn with(&self, more: &[&OsStr]) -> Vec<OsString> {
        let mut call = self.call();
        call.extend(more.iter().map(|&word| word.to_owned()));
        call
    }

    fn replaced(&self, word: &str, other: &OsStr) -> Vec<OsString> {
        self.call().into_iter().map(|it| if it == word { other.to_owned() } else { it }).collect()
    }

    fn cases(&self) -> Vec<Case> {
        let mut cases = vec![(self.with(&["--frobnicate".as_ref()]), "'--frobnicate'".to_owned())];
        // Those take any number of words, and say which they do not know, or that they are not for it.
        if !["hand params", "hand zero", "calibrate-mount"].contains(&self.command) {
            cases.push((self.with(&["surplus".as_ref()]), "'surplus'".to_owned()));
        }
        for word in self.inputs {
            let extension = word.rsplit('.').next().unwrap();
            for name in ["none", "empty", "garbage"] {
                let name = format!("{name}.{}", if extension == "off" { "ply" } else { extension });
                cases.push((self.replaced(word, name.as_ref()), name));
            }
            cases.push((self.replaced(word, "folder".as_ref()), "folder".to_owned()));
            cases.push((self.replaced(word, "".as_ref()), String::new()));
            cases.push((self.replaced(word, &foreign(extension)), String::new()));
        }
        for word in self.outputs {
            for name in [format!("nowhere/{word}"), format!("box.off/{word}")] {
                cases.push((self.replaced(word, name.as_ref()), name));
            }
            cases.push((self.replaced(word, "".as_ref()), String::new()));
        }
        for (options, values) in [
            (self.amounts, &["-1", "NaN", "inf", "1e999", "much", ""][..]),
            (self.counts, &["-1", "1.5", "NaN", "99999999999999999999999", "many", ""]),
            (self.choices, &["nonsense", "", "0,NaN"]),
        ] {
            for option in options {
                for value in values {
                    let named = match *value {
                        // An error about a word that is not there can only name the option.
                        "" => (*option).to_owned(),
                        _ if self.choices.contains(option) => (*value).to_owned(),
                        _ => format!("'{value}' for '{option}"),
                    };
                    cases.push((self.with(&[option.as_ref(), value.as_ref()]), named));
                }
                cases.push((self.with(&[option.as_ref()]), (*option).to_owned()));
                cases.push((self.with(&[option.as_ref(), &foreign("x")]), String::new()));
            }
        }
        cases
    }
}

#[test]
fn every_command_refuses_every_kind_of_wrong_argument() {
    let mut shaped: Vec<&str> = SHAPES.iter().map(|shape| shape.command).collect();
    let mut all = commands();
    shaped.sort_unstable();
    all.sort_unstable();
    assert_eq!(shaped, all, "a shape a command");
    let folder = tempfile::tempdir().unwrap();
    fill(folder.path());
    let before = snapshot(folder.path());
    let cases: Vec<Case> = SHAPES.iter().flat_map(Shape::cases).collect();
    assert!(cases.len() >= 60);
    let mut wrong = Vec::new();
    for (call, named) in &cases {
        let ran = ran(command(folder.path(), call));
        let mut faults = faults(&ran, named);
        let after = snapshot(folder.path());
        if after != before {
            faults.push(format!("files changed: {:?}", changed(&before, &after)));
            fs::remove_dir_all(folder.path()).unwrap();
            fs::create_dir(folder.path()).unwrap();
            fill(folder.path());
        }
        if !faults.is_empty() {
            wrong.push(format!("{}: {}", ran.call, faults.join("; ")));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}
