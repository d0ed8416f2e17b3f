//! OpenEXR. The container is read and written here, which keeps attributes byte for byte, checks every claim before
//! memory is taken for it, and makes equal pictures equal files; the exr crate packs and unpacks the blocks.

mod blocks;
mod half_bits;
mod header;
mod read;
mod write;

pub use read::read;
pub use write::write;

#[cfg(test)]
mod tests;
