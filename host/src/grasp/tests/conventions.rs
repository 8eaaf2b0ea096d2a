//! Conventions of other programs, against the golden values and closed forms that hold in each.

use super::*;

/// The tetrahedron of friction 0.4 with torques over 1 m: with 4 and with 8 edges, unit normal force.
const TETRAHEDRON: [f64; 2] = [0.250488927, 0.275945702];
/// The six axes, likewise with 8 edges.
const SIX_AXES: f64 = 0.326598632;

fn six_axes() -> Vec<Contact> {
    let axes = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    on_sphere(&axes, 0.4)
}

/// An object about the origin that all conventions are content with, and in all of which torques are over 1 m.
fn object() -> ObjectGeometry {
    ObjectGeometry {
        center_of_mass_in_object: Some(Point3::origin()),
        vertices_in_object: vec![Point3::new(0.0, -1.0, 0.0), Point3::new(0.3, 0.2, 0.1)],
        radius_m: None,
        bounding_box_in_object: Some([Point3::new(-0.5, -1.0, 0.0), Point3::new(0.2, 1.0, 1.5)]),
        surface: six_axes(),
    }
}

fn reproduce(name: NamedConvention, contacts: &[Contact], object: &ObjectGeometry) -> Reproduction {
    let mut workspace = Workspace::new();
    let yardstick = Yardstick::new(name, object, 1e-9, &mut workspace).unwrap();
    yardstick.measure(contacts, &mut workspace).unwrap()
}

fn refused(name: NamedConvention, contacts: &[Contact], object: &ObjectGeometry) -> String {
    let mut workspace = Workspace::new();
    let measured = Yardstick::new(name, object, 1e-9, &mut workspace)
        .and_then(|yardstick| yardstick.measure(contacts, &mut workspace));
    measured.unwrap_err().to_string()
}

#[test]
fn each_gives_the_number_that_its_definition_gives() {
    let edge = 0.4_f64.hypot(1.0);
    for (name, friction, expected) in [
        (NamedConvention::GraspIt, 0.4, TETRAHEDRON[1]),
        (NamedConvention::Frogger, 0.4, TETRAHEDRON[0] / edge),
        (NamedConvention::Simox, 0.4, TETRAHEDRON[1] / SIX_AXES),
        (NamedConvention::DexNet, 0.4, TETRAHEDRON[1]),
        (NamedConvention::DexGraspBench, 0.8, 2.0 - TETRAHEDRON[1]),
    ] {
        let found = reproduce(name, &tetrahedron(friction), &object());
        let Score::Between { low, high } = found.score else { panic!("{name}: {found:?}") };
        assert!(low <= high && (low - expected).abs() < 1e-8 && (high - expected).abs() < 1e-8, "{found:?}");
        assert_eq!(found.convention.name, Some(name));
        assert_eq!(found.convention.reference.torque_scale_m(), 1.0);
        assert!(found.convention.to_string().starts_with(&name.to_string()), "{}", found.convention);
    }
}

