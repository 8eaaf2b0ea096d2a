//! Meshes for the tests, as OFF files.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Vertices in metres and the faces over them.
#[derive(Clone)]
pub(crate) struct Solid {
    pub(crate) vertices: Vec<[f64; 3]>,
    pub(crate) faces: Vec<[usize; 3]>,
}

impl Solid {
    /// A box on z = 0 about the z axis, each side of it cut into `cuts` times `cuts` squares of two triangles.
    pub(crate) fn block(size_m: [f64; 3], cuts: usize) -> Self {
        let mut solid = Self { vertices: Vec::new(), faces: Vec::new() };
        let mut index_of: HashMap<[usize; 3], usize> = HashMap::new();
        for axis in 0..3 {
            for end in [0, cuts] {
                for (i, k) in (0..cuts).flat_map(|i| (0..cuts).map(move |k| (i, k))) {
                    let corners = [(i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)].map(|(i, k)| {
                        let mut place = [end; 3];
                        (place[(axis + 1) % 3], place[(axis + 2) % 3]) = (i, k);
                        *index_of.entry(place).or_insert_with(|| {
                            let share = place.map(|steps| steps as f64 / cuts as f64);
                            let [x, y, z] = size_m;
                            solid.vertices.push([(share[0] - 0.5) * x, (share[1] - 0.5) * y, share[2] * z]);
                            solid.vertices.len() - 1
                        })
                    });
                    let [a, b, c, d] = corners;
                    solid.faces.extend(if end == 0 {
                        [[a, c, b], [a, d, c]]
                    } else {
                        [[a, b, c], [a, c, d]]
                    });
                }
            }
        }
        solid
    }

    /// An upright cylinder on z = 0 about the z axis.
    pub(crate) fn cylinder(diameter_m: f64, height_m: f64) -> Self {
        const SIDES: usize = 48;
        let mut vertices = vec![[0.0; 3], [0.0, 0.0, height_m]];
        let mut faces = Vec::new();
        for side in 0..SIDES {
            let (sin, cos) = (TAU * side as f64 / SIDES as f64).sin_cos();
            vertices.extend([0.0, height_m].map(|z| [0.5 * diameter_m * cos, 0.5 * diameter_m * sin, z]));
            let [low, high] = [2 + 2 * side, 3 + 2 * side];
            let next = (side + 1) % SIDES;
            let [next_low, next_high] = [2 + 2 * next, 3 + 2 * next];
            faces.extend([
                [low, next_low, next_high],
                [low, next_high, high],
                [0, next_low, low],
                [1, high, next_high],
            ]);
        }
        Self { vertices, faces }
    }

    /// With the corners of some faces the other way round.
    pub(crate) fn with_turned(mut self, is_turned: impl Fn(usize) -> bool) -> Self {
        for (_, face) in self.faces.iter_mut().enumerate().filter(|(index, _)| is_turned(*index)) {
            face.swap(1, 2);
        }
        self
    }

    pub(crate) fn scaled(mut self, by: f64) -> Self {
        self.vertices.iter_mut().flatten().for_each(|c| *c *= by);
        self
    }

    pub(crate) fn write(&self, path: &Path) {
        let mut text = format!("OFF\n{} {} 0\n", self.vertices.len(), self.faces.len());
        for [x, y, z] in &self.vertices {
            writeln!(text, "{x} {y} {z}").unwrap();
        }
        for [a, b, c] in &self.faces {
            writeln!(text, "3 {a} {b} {c}").unwrap();
        }
        fs::write(path, text).unwrap();
    }
}
