use super::*;

const MICROMETRE: f64 = 1e-6;

struct Figures {
    calibrated: Calibrated,
    /// Of each candidate against the truth, inside the field and up to 10 mm outside.
    truth: Vec<(ModelKind, Errors, Errors)>,
}

impl Figures {
    fn of(camera: &BenchCamera, noise_px: f64, seed: u64) -> Self {
        let bench = Bench { noise_px, ..Bench::default() };
        let settings = CalibrateSettings { seed, ..Default::default() };
        let calibrated = calibrate(&bench.measure(camera, seed), &settings).unwrap();
        let points = bench.verification(camera, 0.010);
        let errors = |model: &Model, inside: bool| {
            Errors::at(model, points.iter().filter(|point| point.inside == inside)).unwrap()
        };
        let truth = calibrated
            .candidates
            .iter()
            .map(|c| (c.model.kind(), errors(&c.model, true), errors(&c.model, false)))
            .collect();
        Self { calibrated, truth }
    }

    fn chosen(&self) -> ModelKind {
        self.calibrated.calibration.model().kind()
    }

    fn inside_um(&self, kind: ModelKind) -> f64 {
        self.truth.iter().find(|(k, ..)| *k == kind).unwrap().1.rms_m / MICROMETRE
    }
}

#[test]
fn where_the_optics_fit_the_physical_model_is_chosen() {
    for seed in 1..=3 {
        let figures = Figures::of(&BenchCamera::default(), 0.1, seed);
        assert_eq!(figures.chosen(), ModelKind::Physical);
        assert!(figures.inside_um(ModelKind::Physical) <= 3.5);
        assert!(figures.inside_um(ModelKind::Network) <= 6.5);
        let [physical, hybrid, network] = figures.calibrated.candidates.as_slice() else {
            panic!("a candidate is missing");
        };
        assert!((physical.fit.noise_px.unwrap() - 0.1).abs() < 0.005);
        assert!(physical.fit.converged && network.fit.converged);
        assert_eq!(network.fit.parameters, 92);
        // What is left over is noise, and the network on it knows.
        assert!(hybrid.fit.effective_parameters < PHYSICAL_PARAMETERS as f64 + 5.0);
        assert_eq!(figures.calibrated.held_out_pairs, 200);
    }
}

#[test]
fn where_they_do_not_the_hybrid_is_chosen() {
    for seed in 1..=3 {
        let figures = Figures::of(&BenchCamera::rippled(), 0.1, seed);
        assert_eq!(figures.chosen(), ModelKind::Hybrid);
        assert!(figures.inside_um(ModelKind::Hybrid) <= 10.0);
        assert!(figures.inside_um(ModelKind::Physical) > 20.0);
    }
}

#[test]
fn without_noise_the_physical_model_is_exact() {
    let bench = Bench { noise_px: 0.0, ..Bench::default() };
    let camera = BenchCamera::default();
    let settings = CalibrateSettings { starts: 1, max_iterations: 20, ..Default::default() };
    let calibrated = calibrate(&bench.measure(&camera, 1), &settings).unwrap();
    assert_eq!(calibrated.calibration.model().kind(), ModelKind::Physical);
    let all = bench.verification(&camera, 0.010);
    assert!(Errors::at(calibrated.calibration.model(), &all).unwrap().max_m < 1e-9);
}