#[test]
fn each_takes_its_own_torque_scale() {
    let object = ObjectGeometry {
        center_of_mass_in_object: Some(Point3::new(0.0, 0.0, 1.0)),
        vertices_in_object: vec![Point3::new(0.0, 3.0, -3.0), Point3::new(2.0, -0.5, 4.0)],
        ..ObjectGeometry::default()
    };
    // The farther vertex is 5 m off; the box is 2 x 3.5 x 7 and ends at (2, 3, 3) from the centre.
    let contacts = [[2.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
        .map(|p| Contact::new(Point3::from(p), -Vector3::from(p), 0.5).unwrap());
    for (name, scale, center_z) in [
        (NamedConvention::GraspIt, 5.0, 1.0),
        (NamedConvention::Frogger, 1.0, 1.0),
        (NamedConvention::Simox, 3.5, 1.0),
        (NamedConvention::DexNet, 3.0, 1.0),
        (NamedConvention::DexGraspBench, 1.5, 0.0),
    ] {
        let reference = name.reference(&contacts, &object).unwrap();
        assert_eq!(reference.torque_scale_m(), scale, "{name}");
        assert_eq!(reference.center_of_mass_in_object().z, center_z, "{name}");
    }
    let only_radius = ObjectGeometry { vertices_in_object: Vec::new(), radius_m: Some(7.0), ..object };
    let reference = NamedConvention::GraspIt.reference(&contacts, &only_radius).unwrap();
    assert_eq!(reference.torque_scale_m(), 7.0);
}

#[test]
fn without_closure_each_says_what_it_says() {
    let open = &six_axes()[..2];
    for (name, expected) in [
        (NamedConvention::GraspIt, Score::WithoutClosure(-1.0)),
        (NamedConvention::Frogger, Score::NotReproduced),
        (NamedConvention::Simox, Score::NotReproduced),
        (NamedConvention::DexNet, Score::WithoutClosure(0.0)),
        (NamedConvention::DexGraspBench, Score::WithoutClosure(2.0)),
    ] {
        let found = reproduce(name, open, &object());
        assert_eq!(found.score, expected, "{name}");
        assert!(matches!(found.closure, Closure::None(_)));
    }
}

#[test]
fn what_is_missing_is_named() {
    let nothing = ObjectGeometry::default();
    let contacts = tetrahedron(0.4);
    for name in NamedConvention::ALL {
        if name != NamedConvention::DexGraspBench && name != NamedConvention::Simox {
            let error = refused(name, &contacts, &nothing);
            assert_eq!(error, format!("{name} needs center_of_mass"));
        }
    }
    let center = ObjectGeometry { center_of_mass_in_object: Some(Point3::origin()), ..nothing };
    assert!(refused(NamedConvention::GraspIt, &contacts, &center).contains("object.vertices"));
    assert!(refused(NamedConvention::DexNet, &contacts, &center).contains("object.bounding_box"));
    assert!(refused(NamedConvention::Simox, &contacts, &center).contains("object.surface"));
    let boxed = ObjectGeometry { surface: tetrahedron(0.4), ..center.clone() };
    assert!(refused(NamedConvention::Simox, &contacts, &boxed).contains("object.bounding_box"));
    let open = ObjectGeometry { surface: tetrahedron(0.4)[..2].to_vec(), ..object() };
    assert!(refused(NamedConvention::Simox, &contacts, &open).contains("no force closure"));

    let corners = [Point3::new(1.0, 1.0, 1.0), Point3::origin()];
    let swapped = ObjectGeometry { bounding_box_in_object: Some(corners), ..object() };
    assert!(refused(NamedConvention::DexNet, &contacts, &swapped).contains("object.bounding_box"));
    let nan = ObjectGeometry { vertices_in_object: vec![Point3::new(0.0, f64::NAN, 0.0)], ..object() };
    assert!(refused(NamedConvention::GraspIt, &contacts, &nan).contains("vertex"));
    let below = [Point3::new(-3.0, -3.0, -3.0), Point3::new(-1.0, -1.0, -1.0)];
    let below = ObjectGeometry { bounding_box_in_object: Some(below), ..object() };
    assert!(refused(NamedConvention::DexNet, &contacts, &below).contains("torque_scale_m -1"));
    let soft: Vec<_> = contacts.iter().map(|c| c.with_torsion(0.01).unwrap()).collect();
    assert!(refused(NamedConvention::GraspIt, &soft, &object()).starts_with("contact 0 has torsional"));
}

#[test]
fn an_object_of_many_samples_bounds_every_grasp_on_it() {
    // Spread over the sphere by the golden angle; the tetrahedron is four more.
    let mut surface: Vec<Contact> = tetrahedron(0.4);
    surface.extend((0..60).map(|k| {
        let (z, angle) = (1.0 - (2.0 * f64::from(k) + 1.0) / 60.0, 2.399_963 * f64::from(k));
        let (sin, cos) = angle.sin_cos();
        let around = (1.0 - z * z).sqrt();
        on_sphere(&[[around * cos, around * sin, z]], 0.4)[0]
    }));
    let object = ObjectGeometry { surface, ..object() };
    let mut workspace = Workspace::new();
    let yardstick = Yardstick::new(NamedConvention::Simox, &object, 0.1, &mut workspace).unwrap();
    let found = yardstick.measure(&tetrahedron(0.4), &mut workspace).unwrap();
    let Score::Between { low, high } = found.score else { panic!("{found:?}") };
    // More contacts, more wrenches; and the ball of wrenches is no larger than a unit edge makes it.
    assert!(0.0 < low && low <= high && low < 1.0, "{found:?}");
    assert!(found.object.unwrap().epsilon_low < 1.0, "{found:?}");
}
