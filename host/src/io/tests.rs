//! Round trips, tolerance and properties; what must be refused is in `tests/io_bad_files.rs`.

use std::path::Path;

use nalgebra::{Point3, Unit as Normalized, Vector3};
use proptest::prelude::*;

use super::*;
use crate::surface::Provenance;

const MESH_FORMATS: [(MeshFormat, &str); 7] = [
    (MeshFormat::Ply, "ply"),
    (MeshFormat::PlyAscii, "ply"),
    (MeshFormat::Stl, "stl"),
    (MeshFormat::StlAscii, "stl"),
    (MeshFormat::Obj, "obj"),
    (MeshFormat::Off, "off"),
    (MeshFormat::Inventor, "iv"),
];

const CLOUD_FORMATS: [(CloudFormat, &str); 7] = [
    (CloudFormat::Ply, "ply"),
    (CloudFormat::PlyAscii, "ply"),
    (CloudFormat::Pcd, "pcd"),
    (CloudFormat::PcdAscii, "pcd"),
    (CloudFormat::PcdCompressed, "pcd"),
    (CloudFormat::Xyz, "xyz"),
    (CloudFormat::Csv, "csv"),
];

/// A closed surface without symmetry: a torus with a wavy tube.
fn torus(around: u32, across: u32) -> Mesh {
    let angle = |k: u32, n: u32| f64::from(k) / f64::from(n) * std::f64::consts::TAU;
    let vertices = (0..around * across)
        .map(|k| {
            let (u, v) = (angle(k / across, around), angle(k % across, across));
            let tube = 0.012 + 0.003 * (3.0 * u).sin();
            let reach = 0.05 + tube * v.cos();
            Point3::new(reach * u.cos() + 0.1, reach * u.sin(), tube * v.sin())
        })
        .collect();
    let at = |i: u32, j: u32| (i % around) * across + j % across;
    let faces = (0..around * across)
        .flat_map(|k| {
            let (i, j) = (k / across, k % across);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    Mesh::new(vertices, faces).unwrap()
}

fn cloud(points: usize, normals: bool, views: bool) -> PointCloud {
    let direction = |k: usize, turn: f64| {
        let (sin, cos) = (k as f64 * turn).sin_cos();
        Normalized::new_normalize(Vector3::new(sin, cos, 0.3 + sin * cos))
    };
    PointCloud {
        points: (0..points).map(|k| Point3::new(k as f64 * 1e-4, 0.1 / (k + 1) as f64, -0.02)).collect(),
        normals: normals.then(|| (0..points).map(|k| direction(k, 0.7)).collect()),
        views: views.then(|| (0..points).map(|k| direction(k, 1.3)).collect()),
        sweeps: views.then(|| (0..points).map(|k| (k % 7) as u16).collect()),
    }
}

fn mesh_bytes(format: MeshFormat, mesh: &Mesh) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_mesh_to(format, &mut bytes, mesh).unwrap();
    bytes
}

fn cloud_bytes(format: CloudFormat, cloud: &PointCloud) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_cloud_to(format, &mut bytes, cloud).unwrap();
    bytes
}

fn mesh_of(text: &str, name: &str) -> Loaded<Mesh> {
    read_mesh_bytes(text.as_bytes(), Path::new(name), Unit::Metre).unwrap()
}

fn cloud_of(text: &str, name: &str) -> Loaded<PointCloud> {
    read_cloud_bytes(text.as_bytes(), Path::new(name), Unit::Metre).unwrap()
}

fn assert_near(a: &[Point3<f64>], b: &[Point3<f64>], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).norm() <= tolerance, "{a} {b}");
    }
}

#[test]
fn meshes_come_back_from_every_format() {
    let mesh = torus(20, 9);
    for (format, extension) in MESH_FORMATS {
        let name = format!("torus.{extension}");
        let back = read_mesh_bytes(&mesh_bytes(format, &mesh), Path::new(&name), Unit::Metre).unwrap();
        assert_eq!(back.warnings, Vec::<String>::new(), "{format:?}");
        let back = back.value;
        assert!(back.is_watertight(), "{format:?}");
        let lost = (back.signed_volume_m3() / mesh.signed_volume_m3() - 1.0).abs();
        if matches!(format, MeshFormat::Stl | MeshFormat::StlAscii) {
            assert_eq!((back.vertices().len(), back.faces().len()), (180, 360));
            assert!(lost < 1e-6, "{format:?}: {lost}");
        } else {
            assert_eq!(back, mesh, "{format:?}");
        }
    }
}

