//! Numbers and words as YAML and XML want them.

use nalgebra::{Isometry3, Vector3};

/// A number that every YAML reader takes for one with a fraction: no exponent, always a point. Exact on reading back.
pub(super) fn real(value: f64) -> String {
    let text = value.to_string();
    if text.contains('.') { text } else { text + ".0" }
}

/// `[1.0, 2.0]`, as in YAML.
pub(super) fn list(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|v| real(*v)).collect::<Vec<_>>().join(", "))
}

/// `1 2`, as in XML attributes.
pub(super) fn spaced<'a>(values: impl IntoIterator<Item = &'a f64>) -> String {
    values.into_iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// A string between double quotes; JSON's escapes are among YAML's.
pub(super) fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// Position and orientation (w first) as XML attributes.
pub(super) fn position_and_wxyz(pose: &Isometry3<f64>) -> [String; 2] {
    let (p, q): (&Vector3<f64>, _) = (&pose.translation.vector, &pose.rotation);
    [spaced(p.iter()), spaced(&[q.w, q.i, q.j, q.k])]
}
