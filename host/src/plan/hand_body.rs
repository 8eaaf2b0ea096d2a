//! The hand as bodies that can touch: each finger a chain of spheres, the palm a box.
//!
//! Spheres, because the distance from a mesh to a sphere is one nearest-point query, and because the direction from a
//! sphere's centre to the touched point is a contact normal that averages the facets' noise over the tip's radius.

use hand_model::{FingerAngles, FingerTrig, HandModel, links};
use nalgebra::{Isometry3, IsometryMatrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use protocol::ids::FingerId;

/// A part of a finger that can touch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Link {
    /// Between the base axes and the middle joint.
    Proximal,
    /// Between the middle and the distal joint.
    Middle,
    /// From the distal joint up to the tip sphere.
    Distal,
    /// The tip sphere.
    Tip,
}

impl Link {
    /// Name, as in the plan document.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Proximal => "proximal",
            Self::Middle => "middle",
            Self::Distal => "distal",
            Self::Tip => "tip",
        }
    }
}

/// One sphere of a finger's chain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bead {
    /// The link that carries it; its frame's x axis runs along it.
    pub link: Link,
    /// Distance of its centre from the link's joint, along the link, metres.
    pub along_m: f64,
    /// Radius, metres.
    pub radius_m: f64,
}

/// What the planner needs of a hand: kinematics, chains of spheres, palm box.
#[derive(Debug, Clone)]
pub struct HandBody {
    /// Kinematics, limits and dimensions.
    pub model: HandModel<f64>,
    beads: Vec<Bead>,
    /// Pose of the palm box in the palm frame.
    pub palm_from_box: Isometry3<f64>,
    /// Half extents of the palm box, metres.
    pub palm_half_extents_m: Vector3<f64>,
}

impl HandBody {
    /// The HIT/DLR hand, with beads and box from the model's collision geometry.
    #[must_use]
    pub fn hit_dlr() -> Self {
        let model = HandModel::<f64>::hit_dlr();
        let finger = &model.finger;
        let radii = model.collision.link_radii_m;
        let mut beads = Vec::new();
        for (link, length_m, radius_m) in [
            (Link::Proximal, finger.l1_m, radii[0]),
            (Link::Middle, finger.l2_m, radii[1]),
            (Link::Distal, finger.l3_m, radii[2]),
        ] {
            // Centres three quarters of a radius apart at most: the chain's waist is 7 % (1 mm) thinner than the capsule
            // it stands for. The proximal link has none at its joint, which the palm covers, and the distal one none at
            // its end, where the tip is.
            let count = (length_m / (0.75 * radius_m)).ceil().max(1.0);
            beads.extend((1..=count as usize).map(|i| Bead {
                link,
                along_m: length_m * i as f64 / count
                    - if link == Link::Distal { length_m / count } else { 0.0 },
                radius_m,
            }));
        }
        beads.push(Bead { link: Link::Tip, along_m: finger.l3_m, radius_m: finger.tip_radius_m });
        let (low, high) = (model.collision.palm.min_in_palm, model.collision.palm.max_in_palm);
        Self {
            palm_from_box: Isometry3::from(nalgebra::center(&low, &high).coords),
            palm_half_extents_m: 0.5 * (high - low),
            beads,
            model,
        }
    }

    /// The chain of one finger, root to tip; all fingers are alike.
    #[must_use]
    pub fn beads(&self) -> &[Bead] {
        &self.beads
    }

    /// Pose of a finger's base in the palm frame.
    #[must_use]
    pub fn palm_from_finger_base(&self, finger: FingerId, thumb_rotation_rad: f64) -> Isometry3<f64> {
        let matrix = self.model.palm_from_finger_base(finger, thumb_rotation_rad.sin_cos());
        to_isometry(&matrix)
    }

    /// Centres of the finger's beads in its base frame, in the order of [`Self::beads`], written into `centers`.
    pub fn bead_centers(&self, angles: &FingerAngles<f64>, centers: &mut Vec<Point3<f64>>) {
        let trig = FingerTrig::new(angles, f64::sin_cos);
        let frames = links(&self.model.finger, &trig);
        centers.clear();
        centers.extend(self.beads.iter().map(|bead| {
            let frame = match bead.link {
                Link::Proximal => &frames.proximal,
                Link::Middle => &frames.middle,
                Link::Distal | Link::Tip => &frames.distal,
            };
            frame * Point3::new(bead.along_m, 0.0, 0.0)
        }));
    }

    /// Mass of one finger, kg.
    #[must_use]
    pub fn finger_mass_kg(&self) -> f64 {
        let masses = &self.model.masses;
        masses.base.mass_kg + masses.proximal.mass_kg + masses.middle.mass_kg + masses.distal.mass_kg
    }

    /// Upper soft limits of flexion and middle joint, rad: where closing ends.
    #[must_use]
    pub fn flexion_limit_rad(&self) -> [f64; 2] {
        let limits = &self.model.soft_limits;
        [limits.flexion.upper_rad, limits.middle.upper_rad]
    }

    /// Greatest distance of a bead's centre from the finger's base, metres: bounds its speed per radian of flexion.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        self.model.finger.l1_m + self.model.finger.l2_m + self.model.finger.l3_m
    }
}

/// A matrix isometry as a quaternion one.
fn to_isometry(matrix: &IsometryMatrix3<f64>) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(matrix.rotation.into_inner());
    Isometry3::from_parts(matrix.translation, UnitQuaternion::from_rotation_matrix(&rotation))
}
