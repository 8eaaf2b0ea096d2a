//! Faces and strips over coordinates.

use std::collections::HashMap;

use nalgebra::Point3;

use super::super::error::{Fault, Place, Problem};
use super::Dialect;
use super::parser::Node;
use super::scene::{Scene, State};

/// Adds the surface of a node. `false` when the node is no shape of this kind.
pub(super) fn add<'d, 'a>(
    scene: &mut Scene<'d, 'a>,
    node: &'d Node<'a>,
    state: &State,
) -> Result<bool, Fault> {
    if !["IndexedFaceSet", "FaceSet", "IndexedTriangleStripSet", "TriangleStripSet"].contains(&node.kind) {
        return Ok(false);
    }
    let clockwise = match scene.dialect {
        Dialect::Inventor => state.clockwise,
        Dialect::Vrml2 => node.words("ccw") == ["FALSE"],
    };
    let coordinates = coordinates(scene, node, state)?;
    let is_turned = clockwise != state.is_mirrored();
    let mut faces = Faces { scene, node, state, coordinates, is_turned, made: HashMap::new(), face: 0 };
    match node.kind {
        "IndexedFaceSet" => faces.indexed_faces(),
        "FaceSet" => faces.faces(),
        "IndexedTriangleStripSet" => faces.indexed_strips(),
        _ => faces.strips(),
    }?;
    Ok(true)
}

/// Numbers of the current coordinates, three per point: the shape's own, else the inherited ones, else none.
fn coordinates<'d>(scene: &Scene<'d, '_>, node: &'d Node<'_>, state: &State) -> Result<&'d [f64], Fault> {
    let own = node.nodes("vertexProperty").first().or(node.nodes("coord").first()).copied();
    let inherited = if scene.dialect == Dialect::Inventor { state.coordinates } else { None };
    let Some(id) = own.or(inherited) else { return Ok(&[]) };
    let holder = &scene.document.nodes[id];
    let numbers = match holder.numbers("point")? {
        Some(numbers) => numbers,
        None => holder.numbers("vertex")?.unwrap_or(&[]),
    };
    if numbers.len() % 3 != 0 {
        let (found, wanted) = (numbers.len() as u64, numbers.len().next_multiple_of(3) as u64);
        return Err(holder.fault(Problem::ValueCount { what: "coordinates", found, wanted }));
    }
    Ok(numbers)
}

struct Faces<'s, 'd, 'a> {
    scene: &'s mut Scene<'d, 'a>,
    node: &'d Node<'a>,
    state: &'s State,
    coordinates: &'d [f64],
    /// Whether corners must be taken in the opposite order.
    is_turned: bool,
    /// Vertex of the mesh for each coordinate that a face has used. Many shapes may share one list of coordinates, so
    /// only the used ones are made.
    made: HashMap<i64, i64>,
    /// Number of the face within the node.
    face: usize,
}

