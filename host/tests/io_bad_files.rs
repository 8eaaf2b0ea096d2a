//! Files that must be refused: each with the words that its message must hold, in little time and memory.
//!
//! One test in a process of its own, because it counts the memory that the process takes.

use std::alloc::{GlobalAlloc, Layout, System};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use host::io::{MAX_FILE_BYTES, Unit, read_cloud, read_geometry_bytes, read_mesh, read_mesh_bytes};

struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// An allocator is an unsafe trait by nature; this one only counts and leaves the work to the system's.
#[allow(unsafe_code)]
// SAFETY: every call goes to `System` with the arguments that came in.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = IN_USE.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(now, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the pointer came from `System` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Far above what the small files below may need, far below what their headers promise.
const MOST_BYTES: usize = 4 << 20;
/// References that multiply may fill their budget before they are refused.
const MOST_BYTES_EXPANDING: usize = 400 << 20;
const MOST_TIME: Duration = Duration::from_secs(10);

/// Name, content, words that the message must hold.
type BadFile = (&'static str, Vec<u8>, &'static str);

fn text(name: &'static str, content: &str, words: &'static str) -> BadFile {
    (name, content.as_bytes().to_vec(), words)
}

const XYZ: &str = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1";
const POINTS3: &str = "0 0 0\n1 0 0\n0 1 0\n";
const VERTEX: &str = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const FACES: &str = "element face 1\nproperty list uint int vertex_indices";

fn files_of_no_format() -> Vec<BadFile> {
    vec![
        ("empty.ply", Vec::new(), "empty.ply: the file is empty"),
        ("noise", (0..999u32).map(|k| (k * k % 251) as u8).collect(), "neither content nor extension"),
        ("zeros.bin", vec![0; 500], "neither content nor extension"),
        text("letter.doc", "Dear reader,\nthis is no mesh.\n", "neither content nor extension"),
    ]
}

fn ply(format: &str, elements: &str) -> String {
    format!("ply\nformat {format} 1.0\n{elements}\nend_header\n")
}

fn ply_mesh(vertices: u64, body: &str) -> String {
    let elements = format!("{VERTEX}{FACES}").replace("vertex 3", &format!("vertex {vertices}"));
    ply("ascii", &elements) + body
}

fn binary_ply(elements: &str, body: &[&[u8]]) -> Vec<u8> {
    [ply("binary_little_endian", elements).as_bytes(), &body.concat()].concat()
}

