//! What the STM32 boards have in common: who runs when, what belongs to whom, and what happens when nothing is right.
//!
//! ```text
//! priority 0  timer, every 125 us     starts the exchange with the first finger of both SPIs
//!             end of an exchange      goes on with the second; after that hands the replies on
//! priority 4  control                 replies to sensors, control period, commands of the next exchange, watchdog
//! thread      bus                     bytes of the line to the controller and back, requests, flash, log
//! ```
//!
//! When torques go out and sensors are read is the timer's alone, so neither bus nor control can shake it. Control
//! interrupts everything that the thread does but its calls of the controller, the longest of which takes less than the
//! slack of a period (`docs/hardware.md`). No hardware has been at hand: see there what a first power-up must check.
#![allow(
    unsafe_code,
    reason = "interrupts share data, DMA reads and writes memory, and the linker knows addresses"
)]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering, compiler_fence};

use cortex_m::peripheral::{DCB, DWT};
use cortex_m_rt::{ExceptionFrame, exception};
use defmt_rtt as _; // the log's way out
use embassy_stm32::flash::{Blocking, Flash, MAX_ERASE_SIZE, WRITE_SIZE};
use embassy_stm32::gpio::Output;
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_stm32::pac;
use embassy_stm32::peripherals::{IWDG, TIM2, TIM6};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{RoundTo, Timer};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Peri, interrupt as handler};
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use protocol::ids::FINGER_COUNT;

#[cfg(feature = "stm32g474")]
use super::stm32g474 as chip;
#[cfg(feature = "stm32h563")]
use super::stm32h563 as chip;
use crate::app::{Controller, Identity};
use crate::clock::PeriodClock;
use crate::finger_bus::{Counters, FingerBus, LEN};
use crate::line::RingReader;
use crate::storage::Storage;

/// Control period.
const PERIOD_US: u32 = 125;
/// Periods for which the boards of all fingers are waited for; without them control begins with what there is.
const WAIT_PERIODS: u32 = 8000;
/// After so long without being fed the watchdog resets the processor. More than two pages of flash take to be erased,
/// during which nobody feeds it; torque ends long before, for finger boards wait 1 ms.
pub(super) const WATCHDOG_US: u32 = 200_000;
/// Periods between two looks at what is worth a line of the log.
const LOG_PERIODS: u32 = 8000;

/// Bytes of the receiver's ring: 480 us at 21.25 Mbaud.
const RECEIVED_MAX: usize = 1024;
/// Bytes that the controller is given at once: no more than one set-point ends in them.
const PIECE: usize = 83;
/// Bytes that are sent at once.
const SENT_MAX: usize = 512;

/// Interrupt that nothing raises but [`exchanged`]: it is control's.
const CONTROL: interrupt::Interrupt = interrupt::Interrupt::LPTIM1;

/// Fingers on each SPI, one after the other.
const SLOTS: usize = 2;

