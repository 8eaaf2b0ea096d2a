use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::*;
use crate::object::BuiltIn;
use crate::plan::arm::Arm;
use crate::scan::capture::{Capture, MeasureSettings, Start};
use crate::scan::joints::carry;
use crate::scan::optics::Optics;
use crate::scan::render::Renderer;
use crate::scan::rig::Rig;
use crate::scan::virtual_capture::{CarriedSweep, CellSettings, virtual_capture};
use crate::scan::{Instrument, StripePose, Sweep, palm_from_scanner};
use crate::surface::Plane;

const FRAMES_OF_TEST: u32 = 6;

/// A few stripes over a cube, recorded.
fn record(folder: &Path, content: Content) -> (PathBuf, Capture) {
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let stripe = |i: u32| StripePose {
        time_s: 0.02 * f64::from(i),
        base_from_scanner: Isometry3::from_parts(
            Translation3::new(0.385 + 0.005 * f64::from(i), 0.0, 0.22),
            down,
        ),
    };
    let sweep = Sweep { name: "over".to_owned(), stripes: (0..FRAMES_OF_TEST).map(stripe).collect() };
    let arm = Arm::rx60();
    let joints = carry(&arm, &palm_from_scanner(), &sweep.stripes).unwrap();
    let object = BuiltIn::Cube.object(1.0).unwrap().mesh.transformed(&Isometry3::translation(0.4, 0.0, 0.0));
    let (instrument, optics) = (Instrument::default(), Optics::default());
    let rig = Rig::calibrated(&instrument, &optics, 1).unwrap();
    let renderer = Renderer::new(&object, Some(Plane::horizontal(0.0)), &instrument, &optics).unwrap();
    let target = folder.join("recording");
    let writer = RecordingWriter::create(&target, content, &arm).unwrap();
    let sink = |frame: u32, camera: Camera, image: &image::GrayImage| writer.image(frame, camera, image);
    let sweeps = [CarriedSweep { sweep, joints }];
    let capture = virtual_capture(
        &renderer,
        &arm,
        &rig,
        &sweeps,
        Start::default(),
        CellSettings { offset_s: 0.0, seed: 1 },
        &sink,
    )
    .unwrap();
    writer.finish(&capture).unwrap();
    (target, capture)
}

