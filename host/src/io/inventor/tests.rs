use std::path::Path;

use nalgebra::Point3;

use super::super::{Loaded, Unit, read_mesh_bytes};
use crate::surface::Mesh;

fn load(text: &str) -> Loaded<Mesh> {
    read_mesh_bytes(text.as_bytes(), Path::new("scene.dat"), Unit::Metre).unwrap()
}

fn inventor(nodes: &str) -> Mesh {
    let loaded = load(&format!("#Inventor V2.1 ascii\n{nodes}\n"));
    assert_eq!(loaded.warnings, Vec::<String>::new(), "{nodes}");
    loaded.value
}

fn vrml2(nodes: &str) -> Mesh {
    let loaded = load(&format!("#VRML V2.0 utf8\n{nodes}\n"));
    assert_eq!(loaded.warnings, Vec::<String>::new(), "{nodes}");
    loaded.value
}

/// Corners of the bounding box, for bodies whose place is the question.
fn bounds(mesh: &Mesh) -> [f64; 6] {
    let (low, high) = mesh.bounding_box();
    [low.x, low.y, low.z, high.x, high.y, high.z]
}

fn assert_bounds(mesh: &Mesh, expected: [f64; 6]) {
    let found = bounds(mesh);
    let is_near = found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(is_near, "{found:?} instead of {expected:?}");
}

/// Outward, closed and of this volume.
fn assert_body(mesh: &Mesh, volume: f64, tolerance: f64) {
    assert!(mesh.is_watertight());
    let found = mesh.signed_volume_m3();
    assert!((found / volume - 1.0).abs() < tolerance, "{found} instead of {volume}");
}

#[test]
fn primitives_have_their_closed_form_volumes_and_stand_along_y() {
    let pi = std::f64::consts::PI;
    assert_body(&inventor("Cube { width 0.1 height 0.2 depth 0.3 }"), 0.006, 1e-12);
    assert_body(&inventor("Sphere { radius 0.5 }"), pi / 6.0, 3e-3);
    let cylinder = inventor("Cylinder { radius 0.1 height 0.6 }");
    assert_body(&cylinder, pi * 0.006, 1e-3);
    assert_bounds(&cylinder, [-0.1, -0.3, -0.1, 0.1, 0.3, 0.1]);
    let cone = inventor("Cone { bottomRadius 0.1 height 0.6 }");
    assert_body(&cone, pi * 0.002, 1e-3);
    let apex = cone.vertices().iter().max_by(|a, b| a.y.total_cmp(&b.y)).unwrap();
    assert!((apex - Point3::new(0.0, 0.3, 0.0)).norm() < 1e-12);
    assert_bounds(&vrml2("Shape { geometry Box { size 0.1 0.2 0.4 } }"), [-0.05, -0.1, -0.2, 0.05, 0.1, 0.2]);
    assert_bounds(&inventor("Cube { }"), [-1.0, -1.0, -1.0, 1.0, 1.0, 1.0]);
}

#[test]
fn parts_of_cylinders_and_cones_can_be_left_out() {
    let area = |mesh: Mesh| mesh.area_m2() / std::f64::consts::PI;
    for (nodes, expected) in [
        ("Cylinder { radius 0.5 height 1 parts SIDES }", 1.0),
        ("Cylinder { radius 0.5 height 1 parts (SIDES | TOP) }", 1.25),
        ("Cylinder { radius 0.5 height 1 parts SIDES | TOP }", 1.25),
        ("Cylinder { radius 0.5 height 1 parts ALL }", 1.5),
        ("Cone { bottomRadius 0.5 height 1 parts BOTTOM }", 0.25),
    ] {
        assert!((area(inventor(nodes)) - expected).abs() < 2e-3, "{nodes}");
    }
    let open = vrml2("Shape { geometry Cylinder { radius 0.5 height 1 top FALSE bottom FALSE side TRUE } }");
    assert!((area(open) - 1.0).abs() < 2e-3);
}