impl Faces<'_, '_, '_> {
    fn indexed_faces(&mut self) -> Result<(), Fault> {
        let indices = self.indices("coordIndex")?;
        self.make_in_order(&indices)?;
        runs(&indices).try_for_each(|run| self.push(run))
    }

    fn indexed_strips(&mut self) -> Result<(), Fault> {
        let indices = self.indices("coordIndex")?;
        self.make_in_order(&indices)?;
        runs(&indices).try_for_each(|run| self.push_strip(run))
    }

    fn faces(&mut self) -> Result<(), Fault> {
        self.consecutive()?.into_iter().try_for_each(|run| self.push(&run.collect::<Vec<_>>()))
    }

    fn strips(&mut self) -> Result<(), Fault> {
        self.consecutive()?.into_iter().try_for_each(|run| self.push_strip(&run.collect::<Vec<_>>()))
    }

    fn indices(&self, name: &str) -> Result<Vec<i64>, Fault> {
        let numbers = self.node.numbers(name)?.unwrap_or(&[]);
        numbers
            .iter()
            .map(|&number| match number.fract() == 0.0 && number.abs() < 1e15 {
                true => Ok(number as i64),
                false => Err(self.node.fault(Problem::NotWhole(number.to_string()))),
            })
            .collect()
    }

    /// Makes the vertices that are used in the order in which the file has them. Indices without a coordinate are left
    /// for the face that names them to report.
    fn make_in_order(&mut self, indices: &[i64]) -> Result<(), Fault> {
        let vertices = (self.coordinates.len() / 3) as i64;
        let mut used: Vec<i64> =
            indices.iter().copied().filter(|index| (0..vertices).contains(index)).collect();
        used.sort_unstable();
        used.dedup();
        used.into_iter().try_for_each(|index| self.vertex(index, self.place(0)).map(|_| ()))
    }

    /// Runs of coordinates in their own order, as `numVertices` cuts them; -1 takes the rest.
    fn consecutive(&self) -> Result<Vec<std::ops::Range<i64>>, Fault> {
        let total = (self.coordinates.len() / 3) as i64;
        let mut start = self.node.scalar("startIndex", 0.0)? as i64;
        let lengths = match self.indices("numVertices")? {
            lengths if lengths.is_empty() => vec![-1],
            lengths => lengths,
        };
        let mut runs = Vec::with_capacity(lengths.len());
        for length in lengths {
            let end = if length == -1 { total } else { start.saturating_add(length) };
            if length < -1 || start < 0 || end > total || start > end {
                let problem = Problem::IndexOutOfRange { index: end, vertices: total as usize };
                return Err(problem.at(self.place(runs.len())));
            }
            runs.push(start..end);
            start = end;
        }
        Ok(runs)
    }

    fn push_strip(&mut self, strip: &[i64]) -> Result<(), Fault> {
        if strip.len() < 3 {
            return Err(Problem::TooFewCorners(strip.len()).at(self.place(self.face)));
        }
        for (k, corners) in strip.windows(3).enumerate() {
            let (a, b, c) = (corners[0], corners[1], corners[2]);
            // Repeated corners join strips and are no faces.
            if a != b && b != c && a != c {
                self.push(&if k % 2 == 0 { [a, b, c] } else { [b, a, c] })?;
            }
        }
        Ok(())
    }

    fn push(&mut self, corners: &[i64]) -> Result<(), Fault> {
        let place = self.place(self.face);
        let mut vertices = Vec::with_capacity(corners.len());
        for &corner in corners {
            vertices.push(self.vertex(corner, place)?);
        }
        if self.is_turned {
            vertices.reverse();
        }
        self.scene.spend(corners.len())?;
        self.face += 1;
        self.scene
            .mesh
            .push(vertices.into_iter().map(Ok), self.node.line)
            .map_err(|problem| problem.at(place))
    }

    fn vertex(&mut self, corner: i64, place: Place) -> Result<i64, Fault> {
        if let Some(&made) = self.made.get(&corner) {
            return Ok(made);
        }
        let vertices = self.coordinates.len() / 3;
        let at = usize::try_from(corner).ok().filter(|&index| index < vertices).map(|index| 3 * index);
        let at = at.ok_or_else(|| Problem::IndexOutOfRange { index: corner, vertices }.at(place))?;
        let local = Point3::from_slice(&self.coordinates[at..at + 3]);
        let new = self.scene.mesh.vertices.len() as i64;
        self.scene.mesh.vertices.push(self.state.placed(&local));
        self.made.insert(corner, new);
        Ok(new)
    }

    fn place(&self, face: usize) -> Place {
        Place::NodeFace { line: self.node.line, face }
    }
}

/// The runs between the -1 of an index list; the last -1 may be missing, and a doubled one encloses nothing.
fn runs(indices: &[i64]) -> impl Iterator<Item = &[i64]> {
    indices.split(|&index| index == -1).filter(|run| !run.is_empty())
}
