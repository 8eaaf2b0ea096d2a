//! Fields by name, as what they are.

use nalgebra::{Rotation3, Unit, Vector3};

use super::super::error::{Fault, Problem, clipped};
use super::parser::{Node, NodeId, Value};

impl<'a> Node<'a> {
    pub(super) fn fault(&self, problem: Problem) -> Fault {
        problem.at_line(self.line)
    }

    fn field(&self, name: &str) -> Option<&Value<'a>> {
        self.fields.iter().find(|(found, _)| *found == name).map(|(_, value)| value)
    }

    /// All numbers of a field; `None` when it is not there.
    pub(super) fn numbers(&self, name: &str) -> Result<Option<&[f64]>, Fault> {
        match self.field(name) {
            None => Ok(None),
            Some(Value::Numbers(numbers)) => Ok(Some(numbers)),
            Some(Value::Words(words)) => {
                Err(self.fault(Problem::NotANumber(clipped(words.first().unwrap_or(&"")))))
            }
            Some(Value::Nodes(_)) => Err(self.fault(Problem::expected("numbers", "a node"))),
        }
    }

    fn array<const N: usize>(&self, name: &'static str) -> Result<Option<[f64; N]>, Fault> {
        let Some(numbers) = self.numbers(name)? else { return Ok(None) };
        let array = numbers.try_into().map_err(|_| {
            let (found, wanted) = (numbers.len() as u64, N as u64);
            self.fault(Problem::ValueCount { what: name, found, wanted })
        })?;
        Ok(Some(array))
    }

    pub(super) fn scalar(&self, name: &'static str, default: f64) -> Result<f64, Fault> {
        Ok(self.array::<1>(name)?.map_or(default, |[value]| value))
    }

    pub(super) fn positive(&self, name: &'static str, default: f64) -> Result<f64, Fault> {
        let value = self.scalar(name, default)?;
        if value > 0.0 { Ok(value) } else { Err(self.fault(Problem::NotPositive { what: name, value })) }
    }

    pub(super) fn vector(&self, name: &'static str) -> Result<Option<Vector3<f64>>, Fault> {
        Ok(self.array::<3>(name)?.map(Vector3::from))
    }

    /// Axis and angle in radians. An axis without length turns nothing.
    pub(super) fn rotation(&self, name: &'static str) -> Result<Option<Rotation3<f64>>, Fault> {
        Ok(self.array::<4>(name)?.map(|[x, y, z, angle]| {
            match Unit::try_new(Vector3::new(x, y, z), f64::MIN_POSITIVE) {
                Some(axis) => Rotation3::from_axis_angle(&axis, angle),
                None => Rotation3::identity(),
            }
        }))
    }

    /// Sixteen numbers in the file's order.
    pub(super) fn matrix(&self, name: &'static str) -> Result<Option<[f64; 16]>, Fault> {
        self.array(name)
    }

    /// Enumerated values; empty when the field is not there.
    pub(super) fn words(&self, name: &str) -> &[&'a str] {
        match self.field(name) {
            Some(Value::Words(words)) => words,
            _ => &[],
        }
    }

    /// Nodes in a field; empty when there are none.
    pub(super) fn nodes(&self, name: &str) -> &[NodeId] {
        match self.field(name) {
            Some(Value::Nodes(nodes)) => nodes,
            _ => &[],
        }
    }
}