#[test]
fn property_nodes_move_what_follows_within_their_separator() {
    let nodes = "Separator {
        Separator { Translation { translation 5 0 0 } Cube { width 0.2 height 0.2 depth 0.2 } }
        Group { Translation { translation 0 1 0 } }
        Cube { width 0.2 height 0.2 depth 0.2 }
        TransformSeparator { Translation { translation 0 0 9 } }
        Separator { Scale { scaleFactor 10 1 1 } Cube { width 0.2 height 0.2 depth 0.2 } }
    }";
    let text = format!("#Inventor V2.0 ascii\n{nodes}");
    let loaded = load(&text);
    assert_bounds(&loaded.value, [-1.0, -0.1, -0.1, 5.1, 1.1, 0.1]);
    assert_eq!(loaded.value.components(), 3);
    assert_eq!(loaded.warnings, ["is 6.1 m across: is it in millimetres? try --unit mm"]);
}

#[test]
fn rotations_are_right_handed_and_in_radians() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let bar = "Translation { translation 0.5 0 0 } Cube { width 0.2 height 0.02 depth 0.02 }";
    let along_y = [-0.01, 0.4, -0.01, 0.01, 0.6, 0.01];
    assert_bounds(&inventor(&format!("Rotation {{ rotation 0 0 2 {quarter} }} {bar}")), along_y);
    assert_bounds(&inventor(&format!("RotationXYZ {{ axis Z angle {quarter} }} {bar}")), along_y);
    assert_bounds(
        &inventor(&format!("Rotation {{ rotation 0 0 0 1 }} {bar}")),
        [0.4, -0.01, -0.01, 0.6, 0.01, 0.01],
    );
    let matrix = "MatrixTransform { matrix 0 1 0 0  -1 0 0 0  0 0 1 0  0 0 0.25 1 }";
    assert_bounds(&inventor(&format!("{matrix} {bar}")), [-0.01, 0.4, 0.24, 0.01, 0.6, 0.26]);
}

#[test]
fn transform_scales_about_its_axes_and_centre_then_rotates_then_translates() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let eighth = quarter / 2.0;
    // The corner (1, 0, 0) about the centre (1, 1, 0): scaled by 2 in y to (1, -1, 0), turned to (3, 1, 0), moved.
    let fields = format!("translation 0 0 1 rotation 0 0 1 {quarter} center 1 1 0");
    let triangle = "point [ 1 0 0, 1 1 0, 0 1 0 ]";
    let faces = "coordIndex [ 0, 1, 2, -1 ]";
    let expected = [Point3::new(3.0, 1.0, 1.0), Point3::new(1.0, 1.0, 1.0), Point3::new(1.0, 0.0, 1.0)];
    let near = |mesh: &Mesh, expected: &[Point3<f64>]| {
        mesh.vertices().iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-12)
    };
    let old = load(&format!(
        "#VRML V1.0 ascii\nTransform {{ {fields} scaleFactor 1 2 1 }} Coordinate3 {{ {triangle} }} IndexedFaceSet {{ {faces} }}"
    ));
    assert!(near(&old.value, &expected), "{:?}", old.value.vertices());
    let new = load(&format!(
        "#VRML V2.0 utf8\nTransform {{ {fields} scale 1 2 1 children Shape {{ geometry IndexedFaceSet {{ \
         coord Coordinate {{ {triangle} }} {faces} }} }} }}"
    ));
    assert_eq!(new.value, old.value);
    // Doubling along the diagonal takes (1, 1) to (2, 2) and leaves (1, -1).
    let diagonal = inventor(&format!(
        "Transform {{ scaleFactor 2 1 1 scaleOrientation 0 0 1 {eighth} }} Coordinate3 {{ point [ 1 1 0, 1 -1 0, 0 0 1 ] }} \
         IndexedFaceSet {{ coordIndex [ 0, 1, 2 ] }}"
    ).replace("1 1 0, 1 -1 0, 0 0 1", "0.1 0.1 0, 0.1 -0.1 0, 0 0 0.1"));
    let expected = [Point3::new(0.2, 0.2, 0.0), Point3::new(0.1, -0.1, 0.0), Point3::new(0.0, 0.0, 0.1)];
    assert!(near(&diagonal, &expected), "{:?}", diagonal.vertices());
}

