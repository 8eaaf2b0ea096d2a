//! What the transformation nodes do, as matrices for column vectors: `outer_from_inner`.

use nalgebra::{Matrix4, Rotation3, Translation3, Vector3};

use super::super::error::{Fault, Problem};
use super::parser::Node;

/// The matrix of a node, `None` when it is no transformation.
pub(super) fn matrix(node: &Node<'_>) -> Result<Option<Matrix4<f64>>, Fault> {
    Ok(Some(match node.kind {
        "Transform" => transform(node)?,
        "Translation" => translation(node.vector("translation")?.unwrap_or_default()),
        "Rotation" => node.rotation("rotation")?.unwrap_or_default().to_homogeneous(),
        "RotationXYZ" => rotation_about_axis(node)?,
        "Scale" => scaling(node.vector("scaleFactor")?),
        // The file has the rows of a matrix for row vectors, which are the columns of one for column vectors.
        "MatrixTransform" => node
            .matrix("matrix")?
            .map_or_else(Matrix4::identity, |numbers| Matrix4::from_column_slice(&numbers)),
        _ => return Ok(None),
    }))
}

/// Scale about a turned set of axes, then rotate, both about `center`, then translate. The scale is `scaleFactor` in
/// Inventor and VRML 1, `scale` in VRML 2.
fn transform(node: &Node<'_>) -> Result<Matrix4<f64>, Fault> {
    let center = node.vector("center")?.unwrap_or_default();
    let rotation = node.rotation("rotation")?.unwrap_or_default();
    let axes = node.rotation("scaleOrientation")?.unwrap_or_default();
    let scale = match node.vector("scaleFactor")? {
        Some(scale) => Some(scale),
        None => node.vector("scale")?,
    };
    Ok(translation(node.vector("translation")?.unwrap_or_default() + center)
        * (rotation * axes).to_homogeneous()
        * scaling(scale)
        * axes.inverse().to_homogeneous()
        * translation(-center))
}

fn rotation_about_axis(node: &Node<'_>) -> Result<Matrix4<f64>, Fault> {
    let axis = match node.words("axis") {
        [] | ["X"] => Vector3::x_axis(),
        ["Y"] => Vector3::y_axis(),
        ["Z"] => Vector3::z_axis(),
        [other, ..] => return Err(node.fault(Problem::unknown("axis", other))),
    };
    Ok(Rotation3::from_axis_angle(&axis, node.scalar("angle", 0.0)?).to_homogeneous())
}

fn translation(by: Vector3<f64>) -> Matrix4<f64> {
    Translation3::from(by).to_homogeneous()
}

fn scaling(factors: Option<Vector3<f64>>) -> Matrix4<f64> {
    Matrix4::new_nonuniform_scaling(&factors.unwrap_or(Vector3::repeat(1.0)))
}
