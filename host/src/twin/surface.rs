//! What touches what, and with which friction.

use rapier3d_f64::prelude::{
    CoefficientCombineRule, ColliderBuilder, Group, InteractionGroups, InteractionTestMode,
};

/// Whose surface it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// The hand touches the object and the table, never itself.
    Hand,
    /// The object touches everything.
    Object,
    /// A piece of the object that stands on feet touches the hand only.
    ObjectOnFeet,
    /// The feet touch the table only.
    Feet,
    /// The table is fixed.
    Table,
}

impl Part {
    fn group(self) -> Group {
        match self {
            Self::Hand => Group::GROUP_1,
            Self::Object | Self::ObjectOnFeet => Group::GROUP_2,
            Self::Table => Group::GROUP_3,
            Self::Feet => Group::GROUP_4,
        }
    }

    fn touches(self) -> Group {
        match self {
            Self::Hand => Group::GROUP_2 | Group::GROUP_3,
            Self::Object => Group::GROUP_1 | Group::GROUP_3,
            Self::ObjectOnFeet => Group::GROUP_1,
            Self::Table => Group::GROUP_1 | Group::GROUP_2 | Group::GROUP_4,
            Self::Feet => Group::GROUP_3,
        }
    }
}

/// Gives a collider its partners and its friction. Coefficients multiply: the object has 1, so that the coefficient of
/// each other surface is that of the pair.
pub(super) fn surface(collider: ColliderBuilder, part: Part, friction: f64) -> ColliderBuilder {
    collider
        .density(0.0)
        .friction(friction)
        .friction_combine_rule(CoefficientCombineRule::Multiply)
        .collision_groups(InteractionGroups::new(part.group(), part.touches(), InteractionTestMode::And))
}