const TETRAHEDRON: &str = "point [ 0 0 0, 0.1 0 0, 0 0.1 0, 0 0 0.1 ]";
const OUTWARD: &str = "coordIndex [ 0, 2, 1, -1, 0, 1, 3, -1, 0, 3, 2, -1, 1, 2, 3, -1 ]";
const INWARD: &str = "coordIndex [ 0, 1, 2, -1, 0, 3, 1, -1, 0, 2, 3, -1, 1, 3, 2 ]";

#[test]
fn orientation_follows_hints_and_survives_mirrors() {
    let volume = 1e-3 / 6.0;
    let shape = |hints: &str, indices: &str| {
        format!("{hints} Coordinate3 {{ {TETRAHEDRON} }} IndexedFaceSet {{ {indices} }}")
    };
    let clockwise = "ShapeHints { vertexOrdering CLOCKWISE shapeType SOLID }";
    let mirror = "Scale { scaleFactor 1 1 -1 }";
    for nodes in [
        shape("", OUTWARD),
        shape("ShapeHints { vertexOrdering COUNTERCLOCKWISE }", OUTWARD),
        shape(clockwise, INWARD),
        shape(mirror, OUTWARD),
        shape(&format!("{clockwise} {mirror}"), INWARD),
        shape(&format!("Separator {{ {clockwise} }}"), OUTWARD),
    ] {
        // A body that came out inside out would be turned, with a warning that `inventor` refuses.
        assert_body(&inventor(&nodes), volume, 1e-12);
    }
    let shape = |ccw: &str, indices: &str| {
        format!(
            "Shape {{ geometry IndexedFaceSet {{ {ccw} coord DEF C Coordinate {{ {TETRAHEDRON} }} {indices} }} }}"
        )
    };
    assert_body(&vrml2(&shape("", OUTWARD)), volume, 1e-12);
    assert_body(&vrml2(&shape("ccw FALSE", INWARD)), volume, 1e-12);
    let mirrored =
        format!("Transform {{ scale -1 1 1 children [ {} ] }}", shape("ccw TRUE solid TRUE", OUTWARD));
    assert_body(&vrml2(&mirrored), volume, 1e-12);
    for primitive in ["Cube { }", "Sphere { }", "Cylinder { }", "Cone { }"] {
        let nodes = format!("Scale {{ scaleFactor 0.1 -0.1 0.1 }} {primitive}");
        assert!(inventor(&nodes).signed_volume_m3() > 0.0, "{nodes}");
    }
}

#[test]
fn faces_and_strips_with_and_without_indices_agree() {
    let square = "0 0 0, 0.1 0 0, 0 0.1 0, 0.1 0.1 0";
    let (triangles, property) = (
        format!("Coordinate3 {{ point [ {square} ] }}"),
        format!("VertexProperty {{ vertex [ {square} ] }}"),
    );
    let expected = vec![[0, 1, 2], [2, 1, 3]];
    for nodes in [
        format!("{triangles} TriangleStripSet {{ numVertices 4 }}"),
        format!("{triangles} TriangleStripSet {{ numVertices [ -1 ] }}"),
        format!("{triangles} IndexedTriangleStripSet {{ coordIndex [ 0, 1, 2, 3, -1 ] }}"),
        format!("IndexedTriangleStripSet {{ vertexProperty {property} coordIndex [ 0 1 2 2 3 ] }}")
            .replace("2 2 3", "2 3"),
        format!("{property} IndexedFaceSet {{ coordIndex [ 0, 1, 2, -1, -1, 2, 1, 3 ] }}"),
    ] {
        assert_eq!(inventor(&nodes).faces(), expected, "{nodes}");
    }
    let loose = "0 0 0, 0.1 0 0, 0 0.1 0, 0 0.1 0, 0.1 0 0, 0.1 0.1 0";
    let faces = inventor(&format!("Coordinate3 {{ point [ {loose} ] }} FaceSet {{ numVertices [ 3, 3 ] }}"));
    assert_eq!(faces.open_edges(), 4);
    let polygon = inventor("Coordinate3 { point [ 0 0 0, 0.4 0 0, 0.4 0.4 0, 0.2 0.1 0 ] } FaceSet { }");
    assert!((polygon.area_m2() - 0.06).abs() < 1e-12);
    let offset = inventor(&format!(
        "Coordinate3 {{ point [ 9 9 9, {square} ] }} FaceSet {{ startIndex 1 numVertices 3 }}"
    ));
    assert_bounds(&offset, [0.0, 0.0, 0.0, 0.1, 0.1, 0.0]);
}