#[test]
fn ply_keeps_where_faces_come_from() {
    let plain = torus(9, 5);
    let marks = (0..plain.faces().len()).map(|face| Provenance::ALL[face * 7 % 4]).collect();
    let mesh = plain.with_provenance(marks).unwrap();
    for format in [MeshFormat::Ply, MeshFormat::PlyAscii] {
        let back = read_mesh_bytes(&mesh_bytes(format, &mesh), Path::new("torus.ply"), Unit::Metre).unwrap();
        assert_eq!((back.value, back.warnings), (mesh.clone(), vec![]), "{format:?}");
    }
    let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nproperty uchar provenance\nend_header\n\
                0 0 0\n0.1 0 0\n0 0.1 0\n3 0 1 2 9\n";
    let odd = mesh_of(text, "odd.ply");
    assert_eq!((odd.value.provenance(), odd.warnings.len()), (None, 1));
}

#[test]
fn clouds_come_back_from_every_format_with_what_they_carry() {
    for (normals, views) in [(false, false), (true, false), (false, true), (true, true)] {
        let cloud = cloud(100, normals, views);
        for (format, extension) in CLOUD_FORMATS {
            let name = format!("cloud.{extension}");
            let back = read_cloud_bytes(&cloud_bytes(format, &cloud), Path::new(&name), Unit::Metre).unwrap();
            assert_eq!(back.warnings, Vec::<String>::new(), "{format:?}");
            let back = back.value;
            assert_near(&back.points, &cloud.points, 1e-8);
            assert_eq!((back.normals.is_some(), back.views.is_some()), (normals, views), "{format:?}");
            assert_eq!(back.sweeps, cloud.sweeps, "{format:?}");
            for (back, sent) in [(&back.normals, &cloud.normals), (&back.views, &cloud.views)] {
                for (back, sent) in back.iter().flatten().zip(sent.iter().flatten()) {
                    assert!((back.into_inner() - sent.into_inner()).norm() < 1e-6);
                }
            }
        }
    }
}

#[test]
fn a_single_incompressible_point_survives_compressed_pcd() {
    let one = cloud(1, false, false);
    let back = read_cloud_bytes(&cloud_bytes(CloudFormat::PcdCompressed, &one), Path::new("p"), Unit::Metre);
    assert_near(&back.unwrap().value.points, &one.points, 1e-8);
}

#[test]
fn millimetres_are_a_thousandth_and_a_wrong_unit_is_asked_about() {
    let mesh = torus(12, 6).scaled(1000.0);
    let bytes = mesh_bytes(MeshFormat::Ply, &mesh);
    let name = Path::new("part.ply");
    let right = read_mesh_bytes(&bytes, name, Unit::Millimetre).unwrap();
    assert_eq!(right.warnings, Vec::<String>::new());
    assert_near(right.value.vertices(), torus(12, 6).vertices(), 1e-15);
    let wrong = read_mesh_bytes(&bytes, name, Unit::Metre).unwrap();
    assert_eq!(wrong.warnings, ["is 124.0 m across: is it in millimetres? try --unit mm"]);
    let tiny = mesh_bytes(MeshFormat::Ply, &torus(12, 6).scaled(1.0));
    let tiny = read_mesh_bytes(&tiny, name, Unit::Millimetre).unwrap();
    assert_eq!(tiny.warnings, ["is 0.124 mm across: is it in metres? try --unit m"]);
    assert_eq!("mm".parse(), Ok(Unit::Millimetre));
    assert_eq!("inch".parse::<Unit>().unwrap_err().to_string(), "'inch' is none of m, mm");
}

