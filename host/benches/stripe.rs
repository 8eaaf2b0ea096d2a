//! Time to find the stripe in a whole image: it must keep up with a camera of 100 frames/s on one core.

use criterion::{Criterion, criterion_group, criterion_main};
use host::scan::stripe::{Across, StripeExtractor, SyntheticLine};
use image::{GrayImage, Luma};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const SIZE_PX: [u32; 2] = [768, 576];

/// A slanted stripe in every column.
fn frame(stripe: &SyntheticLine) -> GrayImage {
    let [width, height] = SIZE_PX;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let columns: Vec<Vec<u8>> = (0..width)
        .map(|u| {
            let center_px = 200.0 + 0.2 * f64::from(u);
            SyntheticLine { center_px, ..stripe.clone() }.render(height as usize, &mut rng)
        })
        .collect();
    GrayImage::from_fn(width, height, |u, v| Luma([columns[u as usize][v as usize]]))
}

fn stripe(criterion: &mut Criterion) {
    let extractor = StripeExtractor::default();
    let mut group = criterion.benchmark_group("stripe in 768 x 576");
    for (name, sigma_px, peak) in
        [("clean", 1.5, 200.0), ("weak", 1.5, 30.0), ("wide, saturated", 5.0, 765.0)]
    {
        let image = frame(&SyntheticLine { sigma_px, peak, ..Default::default() });
        let found = extractor.image(&image, Across::Columns).iter().filter(|o| o.center().is_some()).count();
        assert!(found > 700, "{name}: a stripe in {found} columns only");
        group.bench_function(name, |bench| bench.iter(|| extractor.image(&image, Across::Columns)));
    }
    group.finish();
}

criterion_group!(benches, stripe);
criterion_main!(benches);
