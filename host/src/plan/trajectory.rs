//! Motions of the arm over time.
