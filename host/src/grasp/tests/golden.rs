//! Values that two other algorithms agree on (the complete hull by Qhull, and an expanding polytope written apart from
//! this one), and closed forms.

use super::*;

/// A grasp and its epsilon with 4, 8, 16 and 64 edges, and the range that the exact cone's is known to be in.
struct Case {
    name: &'static str,
    contacts: Vec<Contact>,
    torque_scale_m: f64,
    edges: [f64; 4],
    exact: (f64, f64),
}

fn closed_form(value: f64) -> (f64, f64) {
    (value - 1e-6, value + 1e-6)
}

/// A contact on a cylinder of radius 30 mm around z.
fn on_cylinder(angle_rad: f64, z: f64) -> Contact {
    let outward = Vector3::new(angle_rad.cos(), angle_rad.sin(), 0.0);
    Contact::new(Point3::from(outward * 0.030 + Vector3::z() * z), -outward, 0.4).unwrap()
}

fn cases() -> Vec<Case> {
    let cube = [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y()]
        .map(|n| Contact::new(Point3::from(n * 0.025), -n, 0.4).unwrap());
    let axes = [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
    let cylinder = [(PI, 0.0), (0.0, -0.025), (0.0, 0.0), (0.0, 0.025)].map(|(a, z)| on_cylinder(a, z));
    vec![
        Case {
            name: "A tetrahedron, friction 0.2",
            contacts: tetrahedron(0.2),
            torque_scale_m: 1.0,
            edges: [0.123891100, 0.137258387, 0.140609083, 0.141362248],
            exact: closed_form(0.2 / 2.0_f64.sqrt()),
        },
        Case {
            name: "A tetrahedron, friction 0.4",
            contacts: tetrahedron(0.4),
            torque_scale_m: 1.0,
            edges: [0.250488927, 0.275945702, 0.281160144, 0.282734033],
            exact: closed_form(0.4 / 2.0_f64.sqrt()),
        },
        Case {
            name: "A tetrahedron, friction 0.8",
            contacts: tetrahedron(0.8),
            torque_scale_m: 1.0,
            edges: [0.505708650, 0.550056091, 0.561709922, 0.565444025],
            exact: closed_form(0.8 / 2.0_f64.sqrt()),
        },
        Case {
            name: "B equator, friction 0.4",
            contacts: equator(3, 0.4),
            torque_scale_m: 1.0,
            edges: [0.205985120, 0.222183560, 0.225472552, 0.226599382],
            exact: (0.22660, 0.22675),
        },
        Case {
            name: "B equator, friction 0.8",
            contacts: equator(3, 0.8),
            torque_scale_m: 1.0,
            edges: [0.403180550, 0.435496700, 0.458167981, 0.461562944],
            exact: (0.46156, 0.46192),
        },
        Case {
            name: "C cube",
            contacts: cube.to_vec(),
            torque_scale_m: 0.025 * 3.0_f64.sqrt(),
            edges: [0.133333333, 0.156715575, 0.161353256, 0.162802645],
            exact: closed_form(0.162861),
        },
        Case {
            name: "D six axes",
            contacts: on_sphere(&axes, 0.4),
            torque_scale_m: 1.0,
            edges: [0.230940108, 0.326598632, 0.326598632, 0.326598632],
            exact: closed_form(0.4 * (2.0_f64 / 3.0).sqrt()),
        },
        Case {
            name: "E cylinder, thumb against three",
            contacts: cylinder.to_vec(),
            torque_scale_m: 0.030_f64.hypot(0.050),
            edges: [0.081127585, 0.083855192, 0.084913509, 0.085393394],
            exact: closed_form(0.085436),
        },
    ]
}

#[test]
fn pyramids() {
    for case in cases() {
        for (m, golden) in [4, 8, 16, 64].into_iter().zip(case.edges) {
            let found = measure(&case.contacts, case.torque_scale_m, &edges(m));
            let Closure::Force(quality) = found else { panic!("{}, {m} edges: {found:?}", case.name) };
            assert!((quality.epsilon_low - golden).abs() < 1e-6, "{}, {m} edges: {quality:?}", case.name);
            assert!((quality.epsilon_high - golden).abs() < 1e-6, "{}, {m} edges: {quality:?}", case.name);
        }
    }
}

#[test]
fn exact_cones() {
    for case in cases() {
        let found = measure(&case.contacts, case.torque_scale_m, &with_cone(ConeModel::Exact));
        let Closure::Force(quality) = found else { panic!("{}: {found:?}", case.name) };
        let (low, high) = case.exact;
        assert!(low <= quality.epsilon_low && quality.epsilon_high <= high, "{}: {quality:?}", case.name);
        assert!(quality.epsilon_high - quality.epsilon_low < 1e-6, "{}: {quality:?}", case.name);
    }
}

#[test]
fn turned_outer_fingers_lose_closure() {
    let turn = 40.0_f64.to_radians();
    let contacts = [(PI, 0.0), (turn, -0.025), (0.0, 0.0), (-turn, 0.025)].map(|(a, z)| on_cylinder(a, z));
    let scale = 0.030_f64.hypot(0.050);
    let settings = [4, 8, 16, 64].map(edges);
    for settings in settings.into_iter().chain([with_cone(ConeModel::Exact)]) {
        let found = measure(&contacts, scale, &settings);
        let Closure::None(separation) = found else { panic!("{settings:?}: {found:?}") };
        assert!(separation.verify(&contacts, &reference(scale), &settings), "{settings:?}: {separation:?}");
    }
}