fn ply_files() -> Vec<BadFile> {
    let three = |face: &str| ply_mesh(3, &format!("{POINTS3}{face}\n"));
    let point = |second: &str| ply_mesh(3, &format!("0 0 0\n{second}\n0 1 0\n3 0 1 2\n"));
    let header = |elements: &str| ply("ascii", elements);
    let xyz = "property float x\nproperty float y\nproperty float z";
    let mut files: Vec<BadFile> = [
        ("plyx\n".to_owned(), "PLY, line 1: expected 'ply', found 'plyx'"),
        ("ply\nformat ascii 1.0\nelement vertex 3\n".to_owned(), "ends where 'end_header' was expected"),
        ("ply\nelement vertex 1\nend_header\n".to_owned(), "the line 'format' is missing"),
        (ply("ebcdic", VERTEX), "line 2: unknown format 'ebcdic'"),
        ("ply\nformat ascii 2.0\nend_header\n".to_owned(), "unknown version '2.0'"),
        (header("element vertex many"), "line 3: 'many' is not a whole number"),
        (header("element vertex -3"), "'-3' is not a whole number"),
        (header("element"), "the name of the element is missing"),
        (header("property float x"), "the element of this property is missing"),
        (header("element vertex 1\nproperty quad x"), "unknown type 'quad'"),
        (header("element vertex 1\nproperty list float int a"), "length of a list"),
        (header("element vertex 1\nproperty float x"), "x, y or z of the vertices is missing"),
        (header("nonsense"), "line 3: expected a line of the header, found 'nonsense'"),
        (header("element face 1\nproperty int a"), "the list 'vertex_indices' is missing"),
        (header(FACES), "ends where another record was expected"),
        (ply_mesh(3, "0 0 0\n1 0 0\n"), "ends where another record was expected"),
        (ply_mesh(1 << 31, POINTS3), "ends where another record was expected"),
        (point("1 0"), "line 11: a value of this record is missing"),
        (point("1 zero 0"), "line 11: 'zero' is not a number"),
        (point("1 nan 0"), "vertex 1: NaN is not a finite coordinate"),
        (point("1 0 1e999"), "vertex 1: inf is not a finite coordinate"),
        (three("3 0 1 3"), "face 0: index 3 is out of range: there are 3 vertices"),
        (three("3 0 1 -1"), "line 13: index -1 is out of range"),
        (three("2 0 1"), "line 13: a face needs 3 corners or more, this one has 2"),
        (three("0"), "line 13: a face needs 3 corners or more, this one has 0"),
        (three("4000000000 0 1 2"), "line 13: a value of this record is missing"),
        (three("-1 0 1 2"), "line 13: '-1' is not a whole number"),
        (three("3 0 1 1.5"), "line 13: '1.5' is not a whole number"),
        (three("3 0 1 1"), "no triangle with an area"),
    ]
    .into_iter()
    .map(|(content, words)| ("a.ply", content.into_bytes(), words))
    .collect();
    files.extend([
        (
            "a.ply",
            binary_ply(&format!("element vertex 2147483648\n{xyz}"), &[&[0; 64]]),
            "the records that the header promises need 25769803776 bytes, 64 are left",
        ),
        (
            "a.ply",
            binary_ply(&format!("element vertex {}\n{xyz}", u64::MAX), &[]),
            "need 18446744073709551615 bytes, 0 are left",
        ),
        (
            "a.ply",
            binary_ply(&format!("element nothing {}\nelement vertex 0\n{xyz}", u64::MAX), &[]),
            "holds no point",
        ),
        (
            "a.ply",
            binary_ply(&format!("{VERTEX}{FACES}"), &[&[0; 36], &u32::MAX.to_le_bytes(), &[0; 12]]),
            "face 0: the file is cut short: the items of a list need 17179869180 bytes, 12 are left",
        ),
        (
            "a.ply",
            binary_ply(&format!("{VERTEX}{FACES}").replace("uint", "char"), &[&[0; 36], &[0x80, 0, 0, 0]]),
            "face 0: '-128' is not a whole number",
        ),
    ]);
    files
}

fn stl(count: u32, body: &[u8]) -> Vec<u8> {
    [&[0; 80][..], &count.to_le_bytes(), body].concat()
}

fn stl_files() -> Vec<BadFile> {
    let facet =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let damaged = |good: &str, bad: &str| format!("solid a\n{}endsolid a\n", facet.replace(good, bad));
    vec![
        text("a.stl", "solid a\n", "ends where 'endsolid' was expected"),
        text("a.stl", &format!("solid a\n{facet}"), "ends where 'endsolid' was expected"),
        text("a.stl", "solid a\nendsolid a\n", "holds no face"),
        text("a.stl", &damaged("endloop", "endlop"), "line 7: expected the next part of a facet or solid"),
        text("a.stl", &damaged("vertex 1 0 0", "vertex 1 0"), "line 5: 2 values for a position, 3 wanted"),
        text("a.stl", &damaged("vertex 1 0 0\n", ""), "line 7: a face needs 3 corners"),
        text("a.stl", &damaged("1 0 0", "inf 0 0"), "line 5: inf is not a finite coordinate"),
        text("a.stl", &damaged("1 0 0", "1,0 0 0"), "line 5: '1,0' is not a number"),
        ("a.stl", stl(1, &[])[..60].to_vec(), "header and count of triangles need 84 bytes, 60 are left"),
        ("a.stl", stl(1 << 31, &[0; 100]), "the triangles need 107374182400 bytes, 100 are left"),
        ("a.stl", stl(2, &[0; 99]), "the triangles need 100 bytes, 99 are left"),
        ("a.stl", stl(1, &[0xff; 50]), "face 0: NaN is not a finite coordinate"),
        ("a.stl", stl(1, &[0; 50]), "no triangle with an area"),
    ]
}

