//! Parameters in flash, so that they outlast the power supply.
//!
//! Each parameter that is not at its default is an item of its own under its index, with a checksum; items go around over
//! at least two pages, so a supply that fails while one is written or a page erased loses at most what was being written
//! (crate `sequential-storage`). Erasing stops the processor for some 25 ms: nothing is stored while a drive has torque.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::NorFlash;
use protocol::service::Value;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};
use thiserror::Error;

use crate::parameters::{self, Parameters};

/// Bytes of the longest item: index, type and value, with room.
const ITEM_MAX: usize = 32;

/// Why parameters are not in flash.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum StorageError {
    /// These pages of flash cannot hold them.
    #[error("the flash has no two whole pages here")]
    Pages,
    /// The flash did not do what it was asked, or holds what nobody wrote.
    #[error("the flash cannot be read or written")]
    Flash,
}

type Uncaching = Cache<Uncached, Uncached, Uncached, u16>;

/// The pages of a flash that hold parameters.
pub struct Storage<F: NorFlash> {
    map: MapStorage<u16, F, Uncaching>,
}

impl<F: NorFlash> Storage<F> {
    /// All of `flash`, which has at least two pages.
    ///
    /// # Errors
    ///
    /// [`StorageError::Pages`].
    pub fn new(flash: F) -> Result<Self, StorageError> {
        let pages = 0..u32::try_from(flash.capacity()).map_err(|_| StorageError::Pages)?;
        let config = MapConfig::try_new(pages).map_err(|_| StorageError::Pages)?;
        Ok(Self { map: MapStorage::new(flash, config, Cache::new_uncached()) })
    }

    /// Writes what differs from what is there.
    ///
    /// # Errors
    ///
    /// [`StorageError::Flash`]; then some are written.
    pub fn save(&mut self, parameters: &Parameters) -> Result<(), StorageError> {
        for index in 0..parameters::COUNT {
            let (Ok(value), Ok(info)) = (parameters.get(index), Parameters::info(index)) else { continue };
            let stored = self.read(index)?.unwrap_or(info.default);
            if stored != value {
                let bytes = encode(value);
                let mut buffer = [0; ITEM_MAX];
                block_on(self.map.store_item(&mut buffer, &index, &&bytes[..]))
                    .map_err(|_| StorageError::Flash)?;
            }
        }
        Ok(())
    }

    /// The stored parameters. One that an older firmware wrote and this one refuses stays at its default.
    ///
    /// # Errors
    ///
    /// [`StorageError::Flash`].
    pub fn load(&mut self) -> Result<Parameters, StorageError> {
        let mut parameters = Parameters::default();
        // Those that depend on others may be refused before the others are there.
        for _ in 0..2 {
            for index in 0..parameters::COUNT {
                if let Some(value) = self.read(index)? {
                    let _ = parameters.set(index, value);
                }
            }
        }
        Ok(parameters)
    }

    fn read(&mut self, index: u16) -> Result<Option<Value>, StorageError> {
        let mut buffer = [0; ITEM_MAX];
        let found = block_on(self.map.fetch_item::<&[u8]>(&mut buffer, &index));
        Ok(found.map_err(|_| StorageError::Flash)?.and_then(decode))
    }
}

/// Type, then the value's bits.
const fn encode(value: Value) -> [u8; 5] {
    let (kind, bits) = match value {
        Value::F32(x) => (0, x.to_bits()),
        Value::U32(n) => (1, n),
        Value::Bool(yes) => (2, yes as u32),
    };
    let [a, b, c, d] = bits.to_le_bytes();
    [kind, a, b, c, d]
}

fn decode(bytes: &[u8]) -> Option<Value> {
    let &[kind, a, b, c, d] = bytes else { return None };
    let bits = u32::from_le_bytes([a, b, c, d]);
    match kind {
        0 => Some(Value::F32(f32::from_bits(bits))),
        1 => Some(Value::U32(bits)),
        2 if bits < 2 => Some(Value::Bool(bits == 1)),
        _ => None,
    }
}

#[cfg(test)]
mod tests;