#[test]
fn use_repeats_a_node_in_its_new_place() {
    let nodes = "Separator {
        DEF Peg Separator { Cylinder { radius 0.01 height 0.1 } }
        Translation { translation 0.2 0 0 } USE Peg
        DEF Move Translation { translation 0.2 0 0 } USE Peg
        USE Move USE Peg
    }";
    let mesh = inventor(nodes);
    assert_eq!(mesh.components(), 4);
    assert_bounds(&mesh, [-0.01, -0.05, -0.01, 0.61, 0.05, 0.01]);
    let shared = vrml2(
        "DEF Half Group { children [ Shape { geometry DEF B Box { size 0.1 0.1 0.1 } } ] }
         Transform { translation 0.3 0 0 children [ USE Half, Shape { geometry USE B } ] }",
    );
    assert_eq!(shared.components(), 3);
}

#[test]
fn only_the_chosen_child_and_the_finest_level_are_seen() {
    let cube = |width: f64| format!("Cube {{ width {width} height 0.1 depth 0.1 }}");
    let width = |nodes: &str| {
        let mesh = inventor(nodes);
        bounds(&mesh)[3] * 2.0
    };
    let children = [cube(0.2), cube(0.4), cube(0.6)].join(" ");
    assert_eq!(width(&format!("Switch {{ whichChild 1 {children} }}")), 0.4);
    assert_eq!(width(&format!("Switch {{ whichChild -3 {children} }}")), 0.6);
    assert_eq!(width(&format!("Switch {{ {children} }} {}", cube(0.1))), 0.1);
    assert_eq!(width(&format!("Switch {{ whichChild 7 {children} }} {}", cube(0.1))), 0.1);
    assert_eq!(width(&format!("LOD {{ range [ 1, 2 ] {children} }}")), 0.2);
    let new = vrml2(
        "Switch { whichChoice 0 choice [ Shape { geometry Box { size 0.2 1 1 } } Shape { geometry Sphere { } } ] }
         LOD { level [ Shape { geometry Box { size 0.2 1 1 } } Shape { geometry Sphere { } } ] }",
    );
    assert_bounds(&new, [-0.1, -0.5, -0.5, 0.1, 0.5, 0.5]);
}

#[test]
fn units_node_scales_what_follows() {
    let mesh = inventor(
        "Units { units MILLIMETERS } Cube { width 100 height 50 depth 50 } Units { units METERS } Cube { width 0.2 height 0.05 depth 0.05 }",
    );
    assert_bounds(&mesh, [-0.1, -0.025, -0.025, 0.1, 0.025, 0.025]);
}

