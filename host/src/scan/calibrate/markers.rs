//! Marker pairs as a table: `u_px,v_px,x_mm,y_mm,row`.

use thiserror::Error;

use super::MarkerPair;

/// What is wrong with a table of markers. Lines count from 1.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum MarkersError {
    /// The first line does not name the columns.
    #[error("line 1: the header must be {HEADER}, found {found:?}")]
    Header {
        /// The line, shortened.
        found: String,
    },
    /// A line with too few or too many columns.
    #[error("line {line}: {found} columns instead of 5")]
    Columns {
        /// Line.
        line: usize,
        /// Its columns.
        found: usize,
    },
    /// A value that is no finite number, or a row that is no whole number.
    #[error("line {line}: {column} is {found:?}")]
    Value {
        /// Line.
        line: usize,
        /// Name of the column.
        column: &'static str,
        /// The text, shortened.
        found: String,
    },
    /// More lines than a calibration needs by far.
    #[error("line {line}: more than {MAX_PAIRS} marker pairs")]
    TooMany {
        /// First line beyond.
        line: usize,
    },
}

const HEADER: &str = "u_px,v_px,x_mm,y_mm,row";
const COLUMNS: [&str; 5] = ["u_px", "v_px", "x_mm", "y_mm", "row"];
/// Twenty times the paper's set: training takes as many times longer.
const MAX_PAIRS: usize = 20_000;
const MM: f64 = 1e-3;

/// Reads marker pairs from CSV with the header `u_px,v_px,x_mm,y_mm,row`; blank lines and lines that begin with `#` are
/// passed over.
pub fn parse_markers(text: &str) -> Result<Vec<MarkerPair>, MarkersError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let mut content = lines.by_ref().filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let header = content.next().map_or("", |(_, line)| line);
    if !header.split(',').map(str::trim).eq(COLUMNS) {
        return Err(MarkersError::Header { found: shorten(header) });
    }
    let mut pairs = Vec::new();
    for (line, row) in content {
        if pairs.len() == MAX_PAIRS {
            return Err(MarkersError::TooMany { line });
        }
        pairs.push(pair(line, row)?);
    }
    Ok(pairs)
}

fn pair(line: usize, text: &str) -> Result<MarkerPair, MarkersError> {
    let cells: Vec<&str> = text.split(',').map(str::trim).collect();
    let &[u, v, x, y, row] = cells.as_slice() else {
        return Err(MarkersError::Columns { line, found: cells.len() });
    };
    let wrong =
        |column: usize| MarkersError::Value { line, column: COLUMNS[column], found: shorten(cells[column]) };
    let number = |column: usize, cell: &str| match cell.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(wrong(column)),
    };
    Ok(MarkerPair {
        pixel: [number(0, u)?, number(1, v)?],
        target_m: [number(2, x)? * MM, number(3, y)? * MM],
        row: row.parse().map_err(|_| wrong(4))?,
    })
}

/// Enough of a text to recognise it.
fn shorten(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_spreadsheets_write() {
        let text = "\u{feff}u_px, v_px,x_mm,y_mm,row\r\n# first row\r\n\r\n 10.5,20,-47.5,175,0\r\n";
        let pair = MarkerPair { pixel: [10.5, 20.0], target_m: [-0.0475, 175.0 * MM], row: 0 };
        assert_eq!(parse_markers(text), Ok(vec![pair]));
        assert_eq!(parse_markers("u_px,v_px,x_mm,y_mm,row"), Ok(vec![]));
    }

    #[test]
    fn names_the_line_and_the_value() {
        let message = |rows: &str| parse_markers(&format!("{HEADER}\n{rows}")).unwrap_err().to_string();
        assert_eq!(message("1,2,3,4,0\n1,2,3,4"), "line 3: 4 columns instead of 5");
        assert_eq!(message("1,2,3,4,0,5"), "line 2: 6 columns instead of 5");
        assert_eq!(message("1,two,3,4,0"), "line 2: v_px is \"two\"");
        assert_eq!(message("1,2,inf,4,0"), "line 2: x_mm is \"inf\"");
        assert_eq!(message("1,2,3,4,-1"), "line 2: row is \"-1\"");
        assert_eq!(
            parse_markers("a;b").unwrap_err().to_string(),
            "line 1: the header must be u_px,v_px,x_mm,y_mm,row, found \"a;b\""
        );
        assert_eq!(parse_markers("").unwrap_err(), MarkersError::Header { found: String::new() });
    }
}
