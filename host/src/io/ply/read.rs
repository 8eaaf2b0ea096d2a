//! Vertices, faces and triangle strips.

use super::super::assemble::{Raw, RawCloud, RawMesh};
use super::super::error::{Fault, Place, Problem};
use super::super::text::decoded;
use super::body::Body;
use super::header::{Element, Encoding, Header, Kind};

/// Properties of a vertex that are kept, in the order of [`RawCloud::push`].
const KEPT: [[&str; 2]; 10] = [
    ["x", "x"],
    ["y", "y"],
    ["z", "z"],
    ["nx", "normal_x"],
    ["ny", "normal_y"],
    ["nz", "normal_z"],
    ["view_x", "view_x"],
    ["view_y", "view_y"],
    ["view_z", "view_z"],
    ["sweep", "sweep"],
];

/// A mesh when the file has faces or strips, else a cloud.
pub(in super::super) fn read(bytes: &[u8]) -> Result<Raw, Fault> {
    let header = Header::parse(bytes)?;
    let records = &bytes[header.body_at..];
    let text;
    let mut body = match header.encoding {
        Encoding::Ascii => {
            text = decoded(records);
            Body::text(&text, header.lines)
        }
        binary => Body::bytes(records, binary),
    };
    let (mut mesh, mut cloud, mut provenance) = (RawMesh::by_face(), None, Vec::new());
    for element in &header.elements {
        body.check(element).map_err(|problem| problem.at(Place::File))?;
        match element.name.as_str() {
            "vertex" => cloud = Some(vertices(&mut body, element)?),
            "face" => lists(
                &mut body,
                element,
                "face",
                &["vertex_indices", "vertex_index"],
                |list, face| mesh.push(list.iter().copied().map(Ok), face),
                |number| provenance.push(number),
            )?,
            "tristrips" => {
                lists(
                    &mut body,
                    element,
                    "strip",
                    &["vertex_indices", "vertex_index"],
                    |list, strip| {
                        list.split(|&index| index == -1)
                            .try_for_each(|strip_of| push_strip(&mut mesh, strip_of, strip))
                    },
                    |_| {},
                )?;
            }
            _ => lists(&mut body, element, "record", &[], |_, _| Ok(()), |_| {})?,
        }
    }
    let cloud = cloud.ok_or(Problem::Missing("the element 'vertex'").at(Place::File))?;
    if mesh.has_polygons() {
        mesh.vertices = cloud.points;
        mesh.provenance = provenance;
        return Ok(Raw::Mesh(mesh));
    }
    Ok(Raw::Cloud(cloud))
}

/// Triangles of a strip: every other one is turned, and repeated corners are seams, not faces.
fn push_strip(mesh: &mut RawMesh, strip: &[i64], number: usize) -> Result<(), Problem> {
    for (k, corners) in strip.windows(3).enumerate() {
        let (a, b, c) = (corners[0], corners[1], corners[2]);
        if a != b && b != c && a != c {
            mesh.push(if k % 2 == 0 { [a, b, c] } else { [b, a, c] }.map(Ok), number)?;
        }
    }
    Ok(())
}

fn vertices(body: &mut Body<'_>, element: &Element) -> Result<RawCloud, Fault> {
    let slots: Vec<Option<usize>> = element
        .properties
        .iter()
        .map(|property| KEPT.iter().position(|names| names.contains(&property.name.as_str())))
        .collect();
    let has = |wanted: std::ops::Range<usize>| {
        wanted.into_iter().all(|slot| {
            slots
                .iter()
                .zip(&element.properties)
                .any(|(s, p)| *s == Some(slot) && matches!(p.kind, Kind::One(_)))
        })
    };
    if !has(0..3) {
        return Err(Problem::Missing("x, y or z of the vertices").at(Place::File));
    }
    let mut cloud = RawCloud::with(has(3..6), has(6..9), has(9..10));
    for index in 0..element.count {
        let mut values = [0.0; 10];
        let record = body.begin_record().and_then(|()| {
            for (property, slot) in element.properties.iter().zip(&slots) {
                match (&property.kind, slot) {
                    (Kind::One(scalar), Some(slot)) => values[*slot] = body.next(*scalar)?,
                    (Kind::One(scalar), None) => drop(body.next(*scalar)?),
                    (Kind::List { count, item }, _) => {
                        for _ in 0..body.next_length(*count, *item)? {
                            body.next(*item)?;
                        }
                    }
                }
            }
            Ok(())
        });
        record.map_err(|problem| problem.at(body.place("vertex", index)))?;
        cloud.push(&values);
    }
    Ok(cloud)
}

/// Goes through records that are no vertices and hands the list that has one of `names` to `take`. Without names, the
/// records are only passed over. The property `provenance` goes to `mark`.
fn lists(
    body: &mut Body<'_>,
    element: &Element,
    kind: &'static str,
    names: &[&str],
    mut take: impl FnMut(&[i64], usize) -> Result<(), Problem>,
    mut mark: impl FnMut(f64),
) -> Result<(), Fault> {
    let is_wanted = |name: &str| names.contains(&name);
    let has_list = |p: &super::header::Property| is_wanted(&p.name) && matches!(p.kind, Kind::List { .. });
    if !names.is_empty() && element.count > 0 && !element.properties.iter().any(has_list) {
        return Err(Problem::Missing("the list 'vertex_indices'").at(Place::File));
    }
    if element.properties.is_empty() && matches!(body, Body::Bytes { .. }) {
        // Records without a byte: nothing to pass over, however many the header claims.
        return Ok(());
    }
    let mut list = Vec::new();
    for index in 0..element.count {
        let record = body.begin_record().and_then(|()| {
            for property in &element.properties {
                match property.kind {
                    Kind::One(scalar) => {
                        let value = body.next(scalar)?;
                        if property.name == "provenance" {
                            mark(value);
                        }
                    }
                    Kind::List { count, item } => {
                        list.clear();
                        for _ in 0..body.next_length(count, item)? {
                            let value = body.next(item)?;
                            if is_wanted(&property.name) {
                                list.push(vertex_index(value)?);
                            }
                        }
                        if is_wanted(&property.name) {
                            take(&list, index as usize)?;
                        }
                    }
                }
            }
            Ok(())
        });
        record.map_err(|problem| problem.at(body.place(kind, index)))?;
    }
    Ok(())
}

fn vertex_index(value: f64) -> Result<i64, Problem> {
    if value.fract() == 0.0 { Ok(value as i64) } else { Err(Problem::NotWhole(value.to_string())) }
}
