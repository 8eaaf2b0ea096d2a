//! A control period of a hand on a simulated mechanism, as the image in QEMU runs it.

use protocol::bench::{BusBytes, FromBoard, ToBoard};

use super::Controller;
use crate::control::Sensors;
use crate::parameters::Parameters;

impl Controller {
    /// One control period of the lock-step, from its frame to its answer: what a board's interrupts and its main loop do,
    /// in a fixed order. `save` keeps parameters and says whether it did.
    pub fn bench_period(&mut self, frame: &ToBoard, save: impl FnOnce(&Parameters) -> bool) -> FromBoard {
        self.receive(frame.bus.as_slice());
        let sensors = Sensors {
            position_rad: frame.position_rad,
            joint_torque_nm: frame.joint_torque_nm,
            tip_wrench: frame.tip_wrench,
        };
        let output = self.tick(frame.now_us, &sensors);
        self.serve();
        if let Some(parameters) = self.take_save() {
            self.saved(save(&parameters));
        }
        FromBoard {
            torque_nm: output.torque_nm,
            thumb_rotation_rad: output.thumb_rotation_rad.unwrap_or_default(),
            enabled: output.enabled.iter().rev().fold(0, |bits, &on| bits << 1 | u8::from(on)),
            watchdog_fed: output.feed_watchdog,
            bus: BusBytes::filled(|room| self.transmit(room)),
        }
    }
}
