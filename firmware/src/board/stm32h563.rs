//! STM32H563ZI, Cortex-M33: 250 MHz from a clock of 8 MHz, as the Nucleo-H563ZI gets it from its debugger; 25.0 Mbaud to
//! the host, the paper's rate, and two SPIs of 20.8 MHz to the fingers. `docs/hardware.md` has the pins.
#![allow(unsafe_code, reason = "DMA reads and writes memory that the compiler does not know of")]

use core::cell::UnsafeCell;

use embassy_stm32::Peri;
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{AnyPin, Level, Output, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac;
use embassy_stm32::pac::gpdma::vals::{Ap, Dreq, Dw, Prio};
use embassy_stm32::rcc::{Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart};

use super::stm32::{self, Parts};

/// Name of the board.
pub(super) const NAME: &str = "stm32h563";
/// Clock of the processor and of all buses.
pub(super) const CLOCK_HZ: u32 = 250_000_000;
/// Bits on the line: a tenth of the clock.
const BAUD: u32 = CLOCK_HZ / 10;
/// The oscillator.
const OSCILLATOR_HZ: u32 = 8_000_000;
/// An eighth of the 166.7 MHz that the SPIs get is 20.8 MHz; 20 asks for it.
const SPI_HZ: u32 = 20_000_000;

/// Interrupt of the timer that begins periods.
pub(super) const PERIOD: interrupt::Interrupt = interrupt::Interrupt::TIM6;
/// Interrupt of the end of an exchange: the receiver of the SPI that is started last.
pub(super) const EXCHANGED: interrupt::Interrupt = interrupt::Interrupt::GPDMA1_CHANNEL2;

/// SPIs.
pub(super) const BUSES: usize = 2;
const SPI: [pac::spi::Spi; BUSES] = [pac::SPI1, pac::SPI3];
/// Channels of GPDMA 1 and their requests (reference manual, table of its requests).
const SPI_RECEIVE: [Channel; BUSES] = [Channel { index: 0, request: 6 }, Channel { index: 2, request: 10 }];
const SPI_SEND: [Channel; BUSES] = [Channel { index: 1, request: 7 }, Channel { index: 3, request: 11 }];
const LINE: pac::usart::Usart = pac::USART2;
const LINE_RECEIVE: Channel = Channel { index: 4, request: 23 };
const LINE_SEND: Channel = Channel { index: 5, request: 24 };

/// PE3, as a bit of port E.
const TORQUE_ENABLE: usize = 3;

#[interrupt]
fn TIM6() {
    stm32::period_begins();
}

#[interrupt]
fn GPDMA1_CHANNEL2() {
    stm32::exchanged();
}

/// Clocks, pins and peripherals.
pub(super) fn set_up() -> Parts {
    let reset_cause = reset_cause();
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(OSCILLATOR_HZ), mode: HseMode::BypassDigital });
    config.rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV2,
        mul: PllMul::MUL125,
        divp: Some(PllDiv::DIV2),
        // Of the SPIs.
        divq: Some(PllDiv::DIV3),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.voltage_scale = VoltageScale::Scale0;
    let p = embassy_stm32::init(config);
    // A debugger that halts the processor must not have it reset.
    pac::DBGMCU.apb1lfzr().modify(|w| w.set_iwdg_stop(true));
    // Flash has five wait states at this clock.
    pac::ICACHE.cr().modify(|w| w.set_en(true));

    let mut uart = usart::Config::default();
    uart.baudrate = BAUD;
    uart.de_assertion_time = 16;
    uart.de_deassertion_time = 16;
    match Uart::new_blocking_with_de(p.USART2, p.PD6, p.PD5, p.PD4, uart) {
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
        Spi::new_blocking(p.SPI1, p.PA5, p.PB5, p.PG9, bus),
        Spi::new_blocking(p.SPI3, p.PC10, p.PC12, p.PC11, bus),
    ));
    for spi in SPI {
        spi.cr1().modify(|w| w.set_spe(false));
    }

    let select = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::High, Speed::VeryHigh);
    Parts {
        selects: [select(p.PE2.into()), select(p.PE4.into()), select(p.PE5.into()), select(p.PE6.into())],
        torque_enable: Output::new(p.PE3, Level::Low, Speed::Low),
        watchdog: p.IWDG,
        period_timer: p.TIM6,
        clock_timer: p.TIM2,
        flash: Some(Flash::new_blocking(p.FLASH)),
        reset_cause,
    }
}

fn reset_cause() -> &'static str {
    let flags = pac::RCC.rsr().read();
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
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
    pac::GPIOE.bsrr().write(|w| w.set_br(TORQUE_ENABLE, true));
}

/// The cache still has what was there before.
pub(super) fn flash_has_changed() {
    pac::ICACHE.cr().modify(|w| w.set_cacheinv(true));
    while pac::ICACHE.sr().read().busyf() {}
}

/// Clears the error of a word of flash that cannot be read; whether there was one.
pub(super) fn forgive_flash() -> bool {
    let errors = pac::FLASH.eccdetr().read();
    // A flag is cleared by writing it.
    pac::FLASH.eccdetr().write_value(errors);
    errors.eccd()
}

/// A channel of GPDMA 1.
#[derive(Clone, Copy)]
struct Channel {
    index: usize,
    request: u8,
}

/// Which way bytes go.
#[derive(Clone, Copy, PartialEq)]
enum Course {
    Send,
    Receive,
}

