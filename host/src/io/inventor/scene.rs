//! Walks the nodes with the state that they pass on, and gathers every surface in one mesh.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Point3};

use super::super::assemble::RawMesh;
use super::super::error::{Fault, Place, Problem};
use super::parser::{Document, MAX_DEPTH, Node, NodeId};
use super::{Dialect, primitives, shapes, transform};

/// Nodes visited and vertices made beyond the size of the file: `USE` within `USE` multiplies.
const MAX_EXPANSION: usize = 2_000_000;

/// Nodes that carry no surface; others that are not known are reported.
const SILENT: &str = "\
    Appearance AsciiText AudioClip Background BaseColor ClipPlane Color ColorInterpolator Complexity \
    CoordinateInterpolator CylinderSensor DirectionalLight DrawStyle Environment Event Fog Font \
    FontStyle ImageTexture IndexedLineSet Info Label LightModel LineSet Material MaterialBinding \
    MovieTexture NavigationInfo Normal NormalBinding NormalInterpolator OrientationInterpolator \
    OrthographicCamera PackedColor PerspectiveCamera PickStyle PixelTexture PlaneSensor PointLight \
    PointSet PolygonOffset PositionInterpolator ProximitySensor ScalarInterpolator Script Sound \
    SphereSensor SpotLight Text Text2 Texture2 Texture2Transform TextureCoordinate TextureCoordinate2 \
    TextureCoordinateBinding TextureTransform TimeSensor TouchSensor Viewpoint VisibilitySensor \
    WorldInfo";

/// What nodes inherit from those before them.
#[derive(Debug, Clone)]
pub(super) struct State {
    pub(super) scene_from_local: Matrix4<f64>,
    /// The node that holds the current coordinates.
    pub(super) coordinates: Option<NodeId>,
    /// Whether corners run clockwise seen from outside.
    pub(super) clockwise: bool,
    /// Metres per unit, as the last `Units` node says.
    unit_m: f64,
}

impl State {
    /// Whether the transformation turns a left hand into a right one.
    pub(super) fn is_mirrored(&self) -> bool {
        self.scene_from_local.fixed_view::<3, 3>(0, 0).determinant() < 0.0
    }

    pub(super) fn placed(&self, local: &Point3<f64>) -> Point3<f64> {
        self.scene_from_local.transform_point(local)
    }
}

pub(super) struct Scene<'d, 'a> {
    pub(super) document: &'d Document<'a>,
    pub(super) dialect: Dialect,
    pub(super) mesh: RawMesh,
    /// What may still be visited or made.
    budget: usize,
    limit: usize,
    /// Kinds of nodes that were passed over: how many, and the first one's line.
    skipped: BTreeMap<&'d str, (usize, usize)>,
}

/// All surfaces of a document of `bytes` bytes, with every transformation carried out.
pub(super) fn flatten(document: &Document<'_>, dialect: Dialect, bytes: usize) -> Result<RawMesh, Fault> {
    let limit = MAX_EXPANSION.saturating_add(bytes);
    let mut scene =
        Scene { document, dialect, mesh: RawMesh::by_line(), budget: limit, limit, skipped: BTreeMap::new() };
    for &(what, line) in &document.skipped {
        scene.skip(what, line);
    }
    let mut state =
        State { scene_from_local: Matrix4::identity(), coordinates: None, clockwise: false, unit_m: 1.0 };
    for &root in &document.roots {
        scene.visit(root, &mut state, 0)?;
    }
    let Scene { mut mesh, skipped, .. } = scene;
    mesh.warnings.extend(skipped.into_iter().map(|(kind, (count, line))| {
        format!("{count} x {kind} (the first in line {line}) is not understood and was left out")
    }));
    Ok(mesh)
}

impl<'d, 'a> Scene<'d, 'a> {
    /// Counts against the budget that keeps multiplying references from filling the memory.
    pub(super) fn spend(&mut self, cost: usize) -> Result<(), Fault> {
        self.budget = self.budget.checked_sub(cost).ok_or(Problem::Expands(self.limit).at(Place::File))?;
        Ok(())
    }

