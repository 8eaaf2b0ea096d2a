//! STM32G474RE, Cortex-M4F: 170 MHz from a crystal of 24 MHz, as the Nucleo-G474RE has; 21.25 Mbaud to the host, two SPIs
//! of 21.25 MHz to the fingers. `docs/hardware.md` has the pins.
#![allow(unsafe_code, reason = "DMA reads and writes memory that the compiler does not know of")]

use embassy_stm32::Peri;
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac;
use embassy_stm32::pac::bdma::vals::{Dir, Pl};
use embassy_stm32::rcc::{Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart};

use super::stm32::{self, Parts};

/// Name of the board.
pub(super) const NAME: &str = "stm32g474";
/// Clock of the processor and of all buses.
pub(super) const CLOCK_HZ: u32 = 170_000_000;
/// Bits on the line: an eighth of the clock, the most that the UART can do.
const BAUD: u32 = CLOCK_HZ / 8;
/// The crystal.
const CRYSTAL_HZ: u32 = 24_000_000;
/// An eighth of the clock is 21.25 MHz; 20 asks for it.
const SPI_HZ: u32 = 20_000_000;

/// Interrupt of the timer that begins periods.
pub(super) const PERIOD: interrupt::Interrupt = interrupt::Interrupt::TIM6_DAC;
/// Interrupt of the end of an exchange: the receiver of the SPI that is started last.
pub(super) const EXCHANGED: interrupt::Interrupt = interrupt::Interrupt::DMA1_CHANNEL3;

/// SPIs.
pub(super) const BUSES: usize = 2;
const SPI: [pac::spi::Spi; BUSES] = [pac::SPI1, pac::SPI2];
/// Channels of DMA 1, counted from 0, and their requests at the multiplexer (reference manual, table of its inputs).
const SPI_RECEIVE: [Channel; BUSES] = [Channel { index: 0, request: 10 }, Channel { index: 2, request: 12 }];
const SPI_SEND: [Channel; BUSES] = [Channel { index: 1, request: 11 }, Channel { index: 3, request: 13 }];
const LINE: pac::usart::Usart = pac::USART1;
const LINE_RECEIVE: Channel = Channel { index: 4, request: 24 };
const LINE_SEND: Channel = Channel { index: 5, request: 25 };

/// PC6, as a bit of port C.
const TORQUE_ENABLE: usize = 6;

#[interrupt]
fn TIM6_DAC() {
    stm32::period_begins();
}

#[interrupt]
fn DMA1_CHANNEL3() {
    stm32::exchanged();
}

/// Clocks, pins and peripherals.
pub(super) fn set_up() -> Parts {
    let reset_cause = reset_cause();
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(CRYSTAL_HZ), mode: HseMode::Oscillator });
    config.rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    config.rcc.sys = Sysclk::PLL1_R;
    config.rcc.boost = true;
    let p = embassy_stm32::init(config);
    // A debugger that halts the processor must not have it reset.
    pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg(true));
    // Flash has four wait states at this clock.
    pac::FLASH.acr().modify(|w| w.set_prften(true));

    let mut uart = usart::Config::default();
    uart.baudrate = BAUD;
    uart.de_assertion_time = 16;
    uart.de_deassertion_time = 16;
    match Uart::new_blocking_with_de(p.USART1, p.PA10, p.PA9, p.PA12, uart) {
        // Dropped, it would take its pins back.
        Ok(uart) => core::mem::forget(uart),
        Err(_) => defmt::error!("no {=u32} baud", BAUD),
    }
    LINE.cr1().modify(|w| w.set_ue(false));
    LINE.cr3().modify(|w| {
        // A byte that nobody took in time is lost, and the CRC tells; the receiver goes on.
        w.set_ovrdis(true);
        w.set_dmar(true);
        w.set_dmat(true);
    });
    LINE.cr1().modify(|w| w.set_ue(true));

    let mut bus = spi::Config::default();
    bus.frequency = Hertz(SPI_HZ);
    core::mem::forget((
        Spi::new_blocking(p.SPI1, p.PA5, p.PA7, p.PA6, bus),
        Spi::new_blocking(p.SPI2, p.PB13, p.PB15, p.PB14, bus),
    ));
    for spi in SPI {
        // On from here on: its clock rests at a level that it drives.
        spi.cr1().modify(|w| w.set_spe(false));
        spi.cr2().modify(|w| {
            w.set_rxdmaen(true);
            w.set_txdmaen(true);
        });
        spi.cr1().modify(|w| w.set_spe(true));
    }
    for channel in SPI_RECEIVE.into_iter().chain(SPI_SEND).chain([LINE_RECEIVE, LINE_SEND]) {
        channel.connect();
    }

    let select = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::High, Speed::VeryHigh);
    // Pages of 2 kB, in the bank in which no code is: so the chip comes, unless its option bytes have been changed.
    let is_dual_bank = pac::FLASH.optr().read().dbank();
    Parts {
        selects: [select(p.PC0.into()), select(p.PC1.into()), select(p.PC2.into()), select(p.PC3.into())],
        torque_enable: Output::new(p.PC6, Level::Low, Speed::Low),
        watchdog: p.IWDG,
        period_timer: p.TIM6,
        clock_timer: p.TIM2,
        flash: is_dual_bank.then(|| Flash::new_blocking(p.FLASH)),
        reset_cause,
    }
}

