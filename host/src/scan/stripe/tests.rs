use super::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const LINES: u32 = 2000;

/// Root mean square error over many lines with the stripe at a random place; every line must give a stripe.
fn rms_px(stripe: &SyntheticLine) -> f64 {
    let extractor = StripeExtractor::default();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut sum = 0.0;
    for _ in 0..LINES {
        let shift = rng.random_range(-0.5..0.5);
        let center_px = 128.0 + shift;
        let albedo_step = stripe.albedo_step.map(|step| AlbedoStep { at_px: step.at_px + shift, ..step });
        let pixels = SyntheticLine { center_px, albedo_step, ..stripe.clone() }.render(256, &mut rng);
        let (LineOutcome::Stripe(center) | LineOutcome::Misshapen(center)) = extractor.line(&pixels) else {
            panic!("{:?} at {center_px}", extractor.line(&pixels));
        };
        sum += (center.position_px - center_px).powi(2);
    }
    let rms = (sum / f64::from(LINES)).sqrt();
    println!("{rms:.4} px for {stripe:?}");
    rms
}

fn stripe(sigma_px: f64, peak: f64) -> SyntheticLine {
    SyntheticLine { sigma_px, peak, ..Default::default() }
}

#[test]
fn a_clean_stripe() {
    for sigma in [0.8, 1.5, 3.0, 5.0] {
        assert!(rms_px(&stripe(sigma, 200.0)) <= 0.05, "sigma {sigma}");
    }
    // Without noise what is left is quantisation.
    let quiet = SyntheticLine { read_noise: 0.0, electrons_per_level: 0.0, ..stripe(1.5, 200.0) };
    assert!(rms_px(&quiet) <= 0.003);
}

#[test]
fn a_weak_stripe() {
    assert!(rms_px(&stripe(1.5, 30.0)) <= 0.15);
}

#[test]
fn a_saturated_stripe() {
    for sigma in [1.5, 3.0] {
        assert!(rms_px(&stripe(sigma, 3.0 * 255.0)) <= 0.06, "sigma {sigma}");
    }
}

#[test]
fn a_stripe_in_bright_ambient_light() {
    let bright = SyntheticLine { ambient: 120.0, ..stripe(3.0, 100.0) };
    assert!(rms_px(&bright) <= 0.10);
}

#[test]
fn an_albedo_step_biases_and_shows() {
    let step =
        SyntheticLine { albedo_step: Some(AlbedoStep { at_px: 128.0, ratio: 0.2 }), ..stripe(1.5, 200.0) };
    // Half a sigma and more, whatever one does with a single image.
    let rms = rms_px(&step);
    assert!((0.5..1.5).contains(&rms), "{rms}");
    // Wide enough, it shows.
    let wide = |albedo_step| SyntheticLine { center_px: 128.0, albedo_step, ..stripe(4.0, 200.0) };
    let mean_asymmetry = |line: &SyntheticLine| {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let asymmetry = |_| match StripeExtractor::default().line(&line.render(256, &mut rng)) {
            LineOutcome::Stripe(center) | LineOutcome::Misshapen(center) => center.asymmetry,
            other => panic!("{other:?}"),
        };
        (0..200).map(asymmetry).sum::<f64>() / 200.0
    };
    let plain = mean_asymmetry(&wide(None));
    let stepped = mean_asymmetry(&wide(Some(AlbedoStep { at_px: 128.0, ratio: 0.2 })));
    println!("asymmetry {plain:.3} plain, {stepped:.3} at the step");
    assert!(plain.abs() < 0.01);
    assert!(stepped > 0.15);
}