#[test]
fn what_was_recorded_is_read_to_the_last_bit() {
    for content in [Content::Frames, Content::Stripes] {
        let folder = tempfile::tempdir().unwrap();
        let (path, capture) = record(folder.path(), content);
        let read = read_recording(&path).unwrap();
        assert_eq!(read.warnings, [""; 0]);
        assert_eq!(read.capture, capture);
        let [a, b] = [&read.capture, &capture].map(|c| c.measure(&MeasureSettings::default()).unwrap());
        assert!(a.cloud.len() > 500 && a == b);
        // Nothing is left of the temporary name.
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

#[test]
fn a_recording_overwrites_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken");
    fs::create_dir(&taken).unwrap();
    let create = |target: &Path| RecordingWriter::create(target, Content::Frames, &Arm::rx60());
    let error = create(&taken).unwrap_err();
    assert!(error.to_string().ends_with("taken: is already there; a recording overwrites nothing"));
    let nowhere = folder.path().join("nowhere/recording");
    assert!(matches!(create(&nowhere), Err(RecordingError::System { .. })));
    // Given up half way, nothing stays.
    drop(create(&folder.path().join("half")).unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn missing_images_are_counted_and_the_rest_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = record(folder.path(), Content::Frames);
    for name in ["000002-right", "000004-left", "000004-right"] {
        fs::remove_file(path.join(format!("frames/{name}.png"))).unwrap();
    }
    let read = read_recording(&path).unwrap();
    let warning = "3 of 12 images are missing, the first is frames/000002-right.png";
    assert_eq!(read.warnings, [warning]);
    let measured = read.capture.measure(&MeasureSettings::default()).unwrap();
    assert_eq!(measured.report.missing_images, 3);
    assert!(measured.frame_of_point.contains(&2) && !measured.frame_of_point.contains(&4));
    fs::remove_dir_all(path.join("frames")).unwrap();
    let error = read_recording(&path).unwrap_err().to_string();
    assert!(error.ends_with("frames: no images"), "{error}");
}

/// The error that a changed file leads to, without the folder's name.
fn error_after(path: &Path, name: &str, change: impl Fn(String) -> String) -> String {
    let file = path.join(name);
    let good = fs::read(&file).unwrap();
    fs::write(&file, change(String::from_utf8(good.clone()).unwrap())).unwrap();
    let message = read_recording(path).unwrap_err().to_string();
    fs::write(&file, good).unwrap();
    assert!(!message.contains('\n'), "{message}");
    let message = message.strip_prefix(&format!("{}/", path.display()));
    message.unwrap_or_else(|| panic!("names no file")).to_owned()
}

/// A text in which a line, counted from 1, is another.
fn with_line(text: &str, line: usize, change: impl Fn(&str) -> String) -> String {
    let lines = text.lines().enumerate();
    lines.map(|(i, old)| if i + 1 == line { change(old) } else { old.to_owned() } + "\n").collect()
}

#[test]
fn bad_tables_are_one_line_that_names_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = record(folder.path(), Content::Stripes);
    let cell = |name: &str, line: usize, column: usize, value: &str| {
        error_after(&path, name, |text| {
            with_line(&text, line, |old| {
                let mut cells: Vec<&str> = old.split(',').collect();
                cells[column] = value;
                cells.join(",")
            })
        })
    };
    assert_eq!(cell("joints.csv", 5, 3, "NaN"), "joints.csv: line 5: q3 is \"NaN\"");
    assert_eq!(cell("joints.csv", 5, 0, "-1"), "joints.csv: line 5: out of order: -1 s comes after 0.02 s");
    assert_eq!(
        cell("joints.csv", 1, 0, "t"),
        "joints.csv: line 1: the header must be t_s,q1,q2,q3,q4,q5,q6, found \"t,q1,q2,q3,q4,q5,q6\""
    );
    assert_eq!(cell("joints.csv", 4, 6, "1,2"), "joints.csv: line 4: 8 columns instead of 7");
    assert_eq!(cell("frames.csv", 3, 2, "inf"), "frames.csv: line 3: t_s is \"inf\"");
    assert_eq!(cell("frames.csv", 3, 0, "0"), "frames.csv: line 3: out of order: frame 0 comes after 0");
    assert_eq!(
        cell("frames.csv", 4, 2, "0.01"),
        "frames.csv: line 4: out of order: 0.01 s comes after 0.1 s"
    );
    let uncovered = cell("frames.csv", 7, 2, "17");
    assert_eq!(uncovered, "frames.csv: line 7: frame 5 at 17 s is not covered by joints.csv (0 to 0.26 s)");
    assert_eq!(cell("stripes.csv", 9, 1, "middle"), "stripes.csv: line 9: camera is \"middle\"");
    assert_eq!(cell("stripes.csv", 9, 0, "77"), "stripes.csv: line 9: there is no frame 77 in frames.csv");
    assert!(
        cell("stripes.csv", 9, 2, "5000")
            .starts_with("stripes.csv: line 9: the stripe is outside the frame of 768 x")
    );
    assert_eq!(cell("stripes.csv", 9, 8, "2"), "stripes.csv: line 9: trusted is \"2\"");
    let headless = |name: &str| {
        error_after(&path, name, |text| {
            with_line(&text, 2, |_| String::new()).lines().next().unwrap().to_owned()
        })
    };
    assert_eq!(headless("frames.csv"), "frames.csv: no frames");
    assert_eq!(headless("joints.csv"), "joints.csv: no joints");
}

#[test]
fn bad_descriptions_are_one_line_that_names_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = record(folder.path(), Content::Stripes);
    let with = |from: &str, to: &str| {
        error_after(&path, "scan.toml", |text| {
            assert!(text.contains(from), "{text}");
            text.replacen(from, to, 1)
        })
    };
    assert_eq!(with("version = 1", "version = 9"), "scan.toml: version 9, this program reads 1");
    assert_eq!(with("\"m rad s px\"", "\"mm\""), "scan.toml: units is \"mm\", only \"m rad s px\" is known");
    assert!(with("version", "versoin").starts_with("scan.toml: line 1: "));
    assert!(
        with("content = \"stripes\"", "content = \"films\"")
            .starts_with("scan.toml: line 4: unknown variant")
    );
    assert_eq!(
        with("\"left.toml\"", "\"../left.toml\""),
        "scan.toml: \"../left.toml\" is not the name of a file in the folder"
    );
    assert!(with("position_m = [0.045", "position_m = [nan").contains("palm_from_scanner is no pose"));
    assert!(with("columns_px = 768", "columns_px = 0").starts_with("scan.toml: left: a frame of 0 x"));
    assert!(with("arm = \"rx60\"", "arm = \"rx61.toml\"").starts_with("rx61.toml: "));
    assert!(error_after(&path, "left.toml", |_| "x = ".to_owned()).starts_with("left.toml: "));
    fs::remove_file(path.join("scan.toml")).unwrap();
    assert!(read_recording(&path).unwrap_err().to_string().contains("scan.toml: "));
}

#[test]
fn bad_images_are_one_line_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let (path, _) = record(folder.path(), Content::Frames);
    let image = path.join("frames/000003-left.png");
    let good = fs::read(&image).unwrap();
    let fails = |content: &[u8]| {
        fs::write(&image, content).unwrap();
        let message = read_recording(&path).unwrap_err().to_string();
        assert!(!message.contains('\n'));
        message.split_once("000003-left.png: ").unwrap().1.to_owned()
    };
    assert!(fails(&good[..good.len() / 2]).starts_with("damaged: "));
    assert!(fails(b"no image").starts_with("damaged: "));
    assert!(fails(b"").starts_with("damaged: "));
    let other = folder.path().join("other.png");
    image::GrayImage::new(10, 20).save(&other).unwrap();
    assert!(fails(&fs::read(&other).unwrap()).starts_with("10 x 20 pixels, scan.toml says 768 x "));
    let rows = image::load_from_memory(&good).unwrap().height();
    image::RgbImage::new(768, rows).save(&other).unwrap();
    assert_eq!(fails(&fs::read(&other).unwrap()), "Rgb8 pixels, 8-bit grey is wanted");
}
