//! When the arm is where.
