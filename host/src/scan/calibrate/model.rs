//! The three models that compete.

use serde::{Deserialize, Serialize};

use super::{network::Network, physical::PhysicalModel};

/// Which model; in the order of preference where the held-out rows see no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ModelKind {
    /// Pinhole, lens distortion, flat laser sheet.
    Physical,
    /// The physical model, and a network on what it leaves over.
    Hybrid,
    /// The paper's network alone.
    Network,
}

impl ModelKind {
    /// All, in order of preference.
    pub const ALL: [Self; 3] = [Self::Physical, Self::Hybrid, Self::Network];

    /// As printed and stored.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Physical => "physical",
            Self::Hybrid => "hybrid",
            Self::Network => "network",
        }
    }
}

/// A fitted model from pixels to metres in the laser plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Model {
    /// See [`ModelKind::Physical`].
    Physical {
        /// The whole model.
        physical: PhysicalModel,
    },
    /// See [`ModelKind::Hybrid`].
    Hybrid {
        /// The first part.
        physical: PhysicalModel,
        /// What is added to it.
        residual: Network,
    },
    /// See [`ModelKind::Network`].
    Network {
        /// The whole model.
        network: Network,
    },
}

impl Model {
    /// Which of the three.
    #[must_use]
    pub const fn kind(&self) -> ModelKind {
        match self {
            Self::Physical { .. } => ModelKind::Physical,
            Self::Hybrid { .. } => ModelKind::Hybrid,
            Self::Network { .. } => ModelKind::Network,
        }
    }

    /// Point of the laser plane for a pixel, metres, wherever the pixel is; `None` where the model has no finite answer.
    #[must_use]
    pub fn map(&self, pixel: [f64; 2]) -> Option<[f64; 2]> {
        let point = match self {
            Self::Physical { physical } => physical.map(pixel)?,
            Self::Hybrid { physical, residual } => {
                let [x, y] = physical.map(pixel)?;
                let [dx, dy] = residual.map(pixel);
                [x + dx, y + dy]
            }
            Self::Network { network } => network.map(pixel),
        };
        point.iter().all(|x| x.is_finite()).then_some(point)
    }
}
