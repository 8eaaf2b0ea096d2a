//! What `prehend quality --json` prints.

use nalgebra::Vector6;
use serde::Serialize;

use super::convention::{Convention, NamedConvention, Reproduction, Score};
use super::friction::ConeModel;
use super::quality::{Closure, ForceNorm, NoClosure, Norm, Quality, Separation, Settings};
use super::resistance::{ContactForce, Resistance, Unbalanced};
use super::task::TaskClosure;
use super::wrench::WrenchReference;

/// The document.
///
/// `closure` is `null` when the search ran out of iterations before it could tell. `epsilon` is the lower bound, the
/// number to compare; fields that do not apply are absent.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QualityDocument {
    closure: Option<bool>,
    /// Whether the bracket is as narrow as asked for, or the proof complete.
    finished: bool,
    #[serde(flatten)]
    finding: Finding,
    #[serde(flatten)]
    score: Option<ScoreDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    resistance: Option<ResistanceDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    task: Option<TaskDocument>,
    convention: ConventionDocument,
    /// Support queries made.
    iterations: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum Finding {
    Bracket { epsilon: f64, epsilon_low: f64, epsilon_high: f64, weakest_wrench: [f64; 6] },
    Proof { reason: &'static str, separating_direction: [f64; 6], margin: f64 },
}

/// The number that the named program would report: bounds with closure, one number without.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct ScoreDocument {
    #[serde(skip_serializing_if = "Option::is_none")]
    score_low: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    score_high: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    score: Option<f64>,
    /// Bounds on the epsilon of the object wrench space.
    #[serde(skip_serializing_if = "Option::is_none")]
    object_epsilon: Option<[f64; 2]>,
}

/// How many times a disturbance is balanced; `balanced` is `null` when the search ran out before it could tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct ResistanceDocument {
    balanced: Option<bool>,
    finished: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    factor_low: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    factor_high: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    residual_n: Option<f64>,
    /// Of the upper bound, or of there being no resistance.
    limiting_wrench: [f64; 6],
    /// They balance `factor_low` times the disturbance.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    contact_forces: Vec<ForceDocument>,
    iterations: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct ForceDocument {
    force_n: [f64; 3],
    torsion_nm: f64,
}

impl ResistanceDocument {
    fn new(found: &Resistance, forces: &[ContactForce]) -> Self {
        let (balance, finished) = match found {
            Resistance::Balanced(balance) => (balance, true),
            Resistance::Unfinished(balance) => (balance, false),
            Resistance::None(Unbalanced { direction, iterations, .. }) => {
                return Self {
                    balanced: Some(false),
                    finished: true,
                    factor_low: None,
                    factor_high: None,
                    residual_n: None,
                    limiting_wrench: array(direction),
                    contact_forces: Vec::new(),
                    iterations: *iterations,
                };
            }
        };
        let of = |f: &ContactForce| ForceDocument { force_n: f.force_n.into(), torsion_nm: f.torsion_nm };
        Self {
            balanced: (balance.factor_low > 0.0).then_some(true),
            finished,
            factor_low: Some(balance.factor_low),
            // Infinity is no number of JSON: without a bound there is none.
            factor_high: Some(balance.factor_high).filter(|high| high.is_finite()),
            residual_n: Some(balance.residual_n),
            limiting_wrench: array(&balance.limiting_wrench),
            contact_forces: if balance.factor_low > 0.0 {
                forces.iter().map(of).collect()
            } else {
                Vec::new()
            },
            iterations: balance.iterations,
        }
    }
}

/// How much of a task is withstood; `withstood` is `null` when the search ran out before it could tell.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct TaskDocument {
    withstood: Option<bool>,
    finished: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale_low: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale_high: Option<f64>,
    weakest_wrench: [f64; 6],
    iterations: usize,
}

