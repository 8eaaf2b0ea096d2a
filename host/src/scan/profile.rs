//! One profile of the surface from the stripes that two cameras saw at the same moment.
//!
//! Where both see the stripe they must agree, and their mean counts. A spot that lies half beyond an edge moves to one
//! side of the laser plane, which one camera takes for nearer and the other for farther by as much: the mean is right.
//! Where one loses the stripe, the other's counts alone, if its shape is trusted.

use std::ops::AddAssign;

use super::instrument::Camera;
use super::rig::Rig;
use super::stripe::{LineOutcome, StripeCenter};

/// The stripe in one column of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StripePixel {
    /// Column, pixels from the first.
    pub column: u32,
    /// Where the stripe crosses it, pixels from the frame's first row, and its shape.
    pub center: StripeCenter,
    /// Single and well shaped. What is not needs the other camera's confirmation.
    pub trusted: bool,
}

/// The stripes of a frame, column by column.
#[must_use]
pub fn stripe_pixels(outcomes: &[LineOutcome]) -> Vec<StripePixel> {
    let mut pixels = Vec::with_capacity(outcomes.len());
    for (column, outcome) in (0..).zip(outcomes) {
        let mut push = |center: &StripeCenter, trusted: bool| {
            pixels.push(StripePixel { column, center: *center, trusted });
        };
        match outcome {
            LineOutcome::Stripe(center) => push(center, true),
            LineOutcome::Misshapen(center) => push(center, false),
            LineOutcome::Ambiguous(centers) => centers.iter().for_each(|center| push(center, false)),
            LineOutcome::CutOff | LineOutcome::Dark => {}
        }
    }
    pixels
}

/// How two cameras are joined.
#[derive(Debug, Clone, PartialEq)]
pub struct ProfileSettings {
    /// Largest difference in depth at which both cameras are taken to see the same place. A spot half beyond an edge
    /// differs by twice its error.
    pub agreement_m: f64,
    /// Longest gap along the stripe over which a camera's depth is interpolated.
    pub gap_m: f64,
    /// Distance between the profile's points along the stripe, over which the measured ones are averaged.
    pub pitch_m: f64,
    /// Spread of depth up to which they are: beyond it there is an edge, and the middle one counts.
    pub spread_m: f64,
}

impl Default for ProfileSettings {
    fn default() -> Self {
        Self { agreement_m: 0.0008, gap_m: 0.0006, pitch_m: 0.001, spread_m: 0.0005 }
    }
}

/// A point of a profile, scanner frame, x = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePoint {
    /// Along the stripe.
    pub y_m: f64,
    /// Away from the laser.
    pub z_m: f64,
}

/// What became of the stripes' pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct ProfileCounts {
    /// Places that both cameras saw alike.
    pub agreed: usize,
    /// Places that only one camera saw.
    pub by_one: usize,
    /// Places that the cameras saw differently: dropped.
    pub disagreed: usize,
    /// Pixels of doubtful shape that nothing confirmed: dropped.
    pub doubtful: usize,
    /// Pixels where the camera is not calibrated: dropped.
    pub outside: usize,
}

impl AddAssign for ProfileCounts {
    fn add_assign(&mut self, other: Self) {
        self.agreed += other.agreed;
        self.by_one += other.by_one;
        self.disagreed += other.disagreed;
        self.doubtful += other.doubtful;
        self.outside += other.outside;
    }
}

#[derive(Clone, Copy)]
struct Sample {
    y: f64,
    z: f64,
    trusted: bool,
}

/// Joins what the cameras saw of one stripe; a camera without frame sees nothing.
#[must_use]
pub fn profile(
    rig: &Rig,
    stripes: [Option<&[StripePixel]>; 2],
    settings: &ProfileSettings,
) -> (Vec<ProfilePoint>, ProfileCounts) {
    let mut counts = ProfileCounts::default();
    let [left, right] = Camera::ALL.map(|camera| samples(rig, camera, stripes[camera as usize], &mut counts));
    let mut points = Vec::with_capacity(left.len().max(right.len()));
    // Of the right camera's samples, those that the left one has met.
    let mut met = vec![false; right.len()];
    for sample in &left {
        match meet(sample, &right, &mut met, settings) {
            Meeting::Agreed(z) => {
                counts.agreed += 1;
                points.push(ProfilePoint { y_m: sample.y, z_m: z });
            }
            Meeting::Disagreed => counts.disagreed += 1,
            Meeting::Alone => alone(sample, &mut points, &mut counts),
        }
    }
    for (sample, _) in right.iter().zip(met).filter(|(_, met)| !met) {
        alone(sample, &mut points, &mut counts);
    }
    points.sort_by(|a, b| a.y_m.total_cmp(&b.y_m));
    (thinned(&points, settings), counts)
}

