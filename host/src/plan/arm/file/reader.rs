//! Keys of a TOML table, taken one by one: what is left over is not known.

use toml::{Table, Value};

use super::ArmFileError;
use crate::plan::arm::Joints;

/// A table and where it stands in the file.
pub(super) struct Reader {
    table: Table,
    /// Path of the table, with a dot behind it, or nothing for the file itself.
    path: String,
}

impl Reader {
    /// The whole file.
    pub(super) fn parse(text: &str) -> Result<Self, ArmFileError> {
        let table = text.parse::<Table>().map_err(|error| {
            let start = error.span().map_or(0, |span| span.start.min(text.len()));
            let line = 1 + text.as_bytes()[..start].iter().filter(|&&byte| byte == b'\n').count();
            ArmFileError::Syntax { line, message: error.message().trim().replace('\n', " ") }
        })?;
        Ok(Self { table, path: String::new() })
    }

    /// Errors with the first key that nobody has taken.
    pub(super) fn done(self) -> Result<(), ArmFileError> {
        match self.table.keys().next() {
            Some(key) => Err(ArmFileError::Unknown { key: self.key(key) }),
            None => Ok(()),
        }
    }

    /// A text that has to be there.
    pub(super) fn text(&mut self, key: &str) -> Result<String, ArmFileError> {
        match self.table.remove(key) {
            Some(Value::String(text)) => Ok(text),
            Some(other) => Err(self.wrong_type(key, &other, "a text")),
            None => Err(self.missing(key)),
        }
    }

    /// A table that has to be there.
    pub(super) fn table(&mut self, key: &str) -> Result<Self, ArmFileError> {
        self.optional_table(key)?.ok_or_else(|| self.missing(key))
    }

    pub(super) fn optional_table(&mut self, key: &str) -> Result<Option<Self>, ArmFileError> {
        match self.table.remove(key) {
            Some(Value::Table(table)) => Ok(Some(Self { table, path: format!("{}.", self.key(key)) })),
            Some(other) => Err(self.wrong_type(key, &other, "a table")),
            None => Ok(None),
        }
    }

    /// A list of tables, numbered from 1 in the paths of their keys.
    pub(super) fn tables(&mut self, key: &str) -> Result<Option<Vec<Self>>, ArmFileError> {
        let Some(value) = self.table.remove(key) else { return Ok(None) };
        let Value::Array(values) = value else {
            return Err(self.wrong_type(key, &value, "a list of tables"));
        };
        let numbered = (1..).zip(values).map(|(number, value)| match value {
            Value::Table(table) => Ok(Self { table, path: format!("{} {number}: ", self.key(key)) }),
            other => Err(self.wrong_type(key, &other, "a table")),
        });
        numbered.collect::<Result<_, _>>().map(Some)
    }

    /// A number, if it is there.
    pub(super) fn number(&mut self, key: &str) -> Result<Option<f64>, ArmFileError> {
        self.table.remove(key).map(|value| self.to_number(key, &value)).transpose()
    }

    /// A number that has to be there.
    pub(super) fn needed(&mut self, key: &str) -> Result<f64, ArmFileError> {
        self.number(key)?.ok_or_else(|| self.missing(key))
    }

    /// A list of `N` numbers, if it is there.
    pub(super) fn numbers<const N: usize>(&mut self, key: &str) -> Result<Option<[f64; N]>, ArmFileError> {
        let Some(value) = self.table.remove(key) else { return Ok(None) };
        let Value::Array(values) = value else {
            return Err(self.wrong_type(key, &value, "a list of numbers"));
        };
        let numbers: Vec<f64> = values.iter().map(|v| self.to_number(key, v)).collect::<Result<_, _>>()?;
        let found = numbers.len();
        let wrong = |_| ArmFileError::Length { key: self.key(key), found, wanted: N };
        numbers.try_into().map(Some).map_err(wrong)
    }

    /// A list of `N` numbers that has to be there.
    pub(super) fn needed_numbers<const N: usize>(&mut self, key: &str) -> Result<[f64; N], ArmFileError> {
        self.numbers(key)?.ok_or_else(|| self.missing(key))
    }

    /// One angle for each axis, from `NAME_deg` or `NAME_rad` with a suffix such as `_per_s`; the default when there is
    /// neither.
    pub(super) fn angles(
        &mut self,
        name: &str,
        suffix: &str,
        default: Option<Joints>,
    ) -> Result<Joints, ArmFileError> {
        let [degrees, radians] = ["deg", "rad"].map(|unit| format!("{name}_{unit}{suffix}"));
        match (self.numbers::<6>(&degrees)?, self.numbers::<6>(&radians)?, default) {
            (Some(_), Some(_), _) => {
                Err(ArmFileError::Twice { first: self.key(&degrees), second: self.key(&radians) })
            }
            (Some(degrees), None, _) => Ok(degrees.map(f64::to_radians)),
            (None, Some(radians), _) | (None, None, Some(radians)) => Ok(radians),
            (None, None, None) => Err(self.missing(&format!("{degrees} (or {radians})"))),
        }
    }

    /// Errors unless a value is what it has to be.
    pub(super) fn in_range(
        &self,
        key: &str,
        value: f64,
        is_inside: bool,
        wanted: &'static str,
    ) -> Result<(), ArmFileError> {
        if is_inside { Ok(()) } else { Err(ArmFileError::Range { key: self.key(key), value, wanted }) }
    }

    fn to_number(&self, key: &str, value: &Value) -> Result<f64, ArmFileError> {
        let number = match value {
            Value::Float(number) => *number,
            Value::Integer(number) => *number as f64,
            other => return Err(self.wrong_type(key, other, "a number")),
        };
        if number.is_finite() {
            Ok(number)
        } else {
            Err(ArmFileError::NotFinite { key: self.key(key), value: number })
        }
    }

    fn key(&self, key: &str) -> String {
        format!("{}{key}", self.path)
    }

    fn missing(&self, key: &str) -> ArmFileError {
        ArmFileError::Missing { key: self.key(key) }
    }

    fn wrong_type(&self, key: &str, value: &Value, wanted: &'static str) -> ArmFileError {
        // A table or a long text would not fit into a line.
        let value: String = value.to_string().replace('\n', " ").chars().take(40).collect();
        ArmFileError::Type { key: self.key(key), value, wanted }
    }
}
