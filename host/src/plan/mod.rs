//! Planning: the arm's kinematics, and motions that it can follow.
pub mod arm;
pub mod timing;
pub mod trajectory;