/// What a chip gives after it has been set up.
pub(super) struct Parts {
    /// Chip selects of the fingers, thumb first; low is selected.
    pub selects: [Output<'static>; FINGER_COUNT],
    /// Line to all finger boards without which none gives torque.
    pub torque_enable: Output<'static>,
    pub watchdog: Peri<'static, IWDG>,
    pub period_timer: Peri<'static, TIM6>,
    pub clock_timer: Peri<'static, TIM2>,
    /// The flash, if parameters may be kept in it.
    pub flash: Option<Flash<'static, Blocking>>,
    /// What made the processor start, for the log.
    pub reset_cause: &'static str,
}

/// Whose the frames are.
const IDLE: u8 = 0;
const EXCHANGING: u8 = 1;
const CONTROLLING: u8 = 2;

/// Frames of one exchange, and what moves them.
struct Exchange {
    /// The timer takes an idle exchange, its end passes it to control, and control gives it back.
    owner: AtomicU8,
    frames: UnsafeCell<MaybeUninit<Frames>>,
}

struct Frames {
    commands: [[u8; LEN]; FINGER_COUNT],
    replies: [[u8; LEN]; FINGER_COUNT],
    selects: [Output<'static>; FINGER_COUNT],
    slot: usize,
    /// Counter and cycles at the beginning of the period.
    began_us: u32,
    began_cycles: u32,
}

// SAFETY: `frames` are touched by the one that `owner` names alone.
unsafe impl Sync for Exchange {}

static EXCHANGE: Exchange =
    Exchange { owner: AtomicU8::new(CONTROLLING), frames: UnsafeCell::new(MaybeUninit::uninit()) };

/// Periods that began while the one before was not over.
static SKIPPED: AtomicU32 = AtomicU32::new(0);

/// The hand, which control and thread use in turn.
struct Shared(UnsafeCell<MaybeUninit<Hand>>);

struct Hand {
    controller: &'static mut Controller,
    fingers: FingerBus,
    clock: PeriodClock,
    watchdog: IndependentWatchdog<'static, IWDG>,
    torque_enable: Output<'static>,
    is_running: bool,
    periods: u32,
    worst_cycles: u32,
}

// SAFETY: control's interrupt takes the hand while the thread does not have it, and the thread while that interrupt is
// masked.
unsafe impl Sync for Shared {}

static HAND: Shared = Shared(UnsafeCell::new(MaybeUninit::uninit()));

/// Runs the hand.
pub fn run() -> ! {
    let parts = chip::set_up();
    defmt::timestamp!("{=u32:us}", now_us());
    defmt::info!(
        "{=str}, firmware {=str}; started by {=str}",
        chip::NAME,
        env!("CARGO_PKG_VERSION"),
        parts.reset_cause
    );
    // SAFETY: nothing else uses the core's peripherals; embassy takes those of the chip.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    count_cycles(&mut core.DCB, &mut core.DWT);

    let mut storage = parts.flash.and_then(|flash| Storage::new(ParameterPages(flash)).ok());
    let identity = Identity { board: chip::NAME, period_us: PERIOD_US, has_storage: storage.is_some() };
    let Some(controller) = cortex_m::singleton!(: Controller = Controller::new(identity)) else { stop() };
    match storage.as_mut().map(Storage::load) {
        Some(Ok(parameters)) => controller.set_parameters(&parameters),
        Some(Err(_)) => defmt::error!("parameters cannot be read; defaults"),
        None => defmt::error!("no flash for parameters; defaults"),
    }

    let (Some(received), Some(sent)) = (
        cortex_m::singleton!(: [u8; RECEIVED_MAX] = [0; RECEIVED_MAX]),
        cortex_m::singleton!(: [u8; SENT_MAX] = [0; SENT_MAX]),
    ) else {
        stop()
    };
    let line = Line { received: received.as_mut_ptr(), reader: RingReader::new(RECEIVED_MAX), sent };
    // SAFETY: the buffer is static, and only `Line` reads it.
    unsafe { chip::line_receive(line.received, RECEIVED_MAX) };

    begin(
        parts.selects,
        parts.torque_enable,
        parts.watchdog,
        controller,
        parts.period_timer,
        parts.clock_timer,
    );
    serve(line, storage)
}

/// Starts the timers and with them the periods.
fn begin(
    selects: [Output<'static>; FINGER_COUNT],
    torque_enable: Output<'static>,
    watchdog: Peri<'static, IWDG>,
    controller: &'static mut Controller,
    period_timer: Peri<'static, TIM6>,
    clock_timer: Peri<'static, TIM2>,
) {
    let mut clock_timer = Timer::new(clock_timer);
    clock_timer.set_tick_freq(Hertz(1_000_000));
    clock_timer.regs_core().arr().write(|w| w.0 = u32::MAX);
    clock_timer.start();

    let mut fingers = FingerBus::default();
    let mut frames = Frames {
        commands: [[0; LEN]; FINGER_COUNT],
        replies: [[0; LEN]; FINGER_COUNT],
        selects,
        slot: 0,
        began_us: 0,
        began_cycles: 0,
    };
    fingers.command(None, &mut frames.commands);
    let hand = Hand {
        controller,
        fingers,
        clock: PeriodClock::new(PERIOD_US, now_us()),
        watchdog: IndependentWatchdog::new(watchdog, WATCHDOG_US),
        torque_enable,
        is_running: false,
        periods: 0,
        worst_cycles: 0,
    };
    // SAFETY: no interrupt that uses them is enabled yet.
    unsafe {
        (*EXCHANGE.frames.get()).write(frames);
        (*HAND.0.get()).write(hand);
    }
    EXCHANGE.owner.store(IDLE, Ordering::Release);

    for irq in [chip::PERIOD, chip::EXCHANGED] {
        irq.set_priority(Priority::P0);
    }
    CONTROL.set_priority(Priority::P4);
    let period_timer = Timer::new(period_timer);
    period_timer.set_frequency(Hertz(1_000_000 / PERIOD_US), RoundTo::Slower);
    period_timer.generate_update_event();
    period_timer.clear_update_interrupt();
    period_timer.enable_update_interrupt(true);
    // SAFETY: their handlers are below and in the chip's file, and what they use has just been set up.
    unsafe {
        for irq in [CONTROL, chip::EXCHANGED, chip::PERIOD] {
            irq.enable();
        }
    }
    period_timer.start();
    // Dropped, they would stop.
    core::mem::forget((clock_timer, period_timer));
}

/// The free-running counter.
fn now_us() -> u32 {
    pac::TIM2.cnt().read()
}

fn count_cycles(dcb: &mut DCB, dwt: &mut DWT) {
    dcb.enable_trace();
    dwt.enable_cycle_counter();
}

/// The timer: a period begins. Called by the chip's handler, at the highest priority.
pub(super) fn period_begins() {
    pac::TIM6.sr().write(|w| w.set_uif(false));
    if EXCHANGE.owner.compare_exchange(IDLE, EXCHANGING, Ordering::Acquire, Ordering::Relaxed).is_err() {
        SKIPPED.fetch_add(1, Ordering::Relaxed);
        return;
    }
    // SAFETY: it was idle and is now the exchange's, whose steps are at one priority.
    let frames = unsafe { (*EXCHANGE.frames.get()).assume_init_mut() };
    (frames.began_us, frames.began_cycles) = (now_us(), DWT::cycle_count());
    frames.slot = 0;
    frames.exchange();
}

/// The end of an exchange with one finger of each SPI. Called by the chip's handler.
pub(super) fn exchanged() {
    if EXCHANGE.owner.load(Ordering::Acquire) != EXCHANGING {
        return;
    }
    // SAFETY: it is the exchange's, whose steps are at one priority.
    let frames = unsafe { (*EXCHANGE.frames.get()).assume_init_mut() };
    frames.end();
    frames.slot += 1;
    if frames.slot < SLOTS {
        frames.exchange();
    } else {
        EXCHANGE.owner.store(CONTROLLING, Ordering::Release);
        CONTROL.pend();
    }
}

impl Frames {
    /// Starts the exchange of this slot: thumb and middle finger, then index and ring.
    fn exchange(&mut self) {
        for bus in 0..chip::BUSES {
            let finger = bus * SLOTS + self.slot;
            let (Some(command), Some(reply)) = (self.commands.get(finger), self.replies.get_mut(finger))
            else {
                return;
            };
            // What is not received is no reply, and not that of the exchange before.
            reply.fill(0);
            if let Some(select) = self.selects.get_mut(finger) {
                select.set_low();
            }
            // The compiler does not know that DMA reads and writes.
            compiler_fence(Ordering::SeqCst);
            // SAFETY: the frames are static and nobody touches them before the exchange has ended.
            unsafe { chip::exchange(bus, command.as_ptr(), reply.as_mut_ptr(), LEN) };
        }
    }

    /// Ends it.
    fn end(&mut self) {
        for bus in 0..chip::BUSES {
            chip::end_exchange(bus);
            if let Some(select) = self.selects.get_mut(bus * SLOTS + self.slot) {
                select.set_high();
            }
        }
        compiler_fence(Ordering::SeqCst);
    }
}

/// Control.
#[handler]
fn LPTIM1() {
    if EXCHANGE.owner.load(Ordering::Acquire) != CONTROLLING {
        return;
    }
    // SAFETY: `owner` has just said so.
    let frames = unsafe { (*EXCHANGE.frames.get()).assume_init_mut() };
    // SAFETY: the thread masks this interrupt while it has the hand.
    let hand = unsafe { (*HAND.0.get()).assume_init_mut() };
    hand.control(frames);
    hand.worst_cycles = hand.worst_cycles.max(DWT::cycle_count().wrapping_sub(frames.began_cycles));
    EXCHANGE.owner.store(IDLE, Ordering::Release);
}

impl Hand {
    /// One control period.
    fn control(&mut self, frames: &mut Frames) {
        self.periods = self.periods.wrapping_add(1);
        self.fingers.take(&frames.replies);
        let now_us = self.clock.step(frames.began_us);
        if !self.is_running {
            // Boards may take longer to start than this one.
            if self.fingers.present().contains(&false) && self.periods < WAIT_PERIODS {
                self.fingers.command(None, &mut frames.commands);
                return;
            }
            self.is_running = true;
            self.watchdog.unleash();
        }
        let output = self.controller.tick(now_us, self.fingers.sensors());
        if output.enabled.contains(&true) {
            self.torque_enable.set_high();
        } else {
            self.torque_enable.set_low();
        }
        self.fingers.command(Some(&output), &mut frames.commands);
        if output.feed_watchdog {
            self.watchdog.pet();
        }
    }
}

/// The hand, for the thread. Control waits so long.
fn with_hand<T>(work: impl FnOnce(&mut Hand) -> T) -> T {
    CONTROL.disable();
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    // SAFETY: only control and the thread use the hand; control is masked, and `work` cannot come here again, for this
    // function is called by the thread's loop alone.
    let result = work(unsafe { (*HAND.0.get()).assume_init_mut() });
    // SAFETY: its handler is there, as before.
    unsafe { CONTROL.enable() };
    result
}

/// The line to the host.
struct Line {
    /// The receiver's ring, into which DMA writes.
    received: *mut u8,
    reader: RingReader,
    sent: &'static mut [u8; SENT_MAX],
}

impl Line {
    /// Takes what has come; returns how much that was.
    fn receive(&mut self, bytes: &mut [u8; RECEIVED_MAX]) -> usize {
        let mut len = 0;
        for piece in self.reader.take(chip::line_left()) {
            compiler_fence(Ordering::SeqCst);
            for at in piece {
                let Some(place) = bytes.get_mut(len) else { return len };
                // SAFETY: within the ring. Where DMA is just writing, one of the two bytes is read.
                *place = unsafe { self.received.add(at).read_volatile() };
                len += 1;
            }
        }
        len
    }

    /// Sends the first bytes of the buffer.
    fn send(&mut self, len: usize) {
        compiler_fence(Ordering::SeqCst);
        // SAFETY: the buffer is static and not touched again before the line has sent it.
        unsafe { chip::line_send(self.sent.as_ptr(), len.min(SENT_MAX)) };
    }
}

/// The bus and all that may take longer, for ever.
fn serve(mut line: Line, mut storage: Option<Storage<ParameterPages>>) -> ! {
    let mut bytes = [0; RECEIVED_MAX];
    let mut log = Log::default();
    loop {
        // Returns at once if an interrupt has come since it was here last, as every period does.
        cortex_m::asm::wfe();
        let len = line.receive(&mut bytes);
        let received = bytes.get(..len).unwrap_or(&[]);
        // Piece by piece, and a state apart from a reply, so that control never waits long.
        for piece in received.chunks(PIECE).chain([&[][..]]) {
            with_hand(|hand| hand.controller.receive(piece));
        }
        with_hand(|hand| hand.controller.report());
        with_hand(|hand| hand.controller.serve());
        if !chip::line_is_sending() {
            let len = with_hand(|hand| hand.controller.transmit(line.sent));
            if len > 0 {
                line.send(len);
            }
        }
        if let Some(storage) = &mut storage {
            // Without control in between: torque is off and nobody can bring it on before the flash is at rest.
            with_hand(|hand| {
                if let Some(parameters) = hand.controller.take_save() {
                    hand.controller.saved(storage.save(&parameters).is_ok());
                }
            });
        }
        log.look();
    }
}

/// What has been said.
#[derive(Default)]
struct Log {
    periods: u32,
    worst_cycles: u32,
    skipped: u32,
    present: [bool; FINGER_COUNT],
    counters: [Counters; FINGER_COUNT],
}

impl Log {
    /// Says what has changed.
    fn look(&mut self) {
        let (periods, present, worst_cycles) =
            with_hand(|hand| (hand.periods, hand.fingers.present(), hand.worst_cycles));
        if core::mem::replace(&mut self.present, present) != present {
            defmt::warn!("fingers present: {=[?; 4]}", present);
        }
        if periods.wrapping_sub(self.periods) < LOG_PERIODS {
            return;
        }
        self.periods = periods;
        if worst_cycles > self.worst_cycles {
            self.worst_cycles = worst_cycles;
            defmt::info!(
                "longest period: {=u32} cycles of {=u32}",
                worst_cycles,
                chip::CLOCK_HZ / 1_000_000 * PERIOD_US
            );
        }
        let skipped = SKIPPED.load(Ordering::Relaxed);
        if core::mem::replace(&mut self.skipped, skipped) != skipped {
            defmt::warn!("periods skipped: {=u32}", skipped);
        }
        let counters = with_hand(|hand| *hand.fingers.counters());
        if core::mem::replace(&mut self.counters, counters) != counters {
            for (finger, Counters { broken, deaf, failed }) in counters.into_iter().enumerate() {
                defmt::warn!(
                    "finger {=usize}: {=u32} broken, {=u32} deaf, {=u32} failed",
                    finger,
                    broken,
                    deaf,
                    failed
                );
            }
        }
    }
}

/// The pages of flash that the map keeps for parameters.
struct ParameterPages(Flash<'static, Blocking>);

/// The flash did not do what it was asked.
#[derive(Debug)]
struct PageError;

impl ParameterPages {
    /// Where they begin, from the beginning of the flash, and how long they are; from `memory.x`.
    fn region() -> (u32, usize) {
        unsafe extern "C" {
            static _parameters_start: u8;
            static _parameters_end: u8;
        }
        let (start, end) = (&raw const _parameters_start as usize, &raw const _parameters_end as usize);
        ((start - embassy_stm32::flash::FLASH_BASE) as u32, end - start)
    }

    /// An offset in the flash for one in the pages; none beyond them.
    fn at(offset: u32, len: usize) -> Result<u32, PageError> {
        let (start, all) = Self::region();
        let end = (offset as usize).checked_add(len).ok_or(PageError)?;
        if end <= all { Ok(start + offset) } else { Err(PageError) }
    }
}

impl NorFlashError for PageError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl ErrorType for ParameterPages {
    type Error = PageError;
}

impl ReadNorFlash for ParameterPages {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PageError> {
        self.0.blocking_read(Self::at(offset, bytes.len())?, bytes).map_err(|_| PageError)
    }

    fn capacity(&self) -> usize {
        Self::region().1
    }
}

impl NorFlash for ParameterPages {
    const WRITE_SIZE: usize = WRITE_SIZE;
    const ERASE_SIZE: usize = MAX_ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), PageError> {
        let len = to.checked_sub(from).ok_or(PageError)?;
        let at = Self::at(from, len as usize)?;
        let erased = self.0.blocking_erase(at, at + len).map_err(|_| PageError);
        chip::flash_has_changed();
        erased
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PageError> {
        let written = self.0.blocking_write(Self::at(offset, bytes.len())?, bytes).map_err(|_| PageError);
        chip::flash_has_changed();
        written
    }
}

/// No torque, and no way back but a reset, which the watchdog brings.
fn stop() -> ! {
    cortex_m::interrupt::disable();
    chip::torque_off();
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    chip::torque_off();
    if let Some(place) = info.location() {
        defmt::error!("panic at {=str}:{=u32}", place.file(), place.line());
    }
    stop()
}

#[exception(trampoline = true)]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    chip::torque_off();
    defmt::error!("hard fault at {=u32:x}", frame.pc());
    stop()
}

/// A word of flash that was being written when the power failed cannot be read by its code. What is read instead does not
/// fit its checksum, so the storage passes over it.
#[exception]
unsafe fn NonMaskableInt() {
    if !chip::forgive_flash() {
        chip::torque_off();
        stop()
    }
}

#[exception]
unsafe fn DefaultHandler(irq: i16) -> ! {
    chip::torque_off();
    defmt::error!("interrupt {=i16} has no handler", irq);
    stop()
}