#[test]
fn what_carries_no_surface_is_passed_over_and_what_may_is_reported() {
    let quiet = inventor(
        "Separator { renderCaching ON Info { string \"a { brace\n and a \\\" quote # no comment\" }
           Material { diffuseColor [ 0.1 0.2 0.3, 1 1 1 ] transparency 0 } DEF Camera PerspectiveCamera { position 0 0 9 }
           Texture2 { image 1 1 3 0xFF00AA } Text2 { string [ \"a\", \"b\" ] } Cube { width 0.1 height 0.1 depth 0.1 } }",
    );
    assert_eq!(quiet.faces().len(), 12);
    let loud = load(
        "#VRML V2.0 utf8
         PROTO Ball [ field SFFloat r 1 ] { Shape { geometry Sphere { radius IS r } } }
         EXTERNPROTO Far [ eventIn SFBool on ] \"far.wrl#Far\"
         DEF Code Script { eventIn SFTime go field SFBool on TRUE url \"javascript: f() {}\" }
         Ball { r 2 } Inline { url \"other.wrl\" }
         Shape { appearance Appearance { material NULL } geometry Extrusion { spine [ 0 0 0, 0 1 0 ] } }
         Shape { geometry Box { size 0.1 0.1 0.1 } }
         ROUTE Code.out TO Code.in",
    );
    assert_eq!(loud.value.faces().len(), 12);
    assert_eq!(
        loud.warnings,
        [
            "1 x Ball (the first in line 5) is not understood and was left out",
            "1 x Extrusion (the first in line 6) is not understood and was left out",
            "1 x Inline (the first in line 5) is not understood and was left out",
            "2 x PROTO (the first in line 2) is not understood and was left out"
        ]
    );
}

#[test]
fn many_shapes_over_one_list_of_coordinates_make_only_the_vertices_they_use() {
    let strip = "IndexedFaceSet { coordIndex [ 0, 2, 1, -1, 0, 1, 3 ] } IndexedFaceSet { coordIndex [ 0, 3, 2, -1, 1, 2, 3 ] }";
    let mesh = inventor(&format!("Coordinate3 {{ {TETRAHEDRON} }} {strip}"));
    assert!(mesh.is_watertight());
    assert_eq!(mesh.vertices().len(), 4);
}

/// All transformation nodes at once, against the flattened scene that `ivfix -a -n -t -f` of SGI's Open Inventor 2.1.5
/// (Debian package inventor-clients) writes.
#[test]
fn composed_transformations_agree_with_open_inventor() {
    let mesh = inventor(
        "Separator {
          Transform { translation 0.1 0.2 0.3 rotation 0.3 0.5 0.7 1.1 scaleFactor 1.5 0.7 2
            scaleOrientation 1 0.2 0.1 0.6 center 0.05 -0.1 0.2 }
          Separator {
            MatrixTransform { matrix 0 1 0 0 -1 0 0 0 0 0 1 0 0.1 0.2 0.25 1 }
            Scale { scaleFactor 1 2 1 }
            Cube { width 0.1 height 0.2 depth 0.3 }
          }
          RotationXYZ { axis Y angle 0.4 }
          Units { units CENTIMETERS }
          Translation { translation 3 0 0 }
          Cube { width 5 height 10 depth 1 }
          Units { units METERS }
          Coordinate3 { point [ 0 0 0, 0.1 0 0, 0 0.1 0, 0.1 0.1 0, 0.05 0.03 0.2 ] }
          TriangleStripSet { numVertices [ 5 ] }
        }",
    );
    let expected = [
        [0.0462447, 0.0161039, 0.784525],
        [0.375851, 0.482047, 0.587986],
        [-0.0563881, 0.0860418, 0.796445],
        [0.273218, 0.551985, 0.599906],
        [-0.471031, 0.21206, 0.524913],
        [-0.141425, 0.678003, 0.328373],
        [-0.368399, 0.142122, 0.512992],
        [-0.0387924, 0.608065, 0.316453],
        [-0.312505, 0.237192, 0.360613],
        [-0.209873, 0.167254, 0.348692],
        [-0.301469, 0.299016, 0.320361],
        [-0.198836, 0.229078, 0.308441],
        [-0.317408, 0.298349, 0.313938],
        [-0.214775, 0.228411, 0.302018],
        [-0.328445, 0.236525, 0.354189],
        [-0.225812, 0.166587, 0.342269],
        [-0.26364, 0.232802, 0.331315],
        [-0.241567, 0.35645, 0.250812],
        [-0.366273, 0.30274, 0.343236],
        [-0.344199, 0.426388, 0.262733],
        [0.0353919, 0.32895, 0.423104],
    ];
    assert_eq!(mesh.vertices().len(), expected.len());
    for place in expected.map(Point3::from) {
        // Six digits are printed.
        assert!(mesh.vertices().iter().any(|vertex| (vertex - place).norm() < 2e-6), "{place}");
    }
}
