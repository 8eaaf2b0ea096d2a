//! The image for the STM32H563.
#![no_std]
#![no_main]

use cortex_m_rt::entry;

#[entry]
fn main() -> ! {
    firmware::board::stm32::run()
}