fn reset_cause() -> &'static str {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    if flags.iwdgrstf() {
        "the watchdog"
    } else if flags.borrstf() {
        "power"
    } else if flags.sftrstf() {
        "software"
    } else if flags.pinrstf() {
        "the reset pin"
    } else {
        "something else"
    }
}

/// Takes torque from all fingers, whoever has the pin.
pub(super) fn torque_off() {
    pac::GPIOC.bsrr().write(|w| w.set_br(TORQUE_ENABLE, true));
}

/// The chip's cache of data is emptied by whoever writes the flash.
pub(super) const fn flash_has_changed() {}

/// Clears the error of a word of flash that cannot be read; whether there was one.
pub(super) fn forgive_flash() -> bool {
    let errors = pac::FLASH.eccr().read();
    // A flag is cleared by writing it.
    pac::FLASH.eccr().write_value(errors);
    errors.eccd() || errors.eccd2()
}

/// A channel of DMA 1.
#[derive(Clone, Copy)]
struct Channel {
    index: usize,
    request: u8,
}

/// What a channel does.
#[derive(Clone, Copy, PartialEq)]
enum Course {
    Send,
    Receive,
    /// Receive round and round.
    Ring,
    /// Receive, and interrupt at the end.
    ReceiveAndTell,
}

impl Channel {
    /// To its peripheral.
    fn connect(self) {
        pac::DMAMUX1.ccr(self.index).write(|w| w.set_dmareq_id(self.request));
    }

    /// Bytes that are left.
    fn left(self) -> usize {
        usize::from(pac::DMA1.ch(self.index).ndtr().read().ndt())
    }

    /// # Safety
    ///
    /// `memory` stays, and nobody else uses it, until no byte is left.
    unsafe fn start(self, peripheral: *mut (), memory: *mut u8, len: usize, course: Course) {
        let channel = pac::DMA1.ch(self.index);
        channel.cr().write(|w| w.set_en(false));
        // All four flags of the channel.
        pac::DMA1.ifcr().write(|w| w.0 = 0xf << (4 * self.index));
        channel.par().write_value(peripheral as u32);
        channel.mar().write_value(memory as u32);
        channel.ndtr().write(|w| w.set_ndt(len as u16));
        channel.cr().write(|w| {
            w.set_dir(if course == Course::Send { Dir::FROM_MEMORY } else { Dir::FROM_PERIPHERAL });
            w.set_minc(true);
            w.set_circ(course == Course::Ring);
            w.set_tcie(course == Course::ReceiveAndTell);
            w.set_pl(if course == Course::Send { Pl::MEDIUM } else { Pl::HIGH });
            w.set_en(true);
        });
    }
}

/// Starts an exchange on one SPI.
///
/// # Safety
///
/// Both frames stay, and nobody else uses them, until [`end_exchange`].
pub(super) unsafe fn exchange(bus: usize, command: *const u8, reply: *mut u8, len: usize) {
    let (Some(spi), Some(receive), Some(send)) = (SPI.get(bus), SPI_RECEIVE.get(bus), SPI_SEND.get(bus))
    else {
        return;
    };
    let tells = if bus + 1 == BUSES { Course::ReceiveAndTell } else { Course::Receive };
    // SAFETY: the caller's promise. The receiver first, so that no byte comes before it.
    unsafe {
        receive.start(spi.dr8().as_ptr().cast(), reply, len, tells);
        send.start(spi.dr8().as_ptr().cast(), command.cast_mut(), len, Course::Send);
    }
}

/// Ends it; the SPI that was started first has a few cycles to end too.
pub(super) fn end_exchange(bus: usize) {
    let Some(receive) = SPI_RECEIVE.get(bus) else { return };
    for _ in 0..100 {
        if receive.left() == 0 {
            break;
        }
    }
    pac::DMA1.ifcr().write(|w| w.0 = 0xf << (4 * receive.index));
}

/// Receives from the line into this ring, for ever.
///
/// # Safety
///
/// The ring stays, and is read by one reader alone.
pub(super) unsafe fn line_receive(ring: *mut u8, len: usize) {
    // SAFETY: the caller's promise.
    unsafe { LINE_RECEIVE.start(LINE.rdr().as_ptr().cast(), ring, len, Course::Ring) };
}

/// Bytes to the end of the ring.
pub(super) fn line_left() -> usize {
    LINE_RECEIVE.left()
}

/// Sends these bytes to the line.
///
/// # Safety
///
/// They stay as they are while [`line_is_sending`].
pub(super) unsafe fn line_send(bytes: *const u8, len: usize) {
    // SAFETY: the caller's promise; a channel that sends does not write.
    unsafe { LINE_SEND.start(LINE.tdr().as_ptr().cast(), bytes.cast_mut(), len, Course::Send) };
}

/// Whether bytes are left to be handed to the line; a channel that has failed has switched itself off.
pub(super) fn line_is_sending() -> bool {
    LINE_SEND.left() > 0 && pac::DMA1.ch(LINE_SEND.index).cr().read().en()
}