#[test]
fn big_endian_ply_with_extra_properties_and_signed_indices_is_read() {
    let mut bytes = b"ply\r\nformat binary_big_endian 1.0\r\nobj_info by hand\r\nelement camera 1\r\n\
        property list uchar short shape\r\nelement vertex 4\r\nproperty uchar red\r\nproperty float x\r\n\
        property float y\r\nproperty double z\r\nproperty list uint8 uint8 tags\r\nelement face 4\r\n\
        property uchar flag\r\nproperty list uint8 int32 vertex_index\r\nend_header\r\n"
        .to_vec();
    bytes.extend([2, 0, 7, 0, 8]);
    for [x, y, z] in [[0.0f32, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]] {
        bytes.push(255);
        bytes.extend([x.to_be_bytes(), y.to_be_bytes()].concat());
        bytes.extend(f64::from(z).to_be_bytes());
        bytes.extend([1, 9]);
    }
    for face in [[0i32, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] {
        bytes.extend([1, 3]);
        face.iter().for_each(|index| bytes.extend(index.to_be_bytes()));
    }
    let mesh = read_mesh_bytes(&bytes, Path::new("x"), Unit::Metre).unwrap().value;
    assert!(mesh.is_watertight());
    assert!((mesh.signed_volume_m3() - 1e-3 / 6.0).abs() < 1e-9);
}

#[test]
fn ply_strips_turn_every_other_triangle() {
    let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n\
        0 0 0\n0.1 0 0\n0 0.1 0\n0.1 0.1 0\n0 0.2 0\n8 0 1 2 3 -1 2 3 4\n";
    let mesh = mesh_of(text, "strip.ply").value;
    assert_eq!(mesh.faces(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
}

#[test]
fn a_ply_file_without_faces_is_a_cloud() {
    let text = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
        element face 0\nproperty list uchar int vertex_indices\nend_header\n0 0 0\nnan 0 0\n1 1 1\n";
    let geometry = read_geometry_bytes(text.as_bytes(), Path::new("x.ply"), Unit::Metre).unwrap();
    assert!(matches!(geometry.value, Geometry::Cloud(cloud) if cloud.len() == 1));
    assert_eq!(geometry.warnings[0], "1 of 2 points that are not finite numbers were dropped");
}

#[test]
fn obj_as_found_in_the_wild_is_read() {
    let text = "# made by hand, caf\u{e9}\r\nmtllib a.mtl\r\no thing\r\nv 0 0 0 0.5 0.5 0.5\r\nv\t0.1 0 0\r\n\
        v 0.1 0.1 0\r\nv 0 0.1 0 \r\nv 0.05 0.05 0.1\r\nvt 0 0\r\nvn 0 0 1\r\ng side\r\ns off\r\n\
        f 4/1/1 3/1/1 2/1/1 1/1/1\r\nf -5 -4 -1\r\nf 2//1 3//1 5//1 # last but one\r\nf 3/1 4/1 \\\r\n 5/1\r\n\
        usemtl b\r\nf 4 1 5\r\nwibble 3";
    let loaded = mesh_of(text, "UPPER.OBJ");
    assert!(loaded.value.is_watertight());
    assert!((loaded.value.signed_volume_m3() - 0.1f64.powi(3) / 3.0).abs() < 1e-15);
    assert_eq!(loaded.warnings, ["1 statements were not understood, the first in line 20"]);
    let mut latin1 = text.as_bytes().to_vec();
    latin1[17] = 0xe9;
    assert!(read_mesh_bytes(&latin1, Path::new("a.obj"), Unit::Metre).is_ok());
}

#[test]
fn off_variants_are_read() {
    let square = "4 2 0\n0 0 0 9 9\n0.1 0 0 9 9\n0.1 0.1 0 9 9\n0 0.1 0 9 9\n3 0 1 2 255 0 0\n3 0 2 3";
    for mark in ["OFF\n", "OFF ", "OFF", "NOFF\n", "COFF # colours\n# and a comment\n\n", "STCNOFF\r\n"] {
        let mesh = mesh_of(&format!("{mark}{square}"), "a.off").value;
        assert_eq!(mesh.faces(), [[0, 1, 2], [0, 2, 3]], "{mark}");
    }
    let polygon = "OFF\n4 1 4\n0 0 0\n0.1 0 0\n0.1 0.1 0\n0 0.1 0\n4 0 1 2 3\n";
    assert!((mesh_of(polygon, "a.txt").value.area_m2() - 0.01).abs() < 1e-15);
}

#[test]
fn a_binary_stl_that_begins_with_solid_is_read_by_its_length() {
    let mut bytes = mesh_bytes(MeshFormat::Stl, &torus(8, 5));
    bytes[..9].copy_from_slice(b"solid abc");
    assert!(read_mesh_bytes(&bytes, Path::new("a.stl"), Unit::Metre).unwrap().value.is_watertight());
    bytes.extend([1, 2, 3]);
    bytes[10] = 0;
    let loaded = read_mesh_bytes(&bytes, Path::new("a.stl"), Unit::Metre).unwrap();
    assert_eq!(loaded.warnings, ["3 bytes behind the last triangle were ignored"]);
}

#[test]
fn ascii_stl_may_shout_and_hold_several_solids() {
    let facet = |z: f64| {
        format!(
            "FACET NORMAL 0 0 NaN\n OUTER LOOP\n VERTEX 0 0 {z}\n VERTEX 0.1 0 {z}\n\tVERTEX 0 1e-1 {z}\n ENDLOOP\nENDFACET\n"
        )
    };
    let text =
        format!("SOLID a\n{}ENDSOLID a\nsolid b\n{}endsolid", facet(0.0), facet(0.1)).replace('\n', "\r\n");
    assert_eq!(mesh_of(&text, "x.stl").value.faces().len(), 2);
}

#[test]
fn split_vertices_are_joined_only_where_that_closes_edges() {
    let mesh = torus(9, 5);
    let loose: Vec<Point3<f64>> = (0..mesh.faces().len()).flat_map(|f| mesh.corners(f)).collect();
    let faces = (0..mesh.faces().len() as u32).map(|f| [3 * f, 3 * f + 1, 3 * f + 2]).collect();
    let soup = Mesh::new(loose, faces).unwrap();
    let back =
        read_mesh_bytes(&mesh_bytes(MeshFormat::Ply, &soup), Path::new("a.ply"), Unit::Metre).unwrap().value;
    assert_eq!((back.vertices().len(), back.open_edges()), (45, 0));

    // Two closed bodies that touch at an edge stay two: joining them would open four-faced edges.
    let tetrahedron = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let touching = "v 0 0 0\nv -0.1 0 0\nv 0 -0.1 0\nv 0 0 0.1\nf 5 7 6\nf 5 6 8\nf 5 8 7\nf 6 7 8\n";
    let pair = mesh_of(&format!("{tetrahedron}{touching}"), "a.obj").value;
    assert_eq!((pair.vertices().len(), pair.components(), pair.open_edges()), (8, 2, 0));
}

#[test]
fn a_fold_of_no_thickness_is_taken_out() {
    // A tetrahedron whose face 2 3 4 carries a flap: corner 5 lies on corner 4, and two faces lie on each other.
    let text = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nv 0 0 0.1\nv 0.1 0.1 0.1\n\
        f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 6\nf 6 3 5\nf 3 6 4\nf 2 6 4\nf 3 4 6\nf 6 4 5\n";
    let loaded = mesh_of(text, "a.obj");
    assert!(loaded.value.is_watertight(), "{:?}", loaded.value);
    assert_eq!(loaded.value.faces().len(), 6);
}

#[test]
fn an_inside_out_body_is_turned_and_said_so() {
    let text =
        "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nv 9 9 9\nf 1 2 3\nf 1 4 2\nf 1 3 4\nf 2 4 3\nf 1 1 2\n";
    let loaded = mesh_of(text, "a.obj");
    assert!(loaded.value.signed_volume_m3() > 0.0);
    assert_eq!(
        loaded.warnings,
        [
            "1 vertices that belong to no face were dropped",
            "1 faces without area were dropped",
            "the closed surface was inside out: its faces were turned"
        ]
    );
}

#[test]
fn text_clouds_take_their_columns_as_they_come() {
    let expected = [Point3::new(0.1, 0.2, 0.3), Point3::new(-1.0, 0.0, 2e-3)];
    for text in [
        "0.1 0.2 0.3\n-1 0 2e-3",
        "# a scan\n\n0.1\t0.2\t0.3\t255 0 0\r\n-1 0 2e-3 1 2 3\r\n",
        "0.1,0.2,0.3,\n-1,0,2e-3,\n",
        "0.1;0.2;0.3\n-1;0;2e-3\n",
        "\u{feff}x,y,z\n0.1, 0.2, 0.3\n-1, 0, 2e-3\n",
        "id;Z [m];Y [m];X [m];t\na;0.3;0.2;0.1;5\nb;2e-3;0;-1;6\n",
        "//X,Y,Z,R\n0.1,0.2,0.3,7\n-1,0,2e-3,7\n",
    ] {
        let cloud = cloud_of(text, "scan.csv").value;
        assert_eq!(cloud.points, expected, "{text}");
        assert_eq!((cloud.normals, cloud.views), (None, None), "{text}");
    }
    let named = cloud_of("x y z nx ny nz\n1 2 3 0 0 5\n1 2 4 0 -1 0\n", "a.xyz").value;
    assert_eq!(named.normals.unwrap()[0].into_inner(), Vector3::z());
    let zero = cloud_of("x y z nx ny nz\n1 2 3 0 0 5\n1 2 4 0 0 0\n", "a.xyz");
    assert_eq!(zero.value.normals, None);
    assert_eq!(zero.warnings, ["normals ignored: 1 of 2 have no direction"]);
}

fn pcd(fields: &str, viewpoint: &str, body: &str) -> String {
    format!("# .PCD v0.7\nVERSION 0.7\n{fields}\nWIDTH 3\nHEIGHT 1\n{viewpoint}POINTS 3\nDATA ascii\n{body}")
}

#[test]
fn pcd_fields_may_stand_in_any_order() {
    let fields = "FIELDS label normal_z z normal_x _ y normal_y x\nSIZE 1 4 8 4 1 4 4 4\nTYPE U F F F U F F I\n\
        COUNT 1 1 1 1 2 1 1 1";
    let cloud =
        cloud_of(&pcd(fields, "", "7 1 3.5 0 0 0 2 0 1\n7 0 nan 0 0 0 2 1 1\n7 0 3 0 0 0 2 1 4"), "a.pcd");
    assert_eq!(cloud.value.points, [Point3::new(1.0, 2.0, 3.5), Point3::new(4.0, 2.0, 3.0)]);
    assert_eq!(cloud.value.normals.unwrap()[1].into_inner(), Vector3::y());
    assert_eq!(cloud.value.views, None);
    assert_eq!(cloud.warnings, ["1 of 3 points that are not finite numbers were dropped"]);
}

#[test]
fn a_pcd_viewpoint_gives_lines_of_sight_and_its_absence_none() {
    let fields = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F";
    let body = "0 0 1\n0 0 5\n3 0 1\n";
    let cloud = cloud_of(&pcd(fields, "VIEWPOINT 0 0 5 1 0 0 0\n", body), "a.pcd");
    let views = cloud.value.views.unwrap();
    assert_eq!(views[0].into_inner(), Vector3::z());
    assert!((views[1].into_inner() - Vector3::new(-0.6, 0.0, 0.8)).norm() < 1e-15);
    assert_eq!(cloud.warnings, ["1 of 3 points at the viewpoint itself were dropped"]);
    assert_eq!(cloud_of(&pcd(fields, "", body), "a.pcd").value.views, None);
}

#[test]
fn files_appear_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("torus.PLY");
    let mesh = torus(8, 5);
    write_mesh(&path, &mesh).unwrap();
    assert_eq!(read_mesh(&path, Unit::Metre).unwrap().value, mesh);
    let failed = write_atomically(&path, |writer| {
        writer.write_all(b"half a fi")?;
        Err(io::Error::other("disk full"))
    });
    assert!(failed.unwrap_err().to_string().ends_with("torus.PLY: disk full"));
    assert_eq!(read_mesh(&path, Unit::Metre).unwrap().value, mesh);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let unknown = write_mesh(&folder.path().join("a.docx"), &mesh).unwrap_err().to_string();
    assert!(
        unknown.ends_with("unknown extension: meshes are written as .ply .stl .obj .off .iv"),
        "{unknown}"
    );
    let astray = write_mesh(&folder.path().join("none/a.ply"), &mesh).unwrap_err().to_string();
    assert!(astray.contains("a.ply: there is no directory ") && astray.ends_with("none"), "{astray}");
    assert!(write_cloud(folder.path(), &cloud(1, false, false)).is_err());
    assert!(matches!(write_atomically(folder.path(), |_| Ok(())), Err(IoError::Directory { .. })));
    #[cfg(unix)]
    {
        write_atomically(Path::new("/dev/null"), |writer| writer.write_all(b"x")).unwrap();
        assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
        let link = folder.path().join("link.ply");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_mesh(&link, &torus(9, 5)).unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(read_mesh(&path, Unit::Metre).unwrap().value.vertices().len(), 45);
    }
}

#[test]
fn what_single_precision_cannot_hold_is_not_written() {
    let huge = torus(8, 5).scaled(1e40);
    assert!(write_mesh_to(MeshFormat::Stl, &mut Vec::new(), &huge).is_err());
    let back = read_mesh_bytes(&mesh_bytes(MeshFormat::Ply, &huge), Path::new("a"), Unit::Metre).unwrap();
    assert!(back.value.is_watertight());
}

/// Every reader is tried on the same bytes: the extension decides where the content does not.
fn read_all_ways(bytes: &[u8]) {
    for extension in ["ply", "stl", "obj", "off", "iv", "wrl", "pcd", "xyz", "csv", "none"] {
        let name = format!("fuzz.{extension}");
        if let Ok(Loaded { value: Geometry::Mesh(mesh), .. }) =
            read_geometry_bytes(bytes, Path::new(&name), Unit::Metre)
        {
            assert!(mesh.vertices().iter().all(|v| v.iter().all(|c| c.is_finite())));
        }
    }
}

fn specimens() -> Vec<Vec<u8>> {
    let (mesh, cloud) = (torus(4, 3), cloud(6, true, true));
    let inventor = "#Inventor V2.1 ascii\nDEF A Separator { Transform { rotation 0 0 1 1 scaleFactor 1 2 3 } \
        Cube { } USE B Coordinate3 { point [ 0 0 0, 1 0 0, 0 1 0 ] } IndexedFaceSet { coordIndex [ 0, 1, 2, -1 ] } \
        Switch { whichChild 0 Cone { parts (SIDES | BOTTOM) } } }";
    let vrml = "#VRML V2.0 utf8\nDEF T Transform { scale 1 1 -1 children [ Shape { geometry Sphere { radius 2 } }, \
        Shape { geometry IndexedFaceSet { ccw FALSE coord Coordinate { point [ 0 0 0 1 0 0 0 1 0 ] } coordIndex [ 0 1 2 ] } } ] }";
    MESH_FORMATS
        .iter()
        .map(|(format, _)| mesh_bytes(*format, &mesh))
        .chain(CLOUD_FORMATS.iter().map(|(format, _)| cloud_bytes(*format, &cloud)))
        .chain([inventor.as_bytes().to_vec(), vrml.as_bytes().to_vec()])
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        read_all_ways(&bytes);
        for mark in ["ply\nformat binary_little_endian 1.0\n", "#Inventor V2.1 ascii\n", "#VRML V2.0 utf8\n", "solid ", "OFF\n", "VERSION 0.7\n"] {
            read_all_ways(&[mark.as_bytes(), &bytes].concat());
        }
    }

    #[test]
    fn damaged_files_never_panic(
        which in any::<proptest::sample::Index>(),
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<proptest::sample::Index>(),
        is_cut in any::<bool>(),
    ) {
        let specimens = specimens();
        let mut bytes = specimens[which.index(specimens.len())].clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if is_cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        read_all_ways(&bytes);
    }

    #[test]
    fn words_of_the_formats_in_any_order_never_panic(
        words in proptest::collection::vec(proptest::sample::select(vec![
            "Separator", "{", "}", "[", "]", "DEF", "USE", "a", "Transform", "children", "IndexedFaceSet", "coordIndex",
            "0", "1", "-1", "2.5", "1e400", "Coordinate3", "point", "Cube", "width", "Switch", "whichChild", "(", ")",
            "|", "PROTO", "ROUTE", "\"", "#", "\n", "FaceSet", "numVertices", "TriangleStripSet", "element", "vertex",
            "property", "list", "uchar", "int", "float", "x", "y", "z", "face", "vertex_indices", "end_header", "f", "v",
            "facet", "endsolid", "FIELDS", "SIZE", "TYPE", "COUNT", "POINTS", "DATA", "ascii", "binary", "F", "4", "3",
        ]), 0..60),
    ) {
        let text = words.join(" ");
        for mark in ["#Inventor V2.1 ascii\n", "#VRML V2.0 utf8\n", "ply\nformat ascii 1.0\n", "VERSION 0.7\n", "solid\n", "OFF\n", ""] {
            read_all_ways(format!("{mark}{text}").as_bytes());
        }
    }
}
