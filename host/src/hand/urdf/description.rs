//! The text of a URDF file as links, joints and shapes; nothing of it is believed yet but that numbers are numbers.
//!
//! An own reader over an XML tree: `urdf-rs` brings three XML libraries, names no line, takes a missing limit for 0 and
//! leaves out words that are no numbers.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
use roxmltree::{Document, Node};

use super::error::Problem;

/// Most links, and most joints: some ten times those of the largest robots.
pub(super) const MAX_LINKS: usize = 2000;

/// A robot.
#[derive(Debug, Clone)]
pub(super) struct Description {
    pub(super) name: String,
    pub(super) links: Vec<LinkElement>,
    pub(super) joints: Vec<JointElement>,
}

/// A link.
#[derive(Debug, Clone)]
pub(super) struct LinkElement {
    pub(super) name: String,
    pub(super) mass_kg: f64,
    pub(super) collision: Vec<Shape>,
    pub(super) visual: Vec<Shape>,
}

/// A solid somewhere in its link.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    pub(super) link_from_shape: IsometryMatrix3<f64>,
    pub(super) solid: Solid,
}

/// A solid about its origin, metres; axes along z.
#[derive(Debug, Clone)]
pub(super) enum Solid {
    Cuboid {
        half: Vector3<f64>,
    },
    Sphere {
        radius_m: f64,
    },
    Cylinder {
        radius_m: f64,
        length_m: f64,
    },
    /// `length_m` without the caps.
    Capsule {
        radius_m: f64,
        length_m: f64,
    },
    Mesh {
        uri: String,
        scale: Vector3<f64>,
    },
}

/// Type of a joint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    Fixed,
    Revolute,
    Continuous,
    Prismatic,
    /// Floating, planar, spherical.
    Other(String),
}

/// A joint. Links by index.
#[derive(Debug, Clone)]
pub(super) struct JointElement {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) parent: usize,
    pub(super) child: usize,
    pub(super) parent_from_child: IsometryMatrix3<f64>,
    /// Not normalised; may be zero.
    pub(super) axis: Vector3<f64>,
    pub(super) limits: Option<[f64; 2]>,
    pub(super) effort: Option<f64>,
    pub(super) velocity: Option<f64>,
    pub(super) mimic: Option<Mimic>,
}

/// What a joint repeats.
#[derive(Debug, Clone)]
pub(super) struct Mimic {
    pub(super) joint: String,
    pub(super) multiplier: f64,
    pub(super) offset: f64,
}

impl Description {
    pub(super) fn parse(text: &str) -> Result<Self, Problem> {
        let document = Document::parse(text).map_err(Problem::Xml)?;
        let robot = document.root_element();
        if robot.tag_name().name() != "robot" {
            return Err(Problem::NotARobot(robot.tag_name().name().to_owned()));
        }
        let is_macro = |node: Node| {
            node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
                || node.attributes().any(|attribute| attribute.value().contains("${"))
        };
        if robot.descendants().any(is_macro) {
            return Err(Problem::Xacro);
        }
        let mut description = Self {
            name: robot.attribute("name").unwrap_or("hand").to_owned(),
            links: Vec::new(),
            joints: Vec::new(),
        };
        let elements = |name: &'static str| robot.children().filter(move |node| node.has_tag_name(name));
        for node in elements("link") {
            if description.links.len() == MAX_LINKS {
                return Err(Problem::TooManyLinks);
            }
            let link = link(node)?;
            if description.links.iter().any(|other| other.name == link.name) {
                return Err(Problem::Twice { line: line(node), what: "link", name: link.name });
            }
            description.links.push(link);
        }
        // Transmissions hold elements of the same name: only children of the robot are joints.
        for node in elements("joint") {
            if description.joints.len() == MAX_LINKS {
                return Err(Problem::TooManyLinks);
            }
            let joint = joint(node, &description.links)?;
            if description.joints.iter().any(|other| other.name == joint.name) {
                return Err(Problem::Twice { line: line(node), what: "joint", name: joint.name });
            }
            description.joints.push(joint);
        }
        if description.links.is_empty() {
            return Err(Problem::Empty);
        }
        Ok(description)
    }

