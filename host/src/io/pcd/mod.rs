//! PCD of the Point Cloud Library.
//!
//! | file | does |
//! |---|---|
//! | `header.rs` | fields, counts, viewpoint, encoding |
//! | `read.rs` | ascii, binary and LZF-compressed points |
//! | `write.rs` | the same three |

mod header;
mod read;
mod write;

pub(super) use header::Encoding;
pub(super) use read::read;
pub(super) use write::write;