impl Channel {
    fn registers(self) -> pac::gpdma::Channel {
        pac::GPDMA1.ch(self.index)
    }

    /// Bytes that are left.
    fn left(self) -> usize {
        usize::from(self.registers().br1().read().bndt())
    }

    /// All flags that a channel may have raised.
    fn clear(self) {
        self.registers().fcr().write(|w| {
            w.set_tcf(true);
            w.set_htf(true);
            w.set_dtef(true);
            w.set_ulef(true);
            w.set_usef(true);
            w.set_suspf(true);
            w.set_tof(true);
        });
    }

    /// All but the start.
    fn prepare(self, peripheral: *mut (), memory: *mut u8, len: usize, course: Course) {
        let channel = self.registers();
        let sends = course == Course::Send;
        channel.cr().write(|w| w.set_reset(true));
        self.clear();
        channel.llr().write(|_| {});
        channel.tr1().write(|w| {
            w.set_sdw(Dw::BYTE);
            w.set_ddw(Dw::BYTE);
            w.set_sinc(sends);
            w.set_dinc(!sends);
            // Both ports reach everything; so memory and peripherals do not wait for each other.
            w.set_sap(if sends { Ap::PORT0 } else { Ap::PORT1 });
            w.set_dap(if sends { Ap::PORT1 } else { Ap::PORT0 });
        });
        channel.tr2().write(|w| {
            w.set_dreq(if sends { Dreq::DESTINATION_PERIPHERAL } else { Dreq::SOURCE_PERIPHERAL });
            w.set_reqsel(self.request);
        });
        channel.br1().write(|w| w.set_bndt(len as u16));
        let (from, to) =
            if sends { (memory as u32, peripheral as u32) } else { (peripheral as u32, memory as u32) };
        channel.sar().write_value(from);
        channel.dar().write_value(to);
    }

    /// # Safety
    ///
    /// The memory that it was [prepared](Self::prepare) for stays, and nobody else uses it, until no byte is left.
    unsafe fn start(self, tells: bool) {
        self.registers().cr().write(|w| {
            w.set_prio(Prio::HIGH);
            w.set_tcie(tells);
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
    receive.prepare(spi.rxdr8().as_ptr().cast(), reply, len, Course::Receive);
    send.prepare(spi.txdr8().as_ptr().cast(), command.cast_mut(), len, Course::Send);
    spi.cr2().write(|w| w.set_tsize(len as u16));
    // In the order that the reference manual asks for: receiver, channels, sender, SPI.
    spi.cfg1().modify(|w| w.set_rxdmaen(true));
    // SAFETY: the caller's promise.
    unsafe {
        receive.start(bus + 1 == BUSES);
        send.start(false);
    }
    spi.cfg1().modify(|w| w.set_txdmaen(true));
    spi.cr1().modify(|w| w.set_spe(true));
    spi.cr1().modify(|w| w.set_cstart(true));
}

/// Ends it; the SPI that was started first has a few cycles to end too.
pub(super) fn end_exchange(bus: usize) {
    let (Some(spi), Some(receive)) = (SPI.get(bus), SPI_RECEIVE.get(bus)) else { return };
    for _ in 0..100 {
        if receive.left() == 0 {
            break;
        }
    }
    receive.clear();
    spi.cr1().modify(|w| w.set_spe(false));
    spi.ifcr().write(|w| w.0 = u32::MAX);
    spi.cfg1().modify(|w| {
        w.set_rxdmaen(false);
        w.set_txdmaen(false);
    });
}

/// What the receiving channel loads at the end of every round: length, address, and where this is.
#[repr(C, align(16))]
struct Round(UnsafeCell<[u32; 3]>);

// SAFETY: written once, before the channel runs; then only read, by the channel.
unsafe impl Sync for Round {}

static ROUND: Round = Round(UnsafeCell::new([0; 3]));

/// Receives from the line into this ring, for ever.
///
/// # Safety
///
/// The ring stays, and is read by one reader alone. Called once.
pub(super) unsafe fn line_receive(ring: *mut u8, len: usize) {
    LINE_RECEIVE.prepare(LINE.rdr().as_ptr().cast(), ring, len, Course::Receive);
    let channel = LINE_RECEIVE.registers();
    let round = ROUND.0.get();
    channel.lbar().write(|w| w.set_lba((round as u32 >> 16) as u16));
    channel.llr().write(|w| {
        w.set_ub1(true);
        w.set_uda(true);
        w.set_ull(true);
        // In words; the upper half of the address is in `lbar`.
        w.set_la((round as u32 as u16) >> 2);
    });
    // SAFETY: the channel does not run yet. Length without the bits above it, as `prepare` has written it.
    unsafe { round.write([len as u32, ring as u32, channel.llr().read().0]) };
    cortex_m::asm::dsb();
    // SAFETY: the caller's promise.
    unsafe { LINE_RECEIVE.start(false) };
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
    LINE_SEND.prepare(LINE.tdr().as_ptr().cast(), bytes.cast_mut(), len, Course::Send);
    // SAFETY: the caller's promise; a channel that sends does not write.
    unsafe { LINE_SEND.start(false) };
}

/// Whether bytes are left to be handed to the line; a channel that has failed has switched itself off.
pub(super) fn line_is_sending() -> bool {
    LINE_SEND.left() > 0 && LINE_SEND.registers().cr().read().en()
}
