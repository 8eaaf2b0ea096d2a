//! PLY: a header that describes records, and the records as text or bytes.
//!
//! | file | does |
//! |---|---|
//! | `header.rs` | elements and their properties |
//! | `body.rs` | one number after the other, whatever the encoding |
//! | `read.rs` | vertices, faces and triangle strips out of them |
//! | `write.rs` | meshes and clouds |

mod body;
mod header;
mod read;
mod write;

pub(super) use header::Encoding;
pub(super) use read::read;
pub(super) use write::{write_cloud, write_mesh};