    pub(super) fn link_index(&self, name: &str) -> Option<usize> {
        self.links.iter().position(|link| link.name == name)
    }

    pub(super) fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }
}

fn line(node: Node) -> u32 {
    node.document().text_pos_at(node.range().start).row
}

fn child<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    node.children().find(|child| child.has_tag_name(name))
}

fn missing(node: Node, missing: &'static str) -> Problem {
    Problem::Missing { line: line(node), element: node.tag_name().name().to_owned(), missing }
}

fn name_of(node: Node) -> Result<String, Problem> {
    match node.attribute("name").map(str::trim) {
        Some(name) if !name.is_empty() => Ok(name.to_owned()),
        _ => Err(missing(node, "name")),
    }
}

/// `N` finite numbers, if the attribute is there.
fn numbers<const N: usize>(
    node: Node,
    attribute: &'static str,
    wanted: &'static str,
) -> Result<Option<[f64; N]>, Problem> {
    let Some(text) = node.attribute(attribute) else { return Ok(None) };
    let parsed: Option<Vec<f64>> =
        text.split_whitespace().map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    match parsed.and_then(|values| <[f64; N]>::try_from(values).ok()) {
        Some(values) => Ok(Some(values)),
        None => Err(Problem::Numbers {
            line: line(node),
            element: node.tag_name().name().to_owned(),
            attribute,
            text: text.chars().take(60).collect(),
            wanted,
        }),
    }
}

fn triple(node: Node, attribute: &'static str) -> Result<Option<Vector3<f64>>, Problem> {
    Ok(numbers::<3>(node, attribute, "three finite numbers")?.map(Vector3::from))
}

fn number(node: Node, attribute: &'static str) -> Result<Option<f64>, Problem> {
    Ok(numbers::<1>(node, attribute, "a finite number")?.map(|[value]| value))
}

/// A length above zero that must be there.
fn length(node: Node, attribute: &'static str) -> Result<f64, Problem> {
    match number(node, attribute)? {
        Some(value) if value > 0.0 => Ok(value),
        Some(value) => Err(Problem::Numbers {
            line: line(node),
            element: node.tag_name().name().to_owned(),
            attribute,
            text: value.to_string(),
            wanted: "a number above 0",
        }),
        None => Err(missing(node, attribute)),
    }
}

/// The pose of an element with `<origin>`, the identity without.
fn origin(node: Node) -> Result<IsometryMatrix3<f64>, Problem> {
    let Some(origin) = child(node, "origin") else { return Ok(IsometryMatrix3::identity()) };
    let xyz = triple(origin, "xyz")?.unwrap_or_default();
    let rpy = triple(origin, "rpy")?.unwrap_or_default();
    Ok(pose(xyz, rpy))
}

/// URDF's pose: fixed-axis roll, pitch, yaw.
pub(super) fn pose(xyz: Vector3<f64>, rpy: Vector3<f64>) -> IsometryMatrix3<f64> {
    IsometryMatrix3::from_parts(Translation3::from(xyz), Rotation3::from_euler_angles(rpy.x, rpy.y, rpy.z))
}

fn link(node: Node) -> Result<LinkElement, Problem> {
    let mass = child(node, "inertial").and_then(|inertial| child(inertial, "mass"));
    let mass_kg = mass.map_or(Ok(None), |mass| number(mass, "value"))?.unwrap_or(0.0);
    let shapes = |name: &str| {
        node.children().filter(|child| child.has_tag_name(name)).map(shape).collect::<Result<_, _>>()
    };
    Ok(LinkElement {
        name: name_of(node)?,
        mass_kg: mass_kg.max(0.0),
        collision: shapes("collision")?,
        visual: shapes("visual")?,
    })
}

