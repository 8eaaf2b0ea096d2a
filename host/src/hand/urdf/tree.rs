//! A description as a tree of rigid bodies: links that fixed joints join are one body, moving joints connect bodies.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Unit, Vector3};

use super::description::{Description, Kind};
use super::error::Problem;
use super::overrides::Overrides;
use crate::hand::finger::{MAX_SEGMENTS, Motion};

/// Links that do not move in each other.
#[derive(Debug, Clone)]
pub(super) struct Body {
    /// Links with their poses, the one behind the moving joint first: its frame is the body's.
    pub(super) links: Vec<(usize, IsometryMatrix3<f64>)>,
    /// Body, and the joint that moves this one in it; `None` for the root.
    pub(super) joint: Option<Connection>,
    /// Bodies that move in this one.
    pub(super) children: Vec<usize>,
}

/// How a body moves in its parent.
#[derive(Debug, Clone)]
pub(super) struct Connection {
    pub(super) parent: usize,
    /// Index of the joint in the description.
    pub(super) joint: usize,
    /// The link of the parent body that carries it.
    pub(super) link: usize,
    /// Parent body's frame, joint at 0.
    pub(super) parent_from_body: IsometryMatrix3<f64>,
    pub(super) axis: Unit<Vector3<f64>>,
    pub(super) motion: Motion,
}

/// Where a link goes: onto a body with a pose in it, or into a body of its own behind a joint, which the root has not.
type Place = Result<(usize, IsometryMatrix3<f64>), Option<Connection>>;

/// All bodies, parents first.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    pub(super) bodies: Vec<Body>,
    /// By link.
    pub(super) body_of: Vec<usize>,
    /// By link: the link that it hangs on.
    pub(super) parent_link: Vec<Option<usize>>,
}

impl Tree {
    /// Checks that joints form one tree, and gathers bodies. Joints without a range are taken as fixed where they are,
    /// with a line in `warnings`.
    pub(super) fn new(
        description: &Description,
        overrides: &Overrides,
        warnings: &mut Vec<String>,
    ) -> Result<Self, Problem> {
        let links = &description.links;
        let mut joint_above: Vec<Option<usize>> = vec![None; links.len()];
        for (i, joint) in description.joints.iter().enumerate() {
            let name = |link: usize| links[link].name.clone();
            if joint.parent == joint.child {
                return Err(Problem::Cycle { link: name(joint.child) });
            }
            if let Some(other) = joint_above[joint.child] {
                return Err(Problem::TwoParents {
                    link: name(joint.child),
                    first: name(description.joints[other].parent),
                    second: name(joint.parent),
                });
            }
            joint_above[joint.child] = Some(i);
        }
        let parent_link: Vec<Option<usize>> =
            joint_above.iter().map(|joint| joint.map(|j| description.joints[j].parent)).collect();
        let roots: Vec<usize> = (0..links.len()).filter(|&link| parent_link[link].is_none()).collect();
        let mut joints_below: Vec<Vec<usize>> = vec![Vec::new(); links.len()];
        for (i, joint) in description.joints.iter().enumerate() {
            joints_below[joint.parent].push(i);
        }
        let mut tree = Self { bodies: Vec::new(), body_of: vec![usize::MAX; links.len()], parent_link };
        let mut open: Vec<(usize, Place)> =
            roots.first().map(|&root| (root, Err(None))).into_iter().collect();
        while let Some((link, place)) = open.pop() {
            let (body, body_from_link) = match place {
                Ok((body, pose)) => {
                    tree.bodies[body].links.push((link, pose));
                    (body, pose)
                }
                Err(joint) => {
                    let body = tree.bodies.len();
                    if let Some(connection) = &joint {
                        tree.bodies[connection.parent].children.push(body);
                    }
                    let own = (link, IsometryMatrix3::identity());
                    tree.bodies.push(Body { links: vec![own], joint, children: Vec::new() });
                    (body, IsometryMatrix3::identity())
                }
            };
            tree.body_of[link] = body;
            // Last in, first out: the first in the file shall come first.
            for &j in joints_below[link].iter().rev() {
                let joint = &description.joints[j];
                let body_from_child = body_from_link * joint.parent_from_child;
                let place = match moving(description, overrides, j, warnings)? {
                    Err(child_at_rest) => Ok((body, body_from_child * child_at_rest)),
                    Ok((axis, motion)) => Err(Some(Connection {
                        parent: body,
                        joint: j,
                        link,
                        parent_from_body: body_from_child,
                        axis,
                        motion,
                    })),
                };
                open.push((joint.child, place));
            }
        }
        if let Some(link) = (0..links.len()).find(|&link| tree.body_of[link] == usize::MAX) {
            // Beside the first root's tree there are others, or circles, which have no root.
            return Err(if roots.len() > 1 {
                let names: Vec<String> =
                    roots.iter().take(4).map(|&root| format!("'{}'", links[root].name)).collect();
                let more = if roots.len() > 4 { ", ..." } else { "" };
                Problem::Roots { links: names.join(", ") + more }
            } else {
                Problem::Cycle { link: links[on_circle(&tree.parent_link, link)].name.clone() }
            });
        }
        Ok(tree)
    }

    /// Bodies from below `from` to `to`, or `None` when `to` is not below it.
    pub(super) fn chain(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        let mut chain = Vec::new();
        let mut body = to;
        while body != from {
            chain.push(body);
            body = self.bodies[body].joint.as_ref()?.parent;
        }
        chain.reverse();
        Some(chain)
    }

