//! Repairs of what exporters get wrong about faces: the same one twice, or some turned against the others.

use std::collections::{HashMap, HashSet, VecDeque};

use crate::surface::Mesh;

/// The mesh with each face once and neighbours turned alike, as far as that can be; `warnings` tell what was done.
pub(super) fn repaired(mesh: Mesh, warnings: &mut Vec<String>) -> Mesh {
    let faces = once_each(mesh.faces(), warnings);
    let faces = turned_alike(faces, warnings);
    if faces == mesh.faces() {
        return mesh;
    }
    // Faces are only left out or turned, so that they are as good as they were.
    Mesh::new(mesh.vertices().to_vec(), faces).unwrap_or(mesh)
}

/// The faces without second ones on the same corners. Two that are turned against each other are both sides of a sheet
/// where all faces are there so; otherwise they may be a fold and stay.
fn once_each(faces: &[[u32; 3]], warnings: &mut Vec<String>) -> Vec<[u32; 3]> {
    let mut seen = HashSet::with_capacity(faces.len());
    let kept: Vec<[u32; 3]> = faces.iter().copied().filter(|&face| seen.insert(from_least(face))).collect();
    let twice = faces.len() - kept.len();
    if twice > 0 {
        warnings.push(format!("{twice} faces that are there twice were dropped"));
    }
    let back = |face: &[u32; 3]| {
        let [a, b, c] = *face;
        from_least([a, c, b])
    };
    if !kept.iter().all(|face| seen.contains(&back(face))) {
        return kept;
    }
    let mut sides = HashSet::with_capacity(kept.len() / 2);
    let one_side: Vec<[u32; 3]> = kept
        .into_iter()
        .filter(|face| {
            let is_first = !sides.contains(&back(face));
            if is_first {
                sides.insert(from_least(*face));
            }
            is_first
        })
        .collect();
    warnings.push(format!("every face is there from both sides: {} were dropped", one_side.len()));
    one_side
}

/// The face beginning at its least corner.
pub(super) fn from_least([a, b, c]: [u32; 3]) -> [u32; 3] {
    match a.min(b).min(c) {
        least if least == a => [a, b, c],
        least if least == b => [b, c, a],
        _ => [c, a, b],
    }
}

/// The faces turned so that those that share an edge run over it in opposite directions: in each connected part the fewer
/// are turned. Edges of three faces and more join nothing; a part that has no two sides, as a Moebius strip, stays.
fn turned_alike(mut faces: Vec<[u32; 3]>, warnings: &mut Vec<String>) -> Vec<[u32; 3]> {
    let mut of_edge: HashMap<[u32; 2], Vec<(usize, bool)>> = HashMap::with_capacity(2 * faces.len());
    for (index, face) in faces.iter().enumerate() {
        for (edge, runs_up) in edges(face) {
            of_edge.entry(edge).or_default().push((index, runs_up));
        }
    }
    let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
    let mut count = 0;
    for start in 0..faces.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let (mut part, mut waiting, mut has_two_sides) = (vec![start], VecDeque::from([start]), true);
        while let Some(index) = waiting.pop_front() {
            let is_turned = turned[index] == Some(true);
            for (edge, runs_up) in edges(&faces[index]) {
                let Some([one, other]) = of_edge.get(&edge).map(Vec::as_slice) else { continue };
                let &(next, next_runs_up) = if one.0 == index { other } else { one };
                let wants_turn = is_turned != (runs_up == next_runs_up);
                match turned[next] {
                    None => {
                        turned[next] = Some(wants_turn);
                        part.push(next);
                        waiting.push_back(next);
                    }
                    Some(is) => has_two_sides &= is == wants_turn,
                }
            }
        }
        let to_turn = part.iter().filter(|&&index| turned[index] == Some(true)).count();
        let turn_the_others = 2 * to_turn > part.len();
        if !has_two_sides || to_turn == 0 {
            continue;
        }
        for index in part {
            if (turned[index] == Some(true)) != turn_the_others {
                faces[index].swap(1, 2);
                count += 1;
            }
        }
    }
    if count > 0 {
        warnings.push(format!("{count} faces were turned to agree with their neighbours"));
    }
    faces
}

/// The edges of a face, lower corner first, and whether the face runs from it to the higher one.
fn edges(&[a, b, c]: &[u32; 3]) -> [([u32; 2], bool); 3] {
    [(a, b), (b, c), (c, a)].map(|(from, to)| ([from.min(to), from.max(to)], from < to))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand_chacha::{ChaCha8Rng, rand_core::SeedableRng};

    use super::*;
    use crate::object::solids::cuboid;

    fn cube() -> Mesh {
        cuboid([0.05; 3]).unwrap()
    }

    fn with_faces(faces: Vec<[u32; 3]>) -> Mesh {
        Mesh::new(cube().vertices().to_vec(), faces).unwrap()
    }

    #[test]
    fn faces_turned_at_random_are_turned_back() {
        let whole = cube();
        for seed in 0..20 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let mut faces = whole.faces().to_vec();
            let mut turned = 0;
            for face in &mut faces {
                // At most a third, so that it is clear which ones are wrong.
                if turned < whole.faces().len() / 3 && rng.random_bool(0.5) {
                    face.swap(1, 2);
                    turned += 1;
                }
            }
            let mut warnings = Vec::new();
            let repaired = repaired(with_faces(faces), &mut warnings);
            assert!(repaired.is_watertight() && repaired.signed_volume_m3() > 0.0, "seed {seed}");
            assert_eq!(warnings.len(), usize::from(turned > 0), "{warnings:?}");
        }
    }

    #[test]
    fn what_is_there_twice_stays_once() {
        let whole = cube();
        let mut twice = whole.faces().to_vec();
        twice.extend(whole.faces().iter().map(|&[a, b, c]| [b, c, a]));
        let mut warnings = Vec::new();
        assert_eq!(repaired(with_faces(twice), &mut warnings).faces(), whole.faces());
        let from_both_sides: Vec<_> =
            whole.faces().iter().flat_map(|&[a, b, c]| [[a, b, c], [a, c, b]]).collect();
        assert_eq!(repaired(with_faces(from_both_sides), &mut warnings).faces(), whole.faces());
        assert!(
            warnings[0].contains("12 faces that are there twice") && warnings[1].contains("from both sides")
        );
    }

    #[test]
    fn what_cannot_be_mended_stays() {
        // Open, but turned alike; a fin on an edge of the cube; a strip of five faces that is joined with half a turn.
        let mut warnings = Vec::new();
        let open = with_faces(cube().faces()[2..].to_vec());
        assert_eq!(repaired(open.clone(), &mut warnings), open);
        let mut fin = cube().faces().to_vec();
        fin.push([0, 1, 6]);
        let fin = with_faces(fin);
        assert_eq!(repaired(fin.clone(), &mut warnings), fin);
        let strip: Vec<[u32; 3]> = (0..5).map(|k| [k, (k + 1) % 5, (k + 2) % 5]).collect();
        let strip = with_faces(strip);
        assert_eq!(repaired(strip.clone(), &mut warnings), strip);
        assert!(warnings.is_empty(), "{warnings:?}");
    }
}
