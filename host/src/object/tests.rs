use std::f64::consts::PI;

use nalgebra::Vector3;
use parry3d_f64::{query::PointQuery, shape::ConvexPolyhedron};

use super::*;

fn hulls(object: &Object) -> Vec<ConvexPolyhedron> {
    let hull = |piece: &Vec<Point3<f64>>| {
        let points: Vec<Vector> = piece.iter().map(|p| Vector::new(p.x, p.y, p.z)).collect();
        ConvexPolyhedron::from_convex_hull(&points).unwrap()
    };
    object.convex_pieces().iter().map(hull).collect()
}

fn inside(hulls: &[ConvexPolyhedron], point: [f64; 3]) -> bool {
    hulls.iter().any(|hull| hull.contains_local_point(Vector::from(point)))
}

#[test]
fn built_ins_are_solids_standing_on_the_table() {
    for built_in in BuiltIn::ALL {
        let object = built_in.object(1.0).unwrap();
        assert!(object.mesh.is_watertight(), "{built_in}");
        assert_eq!(object.mesh.components(), 1, "{built_in}");
        assert!(object.mesh.signed_volume_m3() > 0.0, "{built_in}");
        let (low, high) = object.mesh.bounding_box();
        assert!(
            low.z.abs() < 1e-12 && (low.x + high.x).abs() < 1e-12 && (low.y + high.y).abs() < 1e-12,
            "{built_in}"
        );
        let size = high - low;
        assert!(
            size.min() >= 0.010 && size.max() <= 0.140,
            "{built_in} is outside the paper's range: {size}"
        );
        assert_eq!(built_in.name().parse::<BuiltIn>().unwrap(), built_in);
    }
}

#[test]
fn scale_multiplies_lengths_and_mass() {
    let (one, two) = (BuiltIn::Disk.object(1.0).unwrap(), BuiltIn::Disk.object(2.0).unwrap());
    assert!((two.mesh.signed_volume_m3() / one.mesh.signed_volume_m3() - 8.0).abs() < 1e-9);
    assert!((two.mass_kg / one.mass_kg - 8.0).abs() < 1e-12);
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(BuiltIn::Cube.object(bad), Err(ObjectError::Scale(_))));
    }
    assert_eq!("cup".parse::<BuiltIn>(), Err(ObjectError::UnknownName("cup".to_owned())));
}

#[test]
fn the_lid_has_its_dimensions_and_a_plausible_porcelain_mass() {
    let lid = BuiltIn::TeacupCover.object(1.0).unwrap();
    let (low, high) = lid.mesh.bounding_box();
    assert!((high - low - Vector3::new(0.090, 0.090, 0.048)).norm() < 1e-9);
    // Shell of constant vertical thickness, flange up to the mean inner face, and a knob between a cylinder as thick
    // as its stem and one as thick as its head.
    let volume = lid.mesh.signed_volume_m3();
    let shell = PI * 0.045f64.powi(2) * 0.0032;
    let flange = PI * (0.038f64.powi(2) - 0.0348f64.powi(2)) * 0.0172;
    let (thin, thick) = (PI * 0.006f64.powi(2) * 0.016, PI * 0.009f64.powi(2) * 0.0165);
    assert!(volume > shell + flange + 0.9 * thin && volume < shell + flange + thick, "volume {volume}");
    assert!(
        (0.060..0.120).contains(&(volume * 2350.0)),
        "solid porcelain would weigh {} kg",
        volume * 2350.0
    );
}

#[test]
fn pieces_of_the_lid_keep_rim_and_hollow() {
    let lid = BuiltIn::TeacupCover.object(1.0).unwrap();
    let hulls = hulls(&lid);
    // Volume of the union, counted on a grid that shares no plane with the lid's faces.
    let step = 0.0017;
    let count = |n: usize| (0..n).map(move |i| (i as f64 + 0.37) * step);
    let mut quarter = 0_u32;
    for x in count(27) {
        for y in count(27) {
            quarter += count(29).filter(|&z| inside(&hulls, [x, y, z])).count() as u32;
        }
    }
    let excess = 4.0 * f64::from(quarter) * step.powi(3) / lid.mesh.signed_volume_m3() - 1.0;
    assert!((0.0..0.10).contains(&excess), "the pieces hold {excess} too much");
    for solid in [
        [0.0, 0.0, 0.031],
        [0.0, 0.0, 0.047],
        [0.0, 0.0365, 0.001],
        [0.0445, 0.0, 0.012],
        [-0.030, 0.0, 0.0228],
    ] {
        assert!(inside(&hulls, solid), "{solid:?} should be porcelain");
    }
    for hollow in [
        [0.0, 0.0, 0.010],
        [0.030, 0.0, 0.012],
        [0.042, 0.0, 0.004],
        [0.0, 0.042, 0.0125],
        [0.0085, 0.0, 0.038],
    ] {
        assert!(!inside(&hulls, hollow), "{hollow:?} should be air");
    }
}

#[test]
fn pieces_of_a_foreign_mesh_fill_it() {
    let cube = BuiltIn::Cube.object(1.0).unwrap();
    let foreign = Object::new("crate", cube.mesh.clone(), 0.1, 0.5);
    let hulls = hulls(&foreign);
    assert!(!hulls.is_empty());
    assert!(inside(&hulls, [0.0, 0.0, 0.025]) && !inside(&hulls, [0.0, 0.0, 0.055]));
}
