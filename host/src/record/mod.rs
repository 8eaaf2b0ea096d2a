//! Recordings of executions for viewers: MCAP files with JSON messages of Foxglove's well-known schemas.
//!
//! | topic | schema | holds |
//! |---|---|---|
//! | `/tf` | `foxglove.FrameTransforms` | `base` to `palm`, along every finger, and to `object` where its true pose is known |
//! | `/scene` | `foxglove.SceneUpdate` | once: table, palm, fingers, the object's mesh, each in its own frame |
//! | `/forces` | `foxglove.SceneUpdate` | an arrow for the force on each fingertip, 10 mm a newton |
//! | `/joints` | `prehend.JointStates` | angle, command and torque of each joint |
//! | `/wrenches` | `prehend.TipWrenches` | force and moment on each fingertip, as measured |
//! | `/events` | `foxglove.Log` | phases, contacts, slip, and why the course was left |
//!
//! Times are those of the execution, from 0. Lengths in metres, angles in radians, forces in newtons.
mod message;
mod schema;

use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use serde_json::Value;

use crate::exec::Execution;
use crate::hand::Hand;
use crate::surface::Mesh;

/// What was there beside the execution.
#[derive(Debug, Clone, Copy)]
pub struct RecordedScene<'a> {
    /// The hand.
    pub hand: &'a Hand,
    /// The object's true surface in its own frame.
    pub object: &'a Mesh,
    /// Its name.
    pub object_name: &'a str,
    /// Height of the table's top in the base frame, if there is a table.
    pub table_height_m: Option<f64>,
}

/// Writes the recording of `execution`.
///
/// # Errors
/// Those of the writer.
pub fn write_recording(
    scene: &RecordedScene<'_>,
    execution: &Execution,
    writer: &mut dyn Write,
) -> io::Result<()> {
    // The format's index comes last and points back: the file is made in memory, some megabytes, and written in one go.
    let bytes = recording(scene, execution).map_err(io::Error::other)?;
    writer.write_all(&bytes)
}

fn recording(scene: &RecordedScene<'_>, execution: &Execution) -> Result<Vec<u8>, McapError> {
    let mut bytes = Cursor::new(Vec::new());
    let options = WriteOptions::new().compression(None).library("prehend");
    let mut file = Recorder { writer: options.create(&mut bytes)?, sequence: 0 };
    let transforms = file.channel("/tf", &schema::frame_transforms())?;
    let things = file.channel("/scene", &schema::scene_update())?;
    let forces = file.channel("/forces", &schema::scene_update())?;
    let joints = file.channel("/joints", &schema::joint_states())?;
    let wrenches = file.channel("/wrenches", &schema::tip_wrenches())?;
    let events = file.channel("/events", &schema::log())?;

    file.write(things, 0.0, &message::things(scene))?;
    let mut told = execution.events.iter().peekable();
    for sample in &execution.trace {
        while let Some(event) = told.next_if(|event| event.time_s <= sample.time_s) {
            file.write(events, event.time_s, &message::event(event))?;
        }
        file.write(transforms, sample.time_s, &message::transforms(scene.hand, sample))?;
        file.write(forces, sample.time_s, &message::forces(scene.hand, sample))?;
        file.write(joints, sample.time_s, &message::joints(sample))?;
        file.write(wrenches, sample.time_s, &message::wrenches(scene.hand, sample))?;
    }
    for event in told {
        file.write(events, event.time_s, &message::event(event))?;
    }
    file.write(events, execution.duration_s, &message::verdict(execution))?;
    file.writer.finish()?;
    drop(file);
    Ok(bytes.into_inner())
}

/// A recording that grows.
struct Recorder<'a> {
    writer: Writer<&'a mut Cursor<Vec<u8>>>,
    sequence: u32,
}

impl Recorder<'_> {
    fn channel(&mut self, topic: &str, schema: &Value) -> Result<u16, McapError> {
        let name = schema["title"].as_str().unwrap_or_default();
        let schema_id = self.writer.add_schema(name, "jsonschema", schema.to_string().as_bytes())?;
        self.writer.add_channel(schema_id, topic, "json", &BTreeMap::new())
    }

    fn write(&mut self, channel_id: u16, time_s: f64, message: &Value) -> Result<(), McapError> {
        let log_time = message::nanoseconds(time_s);
        let header = MessageHeader { channel_id, sequence: self.sequence, log_time, publish_time: log_time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, message.to_string().as_bytes())
    }
}

#[cfg(test)]
mod tests;
