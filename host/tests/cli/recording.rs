//! Scans by images, and recordings of them.

use std::fs;

use crate::{number, prehend};

#[test]
fn a_recording_gives_the_cloud_of_the_scan_that_made_it() {
    let folder = tempfile::tempdir().unwrap();
    let run = |call: &str| prehend(folder.path(), call);
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();

    let direct =
        run("scan --virtual cube --sweeps paper --record rec -o direct.ply --json").ends_with(0).json();
    assert!(number(&direct, "/points") > 1000.0, "{direct}");
    assert_eq!(number(&direct, "/images/missing_images"), 0.0);
    let again = run("scan --recording rec -o again.ply --json").ends_with(0);
    assert_eq!(again.stderr, "");
    assert_eq!(number(&again.json(), "/points"), number(&direct, "/points"));
    assert_eq!(bytes("direct.ply"), bytes("again.ply"));
    run("scan --virtual cube --sweeps paper --images -o images.ply").ends_with(0);
    assert_eq!(bytes("direct.ply"), bytes("images.ply"));

    // Nothing is written over, and nothing is left of the attempt.
    let refused = run("scan --virtual cube --sweeps paper --record rec -o other.ply").ends_with(2);
    assert!(refused.stderr.contains("rec: is already there"), "{}", refused.stderr);
    assert!(!folder.path().join("other.ply").exists());

    fs::remove_file(folder.path().join("rec/frames/000010-left.png")).unwrap();
    let gap = run("scan --recording rec -o gap.ply").ends_with(0);
    assert!(gap.stderr.contains("warning: rec: 1 of "), "{}", gap.stderr);
    fs::write(folder.path().join("rec/frames/000011-left.png"), b"junk").unwrap();
    let damaged = run("scan --recording rec -o damaged.ply").ends_with(2);
    assert!(damaged.stderr.contains("000011-left.png: damaged"), "{}", damaged.stderr);
    assert_eq!(damaged.stderr.lines().count(), 1, "{}", damaged.stderr);
}

#[test]
fn calls_that_make_no_sense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (call, words) in [
        ("scan --virtual cube --recording rec -o a.ply", "--recording"),
        ("scan --recording rec --seed 2 -o a.ply", "--seed"),
        ("scan --recording none -o a.ply", "none/scan.toml: "),
        ("scan --virtual cube --record-stripes -o a.ply", "--record"),
        ("scan --virtual cube --calibration one.toml -o a.ply", "--calibration"),
        ("scan --virtual cube --calibration none.toml none.toml -o a.ply", "none.toml"),
        ("scan --virtual cube --images --clock-offset-ms 90 -o a.ply", "'90'"),
        ("scan --virtual cube --record nowhere/rec -o a.ply", "nowhere/rec: "),
        ("calibrate --camera middle -o a.toml", "'middle'"),
    ] {
        let ran = prehend(folder.path(), call).ends_with(2);
        assert!(ran.stderr.contains(words), "{call}: {}", ran.stderr);
        assert!(!ran.stderr.contains("panicked"), "{call}: {}", ran.stderr);
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}