fn obj_files() -> Vec<BadFile> {
    let three = |face: &str| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{face}\n");
    vec![
        text("a.obj", "# nothing\n", "a vertex ('v x y z') is missing"),
        text("a.obj", &three(""), "holds no face"),
        text("a.obj", "v 0 0\n", "line 1: 2 values for a position, 3 wanted"),
        text("a.obj", "v 0 0 nan\n", "line 1: NaN is not a finite coordinate"),
        text("a.obj", "v 0 0 z\n", "line 1: 'z' is not a number"),
        ("a.obj", b"v 0 0 \xff\xfe\n".to_vec(), "line 1: '\u{fffd}\u{fffd}' is not a number"),
        text("a.obj", &three("f 1 2 4"), "line 4: index 3 is out of range: there are 3 vertices"),
        text("a.obj", &three("f 0 1 2"), "line 4: index 0 is out of range"),
        text("a.obj", &three("f -4 1 2"), "line 4: index -4 is out of range"),
        text("a.obj", &three("f 1 2"), "line 4: a face needs 3 corners or more, this one has 2"),
        text("a.obj", &three("f a/b/c 1 1"), "line 4: 'a' is not a whole number"),
        text("a.obj", &three("f 99999999999999999999 1 1"), "is not a whole number in range"),
        text("a.obj", &three("f -9223372036854775808 1 1"), "index -9223372036854775808 is out of range"),
        text("a.obj", &three("f 5000000000 1 1"), "line 4: index 4999999999 is out of range"),
    ]
}

fn off_files() -> Vec<BadFile> {
    let three = |face: &str| format!("OFF\n3 1 0\n{POINTS3}{face}\n");
    vec![
        text("a.off", "OFF\n", "ends where the counts of vertices and faces was expected"),
        text("a.off", "OFF\n3\n", "line 2: expected 'OFF' and the counts"),
        text("a.off", "OFF\nx y\n", "line 2: 'x' is not a whole number"),
        text(
            "a.off",
            "OFF\n2147483648 1 0\n0 0 0\n",
            "line 2: the file is cut short: vertices and faces need",
        ),
        text("a.off", "OFF\n18446744073709551615 18446744073709551615 0\n", "the file is cut short"),
        text("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n\n\n\n\n\n\n\n\n\n\n", "ends where a vertex was expected"),
        text("a.off", &three("# 3 0 1 2"), "ends where a face was expected"),
        text("a.off", &three("3 0 1      "), "line 6: 2 values for the corners of a face, 3 wanted"),
        text("a.off", &three("4000000000 0 1 2"), "line 6: 3 values for the corners of a face"),
        text("a.off", &three("3 0 1 9"), "line 6: index 9 is out of range"),
        text("a.off", &three("2 0 1 1"), "line 6: a face needs 3 corners or more, this one has 2"),
        text("a.off", &format!("4{}", three("3 0 1 2")), "other than three dimensions"),
        text("a.off", "OFF BINARY\n", "binary OFF is not read"),
    ]
}