impl TaskDocument {
    fn new(found: &TaskClosure) -> Self {
        let (quality, finished) = match found {
            TaskClosure::Withstood(quality) => (quality, true),
            TaskClosure::Below(q) | TaskClosure::Above(q) | TaskClosure::Unfinished(q) => (q, false),
            TaskClosure::None { direction, iterations } => {
                return Self {
                    withstood: Some(false),
                    finished: true,
                    scale_low: None,
                    scale_high: None,
                    weakest_wrench: array(direction),
                    iterations: *iterations,
                };
            }
        };
        Self {
            withstood: (quality.scale_low > 0.0).then_some(true),
            finished,
            scale_low: Some(quality.scale_low),
            scale_high: Some(quality.scale_high).filter(|high| high.is_finite()),
            weakest_wrench: array(&quality.weakest_wrench),
            iterations: quality.iterations,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize)]
struct ConventionDocument {
    name: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    not_reproduced: Option<&'static str>,
    edges: Edges,
    norm: &'static str,
    force_norm: &'static str,
    epsilon_unit: &'static str,
    wrench: &'static str,
    center_of_mass: [f64; 3],
    torque_scale_m: f64,
    tolerance: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum Edges {
    Count(u16),
    Exact(&'static str),
}

impl QualityDocument {
    /// The document of an evaluation.
    #[must_use]
    pub fn new(closure: &Closure, settings: &Settings, reference: &WrenchReference) -> Self {
        let (closed, finished, finding, iterations) = match closure {
            Closure::Force(quality) => (Some(true), true, bracket(quality), quality.iterations),
            Closure::None(separation) => (Some(false), true, proof(separation), separation.iterations),
            Closure::Below(quality) | Closure::Above(quality) | Closure::Unfinished(quality) => {
                let closed = (quality.epsilon_low > 0.0).then_some(true);
                (closed, false, bracket(quality), quality.iterations)
            }
        };
        let convention = convention(&Convention::of(settings, reference), settings.tolerance);
        Self {
            closure: closed,
            finished,
            finding,
            score: None,
            resistance: None,
            task: None,
            convention,
            iterations,
        }
    }

    /// The same with what was found of a disturbance, and the contact forces that balance it.
    #[must_use]
    pub fn with_resistance(self, found: &Resistance, forces: &[ContactForce]) -> Self {
        Self { resistance: Some(ResistanceDocument::new(found, forces)), ..self }
    }

    /// The same with what was found of a task.
    #[must_use]
    pub fn with_task(self, found: &TaskClosure) -> Self {
        Self { task: Some(TaskDocument::new(found)), ..self }
    }

    /// The document of an evaluation in a named convention.
    #[must_use]
    pub fn of_reproduction(found: &Reproduction, settings: &Settings) -> Self {
        let (mut score_low, mut score_high, mut score) = (None, None, None);
        match found.score {
            Score::Between { low, high } => (score_low, score_high) = (Some(low), Some(high)),
            Score::WithoutClosure(value) => score = Some(value),
            Score::NotReproduced => {}
        }
        let object_epsilon = found.object.map(|object| [object.epsilon_low, object.epsilon_high]);
        Self {
            score: Some(ScoreDocument { score_low, score_high, score, object_epsilon }),
            convention: convention(&found.convention, settings.tolerance),
            ..Self::new(&found.closure, settings, &found.convention.reference)
        }
    }
}

fn bracket(quality: &Quality) -> Finding {
    Finding::Bracket {
        epsilon: quality.epsilon(),
        epsilon_low: quality.epsilon_low,
        epsilon_high: quality.epsilon_high,
        weakest_wrench: array(&quality.weakest_wrench),
    }
}

fn proof(separation: &Separation) -> Finding {
    let reason = match separation.reason {
        NoClosure::NoContacts => "no-contacts",
        NoClosure::Separated => "separated",
        NoClosure::Flat => "flat",
        NoClosure::Boundary => "boundary",
    };
    let separating_direction = array(&separation.direction);
    Finding::Proof { reason, separating_direction, margin: separation.margin }
}

fn convention(convention: &Convention, tolerance: f64) -> ConventionDocument {
    let (norm, epsilon_unit) = match convention.norm {
        Norm::L1 => ("l1", "fraction of the total normal force"),
        Norm::LInf => ("linf", "N"),
    };
    ConventionDocument {
        name: convention.name.map_or("custom", NamedConvention::name),
        not_reproduced: convention.name.map(NamedConvention::not_reproduced),
        edges: match convention.cone {
            ConeModel::Exact => Edges::Exact("exact"),
            ConeModel::Edges(count) => Edges::Count(count.get()),
        },
        norm,
        force_norm: match convention.force_norm {
            ForceNorm::Normal => "normal",
            ForceNorm::Edge => "edge",
        },
        epsilon_unit,
        wrench: "force, torque / torque_scale_m",
        center_of_mass: convention.reference.center_of_mass_in_object().into(),
        torque_scale_m: convention.reference.torque_scale_m(),
        tolerance,
    }
}

fn array(vector: &Vector6<f64>) -> [f64; 6] {
    (*vector).into()
}