fn alone(sample: &Sample, points: &mut Vec<ProfilePoint>, counts: &mut ProfileCounts) {
    if sample.trusted {
        counts.by_one += 1;
        points.push(ProfilePoint { y_m: sample.y, z_m: sample.z });
    } else {
        counts.doubtful += 1;
    }
}

/// A camera's points of the laser plane in the order of y.
fn samples(
    rig: &Rig,
    camera: Camera,
    stripes: Option<&[StripePixel]>,
    counts: &mut ProfileCounts,
) -> Vec<Sample> {
    let stripes = stripes.unwrap_or_default();
    let mut samples = Vec::with_capacity(stripes.len());
    for pixel in stripes {
        let place = [f64::from(pixel.column), pixel.center.position_px];
        match rig.cameras[camera as usize].measure(place) {
            Some([y, z]) => samples.push(Sample { y, z, trusted: pixel.trusted }),
            None => counts.outside += 1,
        }
    }
    samples.sort_by(|a, b| a.y.total_cmp(&b.y));
    samples
}

enum Meeting {
    /// The mean depth.
    Agreed(f64),
    Disagreed,
    Alone,
}

/// What the other camera says at a sample's place.
fn meet(sample: &Sample, others: &[Sample], met: &mut [bool], settings: &ProfileSettings) -> Meeting {
    let after = others.partition_point(|other| other.y < sample.y);
    let near = |i: usize| (others[i].y - sample.y).abs() <= settings.gap_m;
    let before = after.checked_sub(1).filter(|&i| near(i));
    let after = Some(after).filter(|&i| i < others.len() && near(i));
    let (z, ends) = match (before, after) {
        (Some(a), Some(b)) if (others[b].z - others[a].z).abs() <= settings.agreement_m => {
            let share = (sample.y - others[a].y) / (others[b].y - others[a].y).max(f64::MIN_POSITIVE);
            (others[a].z + share * (others[b].z - others[a].z), [Some(a), Some(b)])
        }
        // Across a jump, or at an end, the nearer in depth: it is the same surface.
        (Some(a), Some(b)) => {
            let off = |i: usize| (others[i].z - sample.z).abs();
            let nearest = if off(a) <= off(b) { a } else { b };
            (others[nearest].z, [Some(nearest), None])
        }
        (Some(i), None) | (None, Some(i)) => (others[i].z, [Some(i), None]),
        (None, None) => return Meeting::Alone,
    };
    if (z - sample.z).abs() <= settings.agreement_m {
        ends.into_iter().flatten().for_each(|i| met[i] = true);
        return Meeting::Agreed(0.5 * (z + sample.z));
    }
    let other_trusted = ends.into_iter().flatten().any(|i| others[i].trusted);
    match (sample.trusted, other_trusted) {
        // A doubtful sight does not contradict a sound one.
        (true, false) => Meeting::Alone,
        (false, _) => Meeting::Disagreed,
        (true, true) => {
            ends.into_iter().flatten().for_each(|i| met[i] = true);
            Meeting::Disagreed
        }
    }
}

/// One point for each length of the pitch.
fn thinned(points: &[ProfilePoint], settings: &ProfileSettings) -> Vec<ProfilePoint> {
    let cell = |point: &ProfilePoint| (point.y_m / settings.pitch_m).floor();
    points.chunk_by(|a, b| cell(a) == cell(b)).filter_map(|group| one(group, settings)).collect()
}

fn one(group: &[ProfilePoint], settings: &ProfileSettings) -> Option<ProfilePoint> {
    let mut sorted = group.to_vec();
    sorted.sort_by(|a, b| a.z_m.total_cmp(&b.z_m));
    let (low, high) = (sorted.first()?, sorted.last()?);
    if high.z_m - low.z_m > settings.spread_m {
        return sorted.get(sorted.len() / 2).copied();
    }
    let share = 1.0 / group.len() as f64;
    Some(ProfilePoint {
        y_m: group.iter().map(|point| point.y_m).sum::<f64>() * share,
        z_m: group.iter().map(|point| point.z_m).sum::<f64>() * share,
    })
}