fn inventor_files() -> Vec<BadFile> {
    let triangle = "Coordinate3 { point [ 0 0 0, 1 0 0, 0 1 0 ] }\n";
    let faces = |indices: &str| format!("{triangle}IndexedFaceSet {{ coordIndex [ {indices} ] }}");
    // Thirty doublings of a sphere: 2^30 spheres in a kilobyte.
    let doubled = |k: u32| format!("DEF A{k} Group {{ USE A{0} USE A{0} }}\n", k - 1);
    let doublings: String = (1..=30).map(doubled).collect();
    // References that are deep though nothing is nested in the text.
    let chain: String = (1..=100_000).map(|k| format!("DEF A{k} Group {{ USE A{} }}\n", k - 1)).collect();
    let of_inventor = [
        (String::new(), "holds no face"),
        ("Separator {".to_owned(), "ends where a field, a node or '}' was expected"),
        ("Separator { } }".to_owned(), "line 2: expected a node, found '}'"),
        ("Separator".to_owned(), "ends where '{' behind the kind of a node was expected"),
        (
            "Info { string \"no end }".to_owned(),
            "line 2: the file ends where the end of a string was expected",
        ),
        ("Cube { width }".to_owned(), "line 2: expected the value of a field, found '}'"),
        ("\n\nCube { width 1..2 }".to_owned(), "line 4: '1..2' is not a number"),
        ("Cube { width -1 }".to_owned(), "the size of a box must be positive, not -1"),
        ("Sphere { radius 0 }".to_owned(), "radius must be positive, not 0"),
        ("Sphere { radius 1e999 }".to_owned(), "inf is not a finite coordinate"),
        ("Sphere { radius big }".to_owned(), "'big' is not a number"),
        ("Sphere { radius Cube { } }".to_owned(), "expected numbers, found 'a node'"),
        ("USE Ghost".to_owned(), "unknown name behind USE 'Ghost'"),
        ("DEF Loop Group { USE Loop }".to_owned(), "unknown name behind USE 'Loop'"),
        ("Translation { translation 1 2 }".to_owned(), "2 values for translation, 3 wanted"),
        ("RotationXYZ { axis W angle 1 }".to_owned(), "unknown axis 'W'"),
        ("Units { units PARSECS }".to_owned(), "unknown unit 'PARSECS'"),
        ("Coordinate3 { point [ 0 0 0, 1 0 ] } FaceSet { }".to_owned(), "5 values for coordinates, 6 wanted"),
        ("Coordinate3 { point [ 0 0 0, 1 nan 0 ] } FaceSet { }".to_owned(), "line 2: 'nan' is not a number"),
        ("IndexedFaceSet { coordIndex [ 0, 1, 2 ] }".to_owned(), "index 0 is out of range: there are 0"),
        (faces("0, 1, 2, -1, 0, 1, 3"), "face 1 of the node in line 3: index 3 is out of range"),
        (faces("0, 1, -2"), "index -2 is out of range"),
        (faces("0, 1"), "face 0 of the node in line 3: a face needs 3 corners or more, this one has 2"),
        (faces("0, 1, 1.5"), "'1.5' is not a whole number"),
        (faces("0, 1, 1e18"), "is not a whole number in range"),
        (
            format!("{triangle} FaceSet {{ numVertices [ 2147483647, 2147483647 ] }}"),
            "index 2147483647 is out of",
        ),
        (format!("{triangle} FaceSet {{ startIndex 9 }}"), "is out of range"),
        (
            format!("{triangle} TriangleStripSet {{ numVertices [ 1, 2 ] }}"),
            "3 corners or more, this one has 1",
        ),
        (
            "Scale { scaleFactor 1e300 1 1 } Scale { scaleFactor 1e300 1 1 } Cube { }".to_owned(),
            "is not a finite coordinate",
        ),
        ("Scale { scaleFactor 0 0 1 } Cube { }".to_owned(), "no triangle with an area"),
        ("Group { ".repeat(100_000), "nested deeper than 200 levels"),
        ("a [ ".repeat(100_000), "line 2: expected '{' behind the kind of a node, found '['"),
        (format!("Cube {{ {}", "a [ ".repeat(100_000)), "expected the next item of a list or ']', found '['"),
        (format!("Switch {{ DEF A0 Sphere {{ }} }} {doublings}"), "repeated references expand to more than"),
        (format!("Switch {{ DEF A0 Cube {{ }} {chain} }} USE A100000"), "nested deeper than 400 levels"),
    ];
    let of_vrml2 = [
        ("Transform { children [ ".repeat(100_000), "nested deeper than 200 levels"),
        (format!("PROTO A {}", "[ ".repeat(100_000)), "ends where a closing bracket was expected"),
        (
            "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 ] coord NULL } }".to_owned(),
            "index 0 is out of",
        ),
        ("Shape { geometry Box { size 1 1 } }".to_owned(), "2 values for size, 3 wanted"),
        ("ROUTE a.b TO".to_owned(), "ends where 'ROUTE a.b TO c.d' was expected"),
    ];
    let mut files = vec![
        text("a.iv", "Separator { }\n", "line 1: expected '#Inventor V2.x ascii'"),
        text("a.iv", "#Inventor V2.1 binary\n\0\0", "binary Inventor is not read"),
        text(
            "a.wrl",
            "#VRML V3.0 utf8\n",
            "'#VRML V1.0 ascii' or '#VRML V2.0 utf8', found '#VRML V3.0 utf8'",
        ),
        ("a.wrl", b"\x1f\x8b\x08\0\0\0".to_vec(), "compressed with gzip: unpack it first"),
        (
            "a.iv",
            b"#Inventor V2.1 ascii\nCube { width 1\xff }".to_vec(),
            "line 2: '1\u{fffd}' is not a number",
        ),
    ];
    let headed = |header: &str, content: String| format!("{header}\n{content}").into_bytes();
    files
        .extend(of_inventor.map(|(content, words)| ("a.iv", headed("#Inventor V2.1 ascii", content), words)));
    files.extend(of_vrml2.map(|(content, words)| ("a.wrl", headed("#VRML V2.0 utf8", content), words)));
    files
}