fn shape(node: Node) -> Result<Shape, Problem> {
    let geometry = child(node, "geometry").ok_or_else(|| missing(node, "<geometry>"))?;
    let element = geometry.children().find(Node::is_element);
    let unknown = || Problem::Geometry { line: line(geometry) };
    let element = element.ok_or_else(unknown)?;
    let solid = match element.tag_name().name() {
        "box" => {
            let size = triple(element, "size")?.ok_or_else(|| missing(element, "size"))?;
            if size.min() <= 0.0 {
                return Err(Problem::Numbers {
                    line: line(element),
                    element: "box".to_owned(),
                    attribute: "size",
                    text: element.attribute("size").unwrap_or_default().to_owned(),
                    wanted: "three numbers above 0",
                });
            }
            Solid::Cuboid { half: size / 2.0 }
        }
        "sphere" => Solid::Sphere { radius_m: length(element, "radius")? },
        "cylinder" => {
            Solid::Cylinder { radius_m: length(element, "radius")?, length_m: length(element, "length")? }
        }
        "capsule" => {
            Solid::Capsule { radius_m: length(element, "radius")?, length_m: length(element, "length")? }
        }
        "mesh" => {
            let uri = element.attribute("filename").map(str::trim).filter(|uri| !uri.is_empty());
            Solid::Mesh {
                uri: uri.ok_or_else(|| missing(element, "filename"))?.to_owned(),
                scale: triple(element, "scale")?.unwrap_or_else(|| Vector3::repeat(1.0)),
            }
        }
        _ => return Err(unknown()),
    };
    Ok(Shape { link_from_shape: origin(node)?, solid })
}

fn joint(node: Node, links: &[LinkElement]) -> Result<JointElement, Problem> {
    let name = name_of(node)?;
    let end = |element: &'static str, what: &'static str| {
        let link = child(node, element).and_then(|end| end.attribute("link")).map(str::trim);
        let link = link.ok_or_else(|| missing(node, what))?;
        let index = links.iter().position(|other| other.name == link);
        index.ok_or_else(|| Problem::NoLink { joint: name.clone(), link: link.to_owned() })
    };
    let kind = match node.attribute("type").map(str::trim) {
        None => return Err(missing(node, "type")),
        Some("fixed") => Kind::Fixed,
        Some("revolute") => Kind::Revolute,
        Some("continuous") => Kind::Continuous,
        Some("prismatic") => Kind::Prismatic,
        Some(kind @ ("floating" | "planar" | "spherical")) => Kind::Other(kind.to_owned()),
        Some(kind) => return Err(Problem::UnknownKind { joint: name, kind: kind.to_owned() }),
    };
    let axis = match child(node, "axis") {
        Some(axis) => triple(axis, "xyz")?.ok_or_else(|| missing(axis, "xyz"))?,
        None => Vector3::x(),
    };
    let limit = child(node, "limit");
    let of_limit = |attribute| limit.map_or(Ok(None), |limit| number(limit, attribute));
    // One of the two may be left out and is 0 then; without both there is no limit.
    let limits = match (of_limit("lower")?, of_limit("upper")?) {
        (None, None) => None,
        (lower, upper) => Some([lower.unwrap_or(0.0), upper.unwrap_or(0.0)]),
    };
    let mimic = match child(node, "mimic") {
        None => None,
        Some(mimic) => Some(Mimic {
            joint: mimic.attribute("joint").ok_or_else(|| missing(mimic, "joint"))?.trim().to_owned(),
            multiplier: number(mimic, "multiplier")?.unwrap_or(1.0),
            offset: number(mimic, "offset")?.unwrap_or(0.0),
        }),
    };
    Ok(JointElement {
        kind,
        parent: end("parent", "<parent link=..>")?,
        child: end("child", "<child link=..>")?,
        parent_from_child: origin(node)?,
        axis,
        limits,
        effort: of_limit("effort")?,
        velocity: of_limit("velocity")?,
        mimic,
        name,
    })
}