    /// Bodies in which chains below `body` end.
    pub(super) fn leaves(&self, body: usize) -> Vec<usize> {
        let mut leaves = Vec::new();
        let mut open = vec![body];
        while let Some(at) = open.pop() {
            let children = &self.bodies[at].children;
            if children.is_empty() && at != body {
                leaves.push(at);
            }
            open.extend(children.iter().rev());
        }
        leaves
    }

    /// The deepest body that carries all of some bodies: a body's first link carries all its others.
    pub(super) fn common_ancestor(&self, of: &[usize]) -> usize {
        let first_links: Vec<usize> = of.iter().map(|&body| self.bodies[body].links[0].0).collect();
        self.common_link(&first_links).map_or(0, |link| self.body_of[link])
    }

    /// The palm: where the chains part that are short enough for fingers.
    ///
    /// Of an arm with a camera that turns and a hand, chains part at the arm's base; they are too long for fingers
    /// there, so the branch with the most ends is followed.
    pub(super) fn palm(&self, description: &Description) -> Result<usize, Problem> {
        let all = self.leaves(0);
        if all.len() < 2 {
            return Err(Problem::NoFingers { count: all.len() });
        }
        let mut palm = self.common_ancestor(&all);
        loop {
            let leaves = self.leaves(palm);
            let longest = leaves.iter().filter_map(|&leaf| self.chain(palm, leaf)).map(|c| c.len()).max();
            if longest.unwrap_or(0) <= MAX_SEGMENTS {
                return Ok(palm);
            }
            let mut branches: Vec<(usize, Vec<usize>)> = self.bodies[palm]
                .children
                .iter()
                .map(|&child| (child, self.leaves(child)))
                .filter(|(_, leaves)| leaves.len() > 1)
                .collect();
            branches.sort_by_key(|(_, leaves)| std::cmp::Reverse(leaves.len()));
            match branches.as_slice() {
                // A finger with too many joints; who makes it says so.
                [] => return Ok(palm),
                [(first, a), (second, b), ..] if a.len() == b.len() => {
                    let name = |body: usize| description.links[self.bodies[body].links[0].0].name.clone();
                    return Err(Problem::AmbiguousPalm { first: name(*first), second: name(*second) });
                }
                [(_, leaves), ..] => palm = self.common_ancestor(leaves),
            }
        }
    }

    /// The deepest link that carries all of some links.
    pub(super) fn common_link(&self, of: &[usize]) -> Option<usize> {
        let from_root = |mut link: usize| {
            let mut path = vec![link];
            while let Some(parent) = self.parent_link[link] {
                path.push(parent);
                link = parent;
            }
            path.reverse();
            path
        };
        let paths: Vec<Vec<usize>> = of.iter().map(|&link| from_root(link)).collect();
        let (first, others) = paths.split_first()?;
        let is_common = |depth: usize| others.iter().all(|path| path.get(depth) == first.get(depth));
        (0..first.len()).take_while(|&depth| is_common(depth)).last().map(|depth| first[depth])
    }

    /// Whether `link` is `ancestor` or hangs on it.
    pub(super) fn is_below(&self, mut link: usize, ancestor: usize) -> bool {
        loop {
            if link == ancestor {
                return true;
            }
            match self.parent_link[link] {
                Some(parent) => link = parent,
                None => return false,
            }
        }
    }
}

/// From a link whose ancestors never end, one that is its own ancestor.
fn on_circle(parent_link: &[Option<usize>], link: usize) -> usize {
    // After as many steps as there are links, one is in the circle.
    (0..parent_link.len()).fold(link, |at, _| parent_link[at].unwrap_or(at))
}

type Moving = (Unit<Vector3<f64>>, Motion);

/// How a joint moves, or where its child rests when it does not.
fn moving(
    description: &Description,
    overrides: &Overrides,
    index: usize,
    warnings: &mut Vec<String>,
) -> Result<Result<Moving, IsometryMatrix3<f64>>, Problem> {
    let joint = &description.joints[index];
    let motion = match &joint.kind {
        Kind::Fixed => return Ok(Err(IsometryMatrix3::identity())),
        Kind::Revolute | Kind::Continuous => Motion::Turning,
        Kind::Prismatic => Motion::Sliding,
        // In an arm's base they do no harm; in a hand `joints::limits` refuses them.
        Kind::Other(_) => return Ok(Ok((Vector3::z_axis(), Motion::Turning))),
    };
    let Some(axis) = Unit::try_new(joint.axis, 1e-9) else {
        return Err(Problem::ZeroAxis { joint: joint.name.clone() });
    };
    let limits = overrides.limits.get(&joint.name).copied().or(joint.limits);
    match limits {
        Some([lower, upper]) if lower == upper && joint.mimic.is_none() && joint.kind != Kind::Continuous => {
            warnings.push(format!("joint '{}' has no range: it is taken as fixed at {lower}", joint.name));
            Ok(Err(match motion {
                Motion::Turning => Rotation3::from_axis_angle(&axis, lower) * IsometryMatrix3::identity(),
                Motion::Sliding => {
                    Translation3::from(axis.into_inner() * lower) * IsometryMatrix3::identity()
                }
            }))
        }
        _ => Ok(Ok((axis, motion))),
    }
}