fn pcd(fields: &str, points: u64, data: &str, body: &[u8]) -> Vec<u8> {
    let header = format!("VERSION 0.7\n{fields}\nWIDTH {points}\nHEIGHT 1\nPOINTS {points}\nDATA {data}\n");
    [header.as_bytes(), body].concat()
}

/// One point with the sizes before and after compression.
fn packed(points: u64, sizes: [u32; 2], data: &[u8]) -> Vec<u8> {
    let body = [&sizes[0].to_le_bytes(), &sizes[1].to_le_bytes(), data].concat();
    pcd(XYZ, points, "binary_compressed", &body)
}

fn pcd_files() -> Vec<BadFile> {
    let headed = |rest: &str| {
        format!("FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n{rest}\nDATA ascii\n0 0 0\n").into_bytes()
    };
    let contents = [
        (b"VERSION 0.7\nFIELDS x y z\n".to_vec(), "ends where the line 'DATA' was expected"),
        (b"VERSION 0.7\nDATA ascii\n".to_vec(), "the line 'POINTS' is missing"),
        (b"VERSION 0.7\nWOBBLE 3\n".to_vec(), "line 2: expected a line of the header, found 'WOBBLE'"),
        (headed("VIEWPOINT 1 2"), "line 4: 2 values for VIEWPOINT, 7 wanted"),
        (headed("VIEWPOINT 1 2 nan 1 0 0 0"), "line 4: NaN is not a finite coordinate"),
        (headed("POINTS"), "line 4: a number is missing"),
        (headed("WIDTH 2\nHEIGHT 2\nPOINTS 3"), "3 values for POINTS (against WIDTH x HEIGHT), 4 wanted"),
        (headed("WIDTH 4294967296\nHEIGHT 4294967296"), "ends where another point was expected"),
        (pcd(XYZ, 0, "ascii", b""), "holds no point"),
        (pcd(XYZ, 3, "morse", b""), "unknown kind of data 'morse'"),
        (pcd("FIELDS x y\nSIZE 4 4\nTYPE F F", 1, "ascii", b"1 2\n"), "x, y or z among FIELDS is missing"),
        (pcd("FIELDS x y z\nSIZE 4 4\nTYPE F F F", 1, "ascii", b"1 2 3\n"), "2 values for SIZE, 3 wanted"),
        (pcd("FIELDS x y z\nSIZE 4 4 3\nTYPE F F F", 1, "ascii", b"1 2 3\n"), "unknown type and size 'F3'"),
        (
            pcd(&format!("{XYZ}4000000000"), 1, "binary", &[0; 12]),
            "'14000000000' is not a whole number in range",
        ),
        (pcd(XYZ, 1 << 31, "ascii", b"0 0 0\n"), "ends where another point was expected"),
        (pcd(XYZ, 1 << 31, "binary", &[0; 12]), "the points need 25769803776 bytes, 12 are left"),
        (pcd(XYZ, u64::MAX, "binary", &[0; 12]), "the points need 18446744073709551615 bytes"),
        (pcd(XYZ, 2, "binary", &[0; 23]), "the points need 24 bytes, 23 are left"),
        (pcd(XYZ, 1, "binary", &[0xff; 12]), "holds no point with finite coordinates"),
        (pcd(XYZ, 1, "ascii", b"1 2\n"), "line 10: 2 values for a point, 3 wanted"),
        (pcd(XYZ, 1, "ascii", b"1 2 three\n"), "line 10: 'three' is not a number"),
        (
            pcd(XYZ, 1, "binary_compressed", &[1, 0, 0]),
            "the sizes of the compressed points need 8 bytes, 3 are left",
        ),
        (packed(1, [9, 12], &[1]), "the compressed points need 9 bytes, 1 are left"),
        (packed(1, [1, 99], &[1]), "99 values for the size of the points, 12 wanted"),
        (packed(1, [2, 12], &[31, 1]), "compressed points do not decompress"),
        (packed(1, [3, 12], &[0xff, 0xff, 0xff]), "compressed points do not decompress"),
        (packed(1, [3, 12], &[1, 7, 7]), "2 values for decompressed bytes, 12 wanted"),
        (
            packed(300_000_000, [4, 3_600_000_000], &[0, 7, 0, 0]),
            "3600000000 values for the size of the points, 352",
        ),
    ];
    contents.map(|(content, words)| ("a.pcd", content, words)).to_vec()
}

