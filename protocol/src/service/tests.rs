//! Every call, answer and event against golden bytes, and whatever bytes against the decoders.

use std::format;
use std::string::String;
use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::tests::assert_golden_text;

const CALLS: [Call; 11] = [
    Call::Hello,
    Call::ParameterInfo { index: 1 },
    Call::ParameterGet { index: 300 },
    Call::ParameterSet { index: 2, value: Value::F32(0.5) },
    Call::SensorZero { joints: 0x1ffe },
    Call::BlackBox,
    Call::BlackBoxRead { index: 99 },
    Call::Link,
    Call::ParameterSave,
    Call::ParameterDefaults,
    Call::Segment {
        number: 7,
        replaces: true,
        time_us: 250_000,
        position: [0x0102, -1, 2, -3, 4, -5, 6, -7, 8, -9, 10, -11, 0x7fff],
    },
];

const FIRST_FAULT: FirstFault = FirstFault { code: Code(36), finger: Some(2), t_us: 0x0102_0304 };

const ANSWERS: [Answer<'static>; 8] = [
    Answer::Hello(Hello {
        firmware: "0.1.0",
        protocol: 1,
        board: "mps2-an386",
        schema: 0x0102_0304_0506_0708,
        parameters: 20,
    }),
    Answer::Refused(Code(8)),
    Answer::Done,
    Answer::ParameterInfo(ParameterInfo {
        name: "bus.hold",
        unit: "us",
        default: Value::U32(10_000),
        min: Value::U32(1000),
        max: Value::U32(100_000),
    }),
    Answer::Parameter(Value::Bool(true)),
    Answer::BlackBox(BlackBox {
        full_rate: 100,
        decimated: 64,
        frozen: true,
        first_fault: Some(FIRST_FAULT),
    }),
    Answer::Record(&[1, 2, 3]),
    Answer::Link(Counters {
        good: 1,
        lost: 2,
        repeated: 3,
        too_short: 4,
        too_long: 5,
        stuffing: 6,
        checksum: 7,
        version: 300,
    }),
];

const EVENTS: [Event; 7] = [
    Event::Started,
    Event::Drives { hand: 4, fingers: [4, 4, 3, 7] },
    Event::Fault(FIRST_FAULT),
    Event::Bus { tier: 2 },
    Event::Refused(Code(4)),
    Event::Dropped { events: 1000 },
    Event::Slip { fingers: 0b0101 },
];

fn line(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ") + "\n"
}

#[test]
fn golden_service() {
    let mut text = String::new();
    let mut buffer = [0; MESSAGE_MAX];
    for (id, call) in (0x80..).zip(CALLS) {
        let request = Request { id, call };
        let bytes = request.encode(&mut buffer).expect("it fits");
        text += &line(bytes);
        assert_eq!(Request::decode(bytes), Ok(request));
    }
    for (id, answer) in (0x80..).zip(ANSWERS) {
        let reply = Reply { id, answer };
        let bytes = reply.encode(&mut buffer).expect("it fits");
        text += &line(bytes);
        assert_eq!(Reply::decode(bytes), Ok(reply));
    }
    for (t_us, event) in (0x80..).zip(EVENTS) {
        let record = LogRecord { t_us, event };
        let bytes = record.encode(&mut buffer).expect("it fits");
        text += &line(bytes);
        assert_eq!(LogRecord::decode(bytes), Ok(record));
    }
    assert_golden_text("service.txt", &text);
}

#[test]
fn wrong_bytes_are_refused_by_cause() {
    let mut buffer = [0; MESSAGE_MAX];
    let request = Request { id: 5, call: Call::ParameterGet { index: 3 } };
    let mut bytes = request.encode(&mut buffer).expect("it fits").to_vec();
    bytes.push(0);
    let kind = MessageKind::Request;
    assert_eq!(Request::decode(&bytes), Err(ServiceError::TrailingBytes { kind, extra: 1 }));
    for len in 1..bytes.len() - 1 {
        assert_eq!(Request::decode(&bytes[..len]), Err(ServiceError::Malformed { kind }), "{len}");
    }
    bytes[2] = CALLS.len() as u8;
    assert_eq!(Request::decode(&bytes), Err(ServiceError::Malformed { kind }), "a call of the future");
    assert_eq!(Request::decode(&[]), Err(ServiceError::Kind { expected: kind, found: None }));
    bytes[0] = 0x82;
    assert_eq!(Request::decode(&bytes), Err(ServiceError::Kind { expected: kind, found: Some(0x82) }));
}

#[test]
fn an_answer_that_does_not_fit_is_an_error() {
    let long = [1; MESSAGE_MAX];
    let reply = |len: usize| Reply { id: 1, answer: Answer::Record(&long[..len]) };
    let mut buffer = [0; MESSAGE_MAX];
    // Kind, id, variant and a length of two bytes come before the record.
    assert_eq!(reply(MESSAGE_MAX - 5).encode(&mut buffer).map(<[u8]>::len), Ok(MESSAGE_MAX));
    assert_eq!(reply(MESSAGE_MAX - 4).encode(&mut buffer), Err(ServiceError::TooLong));
}

/// What decodes encodes to bytes that mean the same. (Not the same bytes: postcard reads overlong numbers too.)
fn assert_stable(bytes: &[u8]) {
    let mut buffer = [0; MESSAGE_MAX];
    if let Ok(request) = Request::decode(bytes) {
        let again = request.encode(&mut buffer).expect("it fits");
        // By its text, for a value may be no number.
        assert_eq!(format!("{:?}", Request::decode(again)), format!("{:?}", Ok::<_, ServiceError>(request)));
    }
    if let Ok(reply) = Reply::decode(bytes) {
        let again = reply.encode(&mut buffer).expect("it fits");
        assert_eq!(format!("{:?}", Reply::decode(again)), format!("{:?}", Ok::<_, ServiceError>(reply)));
    }
    if let Ok(record) = LogRecord::decode(bytes) {
        let again = record.encode(&mut buffer).expect("it fits");
        assert_eq!(LogRecord::decode(again), Ok(record));
    }
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(
        kind in prop_oneof![Just(0x02_u8), Just(0x82), Just(0x83), any::<u8>()],
        variant in 0_u8..11,
        rest in proptest::collection::vec(any::<u8>(), 0..MESSAGE_MAX - 3),
    ) {
        let mut bytes = std::vec![kind, 1, variant];
        bytes.extend(rest);
        for len in 0..=bytes.len() {
            assert_stable(&bytes[..len]);
        }
    }
}