    fn visit(&mut self, id: NodeId, state: &mut State, depth: usize) -> Result<(), Fault> {
        self.spend(1)?;
        let node = &self.document.nodes[id];
        if depth > 2 * MAX_DEPTH {
            return Err(node.fault(Problem::TooDeep(2 * MAX_DEPTH)));
        }
        let grouping_transform = node.kind == "Transform" && self.dialect == Dialect::Vrml2;
        if let Some(outer_from_inner) = transform::matrix(node)? {
            let mut inner = state.clone();
            inner.scene_from_local *= outer_from_inner;
            if grouping_transform {
                return self.visit_all(node, &mut inner, depth);
            }
            *state = inner;
            return Ok(());
        }
        match node.kind {
            "Group" => self.visit_all(node, state, depth),
            "Separator" | "Annotation" | "Selection" | "WWWAnchor" | "Anchor" | "Billboard" | "Collision" => {
                self.visit_all(node, &mut state.clone(), depth)
            }
            "TransformSeparator" => {
                let (matrix, unit_m) = (state.scene_from_local, state.unit_m);
                self.visit_all(node, state, depth)?;
                (state.scene_from_local, state.unit_m) = (matrix, unit_m);
                Ok(())
            }
            "Switch" => self.visit_choice(node, state, depth),
            "LOD" | "LevelOfDetail" => {
                let finest = node.nodes("level").first().or(node.children.first());
                finest.map_or(Ok(()), |&child| self.visit(child, &mut state.clone(), depth + 1))
            }
            "Shape" => {
                node.nodes("geometry").iter().try_for_each(|&shape| self.visit(shape, state, depth + 1))
            }
            "ResetTransform" => {
                state.scene_from_local = Matrix4::identity();
                Ok(())
            }
            "Units" => {
                let unit_m = unit_m(node)?;
                state.scene_from_local *= Matrix4::new_scaling(unit_m / state.unit_m);
                state.unit_m = unit_m;
                Ok(())
            }
            "ShapeHints" => {
                state.clockwise = node.words("vertexOrdering") == ["CLOCKWISE"];
                Ok(())
            }
            "Coordinate3" | "Coordinate" | "VertexProperty" => {
                state.coordinates = Some(id);
                Ok(())
            }
            kind => {
                if !shapes::add(self, node, state)?
                    && !primitives::add(self, node, state)?
                    && !SILENT.split(' ').any(|silent| silent == kind)
                {
                    self.skip(kind, node.line);
                }
                Ok(())
            }
        }
    }

    /// The nodes that stand directly in a group, or in its field `children` as VRML 2 has it.
    fn visit_all(&mut self, node: &'d Node<'a>, state: &mut State, depth: usize) -> Result<(), Fault> {
        node.children
            .iter()
            .chain(node.nodes("children"))
            .try_for_each(|&child| self.visit(child, state, depth + 1))
    }

    fn visit_choice(&mut self, node: &'d Node<'a>, state: &mut State, depth: usize) -> Result<(), Fault> {
        let (children, which) = match self.dialect {
            Dialect::Inventor => (&node.children[..], node.scalar("whichChild", -1.0)?),
            Dialect::Vrml2 => (node.nodes("choice"), node.scalar("whichChoice", -1.0)?),
        };
        // -3 shows all of them, -1 none.
        if which == -3.0 {
            return self.visit_all(node, state, depth);
        }
        let chosen = children.iter().enumerate().find(|(index, _)| *index as f64 == which);
        chosen.map_or(Ok(()), |(_, &child)| self.visit(child, state, depth + 1))
    }

    fn skip(&mut self, kind: &'d str, line: usize) {
        self.skipped.entry(kind).or_insert((0, line)).0 += 1;
    }
}

/// Metres per unit of a `Units` node.
fn unit_m(node: &Node<'_>) -> Result<f64, Fault> {
    let name = node.words("units").first().copied().unwrap_or("METERS");
    Ok(match name {
        "KILOMETERS" => 1e3,
        "METERS" => 1.0,
        "CENTIMETERS" => 1e-2,
        "MILLIMETERS" => 1e-3,
        "MICROMETERS" | "MICRONS" => 1e-6,
        "YARDS" => 0.9144,
        "FEET" => 0.3048,
        "INCHES" => 0.0254,
        "POINTS" => 0.0254 / 72.0,
        _ => return Err(node.fault(Problem::unknown("unit", name))),
    })
}
