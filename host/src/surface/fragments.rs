//! Connected parts of a triangle soup, and the removal of the small ones.

use nalgebra::Point3;

use super::contour::Triangles;

/// What is left, and how many parts went.
pub(super) struct Kept {
    pub(super) triangles: Triangles,
    pub(super) dropped: usize,
}

/// Drops connected parts with less than `share` of the largest part's area, and with `solid` also parts that are
/// inside out: bubbles within the body. Unused vertices go too.
pub(super) fn without_fragments((vertices, faces): Triangles, share: f64, solid: bool) -> Kept {
    let part_of_vertex = parts(vertices.len(), &faces);
    let count = part_of_vertex.iter().max().map_or(0, |&last| last as usize + 1);
    let (mut areas, mut volumes) = (vec![0.0; count], vec![0.0; count]);
    let origin = vertices.first().copied().unwrap_or_else(Point3::origin);
    for face in &faces {
        let [a, b, c] = face.map(|i| vertices[i as usize] - origin);
        let part = part_of_vertex[face[0] as usize] as usize;
        areas[part] += 0.5 * (b - a).cross(&(c - a)).norm();
        volumes[part] += a.dot(&b.cross(&c)) / 6.0;
    }
    let largest = areas.iter().copied().fold(0.0, f64::max);
    let keep = |part: usize| areas[part] >= share * largest && !(solid && volumes[part] <= 0.0);
    let dropped = (0..count).filter(|&part| areas[part] > 0.0 && !keep(part)).count();
    let mut kept_vertices = Vec::with_capacity(vertices.len());
    let mut index_of = vec![u32::MAX; vertices.len()];
    let mut kept_faces = Vec::with_capacity(faces.len());
    for face in faces.iter().filter(|face| keep(part_of_vertex[face[0] as usize] as usize)) {
        kept_faces.push(face.map(|i| {
            let index = &mut index_of[i as usize];
            if *index == u32::MAX {
                *index = kept_vertices.len() as u32;
                kept_vertices.push(vertices[i as usize]);
            }
            *index
        }));
    }
    Kept { triangles: (kept_vertices, kept_faces), dropped }
}

/// Part number of every vertex, counted from 0 in the order of the vertices.
fn parts(vertices: usize, faces: &[[u32; 3]]) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for &[a, b, c] in faces {
        for other in [b, c] {
            let (a, b) = (root(&mut parent, a), root(&mut parent, other));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut numbers = vec![0; vertices];
    let mut count = 0;
    for i in 0..vertices as u32 {
        let root = root(&mut parent, i);
        if root == i {
            numbers[i as usize] = count;
            count += 1;
        } else {
            // A root is the least index of its part, so it has its number already.
            numbers[i as usize] = numbers[root as usize];
        }
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_inverted_parts_go() {
        let tetrahedron = |at: f64, size: f64, flip: bool| {
            let v = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let f = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
            (
                v.map(|p| Point3::from(p) * size + nalgebra::Vector3::x() * at),
                f.map(|[a, b, c]| if flip { [b, a, c] } else { [a, b, c] }),
            )
        };
        let (mut vertices, mut faces) = (Vec::new(), Vec::new());
        for (v, f) in
            [tetrahedron(5.0, 0.1, false), tetrahedron(0.0, 1.0, false), tetrahedron(9.0, 0.8, true)]
        {
            let offset = vertices.len() as u32;
            vertices.extend(v);
            faces.extend(f.map(|face| face.map(|i: u32| i + offset)));
        }
        let sheet = without_fragments((vertices.clone(), faces.clone()), 0.05, false);
        assert_eq!((sheet.dropped, sheet.triangles.0.len(), sheet.triangles.1.len()), (1, 8, 8));
        let solid = without_fragments((vertices, faces), 0.05, true);
        assert_eq!((solid.dropped, solid.triangles.0.len()), (2, 4));
        assert_eq!(without_fragments((Vec::new(), Vec::new()), 0.1, true).dropped, 0);
    }
}
