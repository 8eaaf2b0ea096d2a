//! Where the scanner sits on the palm: hand-eye calibration from end to end.

use std::fs;

use crate::{number, prehend};

#[test]
fn a_mount_is_calibrated_verified_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let run = |call: &str| prehend(folder.path(), call);
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();

    let made = run("calibrate-mount --virtual --sweeps 8 --record kept -o mount.toml --json").ends_with(0);
    let made = made.json();
    assert!(number(&made, "/off_truth/shift_m") < 1e-4, "{made}");
    assert!(number(&made, "/off_truth/turn_rad") < 0.03_f64.to_radians(), "{made}");
    // The scanner had been screwed on askew.
    assert!((number(&made, "/off_recorded/shift_m") - 0.005).abs() < 2e-4, "{made}");
    assert!(number(&made, "/verification/center_rms_m") < 5e-5, "{made}");
    assert!(number(&made, "/verification/radius_error_m").abs() < 5e-5, "{made}");
    assert!(number(&made, "/leave_one_out_rms_m") < 3e-5, "{made}");

    // What was recorded says the same to the last bit.
    let given = "--radius-mm 20 --verify kept/check --verify-radius-mm 12.7";
    let again = run(&format!("calibrate-mount kept/ball {given} -o again.toml")).ends_with(0);
    assert!(String::from_utf8_lossy(&again.stdout).contains("verified on another ball"));
    assert_eq!(read("mount.toml"), read("again.toml"));
    let printed = run(&format!("calibrate-mount kept/ball {given} -o -")).ends_with(0);
    assert_eq!(String::from_utf8(printed.stdout).unwrap(), read("mount.toml"));

    // Scans are put together right with it, and wrong without: the ball's top is where it is.
    let top = |call: &str| {
        run(call).ends_with(0);
        let cloud = read("cloud.xyz");
        let heights = cloud.lines().filter_map(|line| line.split_whitespace().nth(2)?.parse::<f64>().ok());
        heights.fold(0.0, f64::max)
    };
    assert!((top("scan --recording kept/ball --mount mount.toml -o cloud.xyz") - 0.050).abs() < 3e-4);
    assert!((top("scan --recording kept/ball -o cloud.xyz") - 0.050).abs() > 1e-3);

    for (call, words) in [
        ("calibrate-mount kept/ball --radius-mm 19 -o no.toml", "kept/ball: target 0: the radius is 20.0"),
        ("calibrate-mount kept/ball --radius-mm 0 -o no.toml", "'0'"),
        ("calibrate-mount kept/none -o no.toml", "kept/none/scan.toml: "),
        ("calibrate-mount kept/ball --virtual -o no.toml", "--virtual"),
        ("calibrate-mount kept/ball --seed 2 -o no.toml", "--seed"),
        ("calibrate-mount kept/ball --verify-radius-mm 12.7 -o no.toml", "--verify"),
        ("calibrate-mount kept/ball --verify none -o no.toml", "none/scan.toml: "),
        ("calibrate-mount -o no.toml", "required"),
        ("calibrate-mount --virtual --record kept -o no.toml", "kept/ball: is already there"),
        ("calibrate-mount --virtual --sweeps 4 -o no.toml", "seen in 4 sweep(s)"),
        ("scan --recording kept/ball --mount none.toml -o no.ply", "none.toml: "),
        ("scan --recording kept/ball --mount kept/ball/scan.toml -o no.ply", "kept/ball/scan.toml: line "),
        ("scan --virtual cube --mount mount.toml -o no.ply", "--mount"),
    ] {
        let refused = run(call).ends_with(2);
        assert!(refused.stderr.contains(words), "{call}: {}", refused.stderr);
        assert_eq!(refused.stderr.lines().count(), 1, "{call}: {}", refused.stderr);
    }
    assert!(!folder.path().join("no.toml").exists());

    // A scan of something else.
    run("scan --virtual cube --sweeps paper --record cube --record-stripes -o cube.ply").ends_with(0);
    let nothing = run("calibrate-mount cube -o no.toml").ends_with(2);
    assert!(nothing.stderr.starts_with("error: cube: "), "{}", nothing.stderr);
    // Joints that are no numbers.
    let joints = read("kept/ball/joints.csv").replacen("\n0.", "\nNaN", 1);
    fs::write(folder.path().join("kept/ball/joints.csv"), joints).unwrap();
    let nan = run("calibrate-mount kept/ball -o no.toml").ends_with(2);
    assert!(nan.stderr.contains("joints.csv: line "), "{}", nan.stderr);
}
