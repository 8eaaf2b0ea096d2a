//! The paper's object: the lid of a teacup, a body of revolution.
//!
//! ```text
//!            ___
//!           (___)          knob D 18 x 16
//!         ___| |___
//!      .-'         '-.     dome, outer face a spherical cap, apex 22 mm above the lower edge of the rim
//!    .'  .--. _ .--.  '.
//!   |__.'|         |'.__|  rim D 90, its edge a vertical band as high as the wall
//!        |         |       locating flange D 76, 10 mm below the rim; the lid stands on it
//! ```

use std::f64::consts::TAU;

use nalgebra::Point3;

use super::solids::ProfilePoint;

const RIM_RADIUS_M: f64 = 0.045;
const DOME_RISE_M: f64 = 0.022;
/// Measured vertically: the inner face is the outer one moved down, so that the rim's edge is a band of this height.
const WALL_M: f64 = 0.0032;
const FLANGE_OUTER_RADIUS_M: f64 = 0.038;
const FLANGE_INNER_RADIUS_M: f64 = FLANGE_OUTER_RADIUS_M - WALL_M;
const RIM_HEIGHT_M: f64 = 0.010;
const APEX_M: f64 = RIM_HEIGHT_M + DOME_RISE_M;

const STEM_RADIUS_M: f64 = 0.006;
const STEM_TOP_M: f64 = APEX_M + 0.006;
const HEAD_RADIUS_M: f64 = 0.009;
/// Height of the head's widest circle; below it the head flares from the stem.
const HEAD_EQUATOR_M: f64 = APEX_M + 0.010;
const KNOB_TOP_M: f64 = APEX_M + 0.016;

/// Radius of the sphere through the rim's upper edge and the apex.
const SPHERE_M: f64 = {
    let rise = DOME_RISE_M - WALL_M;
    (RIM_RADIUS_M * RIM_RADIUS_M + rise * rise) / (2.0 * rise)
};

fn outer_face(radius_m: f64) -> ProfilePoint {
    let height = (SPHERE_M * SPHERE_M - radius_m * radius_m).max(0.0).sqrt();
    ProfilePoint::new(radius_m, APEX_M - SPHERE_M + height)
}

fn inner_face(radius_m: f64) -> ProfilePoint {
    let outer = outer_face(radius_m);
    ProfilePoint::new(radius_m, outer.z_m - WALL_M)
}

/// `steps + 1` evenly spaced values from `from` to `to`.
fn steps(from: f64, to: f64, steps: usize) -> impl Iterator<Item = f64> {
    (0..=steps).map(move |i| from + (to - from) * i as f64 / steps as f64)
}

/// The head's upper face, a quarter of an ellipse from the equator to the axis.
fn head(steps: usize) -> impl Iterator<Item = ProfilePoint> {
    (0..=steps).map(move |i| {
        let (sin, cos) = (0.25 * TAU * i as f64 / steps as f64).sin_cos();
        // Exactly zero at the last step: there the profile meets the axis.
        let radius = if i == steps { 0.0 } else { HEAD_RADIUS_M * cos };
        ProfilePoint::new(radius, HEAD_EQUATOR_M + (KNOB_TOP_M - HEAD_EQUATOR_M) * sin)
    })
}

/// The lid's section, counter-clockwise from the axis under the dome.
pub(super) fn profile() -> Vec<ProfilePoint> {
    let mut profile: Vec<_> = steps(0.0, FLANGE_INNER_RADIUS_M, 14).map(inner_face).collect();
    profile.push(ProfilePoint::new(FLANGE_INNER_RADIUS_M, 0.0));
    profile.push(ProfilePoint::new(FLANGE_OUTER_RADIUS_M, 0.0));
    profile.extend(steps(FLANGE_OUTER_RADIUS_M, RIM_RADIUS_M, 4).map(inner_face));
    profile.extend(steps(RIM_RADIUS_M, STEM_RADIUS_M, 18).map(outer_face));
    profile.push(ProfilePoint::new(STEM_RADIUS_M, STEM_TOP_M));
    profile.extend(head(8));
    profile
}

/// Convex parts that fill the lid, and of its hollow no more than lies between chords and arcs (9 % of its volume):
/// twenty sectors each of three dome bands and the flange, the middle of the dome, stem and head.
pub(super) fn convex_pieces() -> Vec<Vec<Point3<f64>>> {
    const SECTORS: usize = 20;
    let band = |from: f64, to: f64| -> Vec<ProfilePoint> {
        [from, to].map(inner_face).into_iter().chain(steps(to, from, 4).map(outer_face)).collect()
    };
    let flange_top = [FLANGE_OUTER_RADIUS_M, FLANGE_INNER_RADIUS_M].map(inner_face);
    let flange_foot = [FLANGE_INNER_RADIUS_M, FLANGE_OUTER_RADIUS_M].map(|r| ProfilePoint::new(r, 0.0));
    let rings = [
        band(0.012, 0.026),
        band(0.026, FLANGE_OUTER_RADIUS_M),
        band(FLANGE_OUTER_RADIUS_M, RIM_RADIUS_M),
        flange_foot.into_iter().chain(flange_top).collect(),
    ];
    let stem = [outer_face(STEM_RADIUS_M), ProfilePoint::new(STEM_RADIUS_M, STEM_TOP_M)];
    let hulls = [band(0.0, 0.012), stem.to_vec(), [stem[1]].into_iter().chain(head(6)).collect::<Vec<_>>()];
    // Two steps a sector keep the rim's polygon within 0.14 mm of the circle.
    let turn = |profile: &[ProfilePoint], from: usize, to: usize| -> Vec<Point3<f64>> {
        (from..=to)
            .flat_map(|i| profile.iter().map(move |p| p.turned(TAU * i as f64 / (2 * SECTORS) as f64)))
            .collect()
    };
    let sectors = rings.iter().flat_map(|ring| (0..SECTORS).map(|s| turn(ring, 2 * s, 2 * s + 2)));
    sectors.chain(hulls.iter().map(|hull| turn(hull, 0, 2 * SECTORS - 1))).collect()
}
