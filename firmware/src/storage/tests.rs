//! Against a flash in memory that behaves as one: bits go down by writing and up by erasing only, and power may fail.

use std::cell::RefCell;
use std::rc::Rc;
use std::vec;
use std::vec::Vec;

use embedded_storage_async::nor_flash::{ErrorType, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use super::*;
use crate::parameters::Parameter;

const PAGES: usize = 2;

/// What outlasts the power supply, and how many more bytes it lives: a flash with words of `WORD` bytes and pages of `PAGE`.
#[derive(Clone)]
struct Flash<const WORD: usize, const PAGE: usize>(Rc<RefCell<(Vec<u8>, usize)>>);

/// As the STM32G474.
type Chip = Flash<8, 2048>;
/// As the STM32H563.
type LargeChip = Flash<16, 8192>;

#[derive(Debug)]
struct NoPower;

impl NorFlashError for NoPower {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const WORD: usize, const PAGE: usize> Flash<WORD, PAGE> {
    fn new() -> Self {
        Self(Rc::new(RefCell::new((vec![0xff; PAGE * PAGES], usize::MAX))))
    }

    fn spend(&self, bytes: usize) -> Result<(), NoPower> {
        let left = &mut self.0.borrow_mut().1;
        *left = left.checked_sub(bytes).ok_or(NoPower)?;
        Ok(())
    }

    fn power_for(&self, bytes: usize) {
        self.0.borrow_mut().1 = bytes;
    }
}

impl<const WORD: usize, const PAGE: usize> ErrorType for Flash<WORD, PAGE> {
    type Error = NoPower;
}

impl<const WORD: usize, const PAGE: usize> ReadNorFlash for Flash<WORD, PAGE> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        let start = offset as usize;
        bytes.copy_from_slice(&self.0.borrow().0[start..start + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        PAGE * PAGES
    }
}

impl<const WORD: usize, const PAGE: usize> NorFlash for Flash<WORD, PAGE> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        for at in from as usize..to as usize {
            self.spend(1)?;
            self.0.borrow_mut().0[at] = 0xff;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        assert!((offset as usize).is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD));
        // A word is written whole or not at all, as by a controller that checks it by a code.
        for (at, word) in (offset as usize..).step_by(WORD).zip(bytes.chunks(WORD)) {
            self.spend(WORD)?;
            let place = &mut self.0.borrow_mut().0[at..at + WORD];
            // Some chips would let a word become zeros; the STM32H563 lets none be written twice.
            assert!(place == [0xff; WORD], "written twice without being erased");
            place.copy_from_slice(word);
        }
        Ok(())
    }
}

fn changed(gain: f32) -> Parameters {
    let mut parameters = Parameters::default();
    parameters.set(Parameter::TorqueGain as u16, Value::F32(gain)).expect("in range");
    parameters
}

#[test]
fn what_is_saved_is_there_after_a_restart() {
    let chip = Chip::new();
    let open = || Storage::new(chip.clone()).expect("two pages");
    assert_eq!(open().load(), Ok(Parameters::default()), "an empty flash");
    let mut parameters = changed(0.75);
    // Each alone would stop before it holds.
    parameters.set(Parameter::BusStop as u16, Value::U32(50_000)).expect("in range");
    parameters.set(Parameter::BusHold as u16, Value::U32(30_000)).expect("in range");
    open().save(&parameters).expect("room");
    assert_eq!(open().load(), Ok(parameters));
    open().save(&Parameters::default()).expect("room");
    assert_eq!(open().load(), Ok(Parameters::default()), "defaults again");
}

#[test]
fn pages_go_around() {
    let chip = Chip::new();
    for i in 0..2000 {
        let parameters = changed(0.001 * i as f32);
        Storage::new(chip.clone()).expect("two pages").save(&parameters).expect("room");
        assert_eq!(Storage::new(chip.clone()).expect("two pages").load(), Ok(parameters), "{i}");
    }
}

#[test]
fn long_words_and_large_pages_do_as_well() {
    let chip = LargeChip::new();
    for i in 0..2000 {
        let parameters = changed(0.001 * i as f32);
        Storage::new(chip.clone()).expect("two pages").save(&parameters).expect("room");
        assert_eq!(Storage::new(chip.clone()).expect("two pages").load(), Ok(parameters), "{i}");
    }
}

#[test]
fn a_supply_that_fails_loses_at_most_the_last_change() {
    // All along a sequence that fills pages and erases them.
    let mut failures = 0;
    for power in (0..9000).step_by(56) {
        let chip = Chip::new();
        let mut storage = Storage::new(chip.clone()).expect("two pages");
        storage.save(&changed(0.1)).expect("room");
        chip.power_for(power);
        let (mut last, mut next) = (0.1, 0.1);
        for i in 0..200 {
            next = 0.2 + 0.005 * i as f32;
            if storage.save(&changed(next)).is_err() {
                failures += 1;
                break;
            }
            last = next;
        }
        chip.power_for(usize::MAX);
        let found = Storage::new(chip.clone()).expect("two pages").load().expect("it is repaired");
        assert!([changed(last), changed(next)].contains(&found), "{power}: {last}, {next}, {found:?}");
        let mut again = Storage::new(chip).expect("two pages");
        again.save(&changed(1.9)).expect("it can be written again");
        assert_eq!(again.load(), Ok(changed(1.9)));
    }
    assert!(failures > 60, "{failures}");
}

#[test]
fn garbage_in_flash_is_an_error_or_defaults_and_can_be_told() {
    let chip = Chip::new();
    for (i, byte) in chip.0.borrow_mut().0.iter_mut().enumerate() {
        *byte = (i.wrapping_mul(2_654_435_761) >> 13) as u8;
    }
    let loaded = Storage::new(chip).expect("two pages").load();
    assert!([Ok(Parameters::default()), Err(StorageError::Flash)].contains(&loaded), "{loaded:?}");
}
