//! Where each part of a surface comes from.

use std::fmt;

/// Why a triangle is where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Provenance {
    /// Points of the scan support it.
    Measured,
    /// Nobody saw it; the object's symmetry says so.
    Mirrored,
    /// Nobody saw it; it is drawn down from what was seen above.
    Extruded,
    /// The table, on which the object stands.
    Table,
}

impl Provenance {
    /// All of them, in the order of their numbers in files.
    pub const ALL: [Self; 4] = [Self::Measured, Self::Mirrored, Self::Extruded, Self::Table];

    /// The word for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::Mirrored => "mirrored",
            Self::Extruded => "extruded",
            Self::Table => "table",
        }
    }

    /// Its number in files.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// That of a number in a file, if it has a meaning.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.get(usize::from(number)).copied()
    }
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
