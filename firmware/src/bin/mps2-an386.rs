//! The image for QEMU. With the word `lock-step` on its command line it is the hand's controller on a simulated hand; with
//! `figures` it counts what the controller costs; else it checks its arithmetic, reports and ends.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;

use cortex_m as _; // its critical section
use cortex_m::singleton;
use cortex_m_rt::entry;
use firmware::app::{Controller, Identity};
use firmware::board::mps2_an386::{
    Bench, Console, FileFlash, InstructionCounter, StackPaint, exit, started_with,
};
use firmware::figures;
use firmware::selfcheck::kinematics_digest;
use firmware::storage::Storage;

/// Seed of the poses; the host computes the digest with the same.
const SEED: u32 = 1;

/// The simulated hand's control period.
const IDENTITY: Identity = Identity { board: "mps2-an386", period_us: 1000, has_storage: true };

/// Status when the controller could not be set up.
const NO_CONTROLLER: u32 = 2;
/// Status when there is no flash.
const NO_FLASH: u32 = 3;

#[entry]
fn main() -> ! {
    let figures = started_with("figures").then(StackPaint::apply);
    let Some(controller) = singleton!(: Controller = Controller::new(IDENTITY)) else { exit(NO_CONTROLLER) };
    // Of a static whose address it knows the compiler builds the address of every field anew, three instructions each;
    // behind a pointer a field is one.
    let controller = black_box(controller);
    if started_with("lock-step") {
        control(controller);
    }
    if let Some(stack) = figures {
        let mut console = Console::open();
        let reported =
            figures::report(&InstructionCounter::start(), controller, IDENTITY.period_us, &mut console)
                .and_then(|()| writeln!(console, "stack {}", stack.used_bytes()));
        exit(u32::from(reported.is_err()))
    }
    let digest = kinematics_digest(SEED);
    let reported = writeln!(Console::open(), "kinematics_digest seed={SEED} fnv1a64={digest:016x}");
    exit(u32::from(reported.is_err()))
}

/// Controls the simulated hand until it goes away.
fn control(controller: &mut Controller) -> ! {
    let Some(Ok(mut storage)) = FileFlash::open().map(Storage::new) else { exit(NO_FLASH) };
    // A flash that cannot be read leaves the defaults.
    if let Ok(parameters) = storage.load() {
        controller.set_parameters(&parameters);
    }
    let mut bench = Bench::open();
    while let Some(frame) = bench.read() {
        let answer = controller.bench_period(&frame, |parameters| storage.save(parameters).is_ok());
        if bench.write(&answer).is_err() {
            break;
        }
    }
    exit(0)
}