#[test]
fn pixels_outside_the_markers_are_refused() {
    let (camera, bench) = (BenchCamera::default(), Bench::default());
    let settings = CalibrateSettings { starts: 1, max_iterations: 20, ..Default::default() };
    let pairs = bench.measure(&camera, 5);
    let calibration = calibrate(&pairs, &settings).unwrap().calibration;
    for pair in &pairs {
        assert!(matches!(calibration.evaluate(pair.pixel), Evaluation::Point(_)));
    }
    let half = bench.field_m().map(|length| 0.5 * length);
    let mut refused = 0;
    for point in bench.verification(&camera, 0.010) {
        let beyond =
            (point.target_m[0].abs() - half[0]).max((point.target_m[1] - camera.stand_off_m).abs() - half[1]);
        match calibration.evaluate(point.pixel) {
            Evaluation::Point(measured) => {
                // Noise moves the hull by some tenths of a pixel.
                assert!(beyond < 2e-4, "{beyond} outside");
                let error = (measured[0] - point.target_m[0]).hypot(measured[1] - point.target_m[1]);
                assert!(error < 5e-5);
            }
            Evaluation::OutsideHull { distance_px } => {
                assert!(beyond > -2e-4 && distance_px > 0.0);
                refused += 1;
            }
            Evaluation::Singular => panic!("no answer at {:?}", point.pixel),
        }
    }
    assert!(refused > 500);
    assert_eq!(calibration.evaluate([f64::NAN, 1.0]), Evaluation::OutsideHull { distance_px: f64::INFINITY });
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let pairs = Bench::default().measure(&BenchCamera::rippled(), 2);
    let settings = CalibrateSettings { max_iterations: 60, ..Default::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| calibrate(&pairs, &settings).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_stored_calibration_measures_the_same() {
    let pairs = Bench::default().measure(&BenchCamera::rippled(), 2);
    let calibration = calibrate(&pairs, &CalibrateSettings::default()).unwrap().calibration;
    let text = calibration.to_toml().unwrap();
    assert_eq!(Calibration::from_toml(&text).unwrap(), calibration);
    let fails = |text: &str| Calibration::from_toml(text).unwrap_err().to_string();
    assert_eq!(
        fails(&text.replace("version = 1", "version = 2")),
        "calibration version 2, this program reads 1"
    );
    let start = text.find("weights = [").unwrap() + "weights = [".len();
    let end = start + text[start..].find(',').unwrap() + 1;
    let short = [&text[..start], &text[end..]].concat();
    let message = fails(&short);
    assert!(message.contains("91 weights instead of 92"), "{message}");
    assert!(!fails("version = \n").contains('\n'));
    let corners = calibration.hull().corners_px();
    let hull = |corners: &[[f64; 2]]| {
        let (before, after) = text.split_once("corners_px = ").unwrap();
        let (_, after) = after.split_once("]]").unwrap();
        let corners = format!("{corners:?}").replace("NaN", "nan");
        Calibration::from_toml(&format!("{before}corners_px = {corners}{after}"))
    };
    assert_eq!(hull(corners).unwrap(), calibration);
    let refused = |corners: &[[f64; 2]]| hull(corners).unwrap_err().to_string();
    for few in 0..3 {
        let message = refused(&corners[..few]);
        assert!(message.contains(&format!("the hull has {few} corners, 3 are the least")), "{message}");
    }
    for wild in [f64::NAN, f64::INFINITY] {
        let message = refused(&[corners[0], [1.5, wild], corners[1], corners[2]]);
        assert!(message.contains(&format!("the hull has the corner (1.5, {wild})")), "{message}");
    }
    let backwards: Vec<[f64; 2]> = corners.iter().rev().copied().collect();
    assert!(refused(&backwards).contains("do not go counter-clockwise"));
    assert!(refused(&[corners[0]; 4]).contains("do not go counter-clockwise"));
}

#[test]
fn markers_that_determine_nothing_are_named() {
    let settings = CalibrateSettings::default();
    let pairs = Bench::default().measure(&BenchCamera::default(), 1);
    let fails = |pairs: &[MarkerPair]| calibrate(pairs, &settings).unwrap_err().to_string();
    assert_eq!(fails(&pairs[..20]), "20 marker pairs: at least 28 are needed");
    assert_eq!(fails(&pairs[..60]), "3 rows of markers: at least 5 are needed");
    let with = |change: &dyn Fn(&mut MarkerPair)| {
        let mut changed = pairs.clone();
        changed.iter_mut().for_each(change);
        fails(&changed)
    };
    assert_eq!(with(&|pair| pair.target_m[1] = 0.2), "the markers' targets lie on one line");
    assert_eq!(with(&|pair| pair.pixel[0] = 7.0), "the markers' pixels lie on one line");
    let mut infinite = pairs.clone();
    infinite[17].pixel[1] = f64::INFINITY;
    assert_eq!(fails(&infinite), "marker pair 17 has a coordinate that is not finite");
    // Pixels in another order than the targets.
    let mut mixed = pairs.clone();
    for (pair, other) in mixed.iter_mut().zip(pairs.iter().cycle().skip(413)) {
        pair.pixel = other.pixel;
    }
    let short = CalibrateSettings { starts: 1, max_iterations: 10, ..settings.clone() };
    let error = calibrate(&mixed, &short).unwrap_err();
    assert!(matches!(error, CalibrateError::Unexplained { rms_m } if rms_m > 0.002), "{error}");
    let no_start = CalibrateSettings { starts: 0, ..settings.clone() };
    assert_eq!(calibrate(&pairs, &no_start), Err(CalibrateError::NoStart));
}

#[test]
fn the_instruments_own_cameras_calibrate_too() {
    use crate::scan::instrument::{Camera, Instrument};
    // Seen at 17 degrees, a pixel is 0.6 mm of depth: twice the bench camera's, and so is the error.
    let camera = BenchCamera::of(&Instrument::default(), Camera::Left);
    let figures = Figures::of(&camera, 0.1, 1);
    assert_eq!(figures.chosen(), ModelKind::Physical);
    assert!(figures.inside_um(ModelKind::Physical) < 7.0);
    let [u, v] = camera.project([0.0, 0.2]);
    assert!((u - 383.5).abs() < 1e-9 && (v - 287.5).abs() < 1e-9);
}
