//! Where to grasp and how to get there.
//!
//! A [`scene::Scene`] holds what is fixed. A search ([`paper`] or [`best`]) proposes sites; [`settle`] moves the palm
//! until the fingers touch together; [`attempt`] checks reach and collisions, closes the fingers ([`closing`]) and
//! evaluates the contacts.
pub mod approach;
pub mod arm;
pub mod attempt;
pub mod best;
pub mod closing;
pub mod document;
pub mod finger_motion;
pub mod free_path;
pub mod hand_shape;
pub mod motion;
pub mod obstacles;
pub mod paper;
pub mod preshape;
pub mod profile;
mod propose;
pub mod samples;
pub mod scene;
pub mod search;
pub mod seen;
pub mod settle;
pub mod surface_query;
pub mod timing;
pub mod trajectory;
mod wrap;

#[cfg(test)]
mod tests;