fn column_files() -> Vec<BadFile> {
    vec![
        text("a.xyz", "# only a comment\n", "holds no point"),
        text("a.xyz", "1 2\n", "line 1: 2 values for a point, 3 wanted"),
        text("a.csv", "x,y,z\n1,2,3\n1,two,3\n", "line 3: 'two' is not a number"),
        text("a.csv", "x,y,z\n1,,3\n", "line 2: '' is not a number"),
        text("a.csv", "east,north,up\n1,2,3\n", "line 1: a column named x, y or z is missing"),
        text("a.csv", "nan,nan,nan\n", "holds no point"),
        text("a.txt", "The quick brown fox\n", "line 1: a column named x, y or z is missing"),
        ("a.xyz", vec![0xfe; 300], "a column named x, y or z is missing"),
    ]
}

/// What is wrong with the way in which a file is refused.
fn defect((name, content, words): &BadFile) -> Option<String> {
    let before = IN_USE.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let start = Instant::now();
    let result = read_geometry_bytes(content, Path::new(name), Unit::Metre).map(|_| ());
    let (taken, time) = (PEAK.load(Ordering::Relaxed).saturating_sub(before), start.elapsed());
    let shown = String::from_utf8_lossy(&content[..content.len().min(150)]).into_owned();
    let Err(error) = result else { return Some(format!("{name} {shown:?}: was read, not '{words}'")) };
    let error = error.to_string();
    let most = if error.contains("expand") { MOST_BYTES_EXPANDING } else { MOST_BYTES + 40 * content.len() };
    if !error.contains(words) || !error.starts_with(&format!("{name}: ")) || error.contains('\n') {
        return Some(format!("{name} {shown:?}: '{error}', not '{words}'"));
    }
    (taken > most || time > MOST_TIME).then(|| format!("{name} {shown:?}: took {taken} bytes, {time:?}"))
}

#[test]
fn bad_files_cost_one_clear_line_and_little_else() {
    let files = [
        files_of_no_format(),
        ply_files(),
        stl_files(),
        obj_files(),
        off_files(),
        inventor_files(),
        pcd_files(),
        column_files(),
    ]
    .concat();
    let defects: Vec<String> = files.iter().filter_map(defect).collect();
    assert!(defects.is_empty(), "{} of {}:\n{}", defects.len(), files.len(), defects.join("\n"));

    let points = ply("ascii", VERTEX.trim_end()) + POINTS3;
    let error = read_mesh_bytes(points.as_bytes(), Path::new("a.ply"), Unit::Metre).unwrap_err().to_string();
    assert_eq!(error, "a.ply: PLY file holds points without faces, but a mesh is wanted");

    let folder = tempfile::tempdir().unwrap();
    let message = |path: &Path| read_mesh(path, Unit::Metre).unwrap_err().to_string();
    assert!(message(folder.path()).ends_with("is a directory, not a file"));
    assert!(message(&folder.path().join("none.ply")).ends_with("none.ply: no such file"));
    let huge = folder.path().join("huge.ply");
    // A hole: the file takes no room on the disk.
    std::fs::File::create(&huge).unwrap().set_len(MAX_FILE_BYTES + 1).unwrap();
    assert!(message(&huge).ends_with("the file is larger than 2048 MiB"));
    let mesh = folder.path().join("mesh.off");
    std::fs::write(&mesh, format!("OFF\n3 1 0\n{POINTS3}3 0 1 2\n")).unwrap();
    let error = read_cloud(&mesh, Unit::Metre).unwrap_err().to_string();
    assert!(error.ends_with("OFF file holds a mesh, but a point cloud is wanted"), "{error}");
}