#[test]
fn width_peak_and_saturation_are_measured() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let quiet =
        SyntheticLine { center_px: 60.3, read_noise: 0.0, electrons_per_level: 0.0, ..stripe(3.0, 150.0) };
    let extractor = StripeExtractor::default();
    let center = *extractor.line(&quiet.render(128, &mut rng)).center().unwrap();
    // The mean of three pixels widens by a few per cent.
    assert!((center.width_px - 3.0 * 2.355).abs() < 0.4, "{center:?}");
    assert!((center.peak - 150.0).abs() < 8.0);
    assert!(center.asymmetry.abs() < 0.01);
    assert_eq!(center.saturated_px, 0);
    let bright = SyntheticLine { peak: 765.0, ..quiet };
    // 3 exp(-x^2 / 2 sigma^2) > 1 for |x| < 1.48 sigma.
    let saturated = extractor.line(&bright.render(128, &mut rng)).center().unwrap().saturated_px;
    assert!((8..=10).contains(&saturated), "{saturated}");
}

#[test]
fn lines_without_one_clear_stripe_say_so() {
    let extractor = StripeExtractor::default();
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for ambient in [0.0, 5.0, 120.0, 250.0] {
        let dark = SyntheticLine { ambient, ..stripe(1.5, 0.0) };
        for _ in 0..500 {
            assert_eq!(extractor.line(&dark.render(576, &mut rng)), LineOutcome::Dark, "ambient {ambient}");
        }
    }
    let at = |center_px: f64, peak: f64| SyntheticLine { center_px, peak, ..Default::default() };
    for center in [0.0, -1.0, 575.5] {
        assert_eq!(extractor.line(&at(center, 200.0).render(576, &mut rng)), LineOutcome::CutOff, "{center}");
    }
    // A reflection three quarters as bright, which the ratio of one half does not forgive.
    let mut two = at(100.0, 200.0).render(576, &mut rng);
    for (pixel, &other) in two.iter_mut().zip(&at(140.0, 150.0).render(576, &mut rng)) {
        *pixel = (*pixel).max(other);
    }
    let LineOutcome::Ambiguous([first, second]) = extractor.line(&two) else {
        panic!("{:?}", extractor.line(&two));
    };
    assert!((first.position_px - 100.0).abs() < 0.2 && (second.position_px - 140.0).abs() < 0.2);
    let wide = SyntheticLine { sigma_px: 15.0, ..at(200.0, 200.0) };
    assert!(matches!(extractor.line(&wide.render(576, &mut rng)), LineOutcome::Misshapen(_)));
}

#[test]
fn odd_lines_and_images_are_no_trouble() {
    let extractor = StripeExtractor::default();
    for length in 0..40 {
        for value in [0, 255] {
            assert_eq!(extractor.line(&vec![value; length]), LineOutcome::Dark);
        }
    }
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for length in 0..200 {
        // Whatever comes out: no panic, and centres within the line.
        let pixels: Vec<u8> = (0..length).map(|_| rng.random()).collect();
        if let LineOutcome::Stripe(center) | LineOutcome::Misshapen(center) = extractor.line(&pixels) {
            assert!((0.0..length as f64).contains(&center.position_px));
        }
    }
    assert_eq!(extractor.image(&GrayImage::new(0, 0), Across::Columns), []);
    assert_eq!(extractor.image(&GrayImage::new(3, 0), Across::Rows), []);
}

#[test]
fn an_image_is_its_lines_either_way() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let (width, height) = (150, 90);
    let lines: Vec<Vec<u8>> = (0..width)
        .map(|u| {
            SyntheticLine { center_px: 30.0 + 0.2 * f64::from(u), ..Default::default() }.render(90, &mut rng)
        })
        .collect();
    let standing = GrayImage::from_fn(width, height, |u, v| image::Luma([lines[u as usize][v as usize]]));
    let lying = GrayImage::from_fn(height, width, |u, v| image::Luma([lines[v as usize][u as usize]]));
    let extractor = StripeExtractor::default();
    let expected: Vec<LineOutcome> = lines.iter().map(|line| extractor.line(line)).collect();
    assert_eq!(extractor.image(&standing, Across::Columns), expected);
    assert_eq!(extractor.image(&lying, Across::Rows), expected);
    assert!(expected.iter().all(|outcome| outcome.center().is_some()));
}
